"""How free bodies move and turn in a sub-step: x <- x + h v, and rotations that keep energy and angular momentum.

In the plane a turn is exact. In space a body whose moments are equal turns exactly too; any other by the discrete
Moser-Veselov algorithm (Moser and Veselov 1991), which keeps the angular momentum in space and the energy to round-off.
With y = I w the momentum in the body's frame, it solves for a vector e

    h y (1 + |e|^2)/2 = J e + e x J e

and turns by the quaternion (1, e) normalised. With J = I it is of order 2; with moments that are modified by the
conserved energy H and C = |y|^2/2, 1/J_k = (1 + h^2 s)/I_k + h^2 d, of order 4 (Hairer and Vilmart 2006).
"""

from __future__ import annotations

import math
from typing import Any

from pbd.intrinsics import typed
from pbd.jit import device
from pbd.routine import routine

AXES = {2: 1, 3: 3}
"""Dimension -> components of a spin."""

LARGEST_TURN = 0.25
"""[rad] A longer turn of a body with unequal moments is made in pieces."""

EQUAL = 1e-14
"""Moments that differ by less than this share are equal."""

MOST_ITERATIONS = 60
"""Fixed-point iterations for e; each gains a factor of at least 1/LARGEST_TURN."""


@routine
def move_and_turn(bodies, h):
    """x <- x + h v; and the turns."""
    for k in range(len(bodies.x)):
        for i in range(bodies.radius.shape[0] - 1):
            bodies.x[k][i] += h * bodies.motion[i, k]
    turn_all(bodies, h)


def turn_all(bodies: Any, h: float) -> None:
    """Turn every body by its spin for a time h, and bring frames and inertias along."""
    return turn_in_plane(bodies, h) if len(bodies.x) == 2 else turn_in_space(bodies, h)


@typed(turn_all)
def _turn_all(bodies: Any, h: Any) -> Any:
    if len(bodies.types[0]) == 2:
        return lambda bodies, h: turn_in_plane(bodies, h)
    return lambda bodies, h: turn_in_space(bodies, h)


@device
def turn_in_plane(bodies, h):
    """angle <- angle + h w."""
    angle = bodies.turn[0]
    for i in range(bodies.radius.shape[0] - 1):
        w = bodies.motion[i, 2]
        if w != 0.0:
            angle[i] += h * w
            bodies.frame[i, 0] = math.cos(angle[i])
            bodies.frame[i, 1] = math.sin(angle[i])


@device
def turn_in_space(bodies, h):
    """The quaternion, the matrix and the inverse inertia of every body that turns."""
    for i in range(bodies.radius.shape[0] - 1):
        spin = bodies.motion[i, 3], bodies.motion[i, 4], bodies.motion[i, 5]
        square = spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]
        if square == 0.0:
            continue
        moments = bodies.inertia[0][i], bodies.inertia[1][i], bodies.inertia[2][i]
        most, least = max(moments[0], moments[1], moments[2]), min(moments[0], moments[1], moments[2])
        if most - least <= EQUAL * most:
            turn_evenly(bodies, i, spin, math.sqrt(square), h)
        else:
            pieces = int(h * math.sqrt(square) / LARGEST_TURN) + 1
            turn_freely(bodies, i, spin, moments, h / pieces, pieces)


@device
def turn_evenly(bodies, i, spin, rate, h):
    """About the spin, which stays."""
    half = 0.5 * h * rate
    s = math.sin(half) / rate
    turn = bodies.turn
    q = turn[0][i], turn[1][i], turn[2][i], turn[3][i]
    set_turn(bodies, i, product((math.cos(half), s * spin[0], s * spin[1], s * spin[2]), q))


@device
def turn_freely(bodies, i, spin, moments, h, pieces):
    """The torque-free motion of a body with unequal moments."""
    f, turn = bodies.frame, bodies.turn
    w = to_body(f, i, spin)
    y = moments[0] * w[0], moments[1] * w[1], moments[2] * w[2]
    j = modified(moments, y, h)
    q = turn[0][i], turn[1][i], turn[2][i], turn[3][i]
    for _ in range(pieces):
        e = half_turn(y, j, h)
        q = product(q, (1.0, e[0], e[1], e[2]))
        y = turned_back(y, e)
    set_turn(bodies, i, q)
    w = to_world(f, i, (y[0] / moments[0], y[1] / moments[1], y[2] / moments[2]))
    bodies.motion[i, 3], bodies.motion[i, 4], bodies.motion[i, 5] = w[0], w[1], w[2]


@device
def modified(moments, y, h):
    """The moments J that make the algorithm one of order 4."""
    a, b, c = moments
    energy = 0.5 * (y[0] * y[0] / a + y[1] * y[1] / b + y[2] * y[2] / c)
    square = 0.5 * (y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    total, product_ = a + b + c, a * b * c
    s = total / (6.0 * product_) * square - (1.0 / a + 1.0 / b + 1.0 / c) / 3.0 * energy
    d = total / (6.0 * product_) * energy - square / (3.0 * product_)
    grown, shift = 1.0 + h * h * s, h * h * d
    return 1.0 / (grown / a + shift), 1.0 / (grown / b + shift), 1.0 / (grown / c + shift)


@device
def half_turn(y, j, h):
    """e, the tangent of half the turn along its axis in the body's frame, by fixed-point iteration."""
    half = 0.5 * h
    e = half * y[0] / j[0], half * y[1] / j[1], half * y[2] / j[2]
    for _ in range(MOST_ITERATIONS):
        scale = half * (1.0 + e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        next_e = (
            (scale * y[0] - (j[2] - j[1]) * e[1] * e[2]) / j[0],
            (scale * y[1] - (j[0] - j[2]) * e[2] * e[0]) / j[1],
            (scale * y[2] - (j[1] - j[0]) * e[0] * e[1]) / j[2],
        )
        change = abs(next_e[0] - e[0]) + abs(next_e[1] - e[1]) + abs(next_e[2] - e[2])
        e = next_e
        if change <= 1e-17:
            break
    return e


@device
def turned_back(y, e):
    """y in the frame that was turned by (1, e)."""
    scale = 2.0 / (1.0 + e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    c = y[1] * e[2] - y[2] * e[1], y[2] * e[0] - y[0] * e[2], y[0] * e[1] - y[1] * e[0]
    d = c[1] * e[2] - c[2] * e[1], c[2] * e[0] - c[0] * e[2], c[0] * e[1] - c[1] * e[0]
    return y[0] + scale * (c[0] + d[0]), y[1] + scale * (c[1] + d[1]), y[2] + scale * (c[2] + d[2])


@device
def product(p, q):
    """The quaternion p q."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@device
def set_turn(bodies, i, q):
    """Turn body i as a quaternion of any length says: its unit quaternion, its matrix, its inverse inertia."""
    length = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    w, x, y, z = length * q[0], length * q[1], length * q[2], length * q[3]
    turn, f = bodies.turn, bodies.frame
    turn[0][i], turn[1][i], turn[2][i], turn[3][i] = w, x, y, z
    f[i, 0], f[i, 1], f[i, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    f[i, 3], f[i, 4], f[i, 5] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    f[i, 6], f[i, 7], f[i, 8] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    if bodies.motion[i, 6] > 0.0:
        set_inverse_inertia(bodies, i)


@device
def set_inverse_inertia(bodies, i):
    """R I^-1 R^T in the world's frame: xx, xy, xz, yy, yz, zz."""
    f, m = bodies.frame, bodies.motion
    a, b, c = 1.0 / bodies.inertia[0][i], 1.0 / bodies.inertia[1][i], 1.0 / bodies.inertia[2][i]
    m[i, 7] = a * f[i, 0] * f[i, 0] + b * f[i, 1] * f[i, 1] + c * f[i, 2] * f[i, 2]
    m[i, 8] = a * f[i, 0] * f[i, 3] + b * f[i, 1] * f[i, 4] + c * f[i, 2] * f[i, 5]
    m[i, 9] = a * f[i, 0] * f[i, 6] + b * f[i, 1] * f[i, 7] + c * f[i, 2] * f[i, 8]
    m[i, 10] = a * f[i, 3] * f[i, 3] + b * f[i, 4] * f[i, 4] + c * f[i, 5] * f[i, 5]
    m[i, 11] = a * f[i, 3] * f[i, 6] + b * f[i, 4] * f[i, 7] + c * f[i, 5] * f[i, 8]
    m[i, 12] = a * f[i, 6] * f[i, 6] + b * f[i, 7] * f[i, 7] + c * f[i, 8] * f[i, 8]


@device
def to_body(frame, i, v):
    """R^T v."""
    return (
        frame[i, 0] * v[0] + frame[i, 3] * v[1] + frame[i, 6] * v[2],
        frame[i, 1] * v[0] + frame[i, 4] * v[1] + frame[i, 7] * v[2],
        frame[i, 2] * v[0] + frame[i, 5] * v[1] + frame[i, 8] * v[2],
    )


@device
def to_world(frame, i, v):
    """R v."""
    return (
        frame[i, 0] * v[0] + frame[i, 1] * v[1] + frame[i, 2] * v[2],
        frame[i, 3] * v[0] + frame[i, 4] * v[1] + frame[i, 5] * v[2],
        frame[i, 6] * v[0] + frame[i, 7] * v[1] + frame[i, 8] * v[2],
    )
