"""Line 6, dampVelocities: plain, and relative to the rigid modes (PBD 2006, section 3.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload

from pbd.arrays import number
from pbd.jit import DEVICE_OPTIONS, device
from pbd.vector import accumulate, add, dot, load, scale, subtract, zero

NULL_MODE = 1e-12
"""Moments of inertia below this fraction of the largest are null: a collinear set does not spin about its axis."""


class PlainDamping(NamedTuple):
    """v <- (1 - k) v of what is not pinned. Limit: removes momentum, and depends on the time step."""

    k: float

    def damp(self, state):
        for axis in range(len(state.particles.v)):
            v, w = state.particles.v[axis], state.particles.w
            for i in range(v.shape[0]):
                v[i] -= self.k * v[i] if w[i] > 0.0 else 0.0


class RigidModeDamping(NamedTuple):
    """v_i <- v_i + k (v_cm + omega x r_i - v_i): keeps linear and angular momentum.

    Lines (1)-(9) of the paper's section 3.5 over the free particles:
    x_cm, v_cm, L = sum r x m v, I = sum m (|r|^2 1 - r r^T), omega = I^+ L with the pseudo-inverse.
    Deviation: pinned particles, whose mass is infinite, are left out.
    """

    k: float

    def damp(self, state):
        particles = state.particles
        mass, center, velocity = center_of_mass(particles)
        if mass == 0.0:
            return
        omega = angular_velocity(particles, center, velocity)
        for i in range(particles.w.shape[0]):
            if particles.w[i] > 0.0:
                arm = subtract(load(particles.x, i), center)
                rigid = add(velocity, spin(omega, arm))
                accumulate(particles.v, i, self.k, subtract(rigid, load(particles.v, i)))


@device
def center_of_mass(particles):
    """(m, x_cm, v_cm) of the free particles."""
    mass = 0.0
    center = zero(particles.x)
    velocity = zero(particles.v)
    for i in range(particles.w.shape[0]):
        if particles.w[i] > 0.0:
            m = 1.0 / particles.w[i]
            mass += m
            center = add(center, scale(m, load(particles.x, i)))
            velocity = add(velocity, scale(m, load(particles.v, i)))
    inverse = 1.0 / mass if mass > 0.0 else 0.0
    return mass, scale(inverse, center), scale(inverse, velocity)


@device
def angular_velocity(particles, center, velocity):
    """omega = I^+ L about the centre of mass, always as a 3-vector (2D sets spin about z)."""
    lx = ly = lz = xx = yy = zz = xy = xz = yz = 0.0
    for i in range(particles.w.shape[0]):
        if particles.w[i] > 0.0:
            m = 1.0 / particles.w[i]
            rx, ry, rz = lift(subtract(load(particles.x, i), center))
            ux, uy, uz = lift(subtract(load(particles.v, i), velocity))
            lx += m * (ry * uz - rz * uy)
            ly += m * (rz * ux - rx * uz)
            lz += m * (rx * uy - ry * ux)
            xx += m * (ry * ry + rz * rz)
            yy += m * (rx * rx + rz * rz)
            zz += m * (rx * rx + ry * ry)
            xy -= m * rx * ry
            xz -= m * rx * rz
            yz -= m * ry * rz
    return solve_inertia((xx, yy, zz, xy, xz, yz), (lx, ly, lz))


@device
def solve_inertia(inertia, momentum):
    """I^+ L by Jacobi's eigenvalue rotations; null modes (see NULL_MODE) get no spin."""
    xx, yy, zz, xy, xz, yz = inertia
    e1, e2, e3 = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for _ in range(12):
        xx, yy, xy, xz, yz, e1, e2 = rotate(xx, yy, xy, xz, yz, e1, e2)
        xx, zz, xz, xy, yz, e1, e3 = rotate(xx, zz, xz, xy, yz, e1, e3)
        yy, zz, yz, xy, xz, e2, e3 = rotate(yy, zz, yz, xy, xz, e2, e3)
    floor = NULL_MODE * max(xx, max(yy, zz))
    omega = scale(dot(e1, momentum) / xx if xx > floor else 0.0, e1)
    omega = add(omega, scale(dot(e2, momentum) / yy if yy > floor else 0.0, e2))
    return add(omega, scale(dot(e3, momentum) / zz if zz > floor else 0.0, e3))


@device
def rotate(a, b, ab, ac, bc, u, v):
    """One Jacobi rotation that makes the off-diagonal element ``ab`` zero.

    a, b are the two diagonal elements, ac and bc those that couple to the third axis, u and v the
    eigenvectors so far (Golub and Van Loan, section 8.5).
    """
    if ab == 0.0:
        return a, b, ab, ac, bc, u, v
    theta = (b - a) / (2.0 * ab)
    sign = 1.0 if theta >= 0.0 else -1.0
    t = sign / (abs(theta) + math.sqrt(theta * theta + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    turned_u = subtract(scale(c, u), scale(s, v))
    turned_v = add(scale(s, u), scale(c, v))
    return a - t * ab, b + t * ab, 0.0, c * ac - s * bc, s * ac + c * bc, turned_u, turned_v


def lift(a: tuple[float, ...]) -> tuple[float, float, float]:
    """The vector in 3D, missing components 0."""
    x, y, z = (*a, 0.0, 0.0)[:3]
    return x, y, z


@overload(lift, strict=False, jit_options=DEVICE_OPTIONS)
def _lift(a: types.UniTuple) -> object:
    forms = {1: lambda a: (a[0], 0.0, 0.0), 2: lambda a: (a[0], a[1], 0.0), 3: lambda a: a}
    return forms[len(a)]


def spin(omega: tuple[float, ...], arm: tuple[float, ...]) -> tuple[float, ...]:
    """omega x r in the dimension of r."""
    ox, oy, oz = omega
    rx, ry, rz = lift(arm)
    return (oy * rz - oz * ry, oz * rx - ox * rz, ox * ry - oy * rx)[: len(arm)]


@overload(spin, strict=False, jit_options=DEVICE_OPTIONS)
def _spin(omega: types.UniTuple, arm: types.UniTuple) -> object:
    def in_space(omega, arm):
        ox, oy, oz = omega
        rx, ry, rz = arm
        return (oy * rz - oz * ry, oz * rx - ox * rz, ox * ry - oy * rx)

    forms = {1: lambda omega, arm: (0.0,), 2: lambda omega, arm: (-omega[2] * arm[1], omega[2] * arm[0]), 3: in_space}
    return forms[len(arm)]


@dataclass(frozen=True)
class Damping:
    """Damping as a user chooses it: ``k`` in [0, 1], ``plain`` or relative to the rigid modes."""

    k: float
    plain: bool = False

    def __post_init__(self) -> None:
        number("damping.k", self.k, 0.0, 1.0, "a number in [0, 1]")

    def bind(self) -> Any:
        """The kernel's damping; None, which costs nothing, for k = 0."""
        if self.k == 0.0:
            return None
        return PlainDamping(float(self.k)) if self.plain else RigidModeDamping(float(self.k))
