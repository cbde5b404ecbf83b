"""The step of Position Based Dynamics: symplectic Euler with projected positions (Mueller et al. 2006)."""

from __future__ import annotations

from typing import NamedTuple

from pbd.errors import InvalidInput
from pbd.projection import begin
from pbd.stages import accelerate, damp, end, predict, solve, update


class Euler(NamedTuple):
    """Lines 5-16 of the 2006 algorithm, first order in h.

    Deviation: v <- (p - x)/h loses digits as h shrinks; its round-off floor is about 1e-16 |x| / h.
    """

    def bind(self, problem):
        """The kernel's integrator: itself; refuses bodies that it does not know how to move."""
        if problem.bodies is not None and not hasattr(problem.bodies, "predict"):
            raise InvalidInput("settings.integrator", "euler", "rattle for rigid bodies")
        return self

    def step(self, solver, scene, h):
        state = scene.state
        accelerate(scene.external, state, h)  # (5)  v <- v + h w f_ext
        damp(scene.damping, state)  # (6)  dampVelocities
        predict(state.particles, h)  # (7)  p <- x + h v
        predict(state.bodies, h)
        begin(scene.batches, state, h)  # (8)  generateCollisionConstraints(x -> p)
        solve(solver, scene.batches, state, h)  # (9)-(11)  projectConstraints, iterated
        update(state.particles, h)  # (12)-(15)  v <- (p - x)/h, x <- p
        update(state.bodies, h)
        end(scene.batches, state, h)  # (16)  velocityUpdate
