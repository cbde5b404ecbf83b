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


class JointRows(NamedTuple):
    """m joints of R rows each, between bodies of N = 3 or 6 velocities: of motion and spin.

    pair (m, 2) : bodies i and j; the ground is the last
    gradient, answer (m, 2, R, N) : J and M^-1 J^T, of both bodies
    alpha (m, R) : compliance [m/N]; 0 is rigid
    error (m, R) : C at the present pose
    weight (m, R, R) : K [1/kg]
    inverse (m, R, R) : (K + soft)^-1 of the present pass, in a tree with K as all that hangs on the joint makes it
    mobility (m,) : mean of K's diagonal over the rows that are lengths [1/kg]
    soft, bias (m, R) : of the present pass
    impulse, step, direction (m, R) : of the present pass, the last sweep, and the conjugate direction [N s]
    residual (m, R) : rate + bias + soft p
    force (m, R) : of the last velocity pass [N]
    located (1,) : whether the rows are at the present pose
    """

    pair: np.ndarray
    gradient: np.ndarray
    answer: np.ndarray
    alpha: np.ndarray
    error: np.ndarray
    weight: np.ndarray
    inverse: np.ndarray
    mobility: np.ndarray
    soft: np.ndarray
    bias: np.ndarray
    impulse: np.ndarray
    step: np.ndarray
    direction: np.ndarray
    residual: np.ndarray
    force: np.ndarray
    located: np.ndarray


def new_joint_rows(pairs: np.ndarray, alpha: np.ndarray, velocities: int) -> JointRows:
    """Memory for joints of ``pairs`` (m, 2) with the compliances ``alpha`` (m, R)."""
    m, count = alpha.shape
    sides, square = (m, 2, count, velocities), (m, count, count)
    names = "error", "soft", "bias", "impulse", "step", "direction", "residual", "force"
    return JointRows(
        pair=pairs,
        gradient=np.zeros(sides),
        answer=np.zeros(sides),
        alpha=alpha,
        weight=np.zeros(square),
        inverse=np.zeros(square),
        mobility=np.zeros(m),
        located=np.zeros(1, dtype=np.int64),
        **{name: np.zeros((m, count)) for name in names},
    )


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
    i, d = rows.pair[c, side], len(n)
    turn, sign = spun(motion, i, m), 2.0 * side - 1.0
    for k in range(d):
        rows.gradient[c, side, r, k] = sign * n[k]
        rows.answer[c, side, r, k] = sign * motion[i, 3 * (d - 1)] * n[k]
    for k in range(len(m)):
        rows.gradient[c, side, r, d + k] = sign * m[k]
        rows.answer[c, side, r, d + k] = sign * turn[k]


@routine
def weigh(rows, c, lengths):
    """K = J M^-1 J^T; the first so many rows are lengths."""
    trace, count = 0.0, rows.weight.shape[1]
    for r in range(count):
        for s in range(r + 1):
            total = 0.0
            for k in range(rows.gradient.shape[3]):
                total += rows.gradient[c, 0, r, k] * rows.answer[c, 0, s, k]
                total += rows.gradient[c, 1, r, k] * rows.answer[c, 1, s, k]
            rows.weight[c, r, s] = rows.weight[c, s, r] = total
        if r < lengths:
            trace += rows.weight[c, r, r]
    rows.mobility[c] = trace / min(lengths, count)


@routine
def invert(a, c):
    """Matrix a_c <- its inverse, by Gauss and Jordan; it is symmetric and positive, and so needs no pivots."""
    for k in range(a.shape[1]):
        pivot = 1.0 / a[c, k, k]
        a[c, k, k] = 1.0
        for s in range(a.shape[1]):
            a[c, k, s] *= pivot
        for r in range(a.shape[1]):
            if r != k:
                factor = a[c, r, k]
                a[c, r, k] = 0.0
                for s in range(a.shape[1]):
                    a[c, r, s] -= factor * a[c, k, s]


# ------------------------------------------------------------------ velocities


@routine
def speeds(rows, c, motion):
    """residual <- J v."""
    i, j = rows.pair[c, 0], rows.pair[c, 1]
    for r in range(rows.step.shape[1]):
        total = 0.0
        for k in range(rows.gradient.shape[3]):
            total += rows.gradient[c, 0, r, k] * motion[i, k] + rows.gradient[c, 1, r, k] * motion[j, k]
        rows.residual[c, r] = total


@routine
def push(rows, c, motion):
    """v <- v + M^-1 J^T step."""
    for side in range(2):
        i = rows.pair[c, side]
        for k in range(rows.answer.shape[3]):
            total = 0.0
            for r in range(rows.step.shape[1]):
                total += rows.answer[c, side, r, k] * rows.step[c, r]
            motion[i, k] += total


@routine
def complete(rows, c):
    """residual <- rate + bias + soft p."""
    for r in range(rows.step.shape[1]):
        rows.residual[c, r] += rows.bias[c, r] + rows.soft[c, r] * rows.impulse[c, r]


@routine
def solve_alone(rows, c):
    """step <- -inverse residual."""
    for r in range(rows.step.shape[1]):
        step = 0.0
        for s in range(rows.step.shape[1]):
            step -= rows.inverse[c, r, s] * rows.residual[c, s]
        rows.step[c, r] = step


@routine
def take_step(rows, c, motion):
    """Add the step; the squares of it and of the impulses, by K's diagonal."""
    changed, size = 0.0, 0.0
    for r in range(rows.step.shape[1]):
        step = rows.step[c, r]
        rows.impulse[c, r] += step
        changed += rows.weight[c, r, r] * step * step
        size += rows.weight[c, r, r] * rows.impulse[c, r] * rows.impulse[c, r]
    push(rows, c, motion)
    return changed, size


# ------------------------------------------------------------------ what a spring is


@device
def softness(rows, c, r, h):
    """D = w (RESOLVED/z)^2, z = h^2 w/alpha, w the mobility: 0 for a rigid row, large where a spring is resolved."""
    if rows.alpha[c, r] == 0.0:
        return 0.0
    scaled = RESOLVED * rows.alpha[c, r] / (h * h)
    return scaled * scaled / rows.mobility[c]


@device
def springiness(rows, c, r, h):
    """s = D/(w + D): from 0 for a rigid row to 1."""
    soft = softness(rows, c, r, h)
    return soft / (rows.mobility[c] + soft)
