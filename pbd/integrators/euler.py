"""The step of Position Based Dynamics: symplectic Euler with projected positions (Mueller et al. 2006).

With ``half_kick`` velocities live half a sub-step before the positions, as in the leapfrog scheme: the first kick is
half a sub-step long. Samples hold velocities brought half a sub-step on, to the time of their positions. A free flight
is then its parabola, which symplectic Euler misses by g t h/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pbd import fields
from pbd.errors import InvalidInput
from pbd.jit import device
from pbd.projection import begin
from pbd.stages import accelerate, damp, end, predict, record, solve, update
from pbd.vector import copy, like


@dataclass(frozen=True)
class Euler:
    """Lines 5-16 of the 2006 algorithm, first order in h; with ``half_kick`` exact in a free flight, and no bodies.

    Deviation: v <- (p - x)/h loses digits as h shrinks; its round-off floor is about 1e-16 |x| / h.
    Limits of ``half_kick``: constraints take no part in bringing a sample's velocities on, so what rests on a floor is
    recorded with g h/2; and the velocities of ``Outcome.scene`` are half a sub-step old.
    """

    half_kick: bool = fields.flag(False, "velocities half a sub-step before the positions, as in the leapfrog scheme")

    def __post_init__(self) -> None:
        fields.check(self, "integrator")

    def bind(self, problem):
        """The kernel's integrator; refuses bodies that it does not know how to move."""
        bodies = problem.bodies
        if bodies is not None and not hasattr(bodies, "predict"):
            raise InvalidInput("settings.integrator", "euler", "rattle for rigid bodies")
        if not self.half_kick:
            return WholeKicks()
        if bodies is not None:
            kind = type(bodies).__name__
            raise InvalidInput("integrator.half_kick", True, "false with bodies", f"{kind} has velocities of its own")
        return HalfKick(np.zeros(1, dtype=problem.settings.dtype))


class WholeKicks(NamedTuple):
    """The kernel's step as published."""

    def step(self, solver, scene, h):
        advance(solver, scene, h, h)


class HalfKick(NamedTuple):
    """The kernel's step with the first kick halved; ``before[0]`` [s] is the sub-step before, 0 at the start."""

    before: np.ndarray

    def step(self, solver, scene, h):
        kick = like(h, 0.5) * (self.before[0] + h)
        self.before[0] = h
        advance(solver, scene, h, kick)

    def observe(self, solver, scene, recordings, k):
        """Record positions, and velocities of the same time; p, which the next step writes anew, keeps v meanwhile."""
        particles, before = scene.state.particles, self.before[0]
        copy(particles.p, particles.v)
        accelerate(scene.external, scene.state, like(before, 0.5) * before)
        record(particles, recordings[0], k)
        copy(particles.v, particles.p)


@device
def advance(solver, scene, h, kick):
    """Lines 5-16 over h, with the external forces of a time ``kick``."""
    state = scene.state
    accelerate(scene.external, state, kick)  # (5)  v <- v + h w f_ext
    damp(scene.damping, state)  # (6)  dampVelocities
    predict(state.particles, h)  # (7)  p <- x + h v
    predict(state.bodies, h)
    begin(scene.batches, state, h)  # (8)  generateCollisionConstraints(x -> p)
    solve(solver, scene.batches, state, h)  # (9)-(11)  projectConstraints, iterated
    update(state.particles, h)  # (12)-(15)  v <- (p - x)/h, x <- p
    update(state.bodies, h)
    end(scene.batches, state, h)  # (16)  velocityUpdate
