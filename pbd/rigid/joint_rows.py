"""The rows of a joint, solved as one block: what joints of all kinds share.

A joint holds R constraints C = 0 between bodies i and j. A row's gradient is a direction n and two moments,

    J v = n . (v_j - v_i) + m_j . w_j - m_i . w_i,

and its impulse pushes both bodies by M^-1 J^T p. Whatever the pass, the impulses of a joint obey, with K = J M^-1 J^T,

    rate + bias + soft p = 0,      dp = -(K + soft)^-1 (rate + bias + soft p),

where the rate is J v in a velocity pass, and in a position pass how C will change over the sub-step, divided by h.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.collision.frames import cross
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.rigid.pass_3d import accelerated
from pbd.routine import routine
from pbd.vector import Vector

RESOLVED = 16.0
"""z = h^2 / (m alpha) at which half of a spring is treated as rigid: it turns by 4 rad of its phase in a sub-step."""


NUMBERS = 10
ALPHA, ERROR, MOBILITY, SOFT, BIAS, IMPULSE, STEP, DIRECTION, RESIDUAL, FORCE = range(NUMBERS)
"""Places in `JointRows.number`: compliance [m/N]; C at the present pose; mean of K's diagonal over the rows that are
lengths [1/kg], 0 before the first step; softness and bias of the pass; its impulses, those of the last sweep, and the
conjugate direction [N s]; rate + bias + soft p; the force of the last velocity pass [N]."""

GRADIENT, ANSWER = range(2)
"""Places in `JointRows.lever`: J and M^-1 J^T."""

WEIGHT, INVERSE, JOINED = range(3)
"""Places in `JointRows.square`: K; (K + soft)^-1 of the pass, in a tree with K as what hangs on the joint makes it; and
scratch. Few arrays of many dimensions compile faster than many."""


class JointRows(NamedTuple):
    """m joints of R rows each, between bodies of N = 3 or 6 velocities: of motion and spin.

    pair (m, 2) : bodies i and j; the ground is the last
    number (NUMBERS, m, R) : what there is one of in each row
    lever (2, m, 2, R, N) : of both bodies
    square (3, m, R, R)
    """

    pair: np.ndarray
    number: np.ndarray
    lever: np.ndarray
    square: np.ndarray


def new_joint_rows(pairs: np.ndarray, alpha: np.ndarray, velocities: int) -> JointRows:
    """Memory for joints of ``pairs`` (m, 2) with the compliances ``alpha`` (m, R)."""
    m, count = alpha.shape
    number = np.zeros((NUMBERS, m, count))
    number[ALPHA] = alpha
    return JointRows(pairs, number, np.zeros((2, m, 2, count, velocities)), np.zeros((3, m, count, count)))


# ------------------------------------------------------------------ rows and K at a pose


def moment(r: Vector, n: Vector) -> Vector:
    """r x n, of 1 or 3 components."""
    return (r[0] * n[1] - r[1] * n[0],) if len(r) == 2 else cross(r, n)


@typed(moment)
def _moment(r: Any, n: Any) -> Any:
    if len(r) == 2:
        return lambda r, n: (r[0] * n[1] - r[1] * n[0],)
    return lambda r, n: cross(r, n)


def spun(motion: np.ndarray, i: int, m: Vector) -> Vector:
    """I^-1 m."""
    return (motion[i, 4] * m[0],) if len(m) == 1 else accelerated(motion, i, m)


@typed(spun)
def _spun(motion: Any, i: Any, m: Any) -> Any:
    if len(m) == 1:
        return lambda motion, i, m: (motion[i, 4] * m[0],)
    return lambda motion, i, m: accelerated(motion, i, m)


@routine
def set_row(rows, c, r, side, motion, n, m):
    """Row r of joint c, of its first (side 0) or second body: direction n and moment m, negative for the first."""
    i, d, lever = rows.pair[c, side], len(n), rows.lever
    turn, sign = spun(motion, i, m), 2.0 * side - 1.0
    for k in range(d):
        lever[GRADIENT, c, side, r, k] = sign * n[k]
        lever[ANSWER, c, side, r, k] = sign * motion[i, 3 * (d - 1)] * n[k]
    for k in range(len(m)):
        lever[GRADIENT, c, side, r, d + k] = sign * m[k]
        lever[ANSWER, c, side, r, d + k] = sign * turn[k]


@routine
def weigh(rows, c, lengths):
    """K = J M^-1 J^T; the first so many rows are lengths."""
    trace, lever, count = 0.0, rows.lever, rows.square.shape[2]
    for r in range(count):
        for s in range(r + 1):
            total = 0.0
            for side in range(2):
                for k in range(lever.shape[4]):
                    total += lever[GRADIENT, c, side, r, k] * lever[ANSWER, c, side, s, k]
            rows.square[WEIGHT, c, r, s] = rows.square[WEIGHT, c, s, r] = total
        if r < lengths:
            trace += rows.square[WEIGHT, c, r, r]
    for r in range(count):
        rows.number[MOBILITY, c, r] = trace / min(lengths, count)


@routine
def invert(square, k, c):
    """One matrix <- its inverse, by Gauss and Jordan; it is symmetric and positive, and so needs no pivots."""
    count = square.shape[2]
    for p in range(count):
        pivot = 1.0 / square[k, c, p, p]
        square[k, c, p, p] = 1.0
        for s in range(count):
            square[k, c, p, s] *= pivot
        for r in range(count):
            if r != p:
                factor = square[k, c, r, p]
                square[k, c, r, p] = 0.0
                for s in range(count):
                    square[k, c, r, s] -= factor * square[k, c, p, s]


# ------------------------------------------------------------------ velocities


@routine
def speeds(rows, c, motion):
    """RESIDUAL <- J v."""
    lever, number = rows.lever, rows.number
    for r in range(number.shape[2]):
        number[RESIDUAL, c, r] = 0.0
        for side in range(2):
            i = rows.pair[c, side]
            for k in range(lever.shape[4]):
                number[RESIDUAL, c, r] += lever[GRADIENT, c, side, r, k] * motion[i, k]


@routine
def push(rows, c, motion):
    """v <- v + M^-1 J^T STEP."""
    lever, number = rows.lever, rows.number
    for side in range(2):
        i = rows.pair[c, side]
        for r in range(number.shape[2]):
            for k in range(lever.shape[4]):
                motion[i, k] += lever[ANSWER, c, side, r, k] * number[STEP, c, r]


@routine
def complete(number, c):
    """RESIDUAL, from the rate."""
    for r in range(number.shape[2]):
        number[RESIDUAL, c, r] += number[BIAS, c, r] + number[SOFT, c, r] * number[IMPULSE, c, r]


@routine
def solve_alone(number, square, c):
    """STEP <- -INVERSE RESIDUAL."""
    for r in range(number.shape[2]):
        step = 0.0
        for s in range(number.shape[2]):
            step -= square[INVERSE, c, r, s] * number[RESIDUAL, c, s]
        number[STEP, c, r] = step


@routine
def take_step(rows, c, motion):
    """Add the step; the squares of it and of the impulses, by K's diagonal."""
    changed, size, number = 0.0, 0.0, rows.number
    for r in range(number.shape[2]):
        number[IMPULSE, c, r] += number[STEP, c, r]
        changed += rows.square[WEIGHT, c, r, r] * number[STEP, c, r] ** 2
        size += rows.square[WEIGHT, c, r, r] * number[IMPULSE, c, r] ** 2
    push(rows, c, motion)
    return changed, size


# ------------------------------------------------------------------ what a spring is


@device
def softness(number, c, r, h):
    """D = w (RESOLVED/z)^2, z = h^2 w/alpha, w the mobility: 0 for a rigid row, large where a spring is resolved."""
    scaled = RESOLVED * number[ALPHA, c, r] / (h * h)
    return scaled * scaled / number[MOBILITY, c, r]


@device
def springiness(number, c, r, h):
    """s = D/(w + D): from 0 for a rigid row to 1."""
    soft = softness(number, c, r, h)
    return soft / (number[MOBILITY, c, r] + soft)
