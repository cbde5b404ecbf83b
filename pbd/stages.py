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
