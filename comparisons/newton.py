"""The energies whose minima are references, and the globalised Newton method that finds them.

E(x) = s/2 |x - target|_M^2 - sum m a . x + sum k/2 (l - rest)^2 over the coordinates that can move. With s = 1/h^2
its minimum is a step of implicit Euler, with s = 0 the static state, with s = 1 and k a penalty an exact projection.
Independent of the solver: positions in, positions out, by sparse factorisations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU

from comparisons.network import Edges, Network, factorise
from comparisons.reference import NoReference

TOLERANCE = 1e-11
"""Of the extent: a minimum counts as found when a step of Newton's method, unmodified, is smaller than this.

Convergence is then quadratic, so what remains after that step is round-off.
"""

MAX_ITERATIONS = 150
MAX_HALVINGS = 40
ARMIJO = 1e-4
ROUND_OFF = 1e-14
"""Of the sum of the parts of an energy: a smaller change is none."""

SHORT = 0.1
"""A step cut to less than this asks for a larger shift; one taken whole, for a shift smaller by this factor."""

NEGLIGIBLE = 1e-6
"""A shift below this part of the least is dropped."""


@dataclass(frozen=True)
class Energy:
    """The energy of a network.

    stiffness (m,) [N/m] and rest (m,) [m] of its links; target (n, d) [m] and its weight ``s`` [1/s^2];
    acceleration (d,) [m/s^2] of all masses. For a projection s is the number 1, and no unit has a second in it.
    """

    network: Network
    stiffness: np.ndarray
    rest: np.ndarray
    target: np.ndarray
    s: float
    acceleration: np.ndarray

    def value(self, x: np.ndarray) -> tuple[float, float]:
        """E(x) less its value at the target, and the sum of the sizes of its parts [J]."""
        net = self.network
        moved = (x - self.target)[net.free]
        held = 0.5 * self.s * float(net.inertia @ moved.ravel() ** 2)
        stretched = 0.5 * float(self.stiffness @ (net.edges(x).lengths - self.rest) ** 2)
        work = net.inertia * (moved * self.acceleration).ravel()
        return held + stretched - float(work.sum()), held + stretched + float(np.abs(work).sum())

    def gradient(self, x: np.ndarray, edges: Edges) -> tuple[np.ndarray, float]:
        """The gradient (f d,) [N], and the largest single force in it."""
        net = self.network
        held = net.inertia * (self.s * (x - self.target)[net.free] - self.acceleration).ravel()
        tension = self.stiffness * (edges.lengths - self.rest)
        largest = max(np.abs(held).max(initial=0.0), np.abs(tension).max(initial=0.0))
        return held + net.pull(edges, tension), float(largest)

    def hessian(self, edges: Edges, shift: float = 0.0, *, convex: bool = False) -> csc_array:
        """The second derivative plus ``shift`` M; ``convex`` without what compressed links take from it."""
        transverse = self.stiffness * (1.0 - self.rest / edges.lengths)
        transverse = np.maximum(transverse, 0.0) if convex else transverse
        return self.network.hessian(edges, self.stiffness, transverse, (self.s + shift) * self.network.inertia)


@dataclass(frozen=True)
class Minimum:
    """A strict local minimum, and how well it is met.

    positions : (n, d) [m]
    error : largest component of the Newton step that would follow, the estimate of what is wrong [m]
    gradient : largest component of the gradient there, as a part of the largest single force
    iterations : Newton steps taken
    """

    positions: np.ndarray
    error: float
    gradient: float
    iterations: int


def minimise(energy: Energy, start: np.ndarray, shift: float = 0.0) -> Minimum:
    """The minimum of ``energy`` downhill of ``start`` (n, d).

    Newton's method with the exact Hessian where that is positive definite, else with its convex part, plus at
    least ``shift`` M [1/s^2], and with steps halved until the energy falls. Raises `NoReference` where it does not
    converge, or ends where the energy is stationary but has no strict minimum.
    """
    x, now, length = start, 0.0, np.inf
    extent = float(np.ptp(start, axis=0).max())
    for iteration in range(1, MAX_ITERATIONS + 1):
        edges = energy.network.edges(x)
        gradient, _ = energy.gradient(x, edges)
        factor, exact = _factor(energy, edges, now, shift)
        step = -factor.solve(gradient)
        length = float(np.abs(step).max(initial=0.0))
        if length <= TOLERANCE * extent and now == 0.0:
            if not exact:
                raise NoReference("the state that is stationary is no minimum: links are compressed and may buckle")
            return _finish(energy, energy.network.moved(x, step), factor, iteration)
        part = _part(energy, x, step, float(gradient @ step))
        x = energy.network.moved(x, part * step)
        now = _next_shift(now, shift, part, exact)
    raise NoReference(f"Newton's method still moves by {length:.1e} m after {MAX_ITERATIONS} iterations")


def _finish(energy: Energy, x: np.ndarray, factor: SuperLU, iterations: int) -> Minimum:
    gradient, largest = energy.gradient(x, energy.network.edges(x))
    error = float(np.abs(factor.solve(gradient)).max(initial=0.0))
    return Minimum(x, error, float(np.abs(gradient).max(initial=0.0)) / (largest or 1.0), iterations)


def _factor(energy: Energy, edges: Edges, now: float, least: float) -> tuple[SuperLU, bool]:
    """The factors to take a step with, and whether they are of the exact Hessian, shifted by ``now``."""
    factor = factorise(energy.hessian(edges, now))
    if factor is not None:
        return factor, True
    factor = factorise(energy.hessian(edges, max(now, least), convex=True))
    if factor is None:
        raise NoReference("the links do not determine where the masses are")
    return factor, False


def _part(energy: Energy, x: np.ndarray, step: np.ndarray, slope: float) -> float:
    """The part of a step that lowers the energy enough: 1, 1/2, 1/4, ..."""
    before, size = energy.value(x)
    part = 1.0
    for _ in range(MAX_HALVINGS):
        after, _ = energy.value(energy.network.moved(x, part * step))
        if after <= before + ARMIJO * part * slope + ROUND_OFF * size:
            return part
        part *= 0.5
    return part


def _next_shift(now: float, least: float, part: float, exact: bool) -> float:
    if part < SHORT:
        return max(now / SHORT, least)
    if part < 1.0 or not exact:
        return now
    return SHORT * now if now > NEGLIGIBLE * least else 0.0
