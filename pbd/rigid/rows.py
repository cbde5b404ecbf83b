"""What contacts of the plane and of space have in common: open functions on the memory of all contacts."""

from __future__ import annotations

from pbd.dispatch import stage


@stage(required=True)
def start_row(rows, c, i, j, plane):
    """Contact c is now of bodies i < j, or of body i with a plane, j being the ground; it remembers nothing."""


@stage(required=True)
def pair_of_row(rows, c):
    """(i, j, plane) of contact c."""


@stage(required=True)
def force_of_row(rows, c):
    """The force of contact c on body j, as of the last velocity pass [N]."""


@stage(required=True)
def keep_row(rows, c, k):
    """Put what contact c remembers into place k."""


@stage(required=True)
def recall_row(rows, c, k):
    """Whether place k holds what contact c remembers; then it does again."""


@stage(required=True)
def detect_row(rows, c, bodies, planes, margin):
    """Whether the bodies of contact c are nearer than the margin; then where and how they touch."""


@stage(required=True)
def refresh_row(rows, c, bodies):
    """Bring gaps and all that depends on the pose to the present one."""


@stage(required=True)
def mark_row(rows, c, bodies):
    """Keep the speeds at the start of a sub-step; no impulse yet."""


@stage(required=True)
def warm_start_row(rows, c, bodies, h):
    """Set the impulses to what the last forces give in h/2, and push by the difference."""


@stage(required=True)
def foresee_row(rows, c, bodies, h, limits):
    """Prepare the position pass; returns when within h the contact closes in an impact, else inf; and its gap."""


@stage(required=True)
def project_row(rows, c, bodies, friction):
    """Solve the contact exactly for the present velocities of all else; returns how much its speed changed."""


@stage(required=True)
def relieve_row(rows, c, bodies, depth):
    """Take back what the position pass pushed, if the contact overlapped by more than ``depth``."""


@stage(required=True)
def turn_over_row(rows, c, bodies, h, friction, restitution):
    """From the position pass to the velocity pass; impacts are not in it if ``restitution`` is below 0."""


@stage(required=True)
def strike_row(rows, c, bodies, restitution):
    """From the velocity pass before an impact to that of the impact."""


@stage(required=True)
def settle_row(rows, c, h, steady):
    """Remember the forces."""


@stage(required=True)
def extrapolate_row(rows, c, bodies, share):
    """Go on along the conjugate direction: ``share`` of the last step, then this one."""
