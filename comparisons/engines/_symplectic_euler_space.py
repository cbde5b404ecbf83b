"""What turns, in the plane and in space: spins and moments have one component in 2D, three in 3D.

Each function here is written twice. Its first argument, whose length tells the dimension, chooses when a kernel is
compiled: what a planar scene does not need is not there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from pbd.collision.frames import cross
from pbd.jit import DEVICE_OPTIONS, device
from pbd.vector import Store, dot, load, scale, store

SPLITTING = ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5))
"""Body axes, and the part of the step that is turned about each: there and back, so of second order."""


class State(NamedTuple):
    """n rigid bodies, in stores of arrays (n,); what turns has 1 component in 2D, 3 in 3D.

    x, v, force : centres [m], their velocities, and forces on them [N]
    q : orientations: an angle, or a unit quaternion (w, x, y, z); axes[k] : body axis k in world coordinates
    momentum, spin, torque : about the centres, in world coordinates
    body_momentum : along the body axes, scratch
    w, j : inverse masses (n,), inverse moments of inertia about the body axes; 0 for the fixed
    lightest : (n,) the largest of a body's inverse moments of inertia
    """

    x: Store
    v: Store
    force: Store
    q: Store
    axes: tuple[Store, ...]
    momentum: Store
    spin: Store
    torque: Store
    body_momentum: Store
    w: np.ndarray
    j: Store
    lightest: np.ndarray


def by_dimension(plane: Callable[..., Any], space: Callable[..., Any]) -> Callable[..., Any]:
    """The function that is ``plane`` where its first argument has the length of something planar, else ``space``."""

    def find(first: Any, *_: Any) -> Callable[..., Any]:
        return plane if len(first) < 3 else space

    def call(*args: Any) -> Any:
        return find(*args)(*args)

    overload(call, strict=False, jit_options=DEVICE_OPTIONS)(find)
    return call


# ------------------------------------------------------------------ products


def _turned_in_plane(spin, arm):
    return -spin[0] * arm[1], spin[0] * arm[0]


turned = by_dimension(_turned_in_plane, lambda spin, arm: cross(spin, arm))
"""turned(spin, arm): spin x arm, the velocity of the end of an arm."""


def _moment_in_plane(arm, force):
    return (arm[0] * force[1] - arm[1] * force[0],)


moment = by_dimension(_moment_in_plane, lambda arm, force: cross(arm, force))
"""moment(arm, force): arm x force."""


def _respond_in_plane(moments, state, i):
    return (state.j[0][i] * moments[0],)


def _respond_in_space(moments, state, i):
    x, y, z = load(state.axes[0], i), load(state.axes[1], i), load(state.axes[2], i)
    a, b, c = state.j[0][i] * dot(x, moments), state.j[1][i] * dot(y, moments), state.j[2][i] * dot(z, moments)
    return (
        a * x[0] + b * y[0] + c * z[0],
        a * x[1] + b * y[1] + c * z[1],
        a * x[2] + b * y[2] + c * z[2],
    )


respond = by_dimension(_respond_in_plane, _respond_in_space)
"""respond(moment, state, i): R J R^T moment, the spin that a change of angular momentum gives body i."""


# ------------------------------------------------------------------ orientations


def _frame_in_plane(q, state, i):
    c, s = math.cos(q[0][i]), math.sin(q[0][i])
    store(state.axes[0], i, (c, s))
    store(state.axes[1], i, (-s, c))


def _frame_in_space(q, state, i):
    w, x, y, z = load(q, i)
    store(state.axes[0], i, (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)))
    store(state.axes[1], i, (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)))
    store(state.axes[2], i, (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)))


frame = by_dimension(_frame_in_plane, _frame_in_space)
"""frame(q, state, i): write the axes of body i."""


def _turn_in_plane(q, state, i, h):
    q[0][i] += h * state.j[0][i] * state.momentum[0][i]


def _turn_in_space(q, state, i, h):
    for k in range(3):
        state.body_momentum[k][i] = dot(load(state.axes[k], i), load(state.momentum, i))
    for k, part in SPLITTING:
        turn_about(q, state.body_momentum, i, k, part * h * state.j[k][i] * state.body_momentum[k][i])
    size = dot(load(q, i), load(q, i))
    store(q, i, scale(1.5 - 0.5 * size, load(q, i)))


turn = by_dimension(_turn_in_plane, _turn_in_space)
"""turn(q, state, i, h): turn body i freely for a time h.

In 2D exactly. In 3D by the symplectic splitting of the free top into turns about its body axes (Touma and Wisdom 1994;
Dullweber, Leimkuhler and McLachlan 1997, doi:10.1063/1.474310), each of them exact: of second order, reversible, energy
without drift, and the angular momentum in the world, which no turn changes, kept as it is. The quaternion is brought
back to unit length, from which rounding alone takes it, by a Newton step."""


@device
def turn_about(q, p, i, k, angle):
    """Turn body i about its axis k, q <- q (cos(angle/2), sin(angle/2) e_k), and its momentum p back in its frame."""
    a, b = (k + 1) % 3, (k + 2) % 3
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    w, along, first, second = q[0][i], q[k + 1][i], q[a + 1][i], q[b + 1][i]
    q[0][i], q[k + 1][i] = w * c - along * s, along * c + w * s
    q[a + 1][i], q[b + 1][i] = first * c + second * s, second * c - first * s
    cosine, sine = c * c - s * s, 2.0 * s * c
    first, second = p[a][i], p[b][i]
    p[a][i], p[b][i] = cosine * first + sine * second, cosine * second - sine * first
