"""A ball that bounces on a plane: to h e^(2n) after n impacts, infinitely often until t1 (1 + e) / (1 - e).

Question: how exactly does an engine repeat an impact, and when does it call it rest? An impact is somewhere in a step,
and what the scheme makes of the rest of that step adds up over the rebounds.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.bodies import Ball
from comparisons.scene import Scene
from comparisons.scenes import _bounce, _rigid

QUESTION = "How high are a ball's rebounds, and when does it come to rest?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """A disc, in 3D a sphere."""

    radius: float = _rigid.ball_radius()
    height: float = _rigid.drop_height()
    restitution: float = _rigid.newton(0.8)
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(5.0)
    samples: int = _rigid.sampling(100)


def build(parameters: Parameters) -> Scene:
    """One ball above the plane y = 0."""
    return _bounce.scene(
        parameters,
        Ball(parameters.radius, parameters.dimension),
        ("apexes", "stop_time", "position_error", "energy_rise", "penetration"),
        name="bouncing_ball",
        title=f"a ball bouncing with e = {parameters.restitution:g}, {parameters.place}",
    )
