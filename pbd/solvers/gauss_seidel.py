"""Gauss-Seidel: each projection sees the one before (PBD 2006, section 3.2), in one of three orders.

natural     as the constraints were given: what the paper has, and the default
wavefront   the same result to the last bit, for one chain: all sweeps run at once, two links apart
coloured    independent constraints follow each other, particles stand so that they form unit-stride runs
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd import fields
from pbd.arrangement import Arrangement, Problem, bind_laws, placed, renumbered
from pbd.constraints.distance import Distance, Path
from pbd.errors import InvalidInput
from pbd.projection import project, sweep
from pbd.solvers import runs

TANGENT_SWEEPS = 100
"""Sweeps that bring a recorded velocity onto the constraints. Limit: chains of more than some ten links need more."""

ORDERS = ("natural", "wavefront", "coloured")


@dataclass(frozen=True)
class GaussSeidel:
    """``iterations`` sweeps over all constraints, in an order of ORDERS.

    Limit: information travels along a chain once per sweep in the order's direction and one link a sweep
    against it - in coloured order two links either way -, so a chain of N links needs O(N^2) sweeps.
    """

    order: str = fields.choice("natural", ORDERS, "order of the constraints in a sweep")

    def __post_init__(self) -> None:
        fields.check(self, "solver")

    @property
    def solves_frozen(self) -> bool:
        """Whether it can project what `pbd.frozen` makes of a batch: in natural order."""
        return self.order == "natural"

    def arrange(self, problem: Problem) -> Arrangement:
        """Bind everything; raises `InvalidInput` where the order does not fit the constraints."""
        if self.order == "coloured":
            return _coloured(problem)
        batches, iterations = bind_laws(problem), int(problem.settings.iterations)
        if self.order == "wavefront":
            _check_one_chain(batches)
            return Arrangement(Wavefront(iterations), problem.particles, batches)
        return Arrangement(Sweeps(iterations), problem.particles, batches)


class Sweeps(NamedTuple):
    """Sweeps over all batches, in their order, each in the order of its constraints."""

    iterations: int

    def solve(self, batches, state, h):
        for _ in range(self.iterations):  # (9)
            project(batches, state, h)  # (10)

    def solve_velocities(self, batches, state):
        for _ in range(TANGENT_SWEEPS):
            project(batches, state, 1.0)


class Wavefront(NamedTuple):
    """All sweeps of a chain at once: at time t, sweep s projects link t - 2 s.

    Link c of sweep s needs links c - 1 and c of this sweep and c, c + 1 of the one before: all are done. The
    links of one time step are two apart, share no particle, and so fill the processor, which one natural sweep
    leaves waiting for square root and division (dependent operations: about 40 cycles a link).
    """

    iterations: int

    def solve(self, batches, state, h):
        chain = batches[0]
        links, sweeps = chain.rest.shape[0], self.iterations
        for t in range(links + 2 * (sweeps - 1)):
            latest = max((t - links + 2) // 2, 0)
            first = t - 2 * min(t // 2, sweeps - 1)
            links_now = range(np.uint64(first), np.uint64(t - 2 * latest + 1), np.uint64(2))
            sweep(chain, links_now, state.particles, h)
        state.work[0] += sweeps * links


def _check_one_chain(batches: tuple) -> None:
    alone = len(batches) == 1 and isinstance(batches[0], Distance)
    if not alone or not isinstance(batches[0].pairs, Path):
        allowed = "natural or coloured here"
        reason = "a wavefront takes one chain of distances, particle k to k + 1, and nothing else"
        raise InvalidInput("solver.order", "wavefront", allowed, reason)


def _coloured(problem: Problem) -> Arrangement:
    """Particles moved to where most constraints form runs; each batch of distances in runs, the rest by colour."""
    batches = bind_laws(problem)
    if not any(isinstance(batch, Distance) for batch in batches):
        raise InvalidInput("solver.order", "coloured", "natural here", "it is made for distances, and there are none")
    pairs = [batch.pairs.as_array(batch.size()) for batch in batches if isinstance(batch, Distance)]
    layout = runs.choose_layout(pairs, len(problem.particles.w))
    particles = placed(problem.particles, layout.slot, layout.slots)
    found: list[Any] = []
    for batch in batches:
        moved = renumbered(batch, layout.slot, "coloured")
        found += runs.split(moved, particles.w) if isinstance(batch, Distance) else [moved]
    return Arrangement(Sweeps(int(problem.settings.iterations)), particles, tuple(found), layout.slot)
