"""How the arms of a body turn in a sub-step, before it does: (R - 1) r, as `pbd.rigid.turning` will turn it.

A constraint that is to hold at the end of a sub-step is evaluated there. The difference is formed, not the turned arm,
so that little is lost to round-off where little turns.
"""

from __future__ import annotations

import math
from typing import Any

from pbd.collision.frames import cross
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.rigid.turning import EQUAL, LARGEST_TURN, half_turn, modified, product, to_body, to_world, turned_back
from pbd.routine import routine


def swing(bodies: Any, i: int, h: float) -> Any:
    """The turn of body i in h under its present spin: (cos - 1, sin), or a unit quaternion in the world's frame."""
    return swing_in_plane(bodies, i, h) if len(bodies.x) == 2 else swing_in_space(bodies, i, h)


@typed(swing)
def _swing(bodies: Any, i: Any, h: Any) -> Any:
    if len(bodies.types[0]) == 2:
        return lambda bodies, i, h: swing_in_plane(bodies, i, h)
    return lambda bodies, i, h: swing_in_space(bodies, i, h)


def swung(turn: Any, r: Any) -> Any:
    """(R - 1) r for a turn from `swing`."""
    return swung_in_plane(turn, r) if len(r) == 2 else swung_in_space(turn, r)


@typed(swung)
def _swung(turn: Any, r: Any) -> Any:
    if len(r) == 2:
        return lambda turn, r: swung_in_plane(turn, r)
    return lambda turn, r: swung_in_space(turn, r)


def arm(bodies: Any, i: int, r: Any) -> Any:
    """An arm fixed in body i, in the world's frame."""
    return arm_in_plane(bodies, i, r) if len(r) == 2 else to_world(bodies.frame, i, r)


@typed(arm)
def _arm(bodies: Any, i: Any, r: Any) -> Any:
    if len(r) == 2:
        return lambda bodies, i, r: arm_in_plane(bodies, i, r)
    return lambda bodies, i, r: to_world(bodies.frame, i, r)


@device
def arm_in_plane(bodies, i, r):
    c, s = bodies.frame[i, 0], bodies.frame[i, 1]
    return c * r[0] - s * r[1], s * r[0] + c * r[1]


@device
def swing_in_plane(bodies, i, h):
    angle = h * bodies.motion[i, 2]
    half = math.sin(0.5 * angle)
    return -2.0 * half * half, math.sin(angle)


@device
def swung_in_plane(turn, r):
    return turn[0] * r[0] - turn[1] * r[1], turn[1] * r[0] + turn[0] * r[1]


@routine
def swing_in_space(bodies, i, h):
    spin = bodies.motion[i, 3], bodies.motion[i, 4], bodies.motion[i, 5]
    square = spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]
    if square == 0.0:
        return 1.0, 0.0, 0.0, 0.0
    rate = math.sqrt(square)
    moments = bodies.inertia[0][i], bodies.inertia[1][i], bodies.inertia[2][i]
    most, least = max(moments[0], moments[1], moments[2]), min(moments[0], moments[1], moments[2])
    if most - least <= EQUAL * most:
        s = math.sin(0.5 * h * rate) / rate
        return math.cos(0.5 * h * rate), s * spin[0], s * spin[1], s * spin[2]
    pieces = int(h * rate / LARGEST_TURN) + 1
    q = free_swing(to_body(bodies.frame, i, spin), moments, h / pieces, pieces)
    u = to_world(bodies.frame, i, (q[1], q[2], q[3]))
    return q[0], u[0], u[1], u[2]


@device
def free_swing(w, moments, h, pieces):
    """The unit quaternion, in the body's frame, of the torque-free motion of a body with unequal moments."""
    y = moments[0] * w[0], moments[1] * w[1], moments[2] * w[2]
    j = modified(moments, y, h)
    q = 1.0, 0.0, 0.0, 0.0
    for _ in range(pieces):
        e = half_turn(y, j, h)
        q = product(q, (1.0, e[0], e[1], e[2]))
        y = turned_back(y, e)
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return scale * q[0], scale * q[1], scale * q[2], scale * q[3]


@device
def swung_in_space(turn, r):
    """2 (w u x r + u x (u x r)) of the quaternion (w, u)."""
    u = turn[1], turn[2], turn[3]
    once = cross(u, r)
    twice = cross(u, once)
    w = turn[0]
    return 2.0 * (w * once[0] + twice[0]), 2.0 * (w * once[1] + twice[1]), 2.0 * (w * once[2] + twice[2])
