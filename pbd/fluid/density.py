"""Position based fluids: the density of each particle as a constraint (Macklin and Mueller 2013).

    C_i = rho_i/rho0 - 1 <= 0,   rho_i/rho0 = V sum_j W_ij + walls
    l_i = -C_i/(w (|grad_i C_i|^2 + sum_j |grad_j C_i|^2) + eps)
    dp_i = omega w (l_i grad_i C_i + sum_j l_j grad_i C_j)

with V = m/rho0 the volume of a particle, in the gradients too: grad_i C_i = V sum_j grad W_ij + walls, grad_j C_i =
-V grad W_ij. All particles of a pass see the same positions (Jacobi): first all l_i, then all dp_i, each the sum of
parts that are equal and opposite for two neighbours, so linear momentum is kept. rho0 is what a square (cubic)
lattice at the given spacing has: the sum of W over it is not 1 but up to 1.04.

Deviations from the paper: C <= 0, or the surface, whose density is .7 to .8 rho0, would be pulled together; the paper
has an equality. eps is a number over h^2, so that results do not change with the resolution. Walls give back the
density that is missing beside them. Neighbours are found once in a sub-step, as in the paper. Alone, a particle has
no gradient: it flies as it would without the constraint, exactly.

Particles of solids may count in the sums, see `pbd.fluid.solids`.

Limits: all particles of the fluid have the same mass. A pass multiplies a ripple of C in a lattice by 1 - omega g with
g up to 2.5 in 2D at h = 2.5 s, 2.6 in 3D at 2 s, 3.8 at 2.5 s: with omega > 2/g the worst ripple grows until C <= 0
cuts it off. Four iterations of omega = 1 are then still the most accurate in 2D; a single one a step injects energy
until it explodes, whatever the step, where omega = .25 to .5, or eps of order 1, does not.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.fluid.candidates import for_each, gather
from pbd.fluid.cells import Cells, sort
from pbd.fluid.kernels import Poly6Spiky, Wendland
from pbd.fluid.solids import Solids, arrange, carried, constraints, is_fluid, is_free, lightened
from pbd.fluid.sums import density_sums, push_sums
from pbd.fluid.terms import Repulsion
from pbd.fluid.velocities import Confinement, Viscosity, confine, smooth
from pbd.fluid.walls import Walls, beside_walls, find_near, hold_back
from pbd.intrinsics import multiply_add
from pbd.jit import device, kernel
from pbd.projection import increment, reset
from pbd.routine import routine
from pbd.vector import Store, accumulate, aligned, dot, like, load, scale, store


class Unit(NamedTuple):
    """In the place of particles, where a law asks for inverse masses: the gradients' norms hold them already."""

    w: np.ndarray


@stage
def reread(sharing, fluid, p):
    """Bring the sorted positions up to what other batches have made of p since the last pass."""


class Sharing(NamedTuple):
    """There are other batches. Without them positions are read once a step: of a million particles a quarter faster."""

    def reread(self, fluid, p):
        gather(fluid.cells, p, fluid.position)


class Density(NamedTuple):
    """One constraint for each particle of a fluid; arrays in sorted order, see `Cells`. Solids stand among them.

    value, slope : V W = value w, V grad W = -slope g x, of `pbd.fluid.kernels.shape`
    inverse_mass : w [1/kg]; ``softness`` eps w/h^2 [1/(kg m^2)]; ``omega`` relaxation
    law : how stiffly the constraints are enforced, `Stiffness` or `Compliance`
    position, velocity : stores of (n + PADDING,); ``multiplier`` (n + PADDING,) L = omega w l [m^2]
    gradient, push : stores of (n,), grad_i C_i [1/m] and sum_j L_j g (x_i - x_j)
    density : (n,) rho/rho0 at the start of the last iteration
    weight : (n,) sum_j r_j |grad_j C_i|^2 of neighbours [1/m^2]; r_j = 1 but for solids
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
    push: Store
    density: np.ndarray
    weight: np.ndarray
    sharing: Sharing | None
    solids: Solids | None
    repulsion: Repulsion | None
    viscosity: Viscosity | None
    confinement: Confinement | None

    def size(self):
        return self.cells.members.shape[0]

    def alone(self) -> Density:
        """The same where no other batch moves particles."""
        return self._replace(sharing=None)

    def begin(self, state, h):
        reset(self.law)
        prepare(self, state.particles.p)

    def project(self, state, h):
        reread(self.sharing, self, state.particles.p)
        find_multipliers(self, h)
        displace(self, state.particles.p)
        state.work[0] += constraints(self.solids, self.cells.members.shape[0])

    def end(self, state, h):
        confine(self.confinement, self, state.particles, h)
        smooth(self.viscosity, self, state.particles)


def densities(fluid: Density, positions: Any) -> np.ndarray:
    """(m,) rho/rho0 of the members, in the order given, at positions (n, d) of all particles [m].

    Solids count in them. Infinite where a position is not finite, for lack of neighbours.
    """
    x = tuple(aligned(axis, fluid.density.dtype) for axis in np.asarray(positions).T)
    measure(fluid._replace(law=None), x)  # which a user's fluid holds as chosen, a bound one as the kernels'
    found = np.full(int(fluid.cells.members.max()) + 1, np.inf)
    placed = fluid.cells.placed[0]
    found[fluid.cells.particle[:placed]] = fluid.density[:placed]
    return found[fluid.cells.members[: constraints(fluid.solids, fluid.size())]]


@kernel
def measure(fluid, x):
    """Densities at x, in sorted order."""
    place(fluid, x)
    for_each(fluid.cells, fluid.position + carried(fluid.solids), DensitySums(fluid))
    add_walls(fluid)


@routine
def prepare(fluid, p):
    """Sort the particles, none of them within a wall, and find those beside walls."""
    for k in range(fluid.cells.members.shape[0]):
        i = fluid.cells.members[k]
        if is_free(fluid.solids, i):
            hold_back(fluid.walls, p, i)
    place(fluid, p)


@device
def place(fluid, x):
    """Sort the particles at x, and find those beside walls."""
    sort(fluid.cells, x)
    gather(fluid.cells, x, fluid.position)
    arrange(fluid.solids, fluid.cells)
    find_near(fluid.walls, fluid.position, fluid.cells.placed[0])


# ------------------------------------------------------------------ the two passes of an iteration


class DensitySums(NamedTuple):
    """rho_i/rho0, grad_i C_i and the sum of r_j |grad_j C_i|^2 of the neighbours, without walls."""

    fluid: Any

    def visit(self, k, first, last):
        fluid = self.fluid
        sums = density_sums(fluid.kernel, fluid.solids, fluid.cells.near, first, last, load(fluid.position, k))
        fluid.density[k] = fluid.value * sums[0]
        fluid.weight[k] = fluid.slope * fluid.slope * sums[1]
        store(fluid.gradient, k, scale(-fluid.slope, sums[2:]))


class PushSums(NamedTuple):
    """sum_j L_j g (x_i - x_j), with repulsion if there is any."""

    fluid: Any

    def visit(self, k, first, last):
        fluid = self.fluid
        point = load(fluid.position, k)
        store(fluid.push, k, push_sums(fluid.kernel, fluid.repulsion, fluid.cells.near, first, last, point))


@routine
def find_multipliers(fluid, h):
    """L_i of all particles."""
    for_each(fluid.cells, fluid.position + carried(fluid.solids), DensitySums(fluid))
    add_walls(fluid)
    for k in range(fluid.cells.placed[0]):
        find_multiplier(fluid, k, h)


@device
def add_walls(fluid):
    """What walls give, and its gradient."""
    for a in range(fluid.walls.found[0]):
        k = fluid.walls.near[a]
        filled, pull = beside_walls(fluid.walls, load(fluid.position, k))
        fluid.density[k] += filled
        accumulate(fluid.gradient, k, like(filled, 1.0), pull)


@device
def find_multiplier(fluid, k, h):
    """L_k from the sums; 0 for a solid."""
    if not is_fluid(fluid.solids, fluid.cells.particle[k]):
        fluid.multiplier[k] = like(fluid.omega, 0.0)
        return
    gradient = load(fluid.gradient, k)
    weight = fluid.inverse_mass * (fluid.weight[k] + dot(gradient, gradient)) + fluid.softness
    row = (0,), fluid.density[k] - like(weight, 1.0), (gradient,), (weight,)
    fluid.multiplier[k] = fluid.omega * fluid.inverse_mass * increment(fluid.law, k, row, fluid.unit, h)


@routine
def displace(fluid, p):
    """p_i <- p_i + dp_i for all particles, kept from entering walls."""
    cells, position = fluid.cells, fluid.position
    for_each(cells, position + (fluid.multiplier,), PushSums(fluid))
    for axis in range(len(p)):
        for k in range(cells.placed[0]):
            moved = multiply_add(fluid.multiplier[k], fluid.gradient[axis][k], position[axis][k])
            position[axis][k] = multiply_add(lightened(fluid.solids, k, -fluid.slope), fluid.push[axis][k], moved)
    for a in range(fluid.walls.found[0]):
        k = fluid.walls.near[a]
        if is_free(fluid.solids, cells.particle[k]):
            hold_back(fluid.walls, position, k)
    for k in range(cells.placed[0]):
        store(p, cells.particle[k], load(position, k))
