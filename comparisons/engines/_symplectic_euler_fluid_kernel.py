"""The kernel of weakly compressible smoothed particle hydrodynamics, with PBF's neighbours, kernels and walls.

    rho_i' = m sum_j (v_i - v_j) . grad W_ij + rho0 v_i . grad T_i,    rho_i = rho0 at the start
    p = B ((rho/rho0)^7 - 1) >= 0,    B = c^2 rho0/7
    a_i = g - m sum_j (p_i/rho_i^2 + p_j/rho_j^2 + P_ij) grad W_ij - rho0 p_i/rho_i^2 grad T_i
    P_ij = alpha c h max(-v_ij . x_ij, 0)/(rho0 (|x_ij|^2 + .01 h^2))

with T what walls give of a particle's density, over rho0. Source: Monaghan 1994 (doi:10.1006/jcph.1994.1034). Forces
between two particles are equal and opposite, so linear momentum is kept. They do the work that density takes up, walls'
too, so without viscosity and in small steps kinetic, potential and elastic energy are kept. Walls have no friction.

Density by continuity: of a sum over neighbours, as in Becker and Teschner 2007, a surface has .7 to .8 rho0, thus no
pressure until it is pressed together, and a dam break's front comes 4 % short at 20 particles across, against 0.6 %.
Walls push with p_i/rho_i^2 once. Twice, as fluid at the particle's own pressure would, they do more work than density
takes up: what rests trembles, at alpha < .05 it boils, and the front is 2 % short.

Deviations: gradients, walls' too, are divided by what a lattice has of the identity, sum V x grad W = .95: so a linear
pressure in a lattice has its slope exactly. p >= 0, as nothing holds a surface together. The viscosity has rho0 for the
mean density of the two, which is within the compression. h is the support of the kernel, where Monaghan has half of it:
alpha here counts twice.

Limits: all particles have the same mass. Compression is (v/c)^2. The density drifts from what the places of particles
give, the more the longer the step. Pressure beside a wall is not that of water: the first row, which alone holds what
wall and fluid hold elsewhere, has twice as much, and the next ones sway about the right one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from comparisons.engines._symplectic_euler_kernel import drift, kick, not_finite, sample
from pbd.fluid.candidates import for_each, gather
from pbd.fluid.cells import Cells, cut, sort
from pbd.fluid.kernels import Wendland, shape
from pbd.fluid.lanes import fused, inverse, lanes, no_lanes, positive, totals, width
from pbd.fluid.sums import difference, nothing, square, weighted
from pbd.fluid.walls import Walls, beside_walls, hold_back
from pbd.intrinsics import typed
from pbd.jit import device, kernel
from pbd.routine import routine
from pbd.vector import Store, accumulate, dot, load, scale, store, subtract

SOFTENING = 0.01
"""Of h^2, added to |x_ij|^2 in the viscosity."""


class Water(NamedTuple):
    """The fluid; arrays in sorted order, see `Cells`.

    unity : 1 over a lattice's sum V x grad W
    slope : V grad W = -slope g x times unity, g of `pbd.fluid.kernels.shape`
    tait : c^2/7 [m^2/s^2]
    friction : alpha c h [m^2/s]; ``softening`` .01 h^2 [m^2]
    position, velocity : stores of (n + PADDING,)
    pressure : (n + PADDING,) rho0 p/rho^2 [m^2/s^2]
    pull : store of (n,), grad T times unity [1/m]
    density : (n,) rho/rho0, in the scene's order
    """

    kernel: Wendland
    cells: Cells
    walls: Walls
    unity: float
    slope: float
    tait: float
    friction: float
    softening: float
    position: Store
    velocity: Store
    pressure: np.ndarray
    pull: Store
    density: np.ndarray


@kernel
def integrate(water, bodies, gravity, times, counts, samples):
    """As `_symplectic_euler_kernel.integrate`, with the forces of a fluid in walls.

    A step is v, x, rho, p, a, each from those before it.
    """
    h, offset = times
    for i in range(water.density.shape[0]):
        water.density[i] = 1.0
    accelerate(water, bodies, gravity, 0.0)
    kick(bodies, -offset)
    sample(bodies, offset, samples, 0)
    for n in range(1, counts[1] + 1):
        for _ in range(counts[0]):
            kick(bodies, h)
            drift(bodies, h)
            stop(water.walls, bodies, h)
            accelerate(water, bodies, gravity, h)
        sample(bodies, offset, samples, n)
        broken = not_finite(bodies)
        if broken > 0:
            return n, broken
    return counts[1], 0


@routine
def stop(walls, bodies, h):
    """Move what entered a wall to its face; its velocity is then that with which it came there."""
    for i in range(bodies.w.shape[0]):
        entered = load(bodies.x, i)
        hold_back(walls, bodies.x, i)
        accumulate(bodies.v, i, 1.0 / h, subtract(load(bodies.x, i), entered))


@routine
def accelerate(water, bodies, gravity, h):
    """Densities and pressures at the present positions, to which a step h has led, then accelerations."""
    sort(water.cells, bodies.x)
    low, high = cut(water.cells, 0, 1)
    moving = water.position + water.velocity
    gather(water.cells, bodies.x + bodies.v, moving, low, high)
    for_each(water.cells, moving, Pressures(water, h), low, high)
    for_each(water.cells, moving + (water.pressure,), Forces(water, bodies.a, gravity), low, high)


class Pressures(NamedTuple):
    """rho/rho0 after a step h, rho0 p/rho^2, and the walls' pull."""

    water: Any
    h: float

    def visit(self, k, first, last):
        water, i = self.water, self.water.cells.particle[k]
        point, own = load(water.position, k), load(water.velocity, k)
        _, pull = beside_walls(water.walls, point)
        store(water.pull, k, scale(water.unity, pull))
        closing = closing_sum(water.kernel, water.cells.near, first, last, point, own)
        water.density[i] += self.h * (dot(load(water.pull, k), own) - water.slope * closing)
        square_ = water.density[i] * water.density[i]
        water.pressure[k] = water.tait * max(square_ * square_ * water.density[i] - 1.0 / square_, 0.0)


class Forces(NamedTuple):
    """The acceleration of particle k, to its place among the particles of the scene."""

    water: Any
    a: Store
    gravity: tuple

    def visit(self, k, first, last):
        water, i = self.water, self.water.cells.particle[k]
        point, own, pressure = load(water.position, k), load(water.velocity, k), water.pressure[k]
        push = force_sums(water, water.cells.near, first, last, point, own, pressure)
        store(self.a, i, self.gravity)
        accumulate(self.a, i, water.slope, push)
        accumulate(self.a, i, -pressure, load(water.pull, k))


# ------------------------------------------------------------------ sums, a register at a time


@device
def closing_sum(kernel, near, first, last, point, own):
    """sum g (x_i - x_j) . (v_i - v_j), the v_j beside the candidates' positions."""
    closing = no_lanes(near[0])
    for k in range(first, last, width(near[0])):
        apart = difference(point, near, k)
        _, g = shape(kernel, square(apart))
        closing = fused(g, product(apart, difference(own, near[len(point) :], k)), closing)
    return totals((closing,))[0]


@device
def force_sums(water, near, first, last, point, own, pressure):
    """sum (q_i + q_j + P_ij) g (x_i - x_j); beside the candidates' positions are their v_j and q_j."""
    push = nothing(point, near)
    for k in range(first, last, width(near[0])):
        apart = difference(point, near, k)
        squared = square(apart)
        _, g = shape(water.kernel, squared)
        closing = positive(product(apart, difference(own, near[len(point) :], k)) * -water.friction)
        strength = fused(closing, inverse(squared + water.softening), lanes(near[2 * len(point)], k) + pressure)
        push = weighted(g * strength, apart, push)
    return totals(push)


def product(a: tuple, b: tuple) -> Any:
    """a . b of lanes."""
    sum_ = a[0] * b[0]
    for p, q in zip(a[1:], b[1:]):
        sum_ = fused(p, q, sum_)
    return sum_


@typed(product)
def _product(a: Any, b: Any) -> Any:
    if len(a) == 2:
        return lambda a, b: fused(a[1], b[1], a[0] * b[0])
    return lambda a, b: fused(a[2], b[2], fused(a[1], b[1], a[0] * b[0]))
