"""Position based fluids: the density of each particle as a constraint (Macklin and Mueller 2013).

    C_i = rho_i/rho0 - 1 <= 0,   rho_i/rho0 = V sum_j W_ij + walls
    l_i = -C_i/(w (|grad_i C_i|^2 + sum_j |grad_j C_i|^2) + eps),   dp_i = omega w (l_i grad_i C_i + sum_j l_j grad_i C_j)

with V = m/rho0 the volume of a particle, in the gradients too: grad_i C_i = V sum_j grad W_ij + walls, grad_j C_i =
-V grad W_ij. All particles of a pass see the same positions (Jacobi): first all l_i, then all dp_i, each shared with the
neighbours in equal and opposite parts, so linear momentum is kept. rho0 is what a square (cubic) lattice at the given
spacing has: the sum of W over it is not 1 but up to 1.04.

Deviations from the paper: C <= 0, which does not pull a surface together, whose density is .7 to .8 rho0; an equality is
what the paper has. eps is a number over h^2, so that results do not change with the resolution. Walls give back the
density that is missing beside them. Neighbours are found once in a sub-step, as in the paper. Alone, a particle has no
gradient: it flies as it would without the constraint, exactly.

Limits: omega = 1 in one iteration a step injects energy, whatever the step; .25 to .5, or eps of order 1, does not. All
particles have the same mass.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.fluid.cells import Cells, gather, pick, sort
from pbd.fluid.kernels import Poly6Spiky, Wendland
from pbd.fluid.sums import density_sums, push_sums
from pbd.fluid.terms import Repulsion
from pbd.fluid.velocities import Confinement, Viscosity, confine, smooth
from pbd.fluid.walls import Walls, beside_walls, hold_back
from pbd.jit import device
from pbd.projection import increment, reset
from pbd.routine import routine
from pbd.vector import Store, accumulate, add, like, load, scale, store


class Unit(NamedTuple):
    """In the place of particles, where a law asks for inverse masses: the gradients' norms hold them already."""

    w: np.ndarray


class Density(NamedTuple):
    """One constraint for each particle of a fluid; arrays in sorted order, see `Cells`.

    value, slope : V W = value w, V grad W = -slope g x, of `pbd.fluid.kernels.shape`
    inverse_mass : w [1/kg]; ``softness`` eps w/h^2 [1/(kg m^2)]; ``omega`` relaxation
    law : how stiffly the constraints are enforced, `Stiffness` or `Compliance`
    position, velocity : stores of (n + PADDING,); ``multiplier`` (n + PADDING,) L = omega w l [m^2]
    gradient : store of (n,) grad_i C_i [1/m]; ``density`` (n,) rho/rho0 at the start of the last iteration
    """

    kernel: Wendland | Poly6Spiky
    cells: Cells
    walls: Walls
    value: float
    slope: float
    inverse_mass: float
    softness: float
    omega: float
    law: Any
    unit: Unit
    position: Store
    velocity: Store
    multiplier: np.ndarray
    gradient: Store
    density: np.ndarray
    repulsion: Repulsion | None
    viscosity: Viscosity | None
    confinement: Confinement | None

    def size(self):
        return self.cells.members.shape[0]

    def begin(self, state, h):
        reset(self.law)
        p = state.particles.p
        for k in range(self.cells.members.shape[0]):
            hold_back(self.walls, p, self.cells.members[k])
        sort(self.cells, p)

    def project(self, state, h):
        gather(self.cells, state.particles.p, self.position)
        find_multipliers(self, h)
        displace(self, state.particles.p)
        state.work[0] += self.cells.members.shape[0]

    def end(self, state, h):
        confine(self.confinement, self, state.particles, h)
        smooth(self.viscosity, self, state.particles)

    def densities(self) -> np.ndarray:
        """(n,) rho/rho0 of the members, in the order given, at the start of the last iteration (not for kernels)."""
        found = np.zeros(int(self.cells.members.max()) + 1)
        found[self.cells.particle] = self.density
        return found[self.cells.members]


# ------------------------------------------------------------------ the two passes of an iteration


@routine
def find_multipliers(fluid, h):
    """L_i of all particles."""
    for c in range(fluid.cells.last[0]):
        first, last = fluid.cells.start[c], fluid.cells.start[c + 1]
        if first < last:
            count = pick(fluid.cells, c, fluid.position)
            for k in range(first, last):
                find_multiplier(fluid, k, count, h)


@device
def find_multiplier(fluid, k, count, h):
    point = load(fluid.position, k)
    value, slope, norm = density_sums(fluid.kernel, fluid.cells.near, count, point)
    filled, pull = beside_walls(fluid.walls, point)
    density = fluid.value * value + filled
    gradient = add(scale(-fluid.slope, slope), pull)
    squared = fluid.slope * fluid.slope * norm
    for axis in range(len(gradient)):
        squared += gradient[axis] * gradient[axis]
    weight = fluid.inverse_mass * squared + fluid.softness
    row = (0,), density - like(density, 1.0), (gradient,), (weight,)
    change = increment(fluid.law, k, row, fluid.unit, h)
    fluid.multiplier[k] = fluid.omega * fluid.inverse_mass * change
    fluid.density[k] = density
    store(fluid.gradient, k, gradient)


@routine
def displace(fluid, p):
    """p_i <- p_i + dp_i for all particles, kept from entering walls."""
    cells, values = fluid.cells, fluid.position + (fluid.multiplier,)
    for c in range(cells.last[0]):
        first, last = cells.start[c], cells.start[c + 1]
        if first < last:
            count = pick(cells, c, values)
            for k in range(first, last):
                push = push_sums(fluid.kernel, fluid.repulsion, cells.near, count, load(fluid.position, k))
                i = cells.particle[k]
                accumulate(p, i, fluid.multiplier[k], load(fluid.gradient, k))
                accumulate(p, i, -fluid.slope, push)
                hold_back(fluid.walls, p, i)
