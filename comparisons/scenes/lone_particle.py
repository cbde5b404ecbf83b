"""A single particle of a fluid, thrown: it has no neighbours, and its constraint no gradient.

Question: is there a division by zero? It must fly as any point mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _fluid, _rigid
from pbd import fields

QUESTION = "Does a particle without neighbours fly as if it were none of a fluid?"


@dataclass(frozen=True)
class Parameters(_fluid.Common):
    """Thrown along x and y with ``speed`` each."""

    width: float = _fluid.extent(0.1, "that is its own: the spacing")
    speed: float = fields.real(1.0, "m/s", 0.0, 1e6, "along x, and along y")
    duration: float = _rigid.seconds(1.0)
    samples: int = _rigid.sampling(20)


def build(parameters: Parameters) -> Scene:
    """The particle at the origin."""
    p = parameters
    return _fluid.thrown(
        p,
        np.zeros((1, p.dimension)),
        p.width,
        name="lone_particle",
        title=f"a lone particle, {p.dimension}D, {p.duration:g} s",
        metrics=("position_error", "momentum_drift", "energy_drift"),
    )
