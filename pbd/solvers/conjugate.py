"""Gauss-Seidel sweeps with conjugate directions, for the contacts and joints of rigid bodies.

Source: Silcowitz-Hansen, Niebe and Erleben 2010, a nonsmooth nonlinear conjugate gradient method: a sweep is taken as
the gradient step of Fletcher and Reeves, and the last direction is gone along again by the ratio of squared steps;
where that exceeds 1 it starts anew. A pass ends with a sweep, so impulses always obey their contact's laws.
Where sweeps alone need of the order of n^2 for a stack of n, or the mass ratio, this needs n, or its root. Deviation:
steps are measured in the energy of their velocity changes, so that heavy and light bodies count alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from pbd import fields
from pbd.arrangement import Arrangement, Problem, bind_laws
from pbd.errors import InvalidInput
from pbd.jit import device
from pbd.projection import project
from pbd.stages import extrapolate
from pbd.state import CHANGE, SIZE


@dataclass(frozen=True)
class ConjugateSweeps:
    """At most ``iterations`` of the settings sweeps over positions and ``velocity_iterations`` over velocities.

    A pass ends earlier when a sweep changes the impulses by less than ``tolerance`` of themselves.
    """

    velocity_iterations: int = fields.whole(10, 1, 1_000_000, "sweeps over velocities, at most")
    tolerance: float = fields.real(1e-6, "1", 0.0, 1.0, "change of impulses in a sweep, over the impulses")

    def __post_init__(self) -> None:
        fields.check(self, "solver")

    def arrange(self, problem: Problem) -> Arrangement:
        """Bind everything; raises `InvalidInput` without bodies."""
        if problem.bodies is None or problem.particles is not None:
            raise InvalidInput("settings.solver", "conjugate_sweeps", "gauss_seidel for particles", "it solves bodies")
        counts = int(problem.settings.iterations), int(self.velocity_iterations)
        return Arrangement(Conjugate(*counts, float(self.tolerance) ** 2), None, bind_laws(problem))


class Conjugate(NamedTuple):
    """The kernel's solver; ``square`` is the tolerance's."""

    iterations: int
    velocity_iterations: int
    square: float

    def solve(self, batches, state, h):
        sweeps(self, batches, state, h, self.iterations)

    def solve_velocities(self, batches, state):
        sweeps(self, batches, state, 0.0, self.velocity_iterations)


@device
def sweeps(solver, batches, state, h, count):
    """Sweep and extrapolate; h is 0 for velocities."""
    before = 0.0
    for k in range(count):
        state.signals[CHANGE] = state.signals[SIZE] = 0.0
        project(batches, state, h)
        change = state.signals[CHANGE]
        if change <= solver.square * state.signals[SIZE] or k == count - 1:
            break
        extrapolate(batches, state, change / before if k > 0 and change < before else 0.0)
        before = change
