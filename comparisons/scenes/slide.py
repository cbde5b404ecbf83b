"""A box that slides on a rough plane until friction has stopped it, after v0^2 / (2 mu g).

Question: does an engine's friction do Coulomb's work? The deceleration is mu g; a scheme of first order misses the stop
by v0 dt / 2, and friction that is counted twice, or clamped to the wrong impulse, by much more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _rigid
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput

QUESTION = "Where does a sliding box stop?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """The box has equal edges, and tips over from ``friction`` 1 on."""

    size: float = _rigid.edge()
    speed: float = fields.real(5.0, "m/s", 0.0, 1e6, "along x at the start", above=True)
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(1.5)
    samples: int = _rigid.sampling(30)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.friction < 1.0:
            raise InvalidInput("scene.friction", self.friction, "> 0 and < 1", "else the box never stops, or tips over")

    @property
    def stop_time(self) -> float:
        """v0 / (mu g) [s]."""
        return self.speed / (self.friction * self.gravity)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Way [m] and speed [m/s] (s,)."""
        t, slowing = np.minimum(times, self.stop_time), self.friction * self.gravity
        return self.speed * t - 0.5 * slowing * t**2, np.where(times < self.stop_time, self.speed - slowing * t, 0.0)


def build(parameters: Parameters) -> Scene:
    """One box on the plane y = 0, moving along x."""

    def motion(times: np.ndarray) -> Trajectory:
        line = _rigid.along(np.array([0.0, parameters.size / 2.0]), np.array([1.0, 0.0]), *parameters.at(times))
        return _rigid.planar(parameters.dimension, times, *line)

    stops = parameters.lead < parameters.stop_time < parameters.lead + parameters.duration
    start, end = parameters.at(np.array([parameters.lead, parameters.stop_time]))[0]
    return _rigid.moving(
        parameters,
        [_rigid.cube(parameters.size, parameters.dimension)],
        [parameters.mass],
        motion,
        name="slide",
        title=f"a box sliding to a stop, {parameters.place}",
        planes=_rigid.floor(parameters.dimension),
        known={"stop_distance": float(end - start)} if stops else {},
        metrics=(*(["stop_distance"] if stops else []), "position_error", "energy_rise", "penetration"),
    )
