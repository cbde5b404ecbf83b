"""The exact projection: the state nearest to a given one, in the norm of the masses, in which all links are at rest.

x* = argmin 1/2 |x - x0|_M^2 subject to C(x) = 0, which a sweep of a position-based solver approaches. A cloth has
more links than freedoms, so the multipliers are not unique and the KKT matrix is singular. The augmented Lagrangian
(Nocedal and Wright, "Numerical Optimization", chapter 17.3) does not mind: minimise
1/2 |x - x0|_M^2 + lambda . C + rho/2 |C|^2, then lambda <- lambda + rho C, until C = 0. Each minimum is one of springs
of stiffness rho whose rest lengths are shortened by lambda / rho, up to a constant.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from comparisons.network import Network
from comparisons.newton import Energy, minimise
from comparisons.reference import NoReference
from comparisons.scene import PointMasses, Scene

VIOLATION = 1e-10
"""Of the rest length: all links are nearer to it than this."""

STATIONARITY = 1e-8
"""Of |M (x - x0)|: M (x - x0) + J^T lambda is smaller than this."""

PENALTY = 1e5
"""rho over the largest mass: an error of the multipliers shrinks by about rho sigma, sigma the eigenvalues of
J M^-1 J^T, at least about 1/(m n^2) for n links in a row."""

LITTLE = 1e-3
"""Of the extent: where all moves less, stationarity is a part of this, lest round-off is compared with itself."""

MAX_ROUNDS = 100
FLAT = 1e-12
"""Of the extent: particles that are less off a plane are in it."""

STALLED = 0.9
"""A round that leaves more than this part of the violation is one too many."""


@dataclass(frozen=True)
class Projection:
    """The nearest state, and how well the conditions of a minimum hold in it.

    positions : (n, d) [m]
    violation : max |C| / rest length
    stationarity : |M (x - x0) + J^T lambda| as a part of |M (x - x0)|
    distance : the mass-weighted rms distance from the start [m]
    rounds, iterations : updates of the multipliers, linear solves
    """

    positions: np.ndarray
    violation: float
    stationarity: float
    distance: float
    rounds: int
    iterations: int


def project(scene: Scene) -> Projection:
    """The state nearest to the start of a scene that meets all its links, rods and springs alike."""
    pairs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *(link.pairs for link in scene.links)])
    lengths = np.concatenate([np.zeros(0), *(link.lengths for link in scene.links)])
    return project_links(scene.masses, pairs, lengths)


def project_links(masses: PointMasses, pairs: np.ndarray, lengths: np.ndarray) -> Projection:
    """The state nearest to ``masses`` in which the particles of pairs (m, 2) are lengths (m,) [m] apart.

    A start in a plane, or on a line, is projected within it: as every link pulls within it, no solver leaves it.

    Raises `NoReference` where the links cannot be met together, where they are no regular constraints (a cloth with
    two-cell links, approached from out of its plane, has no finite multipliers), and where the state found is no
    strict minimum.
    """
    centre, axes = _span(masses.positions)
    flat = dataclasses.replace(masses, positions=(masses.positions - centre) @ axes)
    found = _project(flat, pairs, lengths)
    positions = np.where(masses.free[:, None], centre + found.positions @ axes.T, masses.positions)
    return dataclasses.replace(found, positions=positions)


def distance(masses: PointMasses, x: np.ndarray, y: np.ndarray) -> float:
    """The mass-weighted rms over free particles of the distance [m] between states (n, d)."""
    m, free = masses.masses, masses.free
    return float(np.sqrt(np.average(np.sum((x - y)[free] ** 2, axis=1), weights=m[free])))


def _span(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A point (d,) and orthonormal directions (d, r) of the line, plane or space in which the particles lie."""
    centre = x.mean(axis=0)
    _, sizes, axes = np.linalg.svd(x - centre, full_matrices=False)
    return centre, axes[sizes > FLAT * sizes[0]].T


def _project(masses: PointMasses, pairs: np.ndarray, lengths: np.ndarray) -> Projection:
    """By the augmented Lagrangian, in the dimension of ``masses``."""
    net, start = Network(masses, pairs), masses.positions
    rest, rho = lengths[net.kept], PENALTY * float(masses.masses[net.free].max(initial=0.0))
    springs = Energy(net, np.full(len(rest), rho), rest, start, 1.0, np.zeros(start.shape[1]))
    x, shortening, before, iterations = start, np.zeros(len(rest)), np.inf, 0
    for rounds in range(MAX_ROUNDS + 1):
        extension = net.edges(x).lengths - rest
        if rounds > 0:
            shortening = shortening + extension
        violation = float((np.abs(extension) / rest).max(initial=0.0))
        stationarity = _stationarity(net, start, x, rho * shortening)
        if violation <= VIOLATION and stationarity <= STATIONARITY:
            return Projection(x, violation, stationarity, distance(masses, x, start), rounds, iterations)
        if violation > STALLED * before:
            break
        before = violation
        found = minimise(dataclasses.replace(springs, rest=rest - shortening), x)
        x, iterations = found.positions, iterations + found.iterations
    raise NoReference(f"the links cannot be met together as regular constraints: {violation:.1e} of a length is left")


def _stationarity(net: Network, start: np.ndarray, x: np.ndarray, multipliers: np.ndarray) -> float:
    moved = net.inertia * (x - start)[net.free].ravel()
    least = LITTLE * float(np.linalg.norm(net.inertia)) * float(np.ptp(start, axis=0).max())
    left = float(np.linalg.norm(moved + net.pull(net.edges(x), multipliers)))
    return left / max(float(np.linalg.norm(moved)), least)
