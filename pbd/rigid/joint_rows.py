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
from pbd.rigid.turning import AXES
from pbd.vector import Vector

RESOLVED = 16.0
"""z = h^2 / (m alpha) at which half of a spring is treated as rigid: it turns by 4 rad of its phase in a sub-step."""


class JointRows(NamedTuple):
    """m joints of R rows each.

    pair (m, 2) : bodies i and j; the ground is the last
    row (m, R, columns) : n, m_i, m_j, and I^-1 of both moments
    alpha (m, R) : compliance [m/N]; 0 is rigid
    error (m, R) : C at the present pose
    weight (m, R, R) : K [1/kg]
    mobility (m,) : mean of K's diagonal over the rows that are lengths [1/kg]
    inverse (m, R, R) : (K + soft)^-1 of the present pass, in a tree with K as all that hangs on the joint makes it
    soft, bias (m, R) : of the present pass
    impulse, step, direction (m, R) : of the present pass, the last sweep, and the conjugate direction [N s]
    residual (m, R) : scratch
    force (m, R) : of the last velocity pass [N]
    located (1,) : whether the rows are at the present pose
    """

    pair: np.ndarray
    row: np.ndarray
    alpha: np.ndarray
    error: np.ndarray
    weight: np.ndarray
    mobility: np.ndarray
    inverse: np.ndarray
    soft: np.ndarray
    bias: np.ndarray
    impulse: np.ndarray
    step: np.ndarray
    direction: np.ndarray
    residual: np.ndarray
    force: np.ndarray
    located: np.ndarray


def new_joint_rows(pairs: np.ndarray, alpha: np.ndarray, dimension: int) -> JointRows:
    """Memory for joints of ``pairs`` (m, 2) with the compliances ``alpha`` (m, R)."""
    m, count = alpha.shape
    square, columns = (m, count, count), dimension + 4 * AXES[dimension]
    return JointRows(
        pairs,
        np.zeros((m, count, columns)),
        alpha,
        np.zeros((m, count)),
        np.zeros(square),
        np.zeros(m),
        np.zeros(square),
        *(np.zeros((m, count)) for _ in range(7)),
        np.zeros(1, dtype=np.int64),
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


@device
def set_row(rows, c, r, motion, n, mi, mj):
    """Row r of joint c: its direction n and its moments."""
    row, d, axes = rows.row, len(n), len(mi)
    ti, tj = spun(motion, rows.pair[c, 0], mi), spun(motion, rows.pair[c, 1], mj)
    for k in range(d):
        row[c, r, k] = n[k]
    for k in range(axes):
        row[c, r, d + k], row[c, r, d + axes + k] = mi[k], mj[k]
        row[c, r, d + 2 * axes + k], row[c, r, d + 3 * axes + k] = ti[k], tj[k]


@device
def weigh(rows, c, bodies):
    """K = J M^-1 J^T."""
    row, motion, d = rows.row, bodies.motion, len(bodies.x)
    turns = 2 * (2 * d - 3)
    mass = motion[rows.pair[c, 0], 3 * (d - 1)] + motion[rows.pair[c, 1], 3 * (d - 1)]
    for r in range(row.shape[1]):
        for s in range(r + 1):
            along, about = 0.0, 0.0
            for k in range(d):
                along += row[c, r, k] * row[c, s, k]
            for k in range(turns):
                about += row[c, r, d + k] * row[c, s, d + turns + k]
            rows.weight[c, r, s] = rows.weight[c, s, r] = mass * along + about
    lengths, trace = min(d, row.shape[1]), 0.0
    for r in range(lengths):
        trace += rows.weight[c, r, r]
    rows.mobility[c] = trace / lengths


@device
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


@device
def speeds(rows, c, bodies):
    """residual <- J v."""
    row, motion, d = rows.row, bodies.motion, len(bodies.x)
    i, j, axes = rows.pair[c, 0], rows.pair[c, 1], 2 * d - 3
    for r in range(row.shape[1]):
        total = 0.0
        for k in range(d):
            total += row[c, r, k] * (motion[j, k] - motion[i, k])
        for k in range(axes):
            total += row[c, r, d + axes + k] * motion[j, d + k] - row[c, r, d + k] * motion[i, d + k]
        rows.residual[c, r] = total


@device
def push(rows, c, bodies, p):
    """v <- v + M^-1 J^T p, for p (m, R)."""
    row, motion, d = rows.row, bodies.motion, len(bodies.x)
    i, j, axes, mass = rows.pair[c, 0], rows.pair[c, 1], 2 * d - 3, 3 * (d - 1)
    for k in range(d):
        total = 0.0
        for r in range(row.shape[1]):
            total += p[c, r] * row[c, r, k]
        motion[i, k] -= motion[i, mass] * total
        motion[j, k] += motion[j, mass] * total
    for k in range(axes):
        turn_i, turn_j = 0.0, 0.0
        for r in range(row.shape[1]):
            turn_i += p[c, r] * row[c, r, d + 2 * axes + k]
            turn_j += p[c, r] * row[c, r, d + 3 * axes + k]
        motion[i, d + k] -= turn_i
        motion[j, d + k] += turn_j


@device
def complete(rows, c):
    """residual <- rate + bias + soft p."""
    for r in range(rows.row.shape[1]):
        rows.residual[c, r] += rows.bias[c, r] + rows.soft[c, r] * rows.impulse[c, r]


@device
def solve_alone(rows, c):
    """step <- what makes the residual 0 when nothing else changes."""
    for r in range(rows.row.shape[1]):
        step = 0.0
        for s in range(rows.row.shape[1]):
            step -= rows.inverse[c, r, s] * rows.residual[c, s]
        rows.step[c, r] = step


@device
def take_step(rows, c, bodies):
    """Add the step; the squares of it and of the impulses, by K's diagonal."""
    changed, size = 0.0, 0.0
    for r in range(rows.row.shape[1]):
        step = rows.step[c, r]
        rows.impulse[c, r] += step
        changed += rows.weight[c, r, r] * step * step
        size += rows.weight[c, r, r] * rows.impulse[c, r] * rows.impulse[c, r]
    push(rows, c, bodies, rows.step)
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
