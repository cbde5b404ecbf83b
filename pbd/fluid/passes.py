"""The passes over a fluid's particles, piece by piece: out of walls, into order, multipliers, displacements.

What they compute stands in `pbd.fluid.density`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.fluid.candidates import for_each
from pbd.fluid.cells import members_of, sorted_places
from pbd.fluid.rest import missing, recall
from pbd.fluid.solids import arrange, carried, is_fluid, is_free, lightened
from pbd.fluid.sums import density_sums, push_sums
from pbd.fluid.walls import beside_walls, find_near, hold_back
from pbd.intrinsics import multiply_add
from pbd.jit import device
from pbd.projection import increment, relax
from pbd.routine import routine
from pbd.vector import accumulate, dot, like, load, scale, store


@device
def hold_members(fluid, p, piece, pieces):
    """Move the members of a piece out of walls."""
    first, last = members_of(fluid.cells, piece, pieces)
    for k in range(first, last):
        i = fluid.cells.members[k]
        if is_free(fluid.solids, i):
            hold_back(fluid.walls, p, i)


@device
def list_members(fluid, piece, low, high):
    """Once after sorting, for cells low, ..., high-1: who is near walls; what is kept by particle in sorted order."""
    first, last = sorted_places(fluid.cells, low, high)
    find_near(fluid.walls, fluid.position, piece, first, last)
    arrange(fluid.solids, fluid.cells, low, high)
    recall(fluid.rest, fluid.cells, low, high)


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
def find_multipliers(fluid, piece, low, high, h):
    """L_i of the particles of a piece, those of cells low, ..., high-1."""
    for_each(fluid.cells, fluid.position + carried(fluid.solids), DensitySums(fluid), low, high)
    first, last = sorted_places(fluid.cells, low, high)
    add_walls(fluid, piece, first)
    for k in range(first, last):
        find_multiplier(fluid, k, h)


@device
def add_walls(fluid, piece, first):
    """What walls give to a piece that starts at sorted particle ``first``, and its gradient."""
    for a in range(first, first + np.uint64(fluid.walls.found[piece])):
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
    row = (0,), fluid.density[k] - like(weight, 1.0) + missing(fluid.rest, k), (gradient,), (weight,)
    change = relax(fluid.law, k, increment(fluid.law, k, row, fluid.unit, h), fluid.omega)
    fluid.multiplier[k] = fluid.inverse_mass * change


@routine
def displace(fluid, p, piece, first, last):
    """p_i <- p_i + dp_i for a piece, sorted particles first, ..., last-1, kept from entering walls."""
    cells, position = fluid.cells, fluid.position
    for axis in range(len(p)):
        for k in range(first, last):
            moved = multiply_add(fluid.multiplier[k], fluid.gradient[axis][k], position[axis][k])
            position[axis][k] = multiply_add(lightened(fluid.solids, k, -fluid.slope), fluid.push[axis][k], moved)
    for a in range(first, first + np.uint64(fluid.walls.found[piece])):
        k = fluid.walls.near[a]
        if is_free(fluid.solids, cells.particle[k]):
            hold_back(fluid.walls, position, k)
    for k in range(first, last):
        store(p, cells.particle[k], load(position, k))
