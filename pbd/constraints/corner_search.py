"""Where boxes made of particles may touch: along which axis they meet, and which of their particles do.

A box is its 2^d corner particles, numbered by bits: bit k says whether a corner lies on the upper side of axis k. Its
frame - centre, axes, half edges - is read off the corners, so it follows a box that is turned, or squeezed.

For a pair that is near at the predictions p, the axis of widest gap, or least overlap, at the start x of the step says
from which side the boxes met (separating axes: the normals of all faces and, in 3D, the cross products of edges). Each
box's face on that side then takes the corners of the other that are, at p, below it or less than a margin above.

Limit: boxes that pass through each other within one step are not seen.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.constraints.surface import cross
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.routine import routine
from pbd.vector import Store, accumulate, add, dot, load, scale, store, subtract, zero, zeros

PARALLEL = 1e-3
"""Edges at a smaller angle [rad] have no direction across both: faces part such boxes as well."""


FLAT = 0.9999
"""Cosine of the angle from which on a face lies flat on the plane between two boxes, about 0.8 degrees."""


class Frames(NamedTuple):
    """Of b boxes: ``center`` (store), ``axis`` (d stores of unit vectors), ``half`` (store of half edges) [m]."""

    center: Store
    axis: tuple[Store, ...]
    half: Store


def new_frames(boxes: int, dimension: int) -> Frames:
    """Room for the frames of that many boxes."""
    axes = tuple(zeros(boxes, dimension) for _ in range(dimension))
    return Frames(zeros(boxes, dimension), axes, zeros(boxes, dimension))


@routine
def read_frames(frames, corner, x):
    """The frames of all boxes, with corners (b, 2^d), at positions x.

    Limit: a box whose corners coincide along an axis has no direction there; its axis is then 0.
    """
    share = 1.0 / corner.shape[1]
    for b in range(corner.shape[0]):
        store(frames.center, b, zero(x))
        for c in range(corner.shape[1]):
            accumulate(frames.center, b, share, load(x, corner[b, c]))
        for k in range(len(frames.axis)):
            edge = half_edge(corner, x, b, k)
            length = math.sqrt(dot(edge, edge))
            frames.half[k][b] = length
            store(frames.axis[k], b, scale(1.0 / length if length > 0.0 else 0.0, edge))


@device
def half_edge(corner, x, b, k):
    """The mean vector from the centre of box b to the corners on its upper side along axis k."""
    edge = zero(x)
    for c in range(corner.shape[1]):
        sign = 1.0 if (c >> k) & 1 else -1.0
        edge = add(edge, scale(sign / corner.shape[1], load(x, corner[b, c])))
    return edge


@routine
def face_axis(frames, a, b):
    """(gap [m], n): along which face's normal boxes a and b are farthest apart, or overlap least; n from a to b."""
    best, found = -math.inf, load(frames.center, a)
    for owner in (a, b):
        for k in range(len(frames.axis)):
            gap, n = gap_along(frames, a, b, load(frames.axis[k], owner))
            if gap > best:
                best, found = gap, n
    return best, found


@routine
def edge_axis(frames, a, b, face_gap, face_normal):
    """In 3D: the same over the cross products of edges, where that is more than ``face_gap``."""
    best, found = face_gap, face_normal
    for k in range(3):
        for m in range(3):
            across = cross(load(frames.axis[k], a), load(frames.axis[m], b))
            length = math.sqrt(dot(across, across))
            if length > PARALLEL:
                gap, n = gap_along(frames, a, b, scale(1.0 / length, across))
                if gap > best:
                    best, found = gap, n
    return best, found


@device
def gap_along(frames, a, b, n):
    """(gap between boxes a and b along the unit vector n, negative where they overlap [m]; n, from a to b)."""
    along = dot(subtract(load(frames.center, b), load(frames.center, a)), n)
    gap = abs(along) - extent(frames, a, n) - extent(frames, b, n)
    return gap, scale(1.0 if along >= 0.0 else -1.0, n)


def meeting_axis(frames: Frames, a: int, b: int) -> tuple[float, ...]:
    """The unit vector from box a to box b along which they are farthest apart, or overlap least."""
    gap, n = face_axis(frames, a, b)
    return edge_axis(frames, a, b, gap, n)[1] if len(n) == 3 else n


@typed(meeting_axis)
def _meeting_axis(frames: Any, a: Any, b: Any) -> Any:
    def in_space(frames, a, b):
        gap, n = face_axis(frames, a, b)
        return edge_axis(frames, a, b, gap, n)[1]

    return in_space if len(frames.types[1]) == 3 else lambda frames, a, b: face_axis(frames, a, b)[1]


@device
def extent(frames, b, n):
    """How far box b reaches from its centre along the unit vector n [m]."""
    total = 0.0
    for k in range(len(frames.axis)):
        total += frames.half[k][b] * abs(dot(load(frames.axis[k], b), n))
    return total


@device
def face_toward(frames, b, n):
    """((axis k, side +1 or -1), whether it is `FLAT`) of the face of box b that looks most along n."""
    best, axis, side = -1.0, 0, 1
    for k in range(len(frames.axis)):
        along = dot(load(frames.axis[k], b), n)
        if abs(along) > best:
            best, axis, side = abs(along), k, 1 if along > 0.0 else -1
    return (axis, side), best > FLAT


def place_in_box(axes: tuple[Store, ...], b: int, arm: tuple[float, ...]) -> tuple[float, ...]:
    """Coordinates of ``arm``, a vector from the centre of box b, along its ``axes`` [m]."""
    return tuple(dot(load(axis, b), arm) for axis in axes)


@typed(place_in_box)
def _place_in_box(axes: Any, b: Any, arm: Any) -> Any:
    if len(axes) == 1:
        return lambda axes, b, arm: (dot(load(axes[0], b), arm),)
    return lambda axes, b, arm: (dot(load(axes[0], b), arm),) + place_in_box(axes[1:], b, arm)


@device
def is_at_face(frames, b, face, place, beside, margin):
    """Whether a place in box b is at its face: inside, or at most ``beside`` [m] to the side and ``margin`` above."""
    axis, side = face
    for k in range(len(frames.axis)):
        if k != axis and abs(place[k]) > frames.half[k][b] + beside:
            return False
    depth = frames.half[axis][b] - side * place[axis]
    return -margin < depth < 2.0 * frames.half[axis][b]


# ------------------------------------------------------------------ the particles of a face


@device
def edge_below(corner, frames, b, face, place):
    """In 2D: the two corners of a face, so that its outer normal is (t_y, -t_x), t leading from one to the other."""
    axis, side = face
    low = (1 << axis) if side > 0 else 0
    high = low | (1 << (1 - axis))
    if (side > 0) == (axis == 0):
        return corner[b, low], corner[b, high]
    return corner[b, high], corner[b, low]


@device
def triangle_below(corner, frames, b, face, place):
    """In 3D: the corners of that one of a face's two triangles that a place is over, counter-clockwise from outside."""
    axis, side = face
    u, v = (axis + 1) % 3, (axis + 2) % 3
    low = (1 << axis) if side > 0 else 0
    far = low | (1 << u) | (1 << v)
    over_u = place[u] * frames.half[v][b] >= place[v] * frames.half[u][b]
    second, third = (low | (1 << u), far) if over_u else (far, low | (1 << v))
    if side > 0:
        return corner[b, low], corner[b, second], corner[b, third]
    return corner[b, low], corner[b, third], corner[b, second]


def particles_below(
    corner: np.ndarray, frames: Frames, b: int, face: tuple[int, int], place: tuple[float, ...]
) -> tuple[int, ...]:
    """The d particles of that face of box b which carry what presses on it at ``place``, in outward order."""
    below = edge_below if len(place) == 2 else triangle_below
    return below(corner, frames, b, face, place)


@typed(particles_below)
def _particles_below(corner: Any, frames: Any, b: Any, face: Any, place: Any) -> Any:
    if len(place) == 2:
        return lambda corner, frames, b, face, place: edge_below(corner, frames, b, face, place)
    return lambda corner, frames, b, face, place: triangle_below(corner, frames, b, face, place)


# ------------------------------------------------------------------ the edges of a face, in 3D


@device
def edge_of_face(corner, b, face, j):
    """(from, to, k): the corners of edge j = 0 .. 3 of a face of box b, and the axis k along which it leads upward."""
    axis, side = face
    k, across = (axis + 1 + j % 2) % 3, (axis + 2 - j % 2) % 3
    low = ((1 << axis) if side > 0 else 0) | ((1 << across) if j > 1 else 0)
    return corner[b, low], corner[b, low | (1 << k)], k


@device
def is_inside_edge(frames, b, k, share, margin):
    """Whether the point at that share of an edge of box b along axis k is farther than ``margin`` [m] from its ends."""
    length = 2.0 * frames.half[k][b]
    return margin < share * length < length - margin
