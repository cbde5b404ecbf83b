"""A box that slides down an inclined plane from rest: g (sin - mu cos) t^2 / 2 along it.

Question: does sliding friction have the right magnitude, also just above the angle at which a box would stick?
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _rigid, _slope

QUESTION = "How far does a box slide down a rough slope?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """The box has equal edges. With ``ratio`` above 1 the slope is so much steeper than sticks."""

    size: float = _rigid.edge()
    angle: float = _slope.angle(30.0)
    ratio: float | None = _slope.ratio()
    friction: float = _rigid.coulomb(0.3)
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()

    def __post_init__(self) -> None:
        super().__post_init__()
        _slope.check_upright(self, slides=True)


def build(parameters: Parameters) -> Scene:
    """One box on the slope."""
    steep = _slope.steepness(parameters)
    return _slope.scene(
        parameters,
        steep,
        _rigid.cube(parameters.size, parameters.dimension),
        parameters.gravity * (np.sin(steep) - parameters.friction * np.cos(steep)),
        name="incline_slip",
        title=f"a box sliding down {np.rad2deg(steep):.4g} degrees, {parameters.place}",
        metrics=("position_error", "energy_rise", "penetration"),
    )
