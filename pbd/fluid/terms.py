"""Repulsion between the particles of a fluid, optional: what is None compiles to nothing.

    s_ij = -k h^2 (W(|x_ij|)/W(q h))^4,    added to L_i + L_j

Source: Macklin and Mueller 2013, equation 13. Deviation: k and q are numbers without a unit, or the result would change
with the resolution. Limit: it acts as a pressure of its own, and moves a dam break's front: off for accuracy.
"""

from __future__ import annotations

from typing import NamedTuple

from pbd.dispatch import stage


@stage
def attract(repulsion, pull, w):
    """Lanes of L_j, and s_ij where there is repulsion; ``w`` as of `pbd.fluid.kernels.shape`."""
    return pull


class Repulsion(NamedTuple):
    """s_corr: ``strength`` -k h^2 [m^2], ``inverse`` 1/w at the distance q h."""

    strength: float
    inverse: float

    def attract(self, pull, w):
        share = w * self.inverse
        square = share * share
        return pull + square * square * self.strength
