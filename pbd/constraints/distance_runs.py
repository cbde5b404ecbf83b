"""Distances in unit-stride runs, as the coloured order makes them: whole vectors of independent constraints.

See `pbd.solvers.runs` for how they are found.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.constraints.distance import Distance, Shifted
from pbd.intrinsics import typed
from pbd.projection import of_run, sweep
from pbd.state import Particles
from pbd.vector import Constant, One


class DistanceRuns(NamedTuple):
    """Distances in unit-stride runs: those from ``start[r]`` to ``start[r + 1]`` join i[r] + c with j[r] + c.

    ``source`` (m,) is their number before they were sorted, -1 for one of weight 0 that fills a gap; ``real`` of them
    are no such. See `pbd.solvers.runs`.
    """

    i: np.ndarray
    j: np.ndarray
    start: np.ndarray
    source: np.ndarray
    real: int
    rest: np.ndarray
    law: Any

    def size(self):
        return self.real

    def project(self, state, h):
        for r in range(self.i.shape[0]):
            run = Distance(Shifted(self.i[r], self.j[r]), self.rest, self.law)
            sweep(run, range(self.start[r], self.start[r + 1]), state.particles, h)
        state.work[0] += self.real


class UniformRuns(NamedTuple):
    """As `DistanceRuns`, without gaps, and each run of equal constraints between equal particles.

    ``rest`` (r,) and ``w`` (r,) [1/kg] hold one number for each run, and so does the law; only XPBD's multipliers
    are one for each constraint. Nothing but positions is then read and written in the loop. Where the law holds no
    multiplier, w is `One` and its factor holds the inverse mass.
    """

    i: np.ndarray
    j: np.ndarray
    start: np.ndarray
    source: np.ndarray
    rest: np.ndarray
    w: np.ndarray | One
    law: Any

    def size(self):
        return self.source.shape[0]

    def project(self, state, h):
        x, p, v, _ = state.particles
        for r in range(self.i.shape[0]):
            run = Distance(Shifted(self.i[r], self.j[r]), Constant(self.rest[r]), of_run(self.law, r))
            particles = Particles(x, p, v, weight_of_run(self.w, r))
            sweep(run, range(self.start[r], self.start[r + 1]), particles, h)
        state.work[0] += self.source.shape[0]


def weight_of_run(w: Any, r: int) -> Any:
    """The inverse mass of all particles of run r, as a constant."""
    return w if isinstance(w, One) else Constant(w[r])


@typed(weight_of_run)
def _weight_of_run(w: Any, r: Any) -> Any:
    return (lambda w, r: w) if hasattr(w, "instance_class") else (lambda w, r: Constant(w[r]))
