"""Where bodies touch in the plane: the contact points of a pair, fixed in both bodies."""

from __future__ import annotations

import math

from pbd.collision.ball_box import ball_ball, ball_box
from pbd.collision.box_box_2d import box_box
from pbd.jit import device
from pbd.vector import load


@device
def detect_pair(hot, cold, points, bodies, planes, margin):
    i, j = hot["i"], hot["j"]
    if cold["plane"] >= 0:
        count, nx, ny, owner = against_plane(bodies, i, planes, cold["plane"], margin, points)
    else:
        count, nx, ny, owner = against_body(bodies, i, j, margin, points)
    hot["points"] = count
    if count == 0:
        cold["force_a"] = cold["force_b"] = cold["force_t"] = cold["slip"] = 0.0
        cold["feature_a"] = cold["feature_b"] = -1
        return False
    fa, fb = int(points[0, 3]) + 8 * owner, -1
    place(cold, bodies, i, j, points, 0, nx, ny)
    if count == 2:
        fb = int(points[1, 3]) + 8 * owner
        place(cold, bodies, i, j, points, 1, nx, ny)
    force_a, force_b = cold["force_a"], cold["force_b"]
    old_a, old_b = cold["feature_a"], cold["feature_b"]
    kept = 0.0
    if fa >= 0 and fa == old_a:
        kept = force_a
    elif fa == old_b:
        kept = force_b
    other = 0.0
    if fb >= 0 and fb == old_b:
        other = force_b
    elif fb >= 0 and fb == old_a:
        other = force_a
    cold["force_a"], cold["force_b"] = kept, other
    if kept + other == 0.0:
        cold["force_t"] = cold["slip"] = 0.0
    cold["feature_a"], cold["feature_b"] = fa, fb
    cold["owner"] = owner
    c, s = bodies.frame[i if owner == 0 else j, 0], bodies.frame[i if owner == 0 else j, 1]
    cold["local_nx"], cold["local_ny"] = c * nx + s * ny, -s * nx + c * ny
    return True


@device
def place(cold, bodies, i, j, points, k, nx, ny):
    """Fix contact point k in both bodies."""
    x, y, half = points[k, 0], points[k, 1], 0.5 * points[k, 2]
    ix, iy = local(bodies, i, x - half * nx, y - half * ny)
    jx, jy = local(bodies, j, x + half * nx, y + half * ny)
    if k == 0:
        cold["iax"], cold["iay"], cold["jax"], cold["jay"] = ix, iy, jx, jy
    else:
        cold["ibx"], cold["iby"], cold["jbx"], cold["jby"] = ix, iy, jx, jy


@device
def local(bodies, i, x, y):
    c, s = bodies.frame[i, 0], bodies.frame[i, 1]
    x, y = x - bodies.x[0][i], y - bodies.x[1][i]
    return c * x + s * y, -s * x + c * y


@device
def against_plane(bodies, i, planes, k, margin, points):
    """Contact of body i with a plane; the normal points into the solid. The owner is the ground."""
    nx, ny, offset = -planes.normal[0][k], -planes.normal[1][k], -planes.offset[k]
    x, y = bodies.x[0][i], bodies.x[1][i]
    depth = offset - (nx * x + ny * y)
    if bodies.kind[i] == 1:
        gap = depth - bodies.half[0][i]
        if gap > margin:
            return 0, nx, ny, 1
        reach = bodies.half[0][i] + 0.5 * gap
        points[0, 0], points[0, 1], points[0, 2], points[0, 3] = x + reach * nx, y + reach * ny, gap, 0.0
        return 1, nx, ny, 1
    c, s = bodies.frame[i, 0], bodies.frame[i, 1]
    u, v = c * nx + s * ny, -s * nx + c * ny
    w, h = bodies.half[0][i], bodies.half[1][i]
    count = 0
    # the face that looks most at the plane, and its two ends
    on_x = abs(u) > abs(v)
    for k2 in range(2):
        end = -1.0 if k2 == 0 else 1.0
        if on_x:
            px, py = math.copysign(w, u), end * h
            feature = (0 if u > 0.0 else 1) * 2 + k2
        else:
            px, py = end * w, math.copysign(h, v)
            feature = (2 if v > 0.0 else 3) * 2 + k2
        rx, ry = c * px - s * py, s * px + c * py
        gap = depth - (rx * nx + ry * ny)
        if gap <= margin:
            points[count, 0], points[count, 1] = x + rx + 0.5 * gap * nx, y + ry + 0.5 * gap * ny
            points[count, 2], points[count, 3] = gap, float(feature)
            count += 1
    return count, nx, ny, 1


@device
def against_body(bodies, i, j, margin, points):
    """Of two bodies: (count, normal from i to j, 0 or 1: in whose frame it is fixed)."""
    if bodies.kind[i] == 0 and bodies.kind[j] == 0:
        return box_box(shape(bodies, i), shape(bodies, j), margin, points)
    if bodies.kind[i] == 1 and bodies.kind[j] == 1:
        radii = bodies.half[0][i], bodies.half[0][j]
        hit, point, gap, n = ball_ball(load(bodies.x, i), radii[0], load(bodies.x, j), radii[1], margin)
        return one_point(hit, point, gap, points), n[0], n[1], 0
    if bodies.kind[i] == 1:
        hit, point, gap, n = ball_box(load(bodies.x, i), bodies.half[0][i], turned_box(bodies, j), margin)
        return one_point(hit, point, gap, points), n[0], n[1], 1
    hit, point, gap, n = ball_box(load(bodies.x, j), bodies.half[0][j], turned_box(bodies, i), margin)
    return one_point(hit, point, gap, points), -n[0], -n[1], 0


@device
def one_point(hit, point, gap, points):
    points[0, 0], points[0, 1], points[0, 2], points[0, 3] = point[0], point[1], gap, 0.0
    return 1 if hit else 0


@device
def shape(bodies, i):
    return bodies.x[0][i], bodies.x[1][i], bodies.frame[i, 0], bodies.frame[i, 1], bodies.half[0][i], bodies.half[1][i]


@device
def turned_box(bodies, i):
    """Centre, half extents and rotation matrix."""
    c, s = bodies.frame[i, 0], bodies.frame[i, 1]
    return load(bodies.x, i), load(bodies.half, i), (c, -s, s, c)
