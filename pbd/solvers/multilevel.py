"""Hierarchical Position Based Dynamics (Mueller 2008): Gauss-Seidel on ever finer levels of the same particles.

A cycle goes from the coarsest level to the finest. On each coarse level distances are projected; then what particles
moved since the cycle began, p_j - q_j, is passed on to those that join on the next finer level:

    p_i <- p_i + sum_j w_ij (p_j - q_j)      corrections, not positions: detail that only i has stays

Level 0 ends with Gauss-Seidel sweeps in opposite orders. So a correction crosses n links in log n steps, not in n.

Coarse lengths are a choice. The paper's are fixed: along the shortest path of finer links (`path`) or as the particles
stand when bound (`straight`). The first is longer than the distance around a corner, the second wrong for a body that
bends or starts deformed; as upper limits both are safe but take no part in what is too short, and stall. Deviation, and
the default: `carried` lengths, set anew in each cycle. With the finest links' vectors at rest length, but in
their present directions, D = L d/|d|, a coarse link's is the mean over the finer paths it stands for of their sum,

    D_AB = mean over paths of sum D,      |p_A - p_B| = |D_AB|

so that a coarse level asks for nothing where the finest is content: cycles converge to a state of the fine
constraints alone, whatever its bends. It needs directions without noise: level 0 is swept before the first cycle too.

A coarse link is dropped for a cycle while the paths it stands for are bent (see `pbd.solvers.coarsening`).

Limits: interpolation keeps linear momentum, not angular, and corrections no longer lie along the constraints'
gradients, so the end is not quite Gauss-Seidel's. Of the way to the exact projection stretched flat cloths miss 1 to
4 % (Gauss-Seidel 4 %), bent chains 4 to 16 % (7 to 13 %). A swinging chain of 100 links pays for lengths that are 35
times better with three times Gauss-Seidel's error of position; with three levels it has a quarter of that error. Folds
of a cloth that coarse levels cannot see are left to level 0. Constraints other than rigid distances act on level 0
only, those of a single particle (contacts) on every level. Coarse arithmetic is in double precision.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd import fields
from pbd.arrangement import Arrangement, Problem, bind_laws, has_law, is_empty
from pbd.constraints.distance import Distance
from pbd.errors import InvalidInput
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.projection import increment, project, scatter, sweep
from pbd.solvers.coarsening import Graph
from pbd.solvers.gauss_seidel import Sweeps
from pbd.solvers.hierarchy import Hierarchy, build, carry, pass_on, project_level
from pbd.stages import evaluate, size
from pbd.vector import copy

LENGTHS = ("carried", "path", "straight")

MOST_LEVELS = 64
"""More than any hierarchy has: each level holds at most about two thirds of the particles of the one before."""


@dataclass(frozen=True)
class Multilevel:
    """Hierarchical PBD; `Settings.iterations` is its number of cycles.

    The defaults are one choice for all scenes. The paper's own is ``lengths="path", unilateral=True, sweeps=2``.
    With ``levels`` 0 there is nothing to cycle through, and an iteration is one Gauss-Seidel sweep.
    """

    levels: int = fields.whole(MOST_LEVELS, 0, MOST_LEVELS, "coarse levels at most; 0 is plain Gauss-Seidel")
    sweeps: int = fields.whole(4, 1, 1000, "on level 0, in each cycle")
    coarse_sweeps: int = fields.whole(6, 1, 1000, "on every coarse level, in each cycle")
    lengths: str = fields.choice("carried", LENGTHS, "coarse lengths: set anew in each cycle; along paths; as at first")
    unilateral: bool = fields.flag(False, "coarse links only hold together: upper limits, as in the paper")

    def __post_init__(self) -> None:
        fields.check(self, "solver")
        if self.lengths == "path" and not self.unilateral:
            reason = "a path around a corner is longer than the distance: as an equality it pushes apart"
            raise InvalidInput("solver.lengths", "path", "carried or straight, or unilateral", reason)

    def arrange(self, problem: Problem) -> Arrangement:
        """Bind everything and build the levels; raises `InvalidInput` where there is nothing to build them of."""
        settings = problem.settings
        cycles = int(settings.iterations)
        if self.levels == 0:
            return Arrangement(Sweeps(cycles), problem.particles, bind_laws(problem))
        carried = self.lengths == "carried"
        finest = _finest(problem)
        hierarchy = build(problem.particles, finest, int(self.levels), self.lengths == "straight", self.unilateral)
        solver = Cycles(cycles, int(self.sweeps), int(self.coarse_sweeps), carried, hierarchy)
        # k' counts the projections of a fine constraint
        counted = dataclasses.replace(settings, iterations=int(self.sweeps) * (cycles + carried))
        return Arrangement(solver, problem.particles, bind_laws(problem._replace(settings=counted)))


def _finest(problem: Problem) -> Graph:
    """The rigid distances that keep together: what coarse levels stand for."""
    held = [b for b in problem.batches if isinstance(b, Distance) and not is_empty(b) and has_law(b)]
    held = [b for b in held if b.law.is_rigid and b.law.relation != "at_least"]
    if not held:
        reason = "coarse levels are made of rigid distances, and there are none"
        raise InvalidInput("settings.solver", "multilevel", "gauss_seidel here", reason)
    pairs = np.concatenate([b.pairs.as_array(b.size()) for b in held])
    upper = np.repeat([b.law.relation == "at_most" for b in held], [b.size() for b in held])
    return Graph(pairs, np.concatenate([b.rest for b in held]), upper, np.zeros(len(pairs)))


class Cycles(NamedTuple):
    """The kernel's solver: ``cycles`` times down all levels of ``hierarchy``."""

    cycles: int
    sweeps: int
    coarse_sweeps: int
    carried: bool
    hierarchy: Hierarchy

    def solve(self, batches, state, h):
        if self.carried:
            smooth(batches, self.sweeps, state, h)
        for _ in range(self.cycles):
            copy(self.hierarchy.before, state.particles.p)
            if self.carried:
                carry(self.hierarchy, state)
            for level in range(self.hierarchy.first.shape[0] - 2, 0, -1):
                for s in range(self.coarse_sweeps):
                    project_level(self.hierarchy, level, s % 2 == 1, state)
                    project_points(batches, self.hierarchy.depth, level, state, h)
                pass_on(self.hierarchy, level, state.particles.p)
            smooth(batches, self.sweeps, state, h)


@device
def smooth(batches, sweeps, state, h):
    """Gauss-Seidel on level 0, forth and back in turn."""
    for s in range(sweeps):
        if s % 2 == 0:
            project(batches, state, h)
        else:
            project_backward(batches, state, h)


def _is_generic(cls: Any) -> bool:
    """Whether a batch is projected constraint by constraint, from evaluate() and its law."""
    return hasattr(cls, "evaluate") and "law" in cls._fields and not hasattr(cls, "project")


def project_backward(batches: tuple, state: Any, h: float) -> None:
    """One sweep in the opposite order; a batch that projects itself has its own order."""
    for batch in reversed(batches):
        (backward if _is_generic(type(batch)) else project)(batch, state, h)


@typed(project_backward)
def _project_backward(batches: Any, state: Any, h: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, state, h: None
    turn = backward if _is_generic(batches[0].instance_class) else project

    def last(batches, state, h):
        project_backward(batches[1:], state, h)
        turn(batches[0], state, h)

    return last


@device
def backward(batch, state, h):
    sweep(batch, range(size(batch) - 1, -1, -1), state.particles, h)
    state.work[0] += size(batch)


def project_points(batches: tuple, depth: np.ndarray, level: int, state: Any, h: float) -> None:
    """Project the constraints of single particles, of those that are on a level."""
    for batch in batches:
        if _is_generic(type(batch)):
            points(batch, depth, level, state, h)


@typed(project_points)
def _project_points(batches: Any, depth: Any, level: Any, state: Any, h: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, depth, level, state, h: None
    if not _is_generic(batches[0].instance_class):
        return lambda batches, depth, level, state, h: project_points(batches[1:], depth, level, state, h)

    def first(batches, depth, level, state, h):
        points(batches[0], depth, level, state, h)
        project_points(batches[1:], depth, level, state, h)

    return first


@device
def points(batch, depth, level, state, h):
    for c in range(size(batch)):
        row = evaluate(batch, c, state.particles.p)
        indices, _, gradients, _ = row
        if len(indices) > 1:
            return
        if depth[indices[0]] >= level:
            scatter(state.particles, indices, gradients, increment(batch.law, c, row, state.particles, h))
            state.work[0] += 1
