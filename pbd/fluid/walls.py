"""Plane walls of a fluid: they hold particles back, and give back the density that is missing beside them.

A wall is taken as filled with rows of particles, the first half a spacing s behind its face, smeared along it:

    T(t) = sum_k s A(t + (k + 1/2) s)/S,    A(r) the integral of W over a plane at distance r

for a particle at distance t, with the sum S of V W over a lattice, V = s^d, which makes its density 1. A lattice beside
the wall is then at rest with the same density everywhere, to .0004 (h = 2.5 s; .001 in 3D at 2 s); with the integral of
W over the half-space instead, its first row would have 2 % too much. Where walls meet, what they fill is
1 - prod_k (1 - T_k): no corner is counted twice. That is right on the faces, and off by at most .0012 between two walls
at a right angle. Walls do not move, and have no friction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from pbd.collision.plane import Planes, height
from pbd.fluid.kernels import Poly6Spiky, Wendland, lattice_sum, profile
from pbd.jit import device
from pbd.vector import accumulate, add, like, load, scale

NODES = 40
"""Of Gauss and Legendre's quadrature; the integrands are smooth."""

TABLE = 512
"""Intervals of the table: linear between its nodes, which leaves 2e-6 of the integral."""


class Walls(NamedTuple):
    """The free side of all planes; ``filled`` is T and ``slope`` -dT/dt [1/m], (TABLE + 2,), at t = k reach/TABLE.

    ``scale`` TABLE/reach [1/m], ``reach`` = h [m]; ``near`` (n,) are the sorted particles that may come within reach in
    this sub-step, of each piece of a pass from its first particle on, ``found`` (pieces,) of them.
    """

    planes: Planes
    reach: float
    scale: float
    filled: np.ndarray
    slope: np.ndarray
    near: np.ndarray
    found: np.ndarray


def new_walls(planes: Planes, kernel: Wendland | Poly6Spiky, spacing: float, dimension: int, count: int) -> Walls:
    """Walls for that many particles with that spacing [m] under a kernel."""
    h = 1.0 / kernel.inverse
    t = np.linspace(0.0, h, TABLE + 2)[:, None]
    rows = t + (np.arange(math.ceil(h / spacing)) + 0.5) * spacing
    whole, drop = plane_integrals(kernel, np.minimum(rows, h), dimension)
    share = spacing / lattice_sum(kernel, spacing, dimension)
    filled, slope = share * whole.sum(axis=1), share * drop.sum(axis=1)
    near, found = np.zeros(count, dtype=np.uint32), np.zeros(1, dtype=np.int64)
    return Walls(planes, h, (TABLE + 1) / h, filled, slope, near, found)


def plane_integrals(kernel: Wendland | Poly6Spiky, t: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """(integral of W [1/m], of its gradient's part along the normal [1/m^2]) over planes at distances t <= h [m].

    In 2D, where a plane is a line, at r = sqrt(t^2 + y^2) with y = y_max sin, in 3D by dA = 2 pi r dr.
    """
    h = 1.0 / kernel.inverse
    nodes, weights = legendre.leggauss(NODES)
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
def find_near(walls, position, piece, first, last):
    """List the particles of a piece, sorted ones first, ..., last-1, that are within twice the reach of a wall."""
    found, far = first, like(walls.reach, 2.0) * walls.reach
    for k in range(first, last):
        near = False
        for plane in range(walls.planes.offset.shape[0]):
            near |= height(walls.planes, plane, load(position, k)) < far
        walls.near[found] = k
        found += np.uint64(near)
    walls.found[piece] = found - first


@device
def beside_walls(walls, point):
    """(filled, gradient [1/m]): the part of a particle's density that walls give, and how it changes with its place."""
    free = like(walls.reach, 1.0)
    pull = scale(like(walls.reach, 0.0), point)
    for k in range(walls.planes.offset.shape[0]):
        t = height(walls.planes, k, point)
        if t < walls.reach:
            filled, slope = from_table(walls, max(t, like(t, 0.0)))
            left = like(walls.reach, 1.0) - filled
            free *= left
            pull = add(pull, scale(slope / left, load(walls.planes.normal, k)))
    return like(walls.reach, 1.0) - free, scale(-free, pull)


@device
def from_table(walls, t):
    """(T, -dT/dt) at a distance t in [0, reach]."""
    place = t * walls.scale
    k = min(int(place), TABLE)
    share = place - like(place, k)
    filled, slope = walls.filled, walls.slope
    return filled[k] + share * (filled[k + 1] - filled[k]), slope[k] + share * (slope[k + 1] - slope[k])


@device
def hold_back(walls, x, i):
    """Move particle i to the face of every wall that it has entered."""
    for k in range(walls.planes.offset.shape[0]):
        t = height(walls.planes, k, load(x, i))
        if t < like(t, 0.0):
            accumulate(x, i, -t, load(walls.planes.normal, k))
