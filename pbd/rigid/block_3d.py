"""The contact of two bodies in space: up to four normals, and friction of the whole contact - a slip and a twist.

Unknown are the impulses p_k >= 0 of the normals, a tangential one t with |t| <= mu P and a moment s about the normal
with |s| <= mu sum_k p_k d_k, where P = sum p_k and d_k is the distance of point k from the contact's middle: one budget
of friction, at the middle. For a pure slip and for a pure twist this is what friction at every point would be; where
both happen at once it allows up to sqrt 2 times as much.

Where all points push and stick the solution is exact (`pbd.rigid.inverse_3d`). Else normals, slip and twist are solved
one after the other, PASSES times, on velocities held in registers. A slip that sticks is then solved exactly; one that
slides moves along the gradient, whose fixed point opposes t to the velocity of slip.
"""

from __future__ import annotations

import math

from pbd.jit import device

PASSES = 2
"""Rounds over the rows of one contact in a projection."""

POINTS = 4

# Columns of `Rows.row`: directions, then 12 numbers a row - the arms' moments r_i x n, r_j x n and I^-1 of them -
# for four normals, two tangents and the twist; then scalars of each row.
NORMAL, TANGENT, BINORMAL = 0, 3, 6
ARMS = 9
SLIP = ARMS + 12 * POINTS
TWIST = SLIP + 24
IMPULSE = TWIST + 12
BIAS = IMPULSE + 7
INVERSE = BIAS + 7
LOW = INVERSE + 7
CHANGE = LOW + 4
DIRECTION = CHANGE + 7
DISTANCE = DIRECTION + 7
SPENT = DISTANCE + 4
COUPLING = SPENT + 5
WHOLE = COUPLING + 1
PROBES = WHOLE + 28
COLUMNS = PROBES + 2

ROWS = 7
"""Of a contact: four normals, two tangents, the twist."""


@device
def speed_along(row, c, direction, arms, v):
    """J v of one row; v are velocities and spins of both bodies."""
    x, y, z = row[c, direction], row[c, direction + 1], row[c, direction + 2]
    return (
        x * (v[6] - v[0])
        + y * (v[7] - v[1])
        + z * (v[8] - v[2])
        + row[c, arms + 3] * v[9]
        + row[c, arms + 4] * v[10]
        + row[c, arms + 5] * v[11]
        - row[c, arms] * v[3]
        - row[c, arms + 1] * v[4]
        - row[c, arms + 2] * v[5]
    )


@device
def twist_speed(row, c, v):
    """The spin of j less that of i, about the normal."""
    return row[c, 0] * (v[9] - v[3]) + row[c, 1] * (v[10] - v[4]) + row[c, 2] * (v[11] - v[5])


@device
def pushed(row, c, direction, arms, p, mi, mj, v):
    """v + M^-1 J^T p of one row."""
    x, y, z = p * row[c, direction], p * row[c, direction + 1], p * row[c, direction + 2]
    vi = v[0] - mi * x, v[1] - mi * y, v[2] - mi * z
    vj = v[6] + mj * x, v[7] + mj * y, v[8] + mj * z
    return vi + turned(row, c, arms + 6, -p, v[3], v[4], v[5]) + vj + turned(row, c, arms + 9, p, v[9], v[10], v[11])


@device
def turned(row, c, column, p, x, y, z):
    return x + p * row[c, column], y + p * row[c, column + 1], z + p * row[c, column + 2]


@device
def twisted(row, c, p, v):
    """v + M^-1 J^T p of the twist."""
    wi = turned(row, c, TWIST + 6, -p, v[3], v[4], v[5])
    wj = turned(row, c, TWIST + 9, p, v[9], v[10], v[11])
    return v[0:3] + wi + v[6:9] + wj


@device
def both_motions(motion, i, j):
    return (
        motion[i, 0],
        motion[i, 1],
        motion[i, 2],
        motion[i, 3],
        motion[i, 4],
        motion[i, 5],
        motion[j, 0],
        motion[j, 1],
        motion[j, 2],
        motion[j, 3],
        motion[j, 4],
        motion[j, 5],
    )


@device
def set_both_motions(motion, i, j, v):
    """The ground is written too: nothing can have moved it."""
    motion[i, 0], motion[i, 1], motion[i, 2] = v[0], v[1], v[2]
    motion[i, 3], motion[i, 4], motion[i, 5] = v[3], v[4], v[5]
    motion[j, 0], motion[j, 1], motion[j, 2] = v[6], v[7], v[8]
    motion[j, 3], motion[j, 4], motion[j, 5] = v[9], v[10], v[11]


@device
def solve_block(row, c, points, motion, i, j, mu):
    """One projection of contact c; returns the squares of its change and of its impulses, by K's diagonal."""
    v = both_motions(motion, i, j)
    if is_open(row, c, points, v):
        for r in range(ROWS):
            row[c, CHANGE + r] = 0.0
        return 0.0, 0.0
    mi, mj = motion[i, 6], motion[j, 6]
    if sticks(row, c, points, v, mu):
        set_both_motions(motion, i, j, pushed_all(row, c, points, mi, mj, CHANGE, v))
        for r in range(ROWS):
            row[c, IMPULSE + r] += row[c, CHANGE + r]
    else:
        for r in range(ROWS):
            row[c, CHANGE + r] = row[c, IMPULSE + r]
        for _ in range(PASSES):
            v = one_after_the_other(row, c, points, mi, mj, mu, v)
        set_both_motions(motion, i, j, v)
        for r in range(ROWS):
            row[c, CHANGE + r] = row[c, IMPULSE + r] - row[c, CHANGE + r]
    changed, size = 0.0, 0.0
    for r in range(ROWS):
        if row[c, INVERSE + r] > 0.0:
            changed += row[c, CHANGE + r] ** 2 / row[c, INVERSE + r]
            size += row[c, IMPULSE + r] ** 2 / row[c, INVERSE + r]
    return changed, size


@device
def is_open(row, c, points, v):
    """Whether nothing pushes, nothing closes, and nothing may be taken back."""
    for r in range(ROWS):
        if row[c, IMPULSE + r] != 0.0:
            return False
    for k in range(points):
        if row[c, LOW + k] != 0.0:
            return False
    least = 0.0
    for k in range(points):
        least = min(least, speed_along(row, c, NORMAL, ARMS + 12 * k, v) + row[c, BIAS + k])
    return least == 0.0


@device
def sticks(row, c, points, v, mu):
    """Whether the impulses that make all points stick obey the laws; their changes are left in CHANGE."""
    u = (
        speed_along(row, c, NORMAL, ARMS, v) + row[c, BIAS],
        speed_along(row, c, NORMAL, ARMS + 12, v) + row[c, BIAS + 1] if points > 1 else 0.0,
        speed_along(row, c, NORMAL, ARMS + 24, v) + row[c, BIAS + 2] if points > 2 else 0.0,
        speed_along(row, c, NORMAL, ARMS + 36, v) + row[c, BIAS + 3] if points > 3 else 0.0,
        speed_along(row, c, TANGENT, SLIP, v) + row[c, BIAS + 4],
        speed_along(row, c, BINORMAL, SLIP + 12, v) + row[c, BIAS + 5],
        twist_speed(row, c, v) + row[c, BIAS + 6],
    )
    for r in range(ROWS):
        total = 0.0
        for s in range(ROWS):
            low, high = min(r, s), max(r, s)
            total -= row[c, WHOLE + high * (high + 1) // 2 + low] * u[s]
        row[c, CHANGE + r] = total
    total, lever = row[c, SPENT], row[c, SPENT + 3]
    for k in range(points):
        p = row[c, IMPULSE + k] + row[c, CHANGE + k]
        if p < row[c, LOW + k]:
            return False
        total += p
        lever += p * row[c, DISTANCE + k]
    t1 = row[c, IMPULSE + 4] + row[c, CHANGE + 4] + row[c, SPENT + 1]
    t2 = row[c, IMPULSE + 5] + row[c, CHANGE + 5] + row[c, SPENT + 2]
    twist = row[c, IMPULSE + 6] + row[c, CHANGE + 6] + row[c, SPENT + 4]
    return t1 * t1 + t2 * t2 <= (mu * total) ** 2 and abs(twist) <= mu * lever


@device
def one_after_the_other(row, c, points, mi, mj, mu, v):
    """Normals, slip and twist; returns the motions after them."""
    total, lever = row[c, SPENT], row[c, SPENT + 3]
    for k in range(points):
        arms = ARMS + 12 * k
        old = row[c, IMPULSE + k]
        new = old - row[c, INVERSE + k] * (speed_along(row, c, NORMAL, arms, v) + row[c, BIAS + k])
        new = max(new, row[c, LOW + k])
        row[c, IMPULSE + k] = new
        v = pushed(row, c, NORMAL, arms, new - old, mi, mj, v)
        total += new
        lever += new * row[c, DISTANCE + k]
    first, second = row[c, IMPULSE + 4], row[c, IMPULSE + 5]
    next_first, next_second = slip(row, c, v, mu * max(total, 0.0))
    row[c, IMPULSE + 4], row[c, IMPULSE + 5] = next_first, next_second
    v = pushed(row, c, TANGENT, SLIP, next_first - first, mi, mj, v)
    v = pushed(row, c, BINORMAL, SLIP + 12, next_second - second, mi, mj, v)
    old, limit, spent = row[c, IMPULSE + 6], mu * max(lever, 0.0), row[c, SPENT + 4]
    new = old - row[c, INVERSE + 6] * (twist_speed(row, c, v) + row[c, BIAS + 6])
    new = max(-limit, min(limit, new + spent)) - spent
    row[c, IMPULSE + 6] = new
    return twisted(row, c, new - old, v)


@device
def slip(row, c, v, limit):
    """The tangential impulses: what sticks, or else a step of the projected gradient on the disc of friction."""
    first, second = row[c, IMPULSE + 4], row[c, IMPULSE + 5]
    u1 = speed_along(row, c, TANGENT, SLIP, v) + row[c, BIAS + 4]
    u2 = speed_along(row, c, BINORMAL, SLIP + 12, v) + row[c, BIAS + 5]
    k11, k22, k12 = 1.0 / row[c, INVERSE + 4], 1.0 / row[c, INVERSE + 5], row[c, COUPLING]
    inverse = 1.0 / (k11 * k22 - k12 * k12)
    spent1, spent2 = row[c, SPENT + 1], row[c, SPENT + 2]
    t1, t2 = first - inverse * (k22 * u1 - k12 * u2) + spent1, second - inverse * (k11 * u2 - k12 * u1) + spent2
    square = t1 * t1 + t2 * t2
    if square > limit * limit:
        step = 1.0 / max(k11, k22)
        t1, t2 = first - step * u1 + spent1, second - step * u2 + spent2
        square = t1 * t1 + t2 * t2
        if square > limit * limit:
            scale = limit / math.sqrt(square)
            t1, t2 = scale * t1, scale * t2
    return t1 - spent1, t2 - spent2


@device
def pushed_all(row, c, points, mi, mj, column, v):
    """v + M^-1 J^T p for the impulses in columns from ``column`` on."""
    for k in range(points):
        v = pushed(row, c, NORMAL, ARMS + 12 * k, row[c, column + k], mi, mj, v)
    v = pushed(row, c, TANGENT, SLIP, row[c, column + 4], mi, mj, v)
    v = pushed(row, c, BINORMAL, SLIP + 12, row[c, column + 5], mi, mj, v)
    return twisted(row, c, row[c, column + 6], v)


@device
def push_bodies(row, c, points, motion, i, j, column):
    """Push both bodies by the impulses in columns from ``column`` on."""
    v = both_motions(motion, i, j)
    set_both_motions(motion, i, j, pushed_all(row, c, points, motion[i, 6], motion[j, 6], column, v))
