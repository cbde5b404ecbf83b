"""What metrics of a fluid share: density, what is attached to the fluid, its front and its height.

Nothing of the solver is used here, so that it is measured and not repeated: Wendland's C2 kernel with a support of 2.5
spacings in 2D and 2 in 3D, over pairs that a tree of scipy's finds. Walls and obstacles are filled with rows of
particles, the first half a spacing behind the face, as fluid would be; where faces meet, 1 - prod (1 - T).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from comparisons.metrics import Refused, Subject
from comparisons.scene import Fluid, Scene

SUPPORT = {2: 2.5, 3: 2.0}
"""Dimension -> reach of the kernel [spacing]."""

LINKED = 2.0
"""Particles nearer to each other than this [spacing] are attached."""

NODES, TABLE = 64, 1000


def fluid_of(scene: Scene) -> Fluid:
    """`Refused` where there is none."""
    if scene.fluid is None:
        raise Refused("a metric of fluids in a scene without one", "ask for other metrics")
    return scene.fluid


def liquid(scene: Scene) -> np.ndarray:
    """(n,) mask of the particles that are fluid."""
    mask = np.ones(len(scene.masses.masses), dtype=bool)
    mask[fluid_of(scene).solid] = False
    return mask


# ------------------------------------------------------------------ density


def densities(subject: Subject) -> np.ndarray:
    """(s, n) rho/rho0 of the particles that are fluid, at each sample."""
    scene, d = subject.scene, len(subject.scene.gravity)
    spacing, chosen = fluid_of(scene).spacing, liquid(scene)
    rows = [_sums(x / spacing, d) for x in subject.trajectory.positions]
    behind = [_filled(scene, x) for x in subject.trajectory.positions]
    return (np.array(rows) + np.array(behind))[:, chosen]


def wendland(q: np.ndarray, dimension: int) -> np.ndarray:
    """W h^d at r/h: 7/pi (21/(2 pi) in 3D) (1 - q)^4 (1 + 4 q)."""
    scale = 7.0 / np.pi if dimension == 2 else 10.5 / np.pi
    return scale * np.maximum(1.0 - q, 0.0) ** 4 * (1.0 + 4.0 * q)


@lru_cache
def _whole(dimension: int) -> float:
    """Sum of W h^d over a lattice."""
    h = SUPPORT[dimension]
    axes = np.meshgrid(*[np.arange(-3.0, 4.0)] * dimension)
    return float(wendland(np.sqrt(np.sum(np.square(axes), axis=0)) / h, dimension).sum())


def _sums(x: np.ndarray, d: int) -> np.ndarray:
    """(n,) density at places in spacings, from particles alone."""
    h, n = SUPPORT[d], len(x)
    i, j = KDTree(x).query_pairs(h, output_type="ndarray").T
    w = wendland(np.linalg.norm(x[i] - x[j], axis=1) / h, d)
    own = wendland(np.zeros(1), d)[0]
    return (own + np.bincount(i, w, n) + np.bincount(j, w, n)) / _whole(d)


def _filled(scene: Scene, x: np.ndarray) -> np.ndarray:
    """(n,) the part of the density at x that walls and obstacles give."""
    d, spacing, free = len(scene.gravity), fluid_of(scene).spacing, np.ones(len(x))
    planes = scene.planes
    for normal, offset in [] if planes is None else zip(planes.normals, planes.offsets, strict=True):
        free *= 1.0 - _beside((x @ normal - offset) / spacing, d)
    for low, high in fluid_of(scene).obstacles:
        faces = np.concatenate([low - x, x - high], axis=1) / spacing
        deep = _plane_table(d)[1][0]
        free *= 1.0 - deep * np.prod(_beside(faces, d) / deep, axis=1)
    return 1.0 - free


def _beside(t: np.ndarray, d: int) -> np.ndarray:
    """T at distances t [spacing] from a plane, negative behind it."""
    distances, values = _plane_table(d)
    return np.interp(t, distances, values)


@lru_cache
def _plane_table(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances in [-h, h] and T there: rows of particles half a spacing behind the plane and on, smeared along it."""
    h = SUPPORT[d]
    t = np.linspace(-h, h, TABLE + 1)
    rows = np.abs(t[:, None] + np.arange(2 * int(np.ceil(h)) + 1) + 0.5)
    return t, np.minimum(_over_plane(rows, h, d).sum(axis=1), 1.0)


def _over_plane(r: np.ndarray, h: float, d: int) -> np.ndarray:
    """Integral of W, over its lattice sum, over a plane at distance r, by Gauss and Legendre's quadrature."""
    nodes, weights = legendre.leggauss(NODES)
    reach = np.sqrt(np.maximum(h**2 - r**2, 0.0))[..., None]
    along = 0.5 * reach * (nodes + 1.0)
    area = reach * weights * (1.0 if d == 2 else np.pi * along)
    w = wendland(np.sqrt(r[..., None] ** 2 + along**2) / h, d)
    return (w * area).sum(axis=-1) / _whole(d)


# ------------------------------------------------------------------ front and height


def attached(subject: Subject) -> list[np.ndarray]:
    """Of each sample the positions of the fluid's particles that are attached to most of it."""
    spacing, chosen = fluid_of(subject.scene).spacing, liquid(subject.scene)
    return [x[_largest_group(x, spacing)] for x in (each[chosen] for each in subject.trajectory.positions)]


def _largest_group(x: np.ndarray, spacing: float) -> np.ndarray:
    """(n,) mask of the largest group of particles that hang together."""
    i, j = KDTree(x).query_pairs(LINKED * spacing, output_type="ndarray").T
    graph = csr_array((np.ones(len(i), dtype=bool), (i, j)), shape=(len(x), len(x)))
    _, group = connected_components(graph, directed=False)
    return group == np.bincount(group).argmax()


def fronts(subject: Subject, percentile: float = 100.0) -> np.ndarray:
    """(s,) x of the farthest attached particle, or of a percentile of the attached, and half a spacing [m]."""
    half = 0.5 * fluid_of(subject.scene).spacing
    return np.array([np.percentile(x[:, 0], percentile) + half for x in subject.attached])


def heights(subject: Subject) -> np.ndarray:
    """(s,) height of the attached water within two spacings of the wall x = 0 [m]; 0 where there is none."""
    spacing = fluid_of(subject.scene).spacing
    near = [x[x[:, 0] < 2.0 * spacing, 1] for x in subject.attached]
    return np.array([y.max() + 0.5 * spacing if len(y) else 0.0 for y in near])


def dimensionless(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """(T, Z) of the front; `Refused` in a scene that is no dam break."""
    known = subject.scene.known
    if "unit" not in known:
        raise Refused("the front of a scene that is no dam break", "ask for other metrics")
    return subject.trajectory.times / known["unit"], fronts(subject) / known["width"]


# ------------------------------------------------------------------ against experiments


def misfit(times: np.ndarray, values: np.ndarray, measured: np.ndarray, offset: float) -> float:
    """rms distance of a curve from ``measured`` (m, 2) times and values, which it is ``offset`` ahead of."""
    at = measured[:, 0] - offset
    inside = (at >= times[0]) & (at <= times[-1])
    return float(np.sqrt(np.mean((np.interp(at[inside], times, values) - measured[inside, 1]) ** 2)))


def fitted(times: np.ndarray, values: np.ndarray, measured: np.ndarray) -> tuple[float, float]:
    """(offset, rms): the one offset in time that leaves the least distance, to a thousandth."""
    offsets = np.arange(-0.5, 0.8, 1e-3)
    left = [misfit(times, values, measured, offset) for offset in offsets]
    best = int(np.argmin(left))
    return float(offsets[best]), left[best]


def neighbours(x: np.ndarray, reach: float) -> float:
    """Mean number of others within ``reach`` [m] of particles at x (n, d)."""
    return 2.0 * len(KDTree(x).query_pairs(reach, output_type="ndarray")) / len(x)
