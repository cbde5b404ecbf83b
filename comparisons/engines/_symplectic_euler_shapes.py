"""Where boxes and balls touch planes and each other: points, depths, and the normal of a pair, in 2D and 3D at once.

Springs ask more of this than a solver of constraints does: no point may appear or vanish under load, or energy comes
out of nothing. So all points are kept, and the normal is always that of least overlap. Where the nearest features
change during an impact - a corner slips over a rim - its energy still errs, by some per cent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from comparisons.engines._symplectic_euler_polygons import clip_face
from comparisons.engines._symplectic_euler_space import by_dimension
from pbd.collision.ball_box import ball_ball, ball_box
from pbd.collision.frames import cross
from pbd.collision.plane import height
from pbd.jit import device
from pbd.vector import Store, add, dot, load, negate, scale, store, subtract

PARALLEL = 1e-4
"""Squared sine of the angle below which directions are the same. Parallel edges have nothing to say, and boxes that lie
flat on each other touch with faces, though two of their edges may by a little overlap less."""


class Shapes(NamedTuple):
    """Half edges (store of (n,) arrays; 0 for balls), radii (n,) (0 for boxes), bounding radii (n,) [m]."""

    half: Store
    radius: np.ndarray
    bound: np.ndarray


class Patch(NamedTuple):
    """The contact of one pair: points, their depths [m] and weights, and what `_symplectic_euler_contacts` adds: parts
    of the step that they touch, relative velocities, tangential displacements [m]. ``spare``: scratch points."""

    point: Store
    depth: np.ndarray
    weight: np.ndarray
    part: np.ndarray
    velocity: Store
    slip: Store
    spare: Store


@device
def find_on_plane(patch, state, shapes, planes, k, i, margin):
    """Points of body i less than a margin above plane k: a ball's lowest, or a box's corners; returns their number."""
    centre = load(state.x, i)
    above = height(planes, k, centre)
    if above >= shapes.bound[i] + margin:
        return 0
    if shapes.radius[i] > 0.0:
        one_point(patch, shapes.radius[i] - above, add(centre, scale(-shapes.radius[i], load(planes.normal, k))))
        return 1
    count = 0
    for c in range(1 << len(state.x)):
        corner = centre
        for axis in range(len(state.x)):
            side = shapes.half[axis][i] if (c >> axis) & 1 else -shapes.half[axis][i]
            corner = add(corner, scale(side, load(state.axes[axis], i)))
        depth = -height(planes, k, corner)
        if depth > -margin:
            store(patch.point, count, corner)
            patch.depth[count] = depth
            patch.weight[count] = 1.0
            count += 1
    return count


@device
def find_between(patch, state, shapes, a, b, margin):
    """Points where bodies a and b overlap or are nearer than a margin: (their number, unit normal from b to a)."""
    between = subtract(load(state.x, a), load(state.x, b))
    reach = shapes.bound[a] + shapes.bound[b] + margin
    if dot(between, between) >= reach * reach:
        return 0, between
    if shapes.radius[a] == 0.0 and shapes.radius[b] == 0.0:
        return boxes(patch, state, shapes, a, b, between, margin)
    if shapes.radius[a] == 0.0 or shapes.radius[b] == 0.0:
        ball, box = (a, b) if shapes.radius[a] > 0.0 else (b, a)
        hit, point, gap, normal = ball_box(load(state.x, ball), shapes.radius[ball], placed(state, shapes, box), margin)
        normal = scale(1.0 if ball == b else -1.0, normal)
    else:
        hit, point, gap, normal = ball_ball(
            load(state.x, b), shapes.radius[b], load(state.x, a), shapes.radius[a], margin
        )
    one_point(patch, -gap, point)
    return 1 if hit else 0, normal


@device
def placed(state, shapes, i):
    """Box i as `pbd.collision` has it."""
    return load(state.x, i), load(shapes.half, i), rotation(state.axes, i)


def _rotation_in_plane(axes, i):
    return axes[0][0][i], axes[1][0][i], axes[0][1][i], axes[1][1][i]


def _rotation_in_space(axes, i):
    x, y, z = load(axes[0], i), load(axes[1], i), load(axes[2], i)
    return x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]


rotation = by_dimension(_rotation_in_plane, _rotation_in_space)
"""rotation(axes, i): the matrix from the frame of body i to the world's, row by row."""


@device
def one_point(patch, depth, point):
    patch.depth[0] = depth
    patch.weight[0] = 1.0
    store(patch.point, 0, point)


@device
def boxes(patch, state, shapes, a, b, between, margin):
    """By separating axes (Gottschalk et al. 1996): the face of least overlap, or in 3D two edges that overlap less."""
    gap, owner, axis, side = -math.inf, a, 0, 1.0
    for k in range(2 * len(state.x)):
        r, i, face = (a, b, k) if k < len(state.x) else (b, a, k - len(state.x))
        direction = load(state.axes[face], r)
        along = dot(between, direction)
        found = abs(along) - shapes.half[face][r] - extent(state, shapes, i, direction)
        if found > gap:
            gap, owner, axis, side = found, r, face, math.copysign(1.0, along)
    normal = scale(side, load(state.axes[axis], owner))
    if gap >= margin:
        return 0, normal
    count, edge_normal = edges(normal, patch, state, shapes, a, b, between, (gap, margin))
    if count >= 0:
        return count, edge_normal
    other, outward = (b, -1.0) if owner == a else (a, 1.0)
    return clip_face(patch, state, shapes, owner, other, axis, scale(outward, normal)), normal


@device
def extent(state, shapes, i, direction):
    """How far box i reaches from its centre along a unit vector."""
    reach = 0.0
    for k in range(len(state.x)):
        reach += shapes.half[k][i] * abs(dot(direction, load(state.axes[k], i)))
    return reach


# ------------------------------------------------------------------ edges, in space only


def _no_edges(normal, patch, state, shapes, a, b, between, limits):
    return -1, normal


def _edges(normal, patch, state, shapes, a, b, between, limits):
    gap, first, second, across = limits[0], -1, -1, normal
    for k in range(9):
        direction = cross(load(state.axes[k // 3], a), load(state.axes[k % 3], b))
        square = dot(direction, direction)
        if square > PARALLEL:
            direction = scale(1.0 / math.sqrt(square), direction)
            along = dot(between, direction)
            found = abs(along) - extent(state, shapes, a, direction) - extent(state, shapes, b, direction)
            if found >= limits[1]:
                return 0, direction
            if found > gap:
                gap, first, second = found, k // 3, k % 3
                across = scale(math.copysign(1.0, along), direction)
    if first < 0 or 1.0 - dot(across, normal) ** 2 < PARALLEL:
        return -1, normal
    one_point(patch, -gap, between_edges(state, shapes, a, first, b, second, across))
    return 1, across


edges = by_dimension(_no_edges, _edges)
"""edges(normal, patch, state, shapes, a, b, between, (gap, margin)): whether two edges are farther apart than ``gap``.

(-1, any) where not; (0, any) where two edges are farther apart than the margin; else (1, the unit normal from b to a).
"""


@device
def between_edges(state, shapes, a, first, b, second, normal):
    """Halfway between edge ``first`` of box a and edge ``second`` of box b, the ones that face each other."""
    u, v = load(state.axes[first], a), load(state.axes[second], b)
    p, q = edge_middle(state, shapes, a, first, negate(normal)), edge_middle(state, shapes, b, second, normal)
    apart, c = subtract(q, p), dot(u, v)
    s = (dot(apart, u) - c * dot(apart, v)) / (1.0 - c * c)
    s = min(max(s, -shapes.half[first][a]), shapes.half[first][a])
    t = c * s - dot(apart, v)
    t = min(max(t, -shapes.half[second][b]), shapes.half[second][b])
    return scale(0.5, add(add(p, scale(s, u)), add(q, scale(t, v))))


@device
def edge_middle(state, shapes, i, along, direction):
    """The middle of the edge of box i, parallel to axis ``along``, that is farthest in a direction."""
    middle = load(state.x, i)
    for k in range(3):
        if k != along:
            half = math.copysign(shapes.half[k][i], dot(load(state.axes[k], i), direction))
            middle = add(middle, scale(half, load(state.axes[k], i)))
    return middle
