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
until it explodes, whatever the step, where omega = .25 to .5, or eps of order 1, does not. XPBD's multipliers, also
without compliance, may take back what they have pushed, so nothing cuts a ripple off: it needs omega < 2/g.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.fluid.candidates import for_each, gather
from pbd.fluid.cells import Cells, cut, fill, laid, place, sort, sorted_places, with_own_candidates
from pbd.fluid.kernels import Poly6Spiky, Wendland
from pbd.fluid.passes import (
    DensitySums,
    PushSums,
    add_walls,
    displace,
    find_multipliers,
    hold_members,
    list_members,
)
from pbd.fluid.rest import Start, remember
from pbd.fluid.solids import Solids, carried, constraints
from pbd.fluid.tasks import CURL, DRAG, FETCH, GATHER, HOLD, LIST, MOVES, MULTIPLIERS, PLACE, PUSHES, SPIN
from pbd.fluid.terms import Repulsion
from pbd.fluid.velocities import Confinement, Viscosity, confine, drag, find_curl, smooth, spin
from pbd.fluid.walls import Walls
from pbd.jit import kernel
from pbd.projection import reset
from pbd.routine import routine
from pbd.team import Team, new_team, together
from pbd.vector import Store, aligned


class Unit(NamedTuple):
    """In the place of particles, where a law asks for inverse masses: the gradients' norms hold them already."""

    w: np.ndarray


@stage
def reread(sharing, fluid, state, h):
    """Bring the sorted positions up to what other batches have made of p since the last pass."""


class Sharing(NamedTuple):
    """There are other batches. Without them positions are read once a step: of a million particles a quarter faster."""

    def reread(self, fluid, state, h):
        together(fluid.team, fluid, GATHER, state, h)


LEAST_PIECE = 64
"""Particles in a piece of a pass."""


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
    rest: Start | None
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
    team: Team | None

    def size(self):
        return self.cells.members.shape[0]

    def alone(self) -> Density:
        """The same where no other batch moves particles."""
        return self._replace(sharing=None)

    def with_team(self, threads: int) -> Density:
        """The same, whose passes so many threads share."""
        team = new_team(threads, self.size() // LEAST_PIECE)
        return self._replace(team=team, walls=self.walls._replace(found=np.zeros(team.pieces, dtype=np.int64)))

    def for_helpers(self) -> list[Density]:
        """One for each thread but the kernel's: candidates are a thread's own, all else is shared."""
        count = self.team.threads - 1 if self.team else 0
        return [self._replace(cells=with_own_candidates(self.cells)) for _ in range(count)]

    def begin(self, state, h):
        reset(self.law)
        remember(self.rest, self, state.particles.x)
        prepare(self, state, h)

    def find_densities(self, x):
        measure_at(self, x)

    def project(self, state, h):
        reread(self.sharing, self, state, h)
        together(self.team, self, MULTIPLIERS, state, h)
        together(self.team, self, PUSHES, state, h)
        together(self.team, self, MOVES, state, h)
        state.work[0] += constraints(self.solids, self.cells.members.shape[0])

    def work(self, task, piece, pieces, state, h):
        do_piece(self, task, piece, pieces, state, h)

    def end(self, state, h):
        confine(self.confinement, self, state, h)
        smooth(self.viscosity, self, state, h)


def densities(fluid: Density, positions: Any) -> np.ndarray:
    """(m,) rho/rho0 of the members, in the order given, at positions (n, d) of all particles [m].

    Solids count in them. Infinite where a position is not finite, for lack of neighbours.
    """
    x = tuple(aligned(axis, fluid.density.dtype) for axis in np.asarray(positions).T)
    # the law a user's fluid holds as chosen, a bound one as the kernels'
    measure(fluid._replace(law=None, team=None), x)
    found = np.full(int(fluid.cells.members.max()) + 1, np.inf)
    placed = fluid.cells.placed[0]
    found[fluid.cells.particle[:placed]] = fluid.density[:placed]
    return found[fluid.cells.members[: constraints(fluid.solids, fluid.size())]]


@kernel
def measure(fluid, x):
    """Densities at x, in sorted order."""
    measure_at(fluid, x)


@routine
def measure_at(fluid, x):
    sort(fluid.cells, x)
    low, high = cut(fluid.cells, 0, 1)
    gather(fluid.cells, x, fluid.position, low, high)
    list_members(fluid, 0, low, high)
    for_each(fluid.cells, fluid.position + carried(fluid.solids), DensitySums(fluid), low, high)
    add_walls(fluid, 0, sorted_places(fluid.cells, low, high)[0])


@routine
def prepare(fluid, state, h):
    """Sort the particles, none of them within a wall, and find those beside walls."""
    together(fluid.team, fluid, HOLD, state, h)
    if laid(fluid.cells, state.particles.p):
        together(fluid.team, fluid, PLACE, state, h)
        fill(fluid.cells)
    together(fluid.team, fluid, GATHER, state, h)
    together(fluid.team, fluid, LIST, state, h)


@routine
def do_piece(fluid, task, piece, pieces, state, h):
    """A piece of the pass of that number, see `pbd.fluid.tasks`."""
    cells, particles = fluid.cells, state.particles
    low, high = cut(cells, piece, pieces)
    first, last = sorted_places(cells, low, high)
    if task == HOLD:
        hold_members(fluid, particles.p, piece, pieces)
    elif task == PLACE:
        place(cells, particles.p, piece, pieces)
    elif task == GATHER:
        gather(cells, particles.p, fluid.position, low, high)
    elif task == LIST:
        list_members(fluid, piece, low, high)
    elif task == MULTIPLIERS:
        find_multipliers(fluid, piece, low, high, h)
    elif task == PUSHES:
        for_each(cells, fluid.position + (fluid.multiplier,), PushSums(fluid), low, high)
    elif task == MOVES:
        displace(fluid, particles.p, piece, first, last)
    elif task == FETCH:
        gather(cells, particles.x + particles.v, fluid.position + fluid.velocity, low, high)
    elif task == DRAG:
        drag(fluid.viscosity, fluid, particles, low, high)
    elif task == CURL:
        find_curl(fluid.confinement, fluid, low, high)
    elif task == SPIN:
        spin(fluid.confinement, fluid, particles, h, low, high)
