"""A box that falls flat and rebounds flat: the first time to e^2 h, the last at t1 (1 + e) / (1 - e).

Question: does restitution work where two or four points touch at once? An engine that treats them one by one shares the
impact unevenly between them, and the box rebounds too low, or turns.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.scene import Scene
from comparisons.scenes import _bounce, _rigid

QUESTION = "How high does a box rebound that falls flat?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """The box has equal edges."""

    size: float = _rigid.edge()
    height: float = _rigid.drop_height()
    restitution: float = _rigid.newton(0.5)
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(2.0)
    samples: int = _rigid.sampling(40)


def build(parameters: Parameters) -> Scene:
    """One box above the plane y = 0."""
    return _bounce.scene(
        parameters,
        _rigid.cube(parameters.size, parameters.dimension),
        ("rebound", "position_error", "energy_rise", "penetration"),
        name="rebound",
        title=f"a box rebounding with e = {parameters.restitution:g}, {parameters.place}",
    )
