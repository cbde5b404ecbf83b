"""SHAKE: the position-based step, with the constraint gradients frozen at its start and a half kick. Second order.

Source: Ryckaert, Ciccotti and Berendsen 1977; as a symplectic method Leimkuhler and Skeel 1994. It differs from the
2006 step in two lines: constraints pull along their gradients at x, not at p, and the first kick is half a step, so
that velocities live between positions (leapfrog). Compositions of such steps, some of them backwards, are of order
4 (Suzuki 1990) and 6 (Kahan and Li 1997); no velocity is projected between their sub-steps: what a projection
would remove, the next one's multipliers absorb. The kick between two sub-steps is their mean.

    v <- v + (h_before + h)/2 w f_ext,   p <- x + h v,   p <- p + w G(x)^T l with C(p) = 0,   v <- v + w G(x)^T l / h
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pbd import fields
from pbd.arrangement import Problem, is_empty, is_rigid_equality
from pbd.dispatch import stage
from pbd.errors import InvalidInput
from pbd.frozen import frozen, tangent
from pbd.stages import accelerate, predict, record, solve, solve_velocities, update
from pbd.vector import copy

STAGES = {
    2: (1.0,),
    4: (1 / (4 - 4 ** (1 / 3)),) * 2 + (1 - 4 / (4 - 4 ** (1 / 3)),),
    6: (
        0.39216144400731413927925056,
        0.33259913678935943859974864,
        -0.70624617255763935980996482,
        0.08221359629355080023149045,
        0.79854399093482996339895035,
    ),
}
"""Order -> the lengths of its sub-steps, up to the middle one: Suzuki's five and Kahan and Li's nine (s9odr6a)."""

VELOCITIES = ("impulses", "differences")


@stage(required=True)
def finish(velocity, particles, h):
    """Lines 12-15: the velocity after the step, and x <- p."""


class Impulses(NamedTuple):
    """v is already right: the constraints' impulses were added to it. Its round-off does not grow as h shrinks."""

    def finish(self, particles, h):
        copy(particles.x, particles.p)


class Differences(NamedTuple):
    """v <- (p - x)/h, as in 2006. Its round-off is about 1e-16 |x|/h."""

    def finish(self, particles, h):
        update(particles, h)


@dataclass(frozen=True)
class Shake:
    """SHAKE of order 2, or its composition of order 4 or 6; ``velocity`` from impulses or from differences."""

    order: int = fields.whole(2, 2, 6, "2, 4 or 6")
    velocity: str = fields.choice("impulses", VELOCITIES, "v <- v + impulse, or (p - x)/h")

    def __post_init__(self) -> None:
        fields.check(self, "integrator")
        if self.order not in STAGES:
            raise InvalidInput("integrator.order", self.order, "2, 4 or 6")

    @property
    def stages(self) -> np.ndarray:
        """(s,) lengths of the sub-steps, as fractions of the step; symmetric, of sum 1."""
        half = STAGES[int(self.order)]
        return np.array(half + half[-2::-1])

    def bind(self, problem: Problem) -> Leapfrog:
        """The kernel's integrator; refuses what would spoil its order."""
        for batch in problem.batches:
            if not is_empty(batch) and not hasattr(batch, "evaluate"):
                reason = f"{type(batch).__name__} has no evaluate(), whose gradients are frozen"
                raise InvalidInput("settings.integrator", "shake", "euler", reason)
            if not is_empty(batch) and not is_rigid_equality(batch):
                reason = f"{type(batch).__name__} is soft or one-sided; its step is Euler's"
                raise InvalidInput("settings.integrator", "shake", "euler, or rigid equality constraints", reason)
        settings = problem.settings
        name = type(settings.solver).__name__
        for field, value, is_bad, allowed, reason in (
            ("solver", name, not getattr(settings.solver, "solves_frozen", False), "Direct, natural GaussSeidel", ""),
            ("damping", settings.damping, settings.damping and settings.damping.k, "none", "it is of first order"),
            ("precision", settings.precision, settings.precision != "float64", "float64", "order 2 needs its digits"),
            ("bodies", problem.bodies, problem.bodies is not None, "none", "only particles are integrated so"),
        ):
            if is_bad:
                raise InvalidInput(f"settings.{field}", value, f"{allowed} with shake", reason)
        velocity = Impulses() if self.velocity == "impulses" else Differences()
        return Leapfrog(self.stages, np.zeros(1), velocity)


class Leapfrog(NamedTuple):
    """The kernel's SHAKE: ``stages`` (s,) of a step; ``before[0]`` [s] is the sub-step before, 0 at the start."""

    stages: np.ndarray
    before: np.ndarray
    velocity: Impulses | Differences

    def step(self, solver, scene, h):
        state = scene.state
        for s in range(self.stages.shape[0]):
            length = self.stages[s] * h
            accelerate(scene.external, state, 0.5 * (self.before[0] + length))
            self.before[0] = length
            predict(state.particles, length)
            solve(solver, frozen(scene.batches, state.particles.x), state, length)
            finish(self.velocity, state.particles, length)

    def observe(self, solver, scene, recordings, k):
        """Record positions, and velocities brought half a sub-step on to the same time, and onto the constraints.

        p, which the next step writes anew, keeps the velocities meanwhile.
        """
        particles = scene.state.particles
        copy(particles.p, particles.v)
        accelerate(scene.external, scene.state, 0.5 * self.before[0])
        solve_velocities(solver, tangent(scene.batches, particles.x), scene.state)
        record(particles, recordings[0], k)
        copy(particles.v, particles.p)
