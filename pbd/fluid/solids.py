"""Particles of solids among those of a fluid, optional: what is None compiles to nothing.

They count in the fluid's sums with the volume of its particles and their own inverse masses, and have no constraint
themselves. With r_k = w_k/w, 1 for a particle of the fluid,

    l_i = -C_i/(w (|grad_i C_i|^2 + sum_j r_j |grad_j C_i|^2 + eps/h^2)),   0 for a solid
    dp_k = omega w r_k (l_k grad_k C_k + sum_j l_j grad_k C_j)
    v_i <- v_i + c sum_j V W_ij min(1, m_j/m_i) (v_j - v_i),   m_j/m_i = r_i/r_j

Source: Macklin et al. 2014, "Unified Particle Physics". What two particles do to one another is equal and opposite, so
linear momentum is kept; buoyancy and drag follow. A solid's mass has no part in the density, only its volume.
Particles of a solid are held together by a batch of their own, such as `pbd.shape_matching`. Pinned ones, r = 0, are
obstacles. Repulsion, where it is on, acts between all.

Limits: a pass moves the particles of a solid as if they were free; a body made of many gives way less, and so takes
more iterations. Solids do not hold one another back: that is for contacts. A single layer of particles lets a fast
fluid through.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.fluid.candidates import gather
from pbd.fluid.lanes import inverse, lanes, positive
from pbd.vector import like

SMALLEST = 1e-30
"""Added to r before a division: between two pinned particles."""


@stage
def constraints(solids, count):
    """How many of the sorted particles are fluid."""
    return count


@stage
def arrange(solids, cells):
    """Bring r into sorted order."""


@stage
def carried(solids):
    """What candidates carry beside other numbers, as a tuple."""
    return ()


@stage
def is_fluid(solids, i):
    """Whether particle i has a constraint."""
    return True


@stage
def is_free(solids, i):
    """Whether particle i can move."""
    return True


@stage
def lightened(solids, k, value):
    """value r_k for the k-th sorted particle."""
    return value


@stage
def lightened_lanes(solids, near, place, k, value):
    """value r_j for lanes k, ... of the candidates, whose r is the array at ``place``."""
    return value


@stage
def dragged(solids, own, near, place, k, w):
    """w min(1, r_i/r_j) for lanes k, ... of the candidates of sorted particle ``own``."""
    return w


class Solids(NamedTuple):
    """Which particles are solid.

    number : of them
    solid (n,) : whether a particle of the whole group is of a solid; ``lightness`` (n,) r
    ordered (sorted + PADDING,) : r in sorted order
    """

    number: int
    solid: np.ndarray
    lightness: np.ndarray
    ordered: np.ndarray

    def constraints(self, count):
        return count - self.number

    def arrange(self, cells):
        gather(cells, (self.lightness,), (self.ordered,))

    def carried(self):
        return (self.ordered,)

    def is_fluid(self, i):
        return not self.solid[i]

    def is_free(self, i):
        return self.lightness[i] > 0.0

    def lightened(self, k, value):
        return value * self.ordered[k]

    def lightened_lanes(self, near, place, k, value):
        return value * lanes(near[place], k)

    def dragged(self, own, near, place, k, w):
        ours, theirs = self.ordered[own], lanes(near[place], k)
        heavier = positive(ours - theirs) + theirs
        return w * (ours * inverse(heavier + like(ours, SMALLEST)))
