"""The kinds of joints: what each holds, and how that will change in a sub-step.

    shared point   C = (x_j + r_j) - (x_i + r_i)              d rows
    length         C = |(x_j + r_j) - (x_i + r_i)| - L        1 row
    hinge          as a shared point, and a_i . b_j = 0 for an axis a of i and two directions b of j across it

A rigid point that an unfinished solve has left open is pulled together at its middle, so that angular momentum stays.
That of a compliant one, which is pulled at both ends, stays as far as a sub-step resolves it, (1 - s) from round-off.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.collision.frames import cross
from pbd.dispatch import stage
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.rigid.joint_rows import ALPHA, ERROR, RESIDUAL, moment, set_row
from pbd.rigid.swing import arm, swung
from pbd.vector import Store, Vector, add, dot, load, scale, subtract


@stage(required=True)
def locate(kind, c, rows, bodies):
    """Bring the rows and errors of joint c to the present pose."""


@stage(required=True)
def change(kind, c, rows, bodies, turns, h):
    """RESIDUAL <- how C will have changed after h, divided by h; ``turns`` of both bodies are from `swing`."""


class SharedPoint(NamedTuple):
    """``local`` (m, 2 d) : the point in the frames of both bodies [m]."""

    local: np.ndarray

    def locate(self, c, rows, bodies):
        locate_point(self.local, c, rows, bodies)

    def change(self, c, rows, bodies, turns, h):
        change_point(self.local, c, rows, bodies, turns, h)


class Length(NamedTuple):
    """``local`` (m, 2 d + 1) : the ends in the frames of both bodies, and the length [m]."""

    local: np.ndarray

    def locate(self, c, rows, bodies):
        ri, rj = arms(self.local, c, rows, bodies)
        away = between(c, rows, bodies, ri, rj)
        length = math.sqrt(dot(away, away))
        rows.number[ERROR, c, 0] = length - self.local[c, 2 * len(away)]
        if length > 0.0:
            n = scale(1.0 / length, away)
            set_row(rows, c, 0, 0, bodies.motion, n, moment(ri, n))
            set_row(rows, c, 0, 1, bodies.motion, n, moment(rj, n))

    def change(self, c, rows, bodies, turns, h):
        ri, rj = arms(self.local, c, rows, bodies)
        away, moved = between(c, rows, bodies, ri, rj), motion_between(c, rows, bodies, turns, ri, rj, h)
        after = add(away, moved)
        lengths = math.sqrt(dot(away, away)) + math.sqrt(dot(after, after))
        growth = (2.0 * dot(away, moved) + dot(moved, moved)) / lengths if lengths > 0.0 else 0.0
        rows.number[RESIDUAL, c, 0] = growth / h


class Hinge(NamedTuple):
    """``local`` (m, 15) : as of a shared point; an axis in the frame of i; two across it and each other in j's."""

    local: np.ndarray

    def locate(self, c, rows, bodies):
        locate_point(self.local, c, rows, bodies)
        axis = direction(self.local, c, rows, bodies, 0, 6)
        for k in range(2):
            across = direction(self.local, c, rows, bodies, 1, 9 + 3 * k)
            about = cross(across, axis)
            rows.number[ERROR, c, 3 + k] = dot(axis, across)
            for side in range(2):
                set_row(rows, c, 3 + k, side, bodies.motion, (0.0, 0.0, 0.0), about)

    def change(self, c, rows, bodies, turns, h):
        change_point(self.local, c, rows, bodies, turns, h)
        axis = direction(self.local, c, rows, bodies, 0, 6)
        tilt = swung(turns[0], axis)
        for k in range(2):
            across = direction(self.local, c, rows, bodies, 1, 9 + 3 * k)
            turn = swung(turns[1], across)
            rows.number[RESIDUAL, c, 3 + k] = (dot(tilt, across) + dot(axis, turn) + dot(tilt, turn)) / h


@device
def locate_point(local, c, rows, bodies):
    ri, rj = arms(local, c, rows, bodies)
    gap = between(c, rows, bodies, ri, rj)
    if rows.number[ALPHA, c, 0] == 0.0:
        ri, rj = add(ri, scale(0.5, gap)), subtract(rj, scale(0.5, gap))
    for k in range(len(gap)):
        n = unit(gap, k)
        set_row(rows, c, k, 0, bodies.motion, n, moment(ri, n))
        set_row(rows, c, k, 1, bodies.motion, n, moment(rj, n))
        rows.number[ERROR, c, k] = gap[k]


@device
def change_point(local, c, rows, bodies, turns, h):
    ri, rj = arms(local, c, rows, bodies)
    moved = motion_between(c, rows, bodies, turns, ri, rj, h)
    for k in range(len(moved)):
        rows.number[RESIDUAL, c, k] = moved[k] / h


@device
def arms(local, c, rows, bodies):
    """(r_i, r_j) in the world's frame."""
    return direction(local, c, rows, bodies, 0, 0), direction(local, c, rows, bodies, 1, len(bodies.x))


@device
def direction(local, c, rows, bodies, side, k):
    """The vector that stands from column k on, fixed in one of the bodies, in the world's frame."""
    return arm(bodies, rows.pair[c, side], components(bodies.x, local, c, k))


@device
def between(c, rows, bodies, ri, rj):
    """(x_j + r_j) - (x_i + r_i)."""
    i, j = rows.pair[c, 0], rows.pair[c, 1]
    return add(subtract(load(bodies.x, j), load(bodies.x, i)), subtract(rj, ri))


@device
def motion_between(c, rows, bodies, turns, ri, rj, h):
    """How far the end of j will have moved after h, less that of i."""
    i, j, motion = rows.pair[c, 0], rows.pair[c, 1], bodies.motion
    speed = subtract(components(bodies.x, motion, j, 0), components(bodies.x, motion, i, 0))
    return add(scale(h, speed), subtract(swung(turns[1], rj), swung(turns[0], ri)))


def unit(x: Vector, k: int) -> Vector:
    """The unit vector along axis k, of the dimension of x."""
    return tuple(1.0 if k == axis else 0.0 for axis in range(len(x)))


@typed(unit)
def _unit(x: Any, k: Any) -> Any:
    if len(x) == 1:
        return lambda x, k: (1.0 if k == 0 else 0.0,)
    return lambda x, k: (1.0 if k == 0 else 0.0,) + unit(x[1:], k - 1)


def components(x: Store, table: np.ndarray, i: int, k: int) -> Vector:
    """As many numbers as x has axes, of row i of a table from column k on."""
    return tuple(table[i, k + axis] for axis in range(len(x)))


@typed(components)
def _components(x: Any, table: Any, i: Any, k: Any) -> Any:
    if len(x) == 1:
        return lambda x, table, i, k: (table[i, k],)
    return lambda x, table, i, k: (table[i, k],) + components(x[1:], table, i, k + 1)
