"""Implicit Euler: each (sub-)step reaches the minimum that XPBD with compliance approaches, but does not reach.

    x* = argmin  1/(2 h^2) |x - x_hat|_M^2 + sum_c C_c(x)^2 / (2 alpha_c),    x_hat = x + h v + h^2 M^-1 f_ext

which is the step of the implicit Euler method (e.g. Gast et al. 2015). The search begins at x_hat + h^2 M^-1 f(x),
with the springs' forces f of the step's start, where that has less energy than x_hat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd import fields
from pbd.arrangement import Arrangement, Problem, bind_laws, is_empty
from pbd.constraints.distance import Distance
from pbd.errors import InvalidInput
from pbd.routine import routine
from pbd.solvers.conjugate_gradients import ConjugateGradients
from pbd.solvers.elastic_energy import Energy, Springs, linearise, value
from pbd.solvers.incidence import CHUNK, incidence
from pbd.solvers.newton_cg import NEWTON, RESYNCHRONISED, Accuracy, Workspace, newton
from pbd.solvers.resynchronisation import balance, resynchronised
from pbd.stiffness import Compliance
from pbd.vector import copy, from_store, zeros

EPSILON = 2.0**-52
"""Unit in the last place of 1."""

COUNTERS = 4


@dataclass(frozen=True)
class Implicit:
    """The minimum to ``tolerance``, by Newton's method with conjugate gradients; takes the place of iterations.

    With ``period`` > 0 each solve first tries that many XPBD sweeps at a time, each time re-synchronised
    (`pbd.solvers.resynchronisation`), for as long as the gradient's norm falls fast enough; Newton's method takes over
    where it does not. That is the slower way wherever it was measured, hence 0, Newton's method at once.

    tolerance : bound of |x - x*|_M over |x* - x_hat|_M, estimated from the last two steps of Newton's method; where
        round-off allows no less, that must do. A solve that meets neither counts in ``Outcome.unconverged``
    Limits: distances only, all with compliance alpha > 0, undamped, and the Euler integrator in double precision.

    ``Outcome.solver.counts`` holds (solves by re-synchronisation alone, solves by Newton's method, Newton's steps, CG
    iterations); ``Outcome.projections`` counts the projections of the sweeps.
    """

    tolerance: float = fields.real(1e-9, "1", 1e-14, 1e-2, "distance from the minimum, over the distance to x_hat")
    period: int = fields.whole(0, 0, 1000, "sweeps before each re-synchronisation; 0: Newton's method at once")

    def __post_init__(self) -> None:
        fields.check(self, "solver")

    def arrange(self, problem: Problem) -> Arrangement:
        """Bind everything; raises `InvalidInput` where something is no compliant distance, or the settings differ."""
        _check_settings(problem.settings)
        if problem.particles is None:
            raise _refused("there are no particles")
        for batch in problem.batches:
            if not is_empty(batch):
                _check_batch(batch)
        batches = bind_laws(problem)
        return Arrangement(_minimiser(self, problem.particles, batches), problem.particles, batches)


class Minimiser(NamedTuple):
    """The kernel's solver; ``counts`` (COUNTERS,) as in `pbd.solvers.newton_cg`."""

    energy: Energy
    work: Workspace
    accuracy: Accuracy
    period: int
    counts: np.ndarray

    def solve(self, batches, state, h):
        particles = state.particles
        copy(self.energy.predicted, particles.p)
        if self.period > 0 and resynchronised(self, batches, state, h):
            self.counts[RESYNCHRONISED] += 1
        else:
            begin_at_lower(self.energy, self.work, particles)
            solved = newton(self.energy, self.work, particles.p, self.accuracy, self.counts)
            self.counts[NEWTON] += 1
            state.work[1] += 0 if solved else 1
        balance(batches, particles.p)


@routine
def begin_at_lower(energy, work, particles):
    """p <- x - W g(x) = x_hat + h^2 W f(x) for what can move, where that has less energy than the present p."""
    x, p, w = particles.x, particles.p, particles.w
    linearise(energy, x, work.springs, work.gradient)
    copy(work.start, p)
    before = value(energy, p, work.springs)
    for k in range(len(p)):
        for i in range(w.shape[0]):
            p[k][i] = x[k][i] - w[i] * work.gradient[k][i] if w[i] > 0.0 else p[k][i]
    if not value(energy, p, work.springs) < before:
        copy(p, work.start)


def _refused(reason: str) -> InvalidInput:
    return InvalidInput("settings.solver", "implicit", "gauss_seidel here", reason)


def _check_settings(settings: Any) -> None:
    if settings.iterations != 1:
        reason = "the implicit solver iterates until it has converged"
        raise InvalidInput("settings.iterations", settings.iterations, "1 with implicit", reason)
    if settings.precision != "float64":
        reason = "single precision cannot reach the minimum"
        raise InvalidInput("settings.precision", settings.precision, "float64 with implicit", reason)


def _check_batch(batch: Any) -> None:
    if not isinstance(batch, Distance):
        raise _refused(f"{type(batch).__name__} is no distance")
    law = batch.law
    if not isinstance(law, Compliance) or not np.all(np.asarray(law.alpha) > 0.0):
        raise _refused("a distance without compliance alpha > 0 has no energy to minimise")
    if law.relation != "equality":
        raise _refused("a one-sided distance has no second derivative")
    if np.any(np.asarray(law.beta) > 0.0):
        raise _refused("a damped distance, beta > 0, has no energy to minimise")


def _minimiser(settings: Implicit, particles: Any, batches: tuple) -> Minimiser:
    w, dimension = particles.w, len(particles.x)
    pairs = [np.zeros((0, 2), dtype=np.int64), *(batch.pairs.as_array(batch.size()) for batch in batches)]
    links, order = incidence(np.concatenate(pairs))
    rest = np.concatenate([np.zeros(0), *(batch.rest for batch in batches)])[order]
    stiffness = np.concatenate([np.zeros(0), *(1.0 / batch.law.scaled for batch in batches)])[order]
    mass = np.divide(1.0, w, out=np.zeros(len(w)), where=w > 0.0)
    energy = Energy(links, rest, stiffness, mass, zeros(len(w), dimension))
    accuracy = _accuracy(settings.tolerance, particles, energy)
    work = _workspace(len(w), len(rest), dimension)
    return Minimiser(energy, work, accuracy, int(settings.period), np.zeros(COUNTERS, dtype=np.int64))


def _accuracy(tolerance: float, particles: Any, energy: Energy) -> Accuracy:
    """With what an error of EPSILON of the extent, in all coordinates, does to |p|_H and to |g|_(M^-1)."""
    x, k, w = from_store(particles.x), energy.stiffness, particles.w
    error = EPSILON * max(float(np.abs(x).max(initial=0.0)), float(energy.rest.max(initial=0.0)))
    squares = energy.mass.sum() + 2.0 * k.sum()
    residuals = energy.mass.sum() + 2.0 * np.sum(k**2 * (w[energy.links.left] + w[energy.links.right]))
    return Accuracy(float(tolerance), error * float(np.sqrt(squares)), error * float(np.sqrt(residuals)))


def _workspace(count: int, links: int, dimension: int) -> Workspace:
    def vectors() -> Any:
        return zeros(count, dimension)

    chunk = (zeros(CHUNK, dimension), np.zeros(CHUNK))
    springs = Springs(zeros(links, dimension), np.zeros(links), np.zeros(links), *chunk)
    linear = ConjugateGradients(vectors(), vectors(), vectors(), vectors(), zeros(count, dimension**2))
    return Workspace(springs, vectors(), vectors(), linear)
