"""Walls and obstacles of a fluid: they hold particles back, and give back the density that is missing beside them.

A wall is a half-space, an obstacle is convex, the intersection of several; without obstacles they compile to nothing. A
half-space is taken as filled with rows of particles, the first half a spacing s behind its face, smeared along it:

    T(t) = sum_k s A(t + (k + 1/2) s),    A(r) the integral of W over a plane at distance r

for a particle at distance t >= 0. A lattice beside it is then at rest with the same density everywhere; with the
integral of W over the half-space instead, its first row would have 2 % too much (h = 2.5 s). Behind the face T goes on
to 1 as what the other side leaves, T(-t) = 1 - T(t) (1 - T(0))/T(0). A solid fills the product of its half-spaces' T,
and solids together 1 - prod_s (1 - filled_s): no corner is counted twice. That is right on the faces; off by at most
.0012 between two walls at a right angle, and as much about an edge of a box. Solids do not move, and have no friction.

Limits: an obstacle is to be as thick as h, or the product adds density that is not there, and gaps as wide, or some is
missing. A particle is held back where it ends a step or a pass, so it must not cross an obstacle in one; it leaves by
the nearest face.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from pbd.collision.plane import Planes, height
from pbd.dispatch import stage
from pbd.fluid.kernels import Poly6Spiky, Wendland, profile
from pbd.jit import device
from pbd.vector import accumulate, add, like, load, negate, scale

QUADRATURE = 40
"""Nodes of Gauss and Legendre's; the integrands are smooth."""

NODES = 514
"""Of the table from 0 to h: linear between them, which leaves 2e-6 of the integral."""


@stage
def is_near(obstacles, point, far):
    """Whether a point may be within a distance of an obstacle."""
    return False


@stage
def beside_obstacles(obstacles, walls, point):
    """(1 - filled, its gradient [1/m]) of all obstacles."""
    return like(walls.reach, 1.0), scale(like(walls.reach, 0.0), point)


@stage
def push_out(obstacles, x, i):
    """Move particle i out of every obstacle that it has entered, to the nearest face."""


class Obstacles(NamedTuple):
    """Obstacle a is behind all planes start_a, ..., start_a+1 - 1."""

    planes: Planes
    start: np.ndarray

    def is_near(self, point, far):
        near = False
        for a in range(self.start.shape[0] - 1):
            near |= deepest(self, a, point)[1] < far
        return near

    def beside_obstacles(self, walls, point):
        free, pull = like(walls.reach, 1.0), scale(like(walls.reach, 0.0), point)
        for a in range(self.start.shape[0] - 1):
            t = deepest(self, a, point)[1]
            if t < walls.reach:
                filled, slope = fill_beside(self, walls, a, point, min(t, like(t, 0.0)))
                free, pull = joined(free, pull, filled, slope)
        return free, pull

    def push_out(self, x, i):
        for a in range(self.start.shape[0] - 1):
            face, t = deepest(self, a, load(x, i))
            if t < like(t, 0.0):
                accumulate(x, i, -t, load(self.planes.normal, face))


class Walls(NamedTuple):
    """The free side of all planes, about obstacles; ``filled`` is T and ``slope`` -dT/dt [1/m], (2 NODES - 1,), from
    t = -reach to reach.

    ``scale`` (NODES - 1)/reach [1/m], ``reach`` = h [m]; ``near`` (n,) are the sorted particles that may come within
    reach in this sub-step, ``found`` (1,) of them.
    """

    planes: Planes
    obstacles: Obstacles | None
    reach: float
    scale: float
    filled: np.ndarray
    slope: np.ndarray
    near: np.ndarray
    found: np.ndarray


def new_walls(
    faces: tuple[Planes, Obstacles | None],
    kernel: Wendland | Poly6Spiky,
    spacing: float,
    dimension: int,
    count: int,
) -> Walls:
    """Walls and obstacles for that many particles with that spacing [m] under a kernel."""
    h = 1.0 / kernel.inverse
    t = np.linspace(0.0, h, NODES)[:, None]
    rows = t + (np.arange(math.ceil(h / spacing)) + 0.5) * spacing
    whole, drop = plane_integrals(kernel, np.minimum(rows, h), dimension)
    filled, slope = spacing * whole.sum(axis=1), spacing * drop.sum(axis=1)
    ratio = (1.0 - filled[0]) / filled[0]
    filled = np.concatenate([1.0 - ratio * filled[:0:-1], filled])
    slope = np.concatenate([ratio * slope[:0:-1], slope])
    near, found = np.zeros(count, dtype=np.uint32), np.zeros(1, dtype=np.int64)
    return Walls(*faces, h, (NODES - 1) / h, filled, slope, near, found)


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
    """List the sorted particles within twice the reach of a wall or an obstacle."""
    found, far = 0, like(walls.reach, 2.0) * walls.reach
    for k in range(count):
        near = is_near(walls.obstacles, load(position, k), far)
        for plane in range(walls.planes.offset.shape[0]):
            near |= height(walls.planes, plane, load(position, k)) < far
        walls.near[found] = k
        found += near
    walls.found[0] = found


@device
def beside_walls(walls, point):
    """(filled, gradient [1/m]): the part of a particle's density that walls give, and how it changes with its place."""
    free, pull = beside_obstacles(walls.obstacles, walls, point)
    for k in range(walls.planes.offset.shape[0]):
        t = height(walls.planes, k, point)
        if t < walls.reach:
            filled, slope = from_table(walls, max(t, like(t, 0.0)))
            free, pull = joined(free, pull, filled, scale(slope, load(walls.planes.normal, k)))
    return like(walls.reach, 1.0) - free, negate(pull)


@device
def joined(free, pull, filled, slope):
    """(1 - filled, its gradient) of what there was and a solid with (filled, -gradient)."""
    left = like(free, 1.0) - filled
    return free * left, add(scale(left, pull), scale(free, slope))


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
def deepest(obstacles, a, point):
    """(face, t): the plane of obstacle a with the largest distance t: < 0 inside, outside at most the obstacle's."""
    face = obstacles.start[a]
    largest = height(obstacles.planes, face, point)
    for k in range(face + 1, obstacles.start[a + 1]):
        t = height(obstacles.planes, k, point)
        face, largest = (k, t) if t > largest else (face, largest)
    return face, largest


@device
def fill_beside(obstacles, walls, a, point, depth):
    """(filled, -gradient [1/m]) of obstacle a; what is within, at ``depth`` < 0, counts as on the nearest face."""
    filled, slope = like(walls.reach, 1.0), scale(like(walls.reach, 0.0), point)
    for k in range(obstacles.start[a], obstacles.start[a + 1]):
        part, drop = from_table(walls, height(obstacles.planes, k, point) - depth)
        slope = add(scale(part, slope), scale(drop * filled, load(obstacles.planes.normal, k)))
        filled *= part
    return filled, slope


@device
def hold_back(walls, x, i):
    """Move particle i to the face of every obstacle and every wall that it has entered."""
    push_out(walls.obstacles, x, i)
    for k in range(walls.planes.offset.shape[0]):
        t = height(walls.planes, k, load(x, i))
        if t < like(t, 0.0):
            accumulate(x, i, -t, load(walls.planes.normal, k))
