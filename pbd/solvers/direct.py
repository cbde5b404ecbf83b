"""Direct solve of chains: Newton's method on the tridiagonal system of the multipliers.

The constraint is taken as C = (|d|^2 - L^2)/2 with d = x_c - x_(c+1): the same zeros as |d| - L without a square
root, and quadratic, so that after a correction D of d the residual is |D|^2/2 exactly, known without another
evaluation. With e the vectors along which links pull (d itself in PBD; d at the start of the step in SHAKE):

    T l = -C,   T_cc = (w_c + w_(c+1)) d_c . e_c,   T_c,c+1 = -w_(c+1) d_c . e_(c+1),   T_c,c-1 = -w_c d_c . e_(c-1)
    p_c <- p_c + w_c (e_c l_c - e_(c-1) l_(c-1))

T is eliminated from both ends towards the middle, two independent recurrences, since each waits for its division
(22 cycles a link). SHAKE's multipliers are smooth in time, so they are predicted by quadratic extrapolation from
the last three steps; one Newton iteration then mostly suffices.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pbd.arrangement import Arrangement, Problem, bind_laws, is_empty, is_rigid_equality
from pbd.constraints.distance import Distance, Path
from pbd.errors import InvalidInput
from pbd.frozen import Frozen, Tangent
from pbd.intrinsics import typed
from pbd.jit import device, device_sum
from pbd.solvers.tridiagonal import Tridiagonal, eliminate
from pbd.vector import Store, copy, dot, load, zeros

TOLERANCE = 1e-15
"""Of the squared length: a residual |D|^2/2 below it is round-off; one unit in the last place of L^2 is 2.2e-16."""

MOST = 30
"""Newton iterations; convergence is quadratic, so a solve that takes more has no solution nearby."""

HISTORY = 3
"""Steps from which SHAKE's multipliers are predicted."""


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
        chains = tuple(_workspace(batch.size(), dimension, stages) for batch in batches)
        return Arrangement(ChainSolver(chains), problem.particles, batches)


def _check_apart(batches: tuple) -> None:
    """Refuse chains that share a particle: their systems are one, which is not tridiagonal."""
    ranges = sorted((int(batch.pairs.first), int(batch.pairs.first) + batch.size()) for batch in batches)
    for one, other in itertools.pairwise(ranges):
        if other[0] <= one[1]:
            raise InvalidInput(
                "settings.solver", "direct", "gauss_seidel here", f"two chains share particle {other[0]}"
            )


class Chain(NamedTuple):
    """Work arrays of one chain of m links.

    link, pull : stores (m,) of d and e;  matrix : T;  multiplier (m,) : l of this step
    past (stages, HISTORY, m) : l of the last steps, newest first
    turn (2,) : the sub-step, and how many steps are known
    """

    link: Store
    pull: Store
    matrix: Tridiagonal
    multiplier: np.ndarray
    past: np.ndarray
    turn: np.ndarray


def _workspace(links: int, dimension: int, stages: int) -> Chain:
    matrix = Tridiagonal(*(np.zeros(links) for _ in range(4)))
    past, turn = np.zeros((stages, HISTORY, links)), np.zeros(2, dtype=np.int64)
    return Chain(zeros(links, dimension), zeros(links, dimension), matrix, np.zeros(links), past, turn)


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
        links_of(batch, p, chain.link)
        assemble(batch, chain, chain.link, w)
        eliminate(chain.matrix)
        pull(batch, p, chain.link, chain.matrix.right, w, 1.0)
        state.work[0] += batch.rest.shape[0]
        if left(batch, chain.link, chain.matrix.right, w) <= TOLERANCE:
            return
    state.work[1] += 1


@device
def solve_frozen(frozen, chain, state, h):
    """SHAKE: links pull as they stood at the start of the step; the impulses are added to v."""
    batch, w, p = frozen.batch, state.particles.w, state.particles.p
    links_of(batch, frozen.start, chain.pull)
    extrapolate(chain)
    pull(batch, p, chain.pull, chain.multiplier, w, 1.0)
    solved = False
    for _ in range(MOST):
        links_of(batch, p, chain.link)
        assemble(batch, chain, chain.pull, w)
        eliminate(chain.matrix)
        pull(batch, p, chain.pull, chain.matrix.right, w, 1.0)
        for c in range(chain.multiplier.shape[0]):
            chain.multiplier[c] += chain.matrix.right[c]
        state.work[0] += batch.rest.shape[0]
        solved = left(batch, chain.pull, chain.matrix.right, w) <= TOLERANCE
        if solved:
            break
    state.work[1] += 0 if solved else 1
    pull(batch, state.particles.v, chain.pull, chain.multiplier, w, 1.0 / h)
    remember(chain)


@device
def solve_tangent(tangent, chain, state, h):
    """Velocities that change no length: d_c . (v_c - v_(c+1)) = 0, which is linear."""
    batch, w, v = tangent.batch, state.particles.w, state.particles.v
    links_of(batch, tangent.at, chain.pull)
    links_of(batch, v, chain.link)
    for c in range(batch.rest.shape[0]):
        chain.multiplier[c] = dot(load(chain.pull, c), load(chain.link, c))
    copy(chain.link, chain.pull)
    assemble(batch, chain, chain.pull, w)
    for c in range(batch.rest.shape[0]):
        chain.matrix.right[c] = -chain.multiplier[c]
    eliminate(chain.matrix)
    pull(batch, v, chain.pull, chain.matrix.right, w, 1.0)
    state.work[0] += batch.rest.shape[0]


@device
def links_of(batch, x, links):
    """d_c = x_c - x_(c+1), into ``links``."""
    first = batch.pairs.first
    for k in range(len(x)):
        for c in range(batch.rest.shape[0]):
            i = first + np.uint64(c)
            links[k][c] = x[k][i] - x[k][i + np.uint64(1)]


@device
def assemble(batch, chain, pulls, w):
    """T and -C for links d = chain.link that pull along e = ``pulls``."""
    lower, diagonal, upper, right = chain.matrix
    first, last = batch.pairs.first, batch.rest.shape[0] - 1
    for c in range(last + 1):
        link = load(chain.link, c)
        i = first + np.uint64(c)
        diagonal[c] = (w[i] + w[i + np.uint64(1)]) * dot(link, load(pulls, c))
        right[c] = 0.5 * (batch.rest[c] * batch.rest[c] - dot(link, link))
    for c in range(last):
        shared = w[first + np.uint64(c + 1)]
        upper[c] = -shared * dot(load(chain.link, c), load(pulls, c + 1))
        lower[c + 1] = -shared * dot(load(chain.link, c + 1), load(pulls, c))


@device
def pull(batch, y, pulls, multiplier, w, factor):
    """y_c <- y_c + factor w_c (e_c l_c - e_(c-1) l_(c-1)), for positions or velocities y."""
    first, links = batch.pairs.first, batch.rest.shape[0]
    for k in range(len(y)):
        e = pulls[k]
        y[k][first] += factor * w[first] * e[0] * multiplier[0]
        for c in range(1, links):
            i = first + np.uint64(c)
            y[k][i] += factor * w[i] * (e[c] * multiplier[c] - e[c - 1] * multiplier[c - 1])
        end = first + np.uint64(links)
        y[k][end] -= factor * w[end] * e[links - 1] * multiplier[links - 1]


@device_sum
def left(batch, pulls, multiplier, w):
    """The residual that a correction leaves: the root of sum_c (|D_c|^2 / (2 L_c^2))^2, D being the change of d."""
    first, links = batch.pairs.first, batch.rest.shape[0]
    total = 0.0
    for c in range(links):
        i = first + np.uint64(c)
        square = 0.0
        for k in range(len(pulls)):
            e = pulls[k]
            change = (w[i] + w[i + np.uint64(1)]) * e[c] * multiplier[c]
            if c > 0:
                change -= w[i] * e[c - 1] * multiplier[c - 1]
            if c + 1 < links:
                change -= w[i + np.uint64(1)] * e[c + 1] * multiplier[c + 1]
            square += change * change
        relative = square / (batch.rest[c] * batch.rest[c])
        total += relative * relative
    return 0.5 * math.sqrt(total)


@device
def extrapolate(chain):
    """l <- 3 l_1 - 3 l_2 + l_3, or what fewer known steps allow; of the same sub-step in each step."""
    past, known = chain.past[chain.turn[0]], chain.turn[1]
    a = 0.0 if known == 0 else (1.0 if known == 1 else (2.0 if known == 2 else 3.0))
    b = 0.0 if known < 2 else (-1.0 if known == 2 else -3.0)
    d = 1.0 if known > 2 else 0.0
    for c in range(chain.multiplier.shape[0]):
        chain.multiplier[c] = a * past[0, c] + b * past[1, c] + d * past[2, c]


@device
def remember(chain):
    """Keep this sub-step's multipliers, and go on to the next sub-step."""
    past = chain.past[chain.turn[0]]
    for c in range(chain.multiplier.shape[0]):
        past[2, c] = past[1, c]
        past[1, c] = past[0, c]
        past[0, c] = chain.multiplier[c]
    chain.turn[0] += 1
    if chain.turn[0] == chain.past.shape[0]:
        chain.turn[0] = 0
        chain.turn[1] = min(chain.turn[1] + 1, HISTORY)
