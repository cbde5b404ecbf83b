"""The contact of two faces of boxes: the part of one that lies over the other, by its corners.

The incident face is clipped against the sides of the reference face (Liang and Barsky 1984). Of up to eight corners
four are kept. All is done in the frame of the reference face: two axes along its edges, the third along its normal.
"""

from __future__ import annotations

from typing import NamedTuple

from pbd.collision.frames import column, cycle, pick
from pbd.jit import device
from pbd.vector import Vector, add, negate, scale, subtract

INSIDE = 1e-6
"""A corner that misses a face by less than this share of its width is inside: for rounding, and small motions of equal
boxes on top of each other, no corner changes its name."""

SAME = 1e-5
"""Corners nearer than this share of the face's width are one; heights that differ by less, and areas, are the same."""

KEPT = 4
"""Corners of a contact: enough to span its area."""


class Faces(NamedTuple):
    """The incident face over the reference face, in the latter's frame.

    middle, first, second : centre and half edges of the incident face; the third components are heights over the
        reference face
    half : half widths of the reference face
    width : the sum of these [m]
    axis, side : which face of its box the reference face is: the axis along its normal, and 0 or 1 for the lower or
        upper end
    other_axis, other_side : the same of the incident face
    swapped : the reference face is one of the second box
    """

    middle: Vector
    first: Vector
    second: Vector
    half: tuple[float, float]
    width: float
    axis: int
    side: int
    other_axis: int
    other_side: int
    swapped: bool


@device
def touch_faces(a, b, pose, axis, margin, points):
    """Contact at a face of box a, the one along ``axis`` that is nearer to b: (count, outward normal of the face).

    pose : b's centre and, as rows of a matrix, its axes in the frame of a
    axis : 0 to 2; 3 to 5 where a is the second box of the pair
    """
    swapped = axis >= 3
    k = axis - 3 if swapped else axis
    side = 1 if pick(pose[0], k) >= 0.0 else 0
    faces = opposed(a[1], b[1], pose, k, side, swapped)
    count = clip(faces, margin, points)
    if count > KEPT:
        count = reduce(points, count, SAME * faces.width)
    x, y = column(a[2], (k + 1) % 3), column(a[2], (k + 2) % 3)
    normal = column(a[2], k) if side == 1 else negate(column(a[2], k))
    height = pick(a[1], k)
    for c in range(count):
        level = height + 0.5 * points[c, 3]
        across = add(scale(points[c, 0], x), scale(points[c, 1], y))
        point = add(a[0], add(across, scale(level, normal)))
        points[c, 0], points[c, 1], points[c, 2] = point
    return count, normal


@device
def opposed(half, other, pose, axis, side, swapped):
    """`Faces`: a reference face, and the face of the other box that is most opposed to it."""
    sign = 1.0 if side == 1 else -1.0
    x, y, z = cycle(pose[0], axis)
    row_x, row_y, row_z = cycle(pose[1], axis)
    half_x, half_y, height = cycle(half, axis)
    j = 0 if abs(row_z[0]) >= abs(row_z[1]) else 1
    j = 2 if abs(row_z[2]) > abs(pick(row_z, j)) else j
    x1, x2, x3 = cycle(row_x, j)
    y1, y2, y3 = cycle(row_y, j)
    z1, z2, z3 = cycle(scale(sign, row_z), j)
    first, second, depth = cycle(other, j)
    to_face = -depth if z3 > 0.0 else depth
    return Faces(
        (x + to_face * x3, y + to_face * y3, sign * z - height - depth * abs(z3)),
        (first * x1, first * y1, first * z1),
        (second * x2, second * y2, second * z2),
        (half_x, half_y),
        half_x + half_y,
        axis,
        side,
        j,
        0 if z3 > 0.0 else 1,
        swapped,
    )


@device
def clip(faces, margin, points):
    """Rows (x, y, -, gap, feature) of the corners of the overlap that are not higher than the margin; their number."""
    (half_x, half_y), tolerance = faces.half, INSIDE * faces.width
    count, inside = 0, 0
    for k in range(4):
        start, end = corner(faces, k), corner(faces, (k + 1) % 4)
        window = cut((0.0, 1.0, -1, -1), half_x - start[0], half_x - end[0], 0, tolerance)
        window = cut(window, half_x + start[0], half_x + end[0], 1, tolerance)
        window = cut(window, half_y - start[1], half_y - end[1], 2, tolerance)
        enter, leave, entered, left = cut(window, half_y + start[1], half_y + end[1], 3, tolerance)
        if enter > leave:
            continue
        if entered < 0:
            inside += 1
            count = put(points, count, start, margin, incident_vertex(faces, k))
        elif enter < 1.0 - SAME:
            count = put(points, count, between(start, end, enter), margin, crossing(faces, k, entered))
        if left >= 0 and leave > enter + SAME:
            count = put(points, count, between(start, end, leave), margin, crossing(faces, k, left))
    if inside < 4:
        count = put_reference_corners(faces, margin, points, count)
    return count


@device
def corner(faces, k):
    """Corner k of the incident face, in order around it."""
    across = scale(1.0 if 0 < k < 3 else -1.0, faces.first)
    along = scale(1.0 if k > 1 else -1.0, faces.second)
    return add(faces.middle, add(across, along))


@device
def between(start, end, t):
    """The point at a share t of the way."""
    return add(start, scale(t, subtract(end, start)))


@device
def cut(window, from_start, from_end, side, tolerance):
    """Cut an edge, whose ends lie so far inside a side: (enter, leave, side entered through, side left through).

    Nothing is left, enter > leave, where both lie outside.
    """
    enter, leave, entered, left = window
    if from_start < -tolerance:
        t = min(from_start / (from_start - from_end), 1.0) if from_end >= -tolerance else 2.0
        if t > enter:
            enter, entered = t, side
    elif from_end < -tolerance:
        t = max(from_start / (from_start - from_end), 0.0)
        if t < leave:
            leave, left = t, side
    return enter, leave, entered, left


@device
def put(points, count, point, margin, feature):
    """Append a corner if it is not too high; returns the new count."""
    if point[2] > margin:
        return count
    points[count, 0] = point[0]
    points[count, 1] = point[1]
    points[count, 3] = point[2]
    points[count, 4] = feature
    return count + 1


@device
def put_reference_corners(faces, margin, points, count):
    """Append the corners of the reference face that lie over the incident face and are not there yet."""
    middle, first, second = faces.middle, faces.first, faces.second
    inverse = 1.0 / (first[0] * second[1] - first[1] * second[0])
    for k in range(4):
        x = faces.half[0] if 0 < k < 3 else -faces.half[0]
        y = faces.half[1] if k > 1 else -faces.half[1]
        dx, dy = x - middle[0], y - middle[1]
        u = (dx * second[1] - dy * second[0]) * inverse
        v = (first[0] * dy - first[1] * dx) * inverse
        inside = abs(u) <= 1.0 + INSIDE and abs(v) <= 1.0 + INSIDE
        if inside and is_new(points, count, x, y, SAME * faces.width):
            point = (x, y, middle[2] + u * first[2] + v * second[2])
            count = put(points, count, point, margin, reference_vertex(faces, k))
    return count


@device
def is_new(points, count, x, y, distance):
    """Whether no corner is so near; there are at most eight."""
    for c in range(count):
        if abs(points[c, 0] - x) + abs(points[c, 1] - y) < distance:
            return False
    return count < 8


@device
def reduce(points, count, tolerance):
    """Keep the deepest corner and those three that span the largest area with it; returns their number.

    Seen from the deepest, any of the others may be opposite: then the largest triangles on both sides of this diagonal.
    Of corners that are the same but for the tolerance the first is taken, so that a flat contact keeps its corners.
    """
    base = anchor(points, count, tolerance)
    best, opposite, left, right = -1.0, base, base, base
    for c in range(count):
        dx, dy = points[c, 0] - points[base, 0], points[c, 1] - points[base, 1]
        high, low, highest, lowest = 0.0, 0.0, base, base
        for m in range(count):
            area = dx * (points[m, 1] - points[base, 1]) - dy * (points[m, 0] - points[base, 0])
            if area > high:
                high, highest = area, m
            if area < low:
                low, lowest = area, m
        if high - low > best * (1.0 + SAME):
            best, opposite, left, right = high - low, c, highest, lowest
    kept = 0
    for c in range(count):
        if c in (base, opposite, left, right):
            for k in range(5):
                points[kept, k] = points[c, k]
            kept += 1
    return kept


@device
def anchor(points, count, tolerance):
    """The deepest corner; of several, that which is farthest from the middle of all."""
    x, y, deepest = 0.0, 0.0, points[0, 3]
    for c in range(count):
        x += points[c, 0] / count
        y += points[c, 1] / count
        deepest = min(deepest, points[c, 3])
    farthest, base = -1.0, 0
    for c in range(count):
        square = (points[c, 0] - x) ** 2 + (points[c, 1] - y) ** 2
        if points[c, 3] <= deepest + tolerance and square > farthest * (1.0 + SAME):
            farthest, base = square, c
    return base


# ------------------------------------------------------------------ names of features


@device
def incident_vertex(faces, k):
    """The number of corner k of the incident face."""
    first, second = 1 if 0 < k < 3 else 0, 1 if k > 1 else 0
    vertex = vertex_number(faces.other_axis, faces.other_side, first, second)
    return vertex if faces.swapped else 8 + vertex


@device
def reference_vertex(faces, k):
    """The number of corner k of the reference face."""
    first, second = 1 if 0 < k < 3 else 0, 1 if k > 1 else 0
    vertex = vertex_number(faces.axis, faces.side, first, second)
    return 8 + vertex if faces.swapped else vertex


@device
def crossing(faces, k, side):
    """The number of incident edge k and a side of the reference face."""
    incident = edge_of_face(faces.other_axis, faces.other_side, k % 2 == 1, 1 if 0 < k < 3 else 0)
    reference = edge_of_face(faces.axis, faces.side, side < 2, 1 - side % 2)
    return edge_pair(incident, reference) if faces.swapped else edge_pair(reference, incident)


@device
def vertex_number(axis, side, first, second):
    """0 to 7: a bit for each axis, from the face's axis and side and the sides on the two axes that follow."""
    return (side << axis) + (first << (axis + 1) % 3) + (second << (axis + 2) % 3)


@device
def edge_of_face(axis, side, along_second, at):
    """The edge of a face that runs along the second or else the first of the axes after the face's, on side ``at``."""
    if along_second:
        return edge_number((axis + 2) % 3, side, at)
    return edge_number((axis + 1) % 3, at, side)


@device
def edge_number(axis, first, second):
    """0 to 11: from the edge's axis and its sides, 0 or 1, on the two axes that follow."""
    return 4 * axis + first + 2 * second


@device
def edge_pair(a, b):
    """16 to 159: an edge of each box."""
    return 16 + 12 * a + b
