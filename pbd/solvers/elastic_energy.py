"""The energy that a step of implicit Euler minimises, for springs between point masses, times h^2.

    F(p) = 1/2 |p - x_hat|_M^2 + 1/2 sum_c k_c C_c(p)^2,        C = |d| - L,  d = p_i - p_j,  k = h^2/alpha
    gradient  M (p - x_hat) + sum_c k_c C_c n_c,                n = d/|d|, with the signs of the two ends
    Hessian   M + sum_c [(k - b) n n^T + b I],                  b = k (1 - L/|d|)

with x_hat = x + h v + h^2 M^-1 f_ext, the prediction (e.g. Gast et al. 2015, "Optimization integrator for large time
steps"). A compressed spring has b < 0, and the Hessian may then not be positive definite; the convex one takes b = 0
there (Teran et al. 2005). Coincident ends have no direction: n is 0 and b is k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pbd.intrinsics import prefer_wide_vectors
from pbd.routine import routine, routine_sum
from pbd.solvers.incidence import Incidence, differences, spread
from pbd.vector import Store


class Energy(NamedTuple):
    """What the energy is made of.

    links : which particles the springs join
    rest, stiffness (m,) : L [m] and k = h^2/alpha [kg]
    mass (n,) : [kg], 0 where pinned
    predicted : store (n,) of x_hat
    """

    links: Incidence
    rest: np.ndarray
    stiffness: np.ndarray
    mass: np.ndarray
    predicted: Store


class Springs(NamedTuple):
    """The springs at one p: store (m,) of n, arrays (m,) of k - b and b; ``part`` and ``size`` hold a chunk."""

    normal: Store
    along: np.ndarray
    across: np.ndarray
    part: Store
    size: np.ndarray


@routine_sum
def inertia(energy, p):
    """|p - x_hat|_M^2."""
    total = 0.0
    for k in range(len(p)):
        for i in range(energy.mass.shape[0]):
            moved = p[k][i] - energy.predicted[k][i]
            total += energy.mass[i] * moved * moved
    return total


@routine_sum
def elastic(energy, p, springs):
    """sum_c k_c C_c^2."""
    prefer_wide_vectors()
    links, total = energy.links, 0.0
    for r in range(links.is_run.shape[0]):
        begin, count = links.start[r], links.start[r + 1] - links.start[r]
        for k in range(len(p)):
            differences(links, r, p[k], springs.part[k])
        for c in range(count):
            square = 0.0
            for k in range(len(p)):
                square += springs.part[k][c] * springs.part[k][c]
            stretch = math.sqrt(square) - energy.rest[begin + c]
            total += energy.stiffness[begin + c] * stretch * stretch
    return total


@routine
def value(energy, p, springs):
    """F(p)."""
    return 0.5 * (inertia(energy, p) + elastic(energy, p, springs))


@routine
def linearise(energy, p, springs, g):
    """The springs at p, exactly, and g <- the gradient; at what is pinned that is a reaction."""
    for k in range(len(p)):
        for i in range(energy.mass.shape[0]):
            g[k][i] = energy.mass[i] * (p[k][i] - energy.predicted[k][i])
    for r in range(energy.links.is_run.shape[0]):
        for k in range(len(p)):
            differences(energy.links, r, p[k], springs.part[k])
        derive(energy, springs, energy.links.start[r], energy.links.start[r + 1])
        for k in range(len(p)):
            spread(energy.links, r, springs.part[k], -1.0, g[k])


@routine
def derive(energy, springs, begin, end):
    """n, k - b and b of a chunk from its d in ``part``, which then holds the forces k C n."""
    prefer_wide_vectors()
    for c in range(end - begin):
        square = 0.0
        for k in range(len(springs.part)):
            square += springs.part[k][c] * springs.part[k][c]
        length = math.sqrt(square)
        inverse = 1.0 / length if length > 0.0 else 0.0
        stiffness, rest = energy.stiffness[begin + c], energy.rest[begin + c]
        springs.along[begin + c] = stiffness * rest * inverse
        springs.across[begin + c] = stiffness - stiffness * rest * inverse
        force = stiffness * (length - rest)
        for k in range(len(springs.part)):
            normal = inverse * springs.part[k][c]
            springs.normal[k][begin + c] = normal
            springs.part[k][c] = force * normal


@routine
def make_convex(energy, springs):
    """Without what compressed springs take from the Hessian."""
    for c in range(energy.rest.shape[0]):
        if springs.across[c] < 0.0:
            springs.across[c] = 0.0
            springs.along[c] = energy.stiffness[c]


@routine
def multiply(energy, springs, q, y):
    """y <- H q."""
    prefer_wide_vectors()
    for k in range(len(q)):
        for i in range(energy.mass.shape[0]):
            y[k][i] = energy.mass[i] * q[k][i]
    links, size = energy.links, springs.size
    for r in range(links.is_run.shape[0]):
        begin, count = links.start[r], links.start[r + 1] - links.start[r]
        for k in range(len(q)):
            differences(links, r, q[k], springs.part[k])
        for c in range(count):
            along = 0.0
            for k in range(len(q)):
                along += springs.normal[k][begin + c] * springs.part[k][c]
            size[c] = springs.along[begin + c] * along
        for k in range(len(q)):
            part = springs.part[k]
            for c in range(count):
                part[c] = size[c] * springs.normal[k][begin + c] + springs.across[begin + c] * part[c]
            spread(links, r, part, -1.0, y[k])
