"""The kinds of joints: what each holds, and how that will change in a sub-step.

    shared point   C = (x_j + r_j) - (x_i + r_i)              d rows
    length         C = |(x_j + r_j) - (x_i + r_i)| - L        1 row
    hinge          as a shared point, and a_i . b_j = 0 for an axis a of i and two directions b of j across it

A shared point is pulled at the middle of what it has become, so that forces on both bodies are opposite and in one
line: momentum and angular momentum stay, however far a spring or an unfinished solve leaves it open.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.collision.frames import cross
from pbd.dispatch import stage
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.rigid.joint_rows import moment, set_row
from pbd.rigid.swing import arm, swung
from pbd.vector import Store, Vector, add, dot, load, scale, subtract


@stage(required=True)
def locate(kind, c, rows, bodies):
    """Bring the rows and errors of joint c to the present pose."""


@stage(required=True)
def change(kind, c, rows, bodies, turns, h):
    """residual <- how C will have changed after h, divided by h; ``turns`` of both bodies are from `swing`."""


class SharedPoint(NamedTuple):
    """``arm_i``, ``arm_j``: stores of the point in the frames of both bodies [m]."""

    arm_i: Store
    arm_j: Store

    def locate(self, c, rows, bodies):
        locate_point(self, c, rows, bodies)

    def change(self, c, rows, bodies, turns, h):
        change_point(self, c, rows, bodies, turns, h)


class Length(NamedTuple):
    """``arm_i``, ``arm_j``: the ends in the frames of both bodies [m]; ``length`` (m,) [m]."""

    arm_i: Store
    arm_j: Store
    length: np.ndarray

    def locate(self, c, rows, bodies):
        ri, rj = arms(self, c, rows, bodies)
        away = between(c, rows, bodies, ri, rj)
        length = math.sqrt(dot(away, away))
        rows.error[c, 0] = length - self.length[c]
        if length > 0.0:
            n = scale(1.0 / length, away)
            set_row(rows, c, 0, 0, bodies.motion, n, moment(ri, n))
            set_row(rows, c, 0, 1, bodies.motion, n, moment(rj, n))

    def change(self, c, rows, bodies, turns, h):
        ri, rj = arms(self, c, rows, bodies)
        away, moved = between(c, rows, bodies, ri, rj), motion_between(c, rows, bodies, turns, ri, rj, h)
        after = add(away, moved)
        lengths = math.sqrt(dot(away, away)) + math.sqrt(dot(after, after))
        growth = (2.0 * dot(away, moved) + dot(moved, moved)) / lengths if lengths > 0.0 else 0.0
        rows.residual[c, 0] = growth / h


class Hinge(NamedTuple):
    """A shared point; ``axis`` in the frame of i; ``first`` and ``second``, across it and each other, in that of j."""

    point: SharedPoint
    axis: Store
    first: Store
    second: Store

    def locate(self, c, rows, bodies):
        locate_point(self.point, c, rows, bodies)
        axis = arm(bodies, rows.pair[c, 0], load(self.axis, c))
        set_angle(rows, c, 3, bodies.motion, axis, arm(bodies, rows.pair[c, 1], load(self.first, c)))
        set_angle(rows, c, 4, bodies.motion, axis, arm(bodies, rows.pair[c, 1], load(self.second, c)))

    def change(self, c, rows, bodies, turns, h):
        change_point(self.point, c, rows, bodies, turns, h)
        axis = arm(bodies, rows.pair[c, 0], load(self.axis, c))
        tilt = swung(turns[0], axis)
        first, second = load(self.first, c), load(self.second, c)
        rows.residual[c, 3] = tilting(axis, tilt, arm(bodies, rows.pair[c, 1], first), turns[1]) / h
        rows.residual[c, 4] = tilting(axis, tilt, arm(bodies, rows.pair[c, 1], second), turns[1]) / h


@device
def locate_point(ends, c, rows, bodies):
    ri, rj = arms(ends, c, rows, bodies)
    half = scale(0.5, between(c, rows, bodies, ri, rj))
    ri, rj = add(ri, half), subtract(rj, half)
    for k in range(len(half)):
        n = unit(half, k)
        set_row(rows, c, k, 0, bodies.motion, n, moment(ri, n))
        set_row(rows, c, k, 1, bodies.motion, n, moment(rj, n))
        rows.error[c, k] = 2.0 * half[k]


@device
def change_point(ends, c, rows, bodies, turns, h):
    ri, rj = arms(ends, c, rows, bodies)
    moved = motion_between(c, rows, bodies, turns, ri, rj, h)
    for k in range(len(moved)):
        rows.residual[c, k] = moved[k] / h


@device
def arms(ends, c, rows, bodies):
    """(r_i, r_j) in the world's frame."""
    return arm(bodies, rows.pair[c, 0], load(ends.arm_i, c)), arm(bodies, rows.pair[c, 1], load(ends.arm_j, c))


@device
def between(c, rows, bodies, ri, rj):
    """(x_j + r_j) - (x_i + r_i)."""
    i, j = rows.pair[c, 0], rows.pair[c, 1]
    return add(subtract(load(bodies.x, j), load(bodies.x, i)), subtract(rj, ri))


@device
def motion_between(c, rows, bodies, turns, ri, rj, h):
    """How far the end of j will have moved after h, less that of i."""
    turned = subtract(swung(turns[1], rj), swung(turns[0], ri))
    return add(turned, scale(h, velocity(bodies.x, bodies.motion, rows.pair[c, 0], rows.pair[c, 1], 0)))


@device
def set_angle(rows, c, r, motion, axis, across):
    about = cross(across, axis)
    set_row(rows, c, r, 0, motion, (0.0, 0.0, 0.0), about)
    set_row(rows, c, r, 1, motion, (0.0, 0.0, 0.0), about)
    rows.error[c, r] = dot(axis, across)


@device
def tilting(a, da, b, turn):
    """(a + da) . (b + db) - a . b."""
    db = swung(turn, b)
    return dot(da, b) + dot(a, db) + dot(da, db)


def unit(x: Vector, k: int) -> Vector:
    """The unit vector along axis k, of the dimension of x."""
    return tuple(1.0 if k == axis else 0.0 for axis in range(len(x)))


@typed(unit)
def _unit(x: Any, k: Any) -> Any:
    if len(x) == 1:
        return lambda x, k: (1.0 if k == 0 else 0.0,)
    return lambda x, k: (1.0 if k == 0 else 0.0,) + unit(x[1:], k - 1)


def velocity(x: Store, motion: np.ndarray, i: int, j: int, k: int) -> Vector:
    """The velocity of body j less that of i, from component k on."""
    return tuple(motion[j, k + axis] - motion[i, k + axis] for axis in range(len(x)))


@typed(velocity)
def _velocity(x: Any, motion: Any, i: Any, j: Any, k: Any) -> Any:
    if len(x) == 1:
        return lambda x, motion, i, j, k: (motion[j, k] - motion[i, k],)
    return lambda x, motion, i, j, k: (motion[j, k] - motion[i, k],) + velocity(x[1:], motion, i, j, k + 1)
