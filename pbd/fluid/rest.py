"""What density counts as rest, optional: what is None compiles to nothing.

    C_i = rho_i/rho0 - 1 + d_i,    d_i = 1 - rho_i/rho0 at the start of the run

Density by summation lacks what is not there: at a free surface it is .7 to .8 rho0, so a column with constraints C <= 0
has no pressure in its outermost row, and behaves as if it were narrower by about a spacing. With d_i what a particle
lacks at the start it may lack for ever: its density is then what the equation of continuity makes of it, since
d(sum_j V W_ij)/dt = sum_j V (v_i - v_j) . grad W_ij, the sum that weakly compressible SPH integrates (Monaghan 1994).
The start, whatever it is, is at rest. Limit: a surface that folds in keeps its d_i, and leaves voids: for what splashes
or stirs for long, rest density by the lattice alone, as published, is right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.fluid.candidates import gather
from pbd.vector import like


@stage(required=True)
def find_densities(fluid, x):
    """Sort the particles at x, and find their densities, in sorted order."""


@stage
def remember(rest, fluid, x):
    """At the start of a run, at positions x: find what is missing there."""


@stage
def recall(rest, cells, low, high):
    """Bring it into the order of the sorted particles of cells low, ..., high-1."""


@stage
def missing(rest, k):
    """d_k of the k-th sorted particle."""
    return 0.0


class Start(NamedTuple):
    """Rest is the start: ``lack`` (particles,) d_i, ``placed`` (n,) in sorted order, ``known`` (1,) whether so."""

    lack: np.ndarray
    placed: np.ndarray
    known: np.ndarray

    def remember(self, fluid, x):
        if self.known[0] == 0:
            self.known[0] = 1
            find_densities(fluid, x)
            for k in range(fluid.cells.placed[0]):
                self.lack[fluid.cells.particle[k]] = like(fluid.density[k], 1.0) - fluid.density[k]

    def recall(self, cells, low, high):
        gather(cells, (self.lack,), (self.placed,), low, high)

    def missing(self, k):
        return self.placed[k]
