"""Two boxes in space: the axis on which they are farthest apart, and the contact along it. Pure geometry.

A box is a tuple (centre (3,), half extents (3,), rotation (9,) as in frames.py). Boxes overlap if and only if they do
along 15 axes: their face normals and the cross products of their edges (Gottschalk, Lin and Manocha 1996). Numbers of
axes: 0 to 2, faces of the first box; 3 to 5, faces of the second; 6 + 3 i + j, edge i of the first times edge j of the
second.
"""

from __future__ import annotations

import math

from pbd.collision.face_face import INSIDE, edge_number, edge_pair, touch_faces
from pbd.collision.frames import column, cosines, cross, cycle, pick, to_frame, transposed
from pbd.jit import device
from pbd.vector import add, dot, negate, scale, subtract

PREFERENCE = 1e-4
"""Axes that differ by less than this share of the smallest half extent are equally good, and then the same is taken in
every step: that of last time, a face before an edge, the first box before the second. By what they differ the contact
is wrong in second order only, since it is clipped. If nothing is left of it, the best axis is taken after all."""

PARALLEL = 1e-8
"""Edges whose squared sine is less have no product: the faces beside them separate as well."""

NOWHERE = (0.0, 0.0, 0.0)


@device
def box_box(a, b, margin, hint, points):
    """Contact of boxes a and b whose gap is at most ``margin``: (count, unit normal from a to b, hint).

    hint : the axis returned by the last call for this pair, or -1. Boxes that it still separates are done with.
    points : (8, 5) float64, receives a row for each of at most 4 points: x, y, z halfway between the surfaces; the gap
        along the normal, negative where they overlap; and a number that stays while the same features touch, a vertex
        of a (0 to 7) or of b (8 to 15), or an edge of each (16 to 159)

    Boxes that overlap have points, whose least gap is minus the shortest way out. Of boxes apart, no point's gap is
    less than the distance; where a vertex is nearest to a vertex or an edge there may be none until they touch.
    """
    if hint >= 0 and is_separating(a, b, hint, margin):
        return 0, NOWHERE, hint
    between = subtract(b[0], a[0])
    ta, tb = to_frame(a[2], between), to_frame(b[2], between)
    turn = cosines(a[2], b[2])
    of_a, of_b = face_gaps(ta, a[1], b[1], turn), face_gaps(tb, b[1], a[1], transposed(turn))
    if max(max(of_a), max(of_b)) > margin:
        return 0, NOWHERE, best_face(of_a, of_b, -1, 0.0)[0]
    for bias in (PREFERENCE * min(min(a[1]), min(b[1])), 0.0):
        axis, gap = best_face(of_a, of_b, hint, bias)
        edges, square = best_edges(ta, a[1], b[1], turn, gap + bias)
        if edges >= 0:
            if square > margin * abs(margin):
                return 0, NOWHERE, edges
            count, normal = touch_edges(a, b, edges - 6, points)
            return count, normal, edges
        reference, incident, pose = a, b, (ta, turn)
        if axis >= 3:
            reference, incident, pose = b, a, (negate(tb), transposed(turn))
        count, normal = touch_faces(reference, incident, pose, axis, margin, points)
        if count > 0:
            return count, normal if axis < 3 else negate(normal), axis
    return 0, NOWHERE, axis


@device
def half_width(half, direction):
    """Half the extent of a box along a direction given in its frame."""
    return dot(half, (abs(direction[0]), abs(direction[1]), abs(direction[2])))


@device
def is_separating(a, b, axis, margin):
    """Whether the boxes are farther apart than the margin along one of the 15 axes."""
    if axis < 3:
        direction, square = column(a[2], axis), 1.0
    elif axis < 6:
        direction, square = column(b[2], axis - 3), 1.0
    else:
        direction = cross(column(a[2], (axis - 6) // 3), column(b[2], axis % 3))
        square = dot(direction, direction)
        if square < PARALLEL:
            return False
    apart = abs(dot(direction, subtract(b[0], a[0])))
    apart -= half_width(a[1], to_frame(a[2], direction)) + half_width(b[1], to_frame(b[2], direction))
    return apart * abs(apart) > margin * abs(margin) * square


@device
def face_gaps(between, half, other, turn):
    """Gaps along the face normals of a box; in its frame ``between`` is the centre, ``turn`` the axes of the other."""
    return (
        abs(between[0]) - half[0] - half_width(other, turn[0]),
        abs(between[1]) - half[1] - half_width(other, turn[1]),
        abs(between[2]) - half[2] - half_width(other, turn[2]),
    )


@device
def best_face(first, second, hint, bias):
    """(axis, gap) of the face normal along which the boxes are farthest apart, with the preferences."""
    axis, gap = largest(first, hint, bias)
    other, other_gap = largest(second, hint - 3, bias)
    if other_gap + (bias if other + 3 == hint else 0.0) > gap + (2.0 * bias if axis == hint else bias):
        return other + 3, other_gap
    return axis, gap


@device
def largest(gaps, hint, bias):
    """(axis, gap) of the largest of three, with the preference for the hint."""
    axis, gap = 0, gaps[0]
    if gaps[1] > gap:
        axis, gap = 1, gaps[1]
    if gaps[2] > gap:
        axis, gap = 2, gaps[2]
    if 0 <= hint < 3 and pick(gaps, hint) > gap - bias:
        return hint, pick(gaps, hint)
    return axis, gap


@device
def best_edges(between, half, other, turn, least):
    """(axis, signed square of its gap) of the product of edges with the largest gap above ``least``, or else (-1, ..).

    Signed squares spare the roots, and all divisions but those by a new best product's square.
    """
    axis, best = -1, least * abs(least)
    for i in range(3):
        t1, t2, _ = cycle(between, i)
        h1, h2, _ = cycle(half, i)
        row1, row2, row = cycle(turn, i)
        for j in range(3):
            o1, o2, _ = cycle(other, j)
            c1, c2, _ = cycle(row, j)
            p, q = pick(row1, j), pick(row2, j)
            square = p * p + q * q
            gap = abs(t2 * p - t1 * q) - h1 * abs(q) - h2 * abs(p) - o1 * abs(c2) - o2 * abs(c1)
            if gap * abs(gap) > best * square and square > PARALLEL:
                axis, best = 6 + 3 * i + j, gap * abs(gap) / square
    return axis, best


@device
def touch_edges(a, b, edges, points):
    """Contact of two edges, halfway between the nearest points of their lines: (1, normal).

    None, (0, normal), where boxes are apart and these points lie beyond the edges' ends: then vertices are nearest, and
    farther from one another than the gap.
    """
    i, j = edges // 3, edges % 3
    between = subtract(b[0], a[0])
    u, v = column(a[2], i), column(b[2], j)
    product = cross(u, v)
    square = dot(product, product)
    normal = scale((1.0 if dot(product, between) >= 0.0 else -1.0) / math.sqrt(square), product)
    p, first = middle_of_edge(a, i, normal)
    q, second = middle_of_edge(b, j, negate(normal))
    gap = subtract(add(between, q), p)
    cosine, along_u, along_v = dot(u, v), dot(gap, u), dot(gap, v)
    on_a, end_a = (along_u - cosine * along_v) / square, pick(a[1], i)
    on_b, end_b = (cosine * along_u - along_v) / square, pick(b[1], j)
    points[0, 3] = dot(normal, gap)
    if points[0, 3] > 0.0 and max(abs(on_a) / end_a, abs(on_b) / end_b) > 1.0 + INSIDE:
        return 0, normal
    ends = add(add(p, scale(clamp(on_a, end_a), u)), add(add(between, q), scale(clamp(on_b, end_b), v)))
    for k in range(3):
        points[0, k] = a[0][k] + 0.5 * ends[k]
    points[0, 4] = edge_pair(first, second)
    return 1, normal


@device
def middle_of_edge(box, k, direction):
    """The edge along axis k that is farthest in a direction: (its middle from the box's centre, its number)."""
    half, rotation = box[1], box[2]
    along = to_frame(rotation, direction)
    m, n = (k + 1) % 3, (k + 2) % 3
    first, second = pick(along, m) > 0.0, pick(along, n) > 0.0
    to_first = pick(half, m) if first else -pick(half, m)
    to_second = pick(half, n) if second else -pick(half, n)
    middle = add(scale(to_first, column(rotation, m)), scale(to_second, column(rotation, n)))
    return middle, edge_number(k, first, second)


@device
def clamp(value, limit):
    """value, or the nearer of -limit and limit."""
    return max(-limit, min(limit, value))
