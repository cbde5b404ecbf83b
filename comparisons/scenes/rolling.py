"""A ball that rolls down an inclined plane from rest without slipping: g sin / (1 + c) t^2 / 2.

Question: does friction turn a ball as it should? c is 1/2 for a disc and 2/5 for a sphere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Ball
from comparisons.scene import Scene
from comparisons.scenes import _rigid, _slope
from pbd.errors import InvalidInput

QUESTION = "How far does a ball roll down a slope?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """A disc, in 3D a sphere."""

    radius: float = _rigid.ball_radius()
    angle: float = _slope.angle(20.0)
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()

    def __post_init__(self) -> None:
        super().__post_init__()
        needed = np.tan(np.deg2rad(self.angle)) * self.inertia / (1.0 + self.inertia)
        if self.friction < needed:
            raise InvalidInput("scene.friction", self.friction, f">= {needed:.4g} at this angle", "else the ball slips")

    @property
    def inertia(self) -> float:
        """c, moment of inertia over m r^2."""
        return float(Ball(1.0, self.dimension).inertia(1.0)[0])


def build(parameters: Parameters) -> Scene:
    """One ball on the slope."""
    steep = float(np.deg2rad(parameters.angle))
    return _slope.scene(
        parameters,
        steep,
        Ball(parameters.radius, parameters.dimension),
        parameters.gravity * np.sin(steep) / (1.0 + parameters.inertia),
        name="rolling",
        title=f"a ball rolling down {parameters.angle:g} degrees, {parameters.place}",
        metrics=("position_error", "attitude_error", "energy_drift", "penetration"),
    )
