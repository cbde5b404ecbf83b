"""What a contact in space does between its projections: bring its rows to the pose, foresee, turn over."""

from __future__ import annotations

import math

from pbd.collision.frames import cross
from pbd.jit import device
from pbd.rigid import block_3d as at
from pbd.rigid.block_3d import both_motions, push_bodies, speed_along, twist_speed
from pbd.rigid.closing import CLOSED, after, closing, opening
from pbd.rigid.inverse_3d import has_changed, set_inverse
from pbd.rigid.turning import to_world
from pbd.vector import add, dot, scale, subtract


@device
def refresh(rows, c, bodies, weights, column):
    """Directions, arms, gaps and K's diagonal at the present pose.

    Friction acts where the normal forces do, which stand in ``weights`` from ``column`` on. Both bodies are pushed at
    one place, or a contact that slides would make angular momentum.
    """
    i, j, points = rows.pair[c, 0], rows.pair[c, 1], rows.pair[c, 2]
    row, local = rows.row, rows.local
    owner = i if rows.feature[c, 4] == 0 else j
    normal = to_world(bodies.frame, owner, (local[c, 0], local[c, 1], local[c, 2]))
    tangent = any_tangent(normal)
    binormal = cross(normal, tangent)
    for k in range(3):
        row[c, at.NORMAL + k], row[c, at.TANGENT + k], row[c, at.BINORMAL + k] = normal[k], tangent[k], binormal[k]
    between = (
        bodies.x[0][j] - bodies.x[0][i],
        bodies.x[1][j] - bodies.x[1][i],
        bodies.x[2][j] - bodies.x[2][i],
    )
    for k in range(points):
        ri, rj = arms(rows, c, bodies, i, j, k, normal)
        rows.gap[c, k] = dot(normal, between) + dot(normal, rj) - dot(normal, ri)
        ri, rj = at_one_place(rows, c, between, ri, rj)
        set_arms(row, c, at.ARMS + 12 * k, bodies, i, j, cross(ri, normal), cross(rj, normal))
        row[c, at.INVERSE + k] = inverse_weight(row, c, bodies, i, j, at.ARMS + 12 * k)
    for k in range(points, at.POINTS):
        row[c, at.INVERSE + k] = 0.0
    middle_i, middle_j = middle(rows, c, bodies, (normal, between), weights, column)
    set_friction(rows, c, bodies, i, j, (normal, tangent, binormal, between), middle_i, middle_j)
    if has_changed(row, c, points, bodies.motion[i, 6] + bodies.motion[j, 6]):
        set_inverse(rows, c, bodies, points)


@device
def middle(rows, c, bodies, place, weights, column):
    """Arms of the contact's middle: the mean of its points by their forces, or where there are none of the nearest."""
    i, j, points, normal = rows.pair[c, 0], rows.pair[c, 1], rows.pair[c, 2], place[0]
    total, least = 0.0, rows.gap[c, 0]
    for k in range(points):
        total += weights[c, column + k]
        least = min(least, rows.gap[c, k])
    count = 0.0
    for k in range(points):
        share = weights[c, column + k] if total > 0.0 else 1.0 if rows.gap[c, k] <= least + CLOSED else 0.0
        rows.share[c, k] = share
        count += share
    mi, mj = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(points):
        rows.share[c, k] /= count
        ri, rj = at_one_place(rows, c, place[1], *arms(rows, c, bodies, i, j, k, normal))
        mi, mj = add(mi, scale(rows.share[c, k], ri)), add(mj, scale(rows.share[c, k], rj))
    return mi, mj


@device
def set_friction(rows, c, bodies, i, j, basis, middle_i, middle_j):
    """Rows of slip and twist at the contact's middle."""
    row, points, binormals = rows.row, rows.pair[c, 2], at.SLIP + 12
    normal, tangent, binormal, between = basis
    set_arms(row, c, at.SLIP, bodies, i, j, cross(middle_i, tangent), cross(middle_j, tangent))
    set_arms(row, c, binormals, bodies, i, j, cross(middle_i, binormal), cross(middle_j, binormal))
    row[c, at.INVERSE + 4] = inverse_weight(row, c, bodies, i, j, at.SLIP)
    row[c, at.INVERSE + 5] = inverse_weight(row, c, bodies, i, j, binormals)
    coupling = 0.0
    for k in range(3):
        coupling += row[c, at.SLIP + k] * row[c, binormals + 6 + k]
        coupling += row[c, at.SLIP + 3 + k] * row[c, binormals + 9 + k]
    row[c, at.COUPLING] = coupling
    set_arms(row, c, at.TWIST, bodies, i, j, normal, normal)
    weight = 0.0
    for k in range(3):
        weight += normal[k] * (row[c, at.TWIST + 6 + k] + row[c, at.TWIST + 9 + k])
    row[c, at.INVERSE + 6] = 1.0 / weight if weight > 0.0 else 0.0
    for k in range(points):
        ri, _ = at_one_place(rows, c, between, *arms(rows, c, bodies, i, j, k, normal))
        away = subtract(ri, middle_i)
        high = dot(away, normal)
        row[c, at.DISTANCE + k] = math.sqrt(max(dot(away, away) - high * high, 0.0))


@device
def any_tangent(n):
    """A unit vector across n, that changes little where n does."""
    if abs(n[1]) > 0.7:
        length = 1.0 / math.sqrt(n[0] * n[0] + n[1] * n[1])
        return n[1] * length, -n[0] * length, 0.0
    length = 1.0 / math.sqrt(n[0] * n[0] + n[2] * n[2])
    return n[2] * length, 0.0, -n[0] * length


@device
def arms(rows, c, bodies, i, j, k, normal):
    """From the centres to point k: fixed in a box; of a ball always the point that faces the other body."""
    local, column = rows.local, 3 + 6 * k
    if bodies.kind[i] == 1:
        ri = scale(bodies.half[0][i], normal)
    else:
        ri = to_world(bodies.frame, i, (local[c, column], local[c, column + 1], local[c, column + 2]))
    if bodies.kind[j] == 1:
        rj = scale(-bodies.half[0][j], normal)
    else:
        rj = to_world(bodies.frame, j, (local[c, column + 3], local[c, column + 4], local[c, column + 5]))
    return ri, rj


@device
def at_one_place(rows, c, between, ri, rj):
    """Arms of a contact point, from the point on the body that does not own the normal."""
    return (add(between, rj), rj) if rows.feature[c, 4] == 0 else (ri, subtract(ri, between))


@device
def set_arms(row, c, column, bodies, i, j, mi, mj):
    """Moments of a row, and I^-1 times them."""
    ti, tj = accelerated(bodies.motion, i, mi), accelerated(bodies.motion, j, mj)
    for k in range(3):
        row[c, column + k], row[c, column + 3 + k] = mi[k], mj[k]
        row[c, column + 6 + k], row[c, column + 9 + k] = ti[k], tj[k]


@device
def accelerated(motion, i, m):
    """I^-1 m."""
    return (
        motion[i, 7] * m[0] + motion[i, 8] * m[1] + motion[i, 9] * m[2],
        motion[i, 8] * m[0] + motion[i, 10] * m[1] + motion[i, 11] * m[2],
        motion[i, 9] * m[0] + motion[i, 11] * m[1] + motion[i, 12] * m[2],
    )


@device
def inverse_weight(row, c, bodies, i, j, column):
    """1 / (J M^-1 J^T) of a row whose direction is a unit vector."""
    weight = bodies.motion[i, 6] + bodies.motion[j, 6]
    for k in range(3):
        weight += row[c, column + k] * row[c, column + 6 + k] + row[c, column + 3 + k] * row[c, column + 9 + k]
    return 1.0 / weight


@device
def contact_speeds(rows, c, bodies):
    """Keep J v of the normals."""
    row, v = rows.row, both_motions(bodies.motion, rows.pair[c, 0], rows.pair[c, 1])
    for k in range(rows.pair[c, 2]):
        rows.before[c, k] = speed_along(row, c, at.NORMAL, at.ARMS + 12 * k, v)


@device
def foresee(rows, c, bodies, h, limits):
    """Set the bias of a position pass; returns when within h the contact closes in an impact, or inf; and its gap."""
    most_push, rest, rate = limits
    i, j, row, points, inverse = rows.pair[c, 0], rows.pair[c, 1], rows.row, rows.pair[c, 2], 1.0 / h
    v = both_motions(bodies.motion, i, j)
    for k in range(4):
        row[c, at.LOW + k] = 0.0
    for k in range(5):
        row[c, at.SPENT + k] = 0.0
    bend_i, bend_j = bending(bodies, i, h), bending(bodies, j, h)
    normal = row[c, 0], row[c, 1], row[c, 2]
    when, least, mean = math.inf, math.inf, (0.0, 0.0, 0.0)
    for k in range(points):
        ri, rj = arms(rows, c, bodies, i, j, k, normal)
        bent = subtract(bent_arm(bend_j, rj), bent_arm(bend_i, ri))
        mean = add(mean, scale(rows.share[c, k], bent))
        bend, gap = dot(normal, bent), rows.gap[c, k]
        speed = speed_along(row, c, at.NORMAL, at.ARMS + 12 * k, v) + bend * inverse
        closes, rows.impact[c, k] = closing(gap, rows.before[c, k], speed, h, rest)
        when, least = min(when, closes), min(least, gap)
        row[c, at.BIAS + k] = opening(gap, bend, inverse, rate, most_push)
    tangent, binormal = (row[c, 3], row[c, 4], row[c, 5]), (row[c, 6], row[c, 7], row[c, 8])
    row[c, at.BIAS + 4] = rows.drift[c, 0] * rate + dot(tangent, mean) * inverse
    row[c, at.BIAS + 5] = rows.drift[c, 1] * rate + dot(binormal, mean) * inverse
    row[c, at.BIAS + 6] = rows.drift[c, 2] * rate
    return when, least


@device
def relieve(rows, c, bodies, depth):
    """After a position pass: take back what it pushed if the contact overlapped by more than ``depth``."""
    row, points, deep = rows.row, rows.pair[c, 2], False
    for k in range(points):
        deep |= rows.gap[c, k] < -depth
    if deep:
        for r in range(7):
            row[c, at.CHANGE + r] = -row[c, at.IMPULSE + r]
            row[c, at.IMPULSE + r] = 0.0
        push_bodies(row, c, points, bodies.motion, rows.pair[c, 0], rows.pair[c, 1], at.CHANGE)


@device
def bending(bodies, i, h):
    """(h w, and the factors a, b with which turning by it bends an arm: a w x (w x r) + b w x r)."""
    w = h * bodies.motion[i, 3], h * bodies.motion[i, 4], h * bodies.motion[i, 5]
    square = dot(w, w)
    if bodies.kind[i] == 1 or square == 0.0:
        return w, 0.0, 0.0
    if square > 0.25:
        angle = math.sqrt(square)
        return w, (1.0 - math.cos(angle)) / square, math.sin(angle) / angle - 1.0
    a = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0))
    return w, a, -square * (1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0)))


@device
def bent_arm(bend, r):
    """Turned arm - arm - h w x arm."""
    w, a, b = bend
    across = cross(w, r)
    twice = cross(w, across)
    return a * twice[0] + b * across[0], a * twice[1] + b * across[1], a * twice[2] + b * across[2]


@device
def turn_over(rows, c, bodies, h, friction, restitution):
    """From the position pass to the velocity pass, as in the plane: what was spent, the new pose, the targets."""
    row, points = rows.row, rows.pair[c, 2]
    v = both_motions(bodies.motion, rows.pair[c, 0], rows.pair[c, 1])
    total, lever = 0.0, 0.0
    for k in range(points):
        total += row[c, at.IMPULSE + k]
        lever += row[c, at.IMPULSE + k] * row[c, at.DISTANCE + k]
    first, second, twist = row[c, at.IMPULSE + 4], row[c, at.IMPULSE + 5], row[c, at.IMPULSE + 6]
    sticks = total > 0.0 and first * first + second * second < (friction * total) ** 2
    rows.drift[c, 0] = h * (speed_along(row, c, at.TANGENT, at.SLIP, v) + row[c, at.BIAS + 4]) if sticks else 0.0
    rows.drift[c, 1] = h * (speed_along(row, c, at.BINORMAL, at.SLIP + 12, v) + row[c, at.BIAS + 5]) if sticks else 0.0
    holds = lever > 0.0 and abs(twist) < friction * lever
    rows.drift[c, 2] = h * (twist_speed(row, c, v) + row[c, at.BIAS + 6]) if holds else 0.0
    refresh(rows, c, bodies, row, at.IMPULSE)
    row[c, at.SPENT], row[c, at.SPENT + 1], row[c, at.SPENT + 2] = total, first, second
    row[c, at.SPENT + 3], row[c, at.SPENT + 4] = lever, twist
    for k in range(points):
        spent, impact = row[c, at.IMPULSE + k], rows.impact[c, k]
        row[c, at.LOW + k] = -spent
        row[c, at.BIAS + k] = after(rows.gap[c, k], spent, impact, restitution)
    for r in range(7):
        row[c, at.IMPULSE + r] = 0.0
    for r in range(4, 7):
        row[c, at.BIAS + r] = 0.0


@device
def strike(rows, c, bodies, restitution):
    """From the velocity pass before an impact to that of the impact: it has a budget of friction of its own."""
    row, v = rows.row, both_motions(bodies.motion, rows.pair[c, 0], rows.pair[c, 1])
    for k in range(rows.pair[c, 2]):
        row[c, at.LOW + k] = 0.0
        if rows.impact[c, k] != 0.0:
            row[c, at.BIAS + k] = restitution * min(speed_along(row, c, at.NORMAL, at.ARMS + 12 * k, v), 0.0)
    for k in range(5):
        row[c, at.SPENT + k] = 0.0
    for r in range(7):
        row[c, at.IMPULSE + r] = 0.0
