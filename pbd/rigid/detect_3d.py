"""Where bodies touch in space: the contact points of a pair, fixed in both bodies; what touches as before remembers."""

from __future__ import annotations

from pbd.collision.ball_box import ball_ball, ball_box
from pbd.collision.box_box_3d import box_box
from pbd.jit import device
from pbd.rigid.turning import to_body
from pbd.vector import load, negate

OWNER, HINT = 4, 5


@device
def detect(rows, c, bodies, planes, margin):
    """Whether the bodies of contact c come within the margin; then where."""
    i, j, plane, points = rows.pair[c, 0], rows.pair[c, 1], rows.pair[c, 3], rows.points
    if plane >= 0:
        count, normal, owner = against_plane(bodies, i, planes, plane, margin, points)
    else:
        count, normal, owner = against_body(rows, c, bodies, i, j, margin, points)
    rows.pair[c, 2] = count
    if count == 0:
        forget(rows, c)
        return False
    match(rows, c, count)
    n = to_body(bodies.frame, i if owner == 0 else j, normal)
    rows.feature[c, OWNER] = owner
    for k in range(3):
        rows.local[c, k] = n[k]
    for k in range(count):
        half = 0.5 * points[k, 3]
        place(rows, c, bodies, i, points, k, normal, -half, 3 + 6 * k)
        place(rows, c, bodies, j, points, k, normal, half, 6 + 6 * k)
    return True


@device
def place(rows, c, bodies, i, points, k, normal, shift, column):
    """The arm of contact point k in body i's frame."""
    arm = (
        points[k, 0] + shift * normal[0] - bodies.x[0][i],
        points[k, 1] + shift * normal[1] - bodies.x[1][i],
        points[k, 2] + shift * normal[2] - bodies.x[2][i],
    )
    local = to_body(bodies.frame, i, arm)
    rows.local[c, column], rows.local[c, column + 1], rows.local[c, column + 2] = local[0], local[1], local[2]


@device
def forget(rows, c):
    for r in range(7):
        rows.force[c, r] = 0.0
    for k in range(4):
        rows.feature[c, k] = -1
    for k in range(3):
        rows.drift[c, k] = 0.0


@device
def match(rows, c, count):
    """Give each point the force of the one that had its features; none is kept of what has gone."""
    f0, f1, f2, f3 = rows.force[c, 0], rows.force[c, 1], rows.force[c, 2], rows.force[c, 3]
    o0, o1, o2, o3 = rows.feature[c, 0], rows.feature[c, 1], rows.feature[c, 2], rows.feature[c, 3]
    total = 0.0
    for k in range(4):
        feature = int(rows.points[k, 4]) if k < count else -1
        force = 0.0
        if feature >= 0:
            force = f0 if feature == o0 else f1 if feature == o1 else f2 if feature == o2 else 0.0
            if feature == o3:
                force = f3
        rows.feature[c, k] = feature
        rows.force[c, k] = force
        total += force
    if total == 0.0:
        for r in range(4, 7):
            rows.force[c, r] = 0.0
        for k in range(3):
            rows.drift[c, k] = 0.0


@device
def against_body(rows, c, bodies, i, j, margin, points):
    """Of two bodies: (count, normal from i to j, 0 or 1: in whose frame it is fixed)."""
    if bodies.kind[i] == 0 and bodies.kind[j] == 0:
        count, normal, hint = box_box(box(bodies, i), box(bodies, j), margin, rows.feature[c, HINT], points)
        rows.feature[c, HINT] = hint
        return count, normal, 1 if 3 <= hint < 6 else 0
    if bodies.kind[i] == 1 and bodies.kind[j] == 1:
        radii = bodies.half[0][i], bodies.half[0][j]
        hit, point, gap, normal = ball_ball(load(bodies.x, i), radii[0], load(bodies.x, j), radii[1], margin)
        return one_point(hit, point, gap, points), normal, 0
    if bodies.kind[i] == 1:
        hit, point, gap, normal = ball_box(load(bodies.x, i), bodies.half[0][i], box(bodies, j), margin)
        return one_point(hit, point, gap, points), normal, 1
    hit, point, gap, normal = ball_box(load(bodies.x, j), bodies.half[0][j], box(bodies, i), margin)
    return one_point(hit, point, gap, points), negate(normal), 0


@device
def one_point(hit, point, gap, points):
    points[0, 0], points[0, 1], points[0, 2], points[0, 3], points[0, 4] = point[0], point[1], point[2], gap, 0.0
    return 1 if hit else 0


@device
def box(bodies, i):
    """Centre, half extents and rotation, as `pbd.collision` takes them."""
    f = bodies.frame
    rotation = f[i, 0], f[i, 1], f[i, 2], f[i, 3], f[i, 4], f[i, 5], f[i, 6], f[i, 7], f[i, 8]
    return load(bodies.x, i), load(bodies.half, i), rotation


@device
def against_plane(bodies, i, planes, k, margin, points):
    """Of body i with a plane: (count, normal into the solid, 1: fixed in the ground)."""
    normal = negate(load(planes.normal, k))
    height = -planes.offset[k]
    for axis in range(3):
        height -= normal[axis] * bodies.x[axis][i]
    if bodies.kind[i] == 1:
        gap = height - bodies.half[0][i]
        reach = bodies.half[0][i] + 0.5 * gap
        point = (
            bodies.x[0][i] + reach * normal[0],
            bodies.x[1][i] + reach * normal[1],
            bodies.x[2][i] + reach * normal[2],
        )
        return one_point(gap <= margin, point, gap, points), normal, 1
    return face_points(bodies, i, normal, height, margin, points), normal, 1


@device
def face_points(bodies, i, normal, height, margin, points):
    """The vertices of the box's face that looks most at the plane, where they are near enough."""
    n = to_body(bodies.frame, i, normal)
    f = bodies.frame
    a, b, c = abs(n[0]), abs(n[1]), abs(n[2])
    axis = 0 if a >= b and a >= c else 1 if b >= c else 2
    count = 0
    for k in range(4):
        first, second = 1.0 if k & 1 else -1.0, 1.0 if k & 2 else -1.0
        if axis == 0:
            s = (1.0 if n[0] > 0.0 else -1.0, first, second)
        elif axis == 1:
            s = (first, 1.0 if n[1] > 0.0 else -1.0, second)
        else:
            s = (first, second, 1.0 if n[2] > 0.0 else -1.0)
        p = s[0] * bodies.half[0][i], s[1] * bodies.half[1][i], s[2] * bodies.half[2][i]
        r = (
            f[i, 0] * p[0] + f[i, 1] * p[1] + f[i, 2] * p[2],
            f[i, 3] * p[0] + f[i, 4] * p[1] + f[i, 5] * p[2],
            f[i, 6] * p[0] + f[i, 7] * p[1] + f[i, 8] * p[2],
        )
        gap = height - (r[0] * normal[0] + r[1] * normal[1] + r[2] * normal[2])
        if gap <= margin:
            for axis_ in range(3):
                points[count, axis_] = bodies.x[axis_][i] + r[axis_] + 0.5 * gap * normal[axis_]
            points[count, 3] = gap
            points[count, 4] = (s[0] > 0.0) + 2.0 * (s[1] > 0.0) + 4.0 * (s[2] > 0.0)
            count += 1
    return count
