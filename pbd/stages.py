"""The stages of a step: the open functions that particles, constraints, solvers and fields implement.

A class joins the simulation by defining methods of these names; see `pbd.dispatch`. Arguments:
``state`` is the `State`, ``h`` the sub-step in s. Two further stages, `begin` and `project`, have
defaults and stand in `pbd.projection`.
"""

from __future__ import annotations

from pbd.dispatch import stage

# ------------------------------------------------------------------ state groups


@stage
def kick(group, acceleration, h):
    """v <- v + h a for one acceleration vector a; nothing for what is pinned."""


@stage
def predict(group, h):
    """Line 7: p <- x + h v."""


@stage
def update(group, h):
    """Lines 12-15: v <- (p - x)/h, x <- p."""


@stage
def record(group, recording, k):
    """Write the present positions and velocities as sample k."""


@stage
def not_finite(group):
    """0 when all is finite, 1 when a position is not, 2 when a velocity is not."""
    return 0


# ------------------------------------------------------------------ what acts on the state


@stage
def accelerate(field, state, h):
    """Line 5: v <- v + h w f_ext(x)."""


@stage
def damp(damping, state):
    """Line 6: dampVelocities."""


@stage(required=True)
def step(integrator, solver, scene, h):
    """Lines 5-16: one (sub-)step of length h."""


@stage
def observe(integrator, solver, scene, recordings, k):
    """Write sample k; an integrator whose velocities live elsewhere than its positions brings them there first."""
    record(scene.state.particles, recordings[0], k)
    record(scene.state.bodies, recordings[1], k)
    record_load(scene.batches, recordings[1], k)


@stage(required=True)
def solve(solver, batches, state, h):
    """Lines 9-11: project all constraints, as often as the solver says."""


@stage(required=True)
def solve_velocities(solver, batches, state):
    """Bring velocities onto constraints that are `pbd.frozen.Tangent`; only SHAKE asks for it, to record them."""


# ------------------------------------------------------------------ constraints


@stage(required=True)
def size(batch):
    """Number of constraints in the batch."""


@stage(required=True)
def evaluate(batch, c, x):
    """Constraint c at positions x: (indices, C, gradients, squared gradient norms), tuples of one length."""


@stage
def end(batch, state, h):
    """Line 16: velocityUpdate - friction, restitution, viscosity."""


# ------------------------------------------------------------------ constraints of rigid bodies, in the order of a step


@stage
def detect(batch, state, h, left):
    """Before a sub-step, ``left`` of which are left in the step: find what touches, as seldom as motion allows."""


@stage
def record_load(batch, recording, k):
    """Add the forces of planes on bodies, as of the last velocity pass, to sample k."""


@stage
def mark(batch, state):
    """Keep the speeds at the start of a sub-step; no impulse yet."""


@stage
def warm_start(batch, state, h):
    """Set impulses to what the last forces give in h/2, and push the bodies by the difference."""


@stage
def foresee(batch, state, h, whole):
    """Prepare a position pass over h from the motion that is foreseen, and signal impacts within it.

    h is the ``whole`` sub-step or the part of it up to an impact. Errors are undone at the rate of a whole one, or a
    short part would turn them into speed.
    """


@stage
def extrapolate(batch, state, share):
    """Repeat ``share`` of the last step along the conjugate direction, and add this sweep's step to it."""


@stage
def drift(bodies, h):
    """x <- x + h v, and the turns."""


@stage
def relieve(batch, state):
    """Take back the impulses with which a position pass has undone deep overlaps, lest they become speed."""


@stage
def turn_over(batch, state, h, strikes):
    """From the position pass, over a sub-step of h, to the velocity pass; impacts come after it, if it ``strikes``."""


@stage
def strike(batch, state):
    """From the velocity pass that ends where bodies strike to that of the impact."""


@stage
def settle(batch, state, h, steady):
    """The sub-step is over: remember its forces, if it was ``steady``, without impact."""
