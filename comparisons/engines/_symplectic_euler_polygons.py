"""The contact of two faces of boxes: a polygon, in 2D of two corners, each with its depth and its weight.

A corner weighs as much as the polygon turns in it: one that becomes two, or a new one amid an edge, changes nothing at
first, and springs at the corners push steadily however faces slide and turn on each other.
"""

from __future__ import annotations

import math

from pbd.jit import device
from pbd.vector import accumulate, add, dot, load, negate, scale, store, subtract

MERGED = 1e-9
"""Corners nearer than this part of the smaller body's bounding radius are one; what is between them is rounding."""


@device
def clip_face(patch, state, shapes, r, i, axis, outward):
    """Clip the face of box i that looks at face ``axis`` of box r by the sides of r (Sutherland and Hodgman 1974)."""
    source, target = patch.point, patch.spare
    count = opposite_face(source, state, shapes, i, outward)
    for k in range(len(state.x)):
        if k != axis:
            for turn in range(2):
                side = scale(1.0 - 2.0 * turn, load(state.axes[k], r))
                limit = shapes.half[k][r] + dot(load(state.x, r), side)
                count = clip(source, target, count, side, limit)
                source, target = target, source
    surface = shapes.half[axis][r] + dot(load(state.x, r), outward)
    count = merge(patch, count, MERGED * min(shapes.bound[r], shapes.bound[i]))
    share(patch, count, 1 << (len(state.x) - 1))
    for c in range(count):
        patch.depth[c] = surface - dot(load(patch.point, c), outward)
        accumulate(patch.point, c, 0.5 * patch.depth[c], outward)
    return count


@device
def opposite_face(corners, state, shapes, i, outward):
    """The corners, in turn, of the face of box i that is most opposed to a direction; returns their number."""
    face, most = 0, 0.0
    for k in range(len(state.x)):
        along = dot(load(state.axes[k], i), outward)
        if abs(along) > abs(most):
            face, most = k, along
    count = 1 << (len(state.x) - 1)
    middle = add(load(state.x, i), scale(-math.copysign(shapes.half[face][i], most), load(state.axes[face], i)))
    for c in range(count):
        code, corner = c ^ (c >> 1), middle  # a Gray code: one sign changes from corner to corner
        for k in range(len(state.x)):
            if k != face:
                half = shapes.half[k][i] if code & 1 else -shapes.half[k][i]
                corner = add(corner, scale(half, load(state.axes[k], i)))
                code >>= 1
        store(corners, c, corner)
    return count


@device
def clip(source, target, count, side, limit):
    """The part of a polygon where side . p <= limit; returns its number of corners."""
    kept = 0
    for c in range(count):
        here, there = load(source, c), load(source, (c + 1) % count)
        a, b = dot(here, side) - limit, dot(there, side) - limit
        if a <= 0.0:
            kept = put(target, kept, here)
        if (a <= 0.0) != (b <= 0.0):
            kept = put(target, kept, add(here, scale(a / (a - b), subtract(there, here))))
    return kept


@device
def put(corners, count, point):
    """Append a corner, unless there are already as many as any polygon has: then rounding has made one too many."""
    if count == corners[0].shape[0]:
        return count
    store(corners, count, point)
    return count + 1


@device
def merge(patch, count, near):
    """Leave out corners that are as near to the one before; returns the number of those that stay."""
    kept = 0
    for c in range(count):
        if kept == 0 or distance(load(patch.point, c), load(patch.point, kept - 1)) > near:
            store(patch.point, kept, load(patch.point, c))
            kept += 1
    while kept > 1 and distance(load(patch.point, kept - 1), load(patch.point, 0)) <= near:
        kept -= 1
    return kept


@device
def share(patch, count, total):
    """Weights: ``total`` by exterior angles, of a whole face's corners 1 each, however the face is tilted."""
    for c in range(count):
        here = load(patch.point, c)
        before = subtract(here, load(patch.point, (c + count - 1) % count))
        after = subtract(load(patch.point, (c + 1) % count), here)
        patch.weight[c] = total * angle(before, after) / (2.0 * math.pi) if count > 1 else float(total)


@device
def angle(a, b):
    """Between two vectors, in [0, pi], to round-off wherever in it."""
    a, b = scale(math.sqrt(dot(b, b)), a), scale(math.sqrt(dot(a, a)), b)
    return 2.0 * math.atan2(distance(a, b), distance(a, negate(b)))


@device
def distance(p, q):
    way = subtract(p, q)
    return math.sqrt(dot(way, way))
