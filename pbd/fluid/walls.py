"""Walls and obstacles of a fluid: they hold particles back, and give back the density that is missing beside them.

Each is a convex solid, the intersection of half-spaces; a wall is one of a single half-space. A half-space is taken as
filled with rows of particles, the first half a spacing s behind its face, smeared along it:

    T(t) = sum_k s A(t + (k + 1/2) s),    A(r) the integral of W over a plane at distance r

for a particle at distance t >= 0. A lattice beside it is then at rest with the same density everywhere; with the
integral of W over the half-space instead, its first row would have 2 % too much (h = 2.5 s). Behind the face T goes on
to 1 as what the other side leaves, T(-t) = 1 - T(t) (1 - T(0))/T(0). A solid fills the product of its half-spaces' T,
and solids together 1 - prod_s (1 - filled_s): no corner is counted twice. That is right on the faces; off by at most
.0012 between two walls at a right angle, and as much about an edge of a box. Solids do not move, and have no friction.

Limits: a solid is to be as thick as h, or its far face adds density that is not there; and the gap between two as wide.
A particle is held back where it ends a step, so it must not cross a solid in one; it leaves by the nearest face.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from pbd.collision.plane import Planes, height
from pbd.fluid.kernels import Poly6Spiky, Wendland, profile
from pbd.jit import device
from pbd.vector import accumulate, add, like, load, negate, scale

QUADRATURE = 40
"""Nodes of Gauss and Legendre's; the integrands are smooth."""

NODES = 514
"""Of the table from 0 to h: linear between them, which leaves 2e-6 of the integral."""


class Walls(NamedTuple):
    """Solids; ``filled`` is T and ``slope`` -dT/dt [1/m], (2 NODES - 1,), from t = -reach to reach.

    Solid s is behind all planes start_s, ..., start_s+1 - 1 of ``planes``. ``scale`` (NODES - 1)/reach [1/m], ``reach``
    = h [m]; ``near`` (n,) are the sorted particles that may come within reach in this sub-step, ``found`` (1,) of them.
    """

    planes: Planes
    start: np.ndarray
    reach: float
    scale: float
    filled: np.ndarray
    slope: np.ndarray
    near: np.ndarray
    found: np.ndarray


def new_walls(
    planes: Planes, start: np.ndarray, kernel: Wendland | Poly6Spiky, spacing: float, dimension: int, count: int
) -> Walls:
    """Walls for that many particles with that spacing [m] under a kernel."""
    h = 1.0 / kernel.inverse
    t = np.linspace(0.0, h, NODES)[:, None]
    rows = t + (np.arange(math.ceil(h / spacing)) + 0.5) * spacing
    whole, drop = plane_integrals(kernel, np.minimum(rows, h), dimension)
    filled, slope = spacing * whole.sum(axis=1), spacing * drop.sum(axis=1)
    ratio = (1.0 - filled[0]) / filled[0]
    filled = np.concatenate([1.0 - ratio * filled[:0:-1], filled])
    slope = np.concatenate([ratio * slope[:0:-1], slope])
    near, found = np.zeros(count, dtype=np.uint32), np.zeros(1, dtype=np.int64)
    return Walls(planes, start, h, (NODES - 1) / h, filled, slope, near, found)


def plane_integrals(kernel: Wendland | Poly6Spiky, t: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """(integral of W [1/m], of its gradient's part along the normal [1/m^2]) over planes at distances t <= h [m].

    In 2D, where a plane is a line, at r = sqrt(t^2 + y^2) with y = y_max sin, in 3D by dA = 2 pi r dr.
    """
    h = 1.0 / kernel.inverse
    nodes, weights = legendre.leggauss(QUADRATURE)
    t = t[..., None]
    if dimension == 2:
        longest = np.sqrt(h**2 - t**2)
        angle = 0.25 * math.pi * (nodes + 1.0)
        r = np.sqrt(t**2 + (longest * np.sin(angle)) ** 2)
        area = 2.0 * longest * np.cos(angle) * 0.25 * math.pi * weights
    else:
        r = t + 0.5 * (h - t) * (nodes + 1.0)
        area = 2.0 * math.pi * r * 0.5 * (h - t) * weights
    value, drop = profile(kernel, np.minimum(r, h))
    cosine = np.divide(t, r, out=np.zeros_like(r), where=r > 0.0)
    return (value * area).sum(axis=-1), (drop * cosine * area).sum(axis=-1)


@device
def find_near(walls, position, count):
    """List the sorted particles within twice the reach of a solid."""
    found, far = 0, like(walls.reach, 2.0) * walls.reach
    for k in range(count):
        near = False
        for solid in range(walls.start.shape[0] - 1):
            near |= distance(walls, solid, load(position, k)) < far
        walls.near[found] = k
        found += near
    walls.found[0] = found


@device
def distance(walls, solid, point):
    """The largest of a point's distances from the planes of a solid: negative inside; outside at most its distance."""
    first = walls.start[solid]
    largest = height(walls.planes, first, point)
    for k in range(first + 1, walls.start[solid + 1]):
        largest = max(largest, height(walls.planes, k, point))
    return largest


@device
def beside_walls(walls, point):
    """(filled, gradient [1/m]): the part of a particle's density that solids give, and its change with the place."""
    free = like(walls.reach, 1.0)
    pull = scale(like(walls.reach, 0.0), point)
    for solid in range(walls.start.shape[0] - 1):
        t = distance(walls, solid, point)
        if t < walls.reach:
            filled, slope = fill_beside(walls, solid, point, min(t, like(t, 0.0)))
            left = like(walls.reach, 1.0) - filled
            pull = add(scale(left, pull), scale(free, slope))
            free *= left
    return like(walls.reach, 1.0) - free, negate(pull)


@device
def fill_beside(walls, solid, point, depth):
    """(filled, -gradient [1/m]) of one solid; what is within, at ``depth`` < 0, counts as on the nearest face."""
    filled = like(walls.reach, 1.0)
    slope = scale(like(walls.reach, 0.0), point)
    for k in range(walls.start[solid], walls.start[solid + 1]):
        part, drop = from_table(walls, height(walls.planes, k, point) - depth)
        slope = add(scale(part, slope), scale(drop * filled, load(walls.planes.normal, k)))
        filled *= part
    return filled, slope


@device
def from_table(walls, t):
    """(T, -dT/dt) at a distance t from a plane; (0, 0) for one that is no number."""
    none = like(t, 0.0)
    if not t < walls.reach:
        return none, none
    if t <= -walls.reach:
        return like(t, 1.0), none
    place = (t + walls.reach) * walls.scale
    k = min(int(place), 2 * NODES - 3)
    share = place - like(place, k)
    filled, slope = walls.filled, walls.slope
    return filled[k] + share * (filled[k + 1] - filled[k]), slope[k] + share * (slope[k + 1] - slope[k])


@device
def hold_back(walls, x, i):
    """Move particle i out of every solid that it has entered, to the nearest face."""
    for solid in range(walls.start.shape[0] - 1):
        first = walls.start[solid]
        nearest, t = first, height(walls.planes, first, load(x, i))
        for k in range(first + 1, walls.start[solid + 1]):
            other = height(walls.planes, k, load(x, i))
            nearest, t = (k, other) if other > t else (nearest, t)
        if t < like(t, 0.0):
            accumulate(x, i, -t, load(walls.planes.normal, nearest))
