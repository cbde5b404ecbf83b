"""What changes the velocities of a fluid after a step, optional: what is None compiles to nothing.

    viscosity     v_i <- v_i + c sum_j V W_ij (v_j - v_i)                             XSPH
    confinement   v_i <- v_i + dt e h N x omega,   N = grad |omega|/|grad |omega||,   omega = curl v

Source: Macklin and Mueller 2013, equations 15-17. Deviations: c is a number without a unit and e is in 1/s, so that
results do not change with the resolution; each neighbour counts with its volume V, which the paper leaves out - its sum
of W alone would be 65 c at h = 0.1 m in 3D, and diverge. V is the same for all, so XSPH keeps linear momentum.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.fluid.candidates import for_each, gather
from pbd.fluid.solids import carried, is_fluid
from pbd.fluid.sums import curl_sums, slope_sums, smoothed_differences
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.routine import routine
from pbd.vector import Store, accumulate, dot, like, load, scale, store

SMALLEST_SLOPE = 1e-12
"""[1/(m s)] A slope of |omega| this small has no direction."""


@stage
def smooth(viscosity, fluid, particles):
    """XSPH on the velocities after the step."""


@stage
def confine(confinement, fluid, particles, h):
    """Vorticity confinement on the velocities after the step."""


class Viscosity(NamedTuple):
    """XSPH: ``factor`` c V times the kernel's constant."""

    factor: float

    def smooth(self, fluid, particles):
        smooth_velocities(self, fluid, particles)


class Confinement(NamedTuple):
    """Vorticity confinement.

    strength : e h [m/s]
    curl : a store of (n,) arrays, of 1 in 2D and 3 in 3D; ``size`` (n + PADDING,) |omega|, in sorted order [1/s]
    """

    strength: float
    curl: Store
    size: np.ndarray

    def confine(self, fluid, particles, h):
        confine_velocities(self, fluid, particles, h)


class Drag(NamedTuple):
    """v_i <- v_i + c sum_j V W_ij (v_j - v_i)."""

    viscosity: Any
    fluid: Any
    particles: Any

    def visit(self, k, first, last):
        fluid = self.fluid
        point, own = load(fluid.position, k), load(fluid.velocity, k)
        drag = smoothed_differences(fluid.kernel, fluid.solids, fluid.cells.near, first, last, k, point, own)
        accumulate(self.particles.v, fluid.cells.particle[k], self.viscosity.factor, drag)


class Curl(NamedTuple):
    """curl v and its size."""

    confinement: Any
    fluid: Any

    def visit(self, k, first, last):
        fluid = self.fluid
        point, own = load(fluid.position, k), load(fluid.velocity, k)
        curl = scale(fluid.slope, curl_sums(fluid.kernel, fluid.cells.near, first, last, point, own))
        store(self.confinement.curl, k, curl)
        self.confinement.size[k] = math.sqrt(dot(curl, curl))


class Spin(NamedTuple):
    """v_i <- v_i + ``change`` N x omega."""

    confinement: Any
    fluid: Any
    particles: Any
    change: float

    def visit(self, k, first, last):
        fluid, confinement = self.fluid, self.confinement
        point = load(fluid.position, k)
        slope = slope_sums(fluid.kernel, fluid.cells.near, first, last, point, confinement.size[k])
        push = turned(unit(scale(fluid.slope, slope)), load(confinement.curl, k))
        i = fluid.cells.particle[k]
        if is_fluid(fluid.solids, i):
            accumulate(self.particles.v, i, self.change, push)


@routine
def smooth_velocities(viscosity, fluid, particles):
    gather(fluid.cells, particles.x, fluid.position)
    gather(fluid.cells, particles.v, fluid.velocity)
    values = fluid.position + fluid.velocity + carried(fluid.solids)
    for_each(fluid.cells, values, Drag(viscosity, fluid, particles))


@routine
def confine_velocities(confinement, fluid, particles, h):
    gather(fluid.cells, particles.x, fluid.position)
    gather(fluid.cells, particles.v, fluid.velocity)
    for_each(fluid.cells, fluid.position + fluid.velocity, Curl(confinement, fluid))
    spin = Spin(confinement, fluid, particles, h * confinement.strength)
    for_each(fluid.cells, fluid.position + (confinement.size,), spin)


@device
def unit(a):
    """a/|a|; 0 where it has no direction."""
    size = math.sqrt(dot(a, a))
    return scale(like(a[0], 1.0) / max(size, like(a[0], SMALLEST_SLOPE)), a)


def turned(n: tuple, curl: tuple) -> tuple:
    """n x omega."""
    if len(n) == 2:
        return (n[1] * curl[0], -n[0] * curl[0])
    return (n[1] * curl[2] - n[2] * curl[1], n[2] * curl[0] - n[0] * curl[2], n[0] * curl[1] - n[1] * curl[0])


@typed(turned)
def _turned(n: Any, curl: Any) -> Any:
    if len(n) == 2:
        return lambda n, curl: (n[1] * curl[0], -n[0] * curl[0])
    return lambda n, curl: (
        n[1] * curl[2] - n[2] * curl[1],
        n[2] * curl[0] - n[0] * curl[2],
        n[0] * curl[1] - n[1] * curl[0],
    )
