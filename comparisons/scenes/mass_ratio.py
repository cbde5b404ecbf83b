"""A heavy box that rests on a light one.

Question: can an engine carry a thousand times a body's weight through it? Solvers that pass contacts one by one need
about as many sweeps as the ratio of the masses; what they lack shows as overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import at_rest
from comparisons.scene import Scene
from comparisons.scenes import _rigid
from pbd import fields

QUESTION = "How deep does a heavy box press a light one into the ground?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """``mass`` is that of the light box; both have equal edges."""

    ratio: float = fields.real(1000.0, "1", 0.0, 1e9, "mass of the upper box over that of the lower", above=True)
    size: float = _rigid.edge()
    offset: float = fields.real(0.01, "1", 0.0, 0.49, "shift of the upper box along x, over its edge")
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    duration: float = _rigid.seconds(3.0)
    samples: int = _rigid.sampling(60)


def build(parameters: Parameters) -> Scene:
    """The two boxes on the plane y = 0."""
    d, size = parameters.dimension, parameters.size
    positions = np.zeros((2, d))
    positions[:, :2] = size * np.array([[0.0, 0.5], [parameters.offset, 1.5]])
    return _rigid.resting(
        parameters,
        at_rest((_rigid.cube(size, d),) * 2, parameters.mass * np.array([1.0, parameters.ratio]), positions),
        name="mass_ratio",
        title=f"a box on one {parameters.ratio:g} times lighter, {parameters.place}",
        planes=_rigid.floor(d),
        metrics=("penetration", "drift", "position_error", "energy_drift"),
    )
