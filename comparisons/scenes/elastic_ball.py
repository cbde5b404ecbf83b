"""A ball that bounces on a plane without loss, for long: its energy is constant.

Question: does an engine's impact gain or lose energy? Any gain grows with each rebound, whatever its phase in a step.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.bodies import Ball
from comparisons.scene import Scene
from comparisons.scenes import _bounce, _rigid

QUESTION = "How much energy does an elastic ball gain or lose?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """A disc, in 3D a sphere."""

    radius: float = _rigid.ball_radius()
    height: float = _rigid.drop_height()
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(20.0)
    samples: int = _rigid.sampling(400)

    @property
    def restitution(self) -> float:
        """It loses nothing."""
        return 1.0


def build(parameters: Parameters) -> Scene:
    """One ball above the plane y = 0."""
    return _bounce.scene(
        parameters,
        Ball(parameters.radius, parameters.dimension),
        ("energy_drift", "position_error", "penetration"),
        name="elastic_ball",
        title=f"an elastic ball, {parameters.place}",
    )
