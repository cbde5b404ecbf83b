"""A box that falls flat on a plane and stays there: y = h - g t^2 / 2 until t1 = sqrt(2 h / g), then 0.

Question: when does an engine see the impact, and what is left of it? The fall tells its scheme, the rest its contact.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.scene import Scene
from comparisons.scenes import _bounce, _rigid

QUESTION = "When does a box that falls flat land, and does it then lie where it should?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """The box has equal edges."""

    size: float = _rigid.edge()
    height: float = _rigid.drop_height()
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()

    @property
    def restitution(self) -> float:
        """It does not rebound."""
        return 0.0


def build(parameters: Parameters) -> Scene:
    """One box above the plane y = 0."""
    return _bounce.scene(
        parameters,
        _rigid.cube(parameters.size, parameters.dimension),
        ("impact_time", "position_error", "energy_rise", "penetration"),
        name="drop",
        title=f"a box dropped flat from {parameters.height:g} m, {parameters.place}",
    )
