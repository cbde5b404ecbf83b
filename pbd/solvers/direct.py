"""Direct solve of chains: Newton's method on the tridiagonal system of the multipliers.

The constraint is taken as C = (|d|^2 - L^2)/2 with d = x_c - x_(c+1): the same zeros as |d| - L without a square
root, and quadratic, so that after a correction D of d the residual is |D|^2/2 exactly, known without another
evaluation. With e the vectors along which links pull (d itself in PBD; d at the start of the step in SHAKE):

    T l = -C,   T_cc = (w_c + w_(c+1)) d_c . e_c,   T_c,c+1 = -w_(c+1) d_c . e_(c+1),   T_c,c-1 = -w_c d_c . e_(c-1)
    p_c <- p_c + w_c (e_c l_c - e_(c-1) l_(c-1))

T is made and eliminated in one pass, from both ends towards the middle: two independent recurrences, since each
waits for its division (some 22 cycles a link), and the rows are made meanwhile. No pivoting: T is definite as long as
links turn by less than a right angle in a step. SHAKE's multipliers are smooth in time, so they are predicted by
quadratic extrapolation from the last three steps; one Newton iteration then mostly suffices.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from pbd.arrangement import Arrangement, Problem, bind_laws, is_empty, is_rigid_equality
from pbd.constraints.distance import Distance, Path
from pbd.errors import InvalidInput
from pbd.frozen import Frozen, Tangent
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.solvers.chain import (
    copy_links,
    eliminate,
    eliminate_rates,
    extrapolate,
    left,
    pull,
    pull_both,
    remember,
    workspace,
)

TOLERANCE = 1e-15
"""Of the squared length: a residual |D|^2/2 below it is round-off; one unit in the last place of L^2 is 2.2e-16."""

MOST = 30
"""Newton iterations; convergence is quadratic, so a solve that takes more has no solution nearby."""


@dataclass(frozen=True)
class Direct:
    """All links of a chain at once, to round-off; takes the place of iterations.

    Limits: chains of rigid distances in order, particle k to k + 1, in any number, and nothing else.
    """

    solves_frozen: ClassVar[bool] = True

    def arrange(self, problem: Problem) -> Arrangement:
        """Bind everything; raises `InvalidInput` where something is no chain, soft or one-sided."""
        batches = bind_laws(problem)
        for given in problem.batches:
            if not is_empty(given) and not (isinstance(given, Distance) and isinstance(given.pairs, Path)):
                reason = f"{type(given).__name__} is no chain of particles k to k + 1"
                raise InvalidInput("settings.solver", "direct", "gauss_seidel here", reason)
            if not is_empty(given) and not is_rigid_equality(given):
                raise InvalidInput("settings.solver", "direct", "gauss_seidel here", "the chain is soft or one-sided")
        _check_apart(batches)
        settings = problem.settings
        if settings.iterations != 1:
            reason = "the direct solver iterates until it has converged"
            raise InvalidInput("settings.iterations", settings.iterations, "1 with direct", reason)
        if settings.precision != "float64":
            raise InvalidInput("settings.precision", settings.precision, "float64 with direct", "it solves to 1e-15")
        stages = len(getattr(settings.integrator, "stages", (1.0,)))
        dimension = len(problem.particles.x)
        chains = tuple(workspace(batch.size(), dimension, stages) for batch in batches)
        return Arrangement(ChainSolver(chains), problem.particles, batches)


def _check_apart(batches: tuple) -> None:
    """Refuse chains that share a particle: their systems are one, which is not tridiagonal."""
    ranges = sorted((int(batch.pairs.first), int(batch.pairs.first) + batch.size()) for batch in batches)
    for one, other in itertools.pairwise(ranges):
        if other[0] <= one[1]:
            raise InvalidInput(
                "settings.solver", "direct", "gauss_seidel here", f"two chains share particle {other[0]}"
            )


class ChainSolver(NamedTuple):
    """The kernel's solver: ``chains`` are the work arrays, one for each batch."""

    chains: tuple

    def solve(self, batches, state, h):
        each_chain(batches, self.chains, state, h)

    def solve_velocities(self, batches, state):
        each_chain(batches, self.chains, state, 1.0)


def each_chain(batches: tuple, chains: tuple, state: Any, h: float) -> None:
    """Solve every chain in the manner of its type: PBD's, SHAKE's (`Frozen`) or for velocities (`Tangent`)."""
    for batch, chain in zip(batches, chains, strict=True):
        _form(type(batch))(batch, chain, state, h)


@typed(each_chain)
def _each_chain(batches: Any, chains: Any, state: Any, h: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, chains, state, h: None
    solve_chain = _form(batches[0].instance_class)

    def first(batches, chains, state, h):
        solve_chain(batches[0], chains[0], state, h)
        each_chain(batches[1:], chains[1:], state, h)

    return first


def _form(kind: Any) -> Any:
    if kind is Frozen:
        return solve_frozen
    return solve_tangent if kind is Tangent else solve_current


@device
def solve_current(batch, chain, state, h):
    """PBD with an exact solve: links pull along themselves, at the iterate p."""
    w, p = state.particles.w, state.particles.p
    for _ in range(MOST):
        copy_links(batch, p, chain.link)
        eliminate(batch, chain, p, w)
        state.work[0] += batch.rest.shape[0]
        pull(batch, chain, p, w, 1.0)
        if left(batch, chain, w) <= TOLERANCE:
            return
    state.work[1] += 1


@device
def solve_frozen(frozen, chain, state, h):
    """SHAKE: links pull as they stood at the start of the step; the impulses are added to v."""
    batch, w, p, v = frozen.batch, state.particles.w, state.particles.p, state.particles.v
    copy_links(batch, frozen.start, chain.link)
    extrapolate(chain)
    pull_both(batch, chain, p, v, w, 1.0 / h)
    solved = False
    for _ in range(MOST):
        eliminate(batch, chain, p, w)
        state.work[0] += batch.rest.shape[0]
        pull_both(batch, chain, p, v, w, 1.0 / h)
        for c in range(chain.total.shape[0]):
            chain.total[c] += chain.multiplier[c + 1]
        solved = left(batch, chain, w) <= TOLERANCE
        if solved:
            break
    state.work[1] += 0 if solved else 1
    remember(chain)


@device
def solve_tangent(tangent, chain, state, h):
    """Velocities that change no length: e_c . (v_c - v_(c+1)) = 0, which is linear."""
    batch, w, v = tangent.batch, state.particles.w, state.particles.v
    copy_links(batch, tangent.at, chain.link)
    eliminate_rates(batch, chain, tangent.at, v, w)
    pull(batch, chain, v, w, 1.0)
    state.work[0] += batch.rest.shape[0]
