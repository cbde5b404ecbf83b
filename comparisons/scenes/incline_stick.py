"""A box at rest on an inclined plane that is less steep than friction holds.

Question: does static friction hold, or does the box creep? Where friction has no memory each step loses a little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _rigid, _slope

QUESTION = "How far does a box creep on a slope that should hold it?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """The box has equal edges. With ``ratio`` up to 1 the slope is so much less steep than slides."""

    size: float = _rigid.edge()
    angle: float = _slope.angle(20.0)
    ratio: float | None = _slope.ratio()
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(10.0)
    samples: int = _rigid.sampling(200)

    def __post_init__(self) -> None:
        super().__post_init__()
        _slope.check_upright(self, slides=False)


def build(parameters: Parameters) -> Scene:
    """One box on the slope."""
    steep = _slope.steepness(parameters)
    return _slope.scene(
        parameters,
        steep,
        _rigid.cube(parameters.size, parameters.dimension),
        0.0,
        name="incline_stick",
        title=f"a box held on {np.rad2deg(steep):.4g} degrees, {parameters.place}",
        metrics=("creep", "position_error", "energy_drift", "penetration"),
    )
