"""The inclined plane: it falls towards +x and goes through the origin; gravity stays vertical."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.bodies import Ball, Box, Planes
from comparisons.scene import Scene
from comparisons.scenes import _rigid
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput


def angle(default: float) -> Any:
    """The field ``angle``."""
    return fields.real(default, "degrees", 0.0, 89.0, "of the plane from horizontal", above=True)


def ratio() -> Any:
    """The field ``ratio``."""
    return fields.real(None, "1", 0.0, 100.0, "tan(angle) over friction, instead of angle", above=True, optional=True)


def steepness(parameters: Any) -> float:
    """The plane's angle [rad]."""
    if parameters.ratio is None:
        return float(np.deg2rad(parameters.angle))
    return float(np.arctan(parameters.ratio * parameters.friction))


def check_upright(parameters: Any, slides: bool) -> None:
    """`InvalidInput` where a box of equal edges does not do what the scene says: slide or stick, and not tip over."""
    slope, mu = np.tan(steepness(parameters)), parameters.friction
    if slides != (slope > mu * (1.0 + 1e-12)):
        wanted = f"{'<' if slides else '>='} tan of the angle, {slope:g}"
        raise InvalidInput("scene.friction", mu, wanted, f"else the box {'sticks' if slides else 'slides'}")
    if min(slope, mu) >= 1.0:
        raise InvalidInput("scene.friction", mu, "< 1, as an angle < 45 degrees", "else the box tips over")


def scene(parameters: Any, steep: float, shape: Box | Ball, acceleration: float, **described: Any) -> Scene:
    """One body that goes down a slope of angle ``steep`` [rad] from rest at ``acceleration`` [m/s^2].

    A ball turns as it goes, without slipping; a box stays level with the plane.
    """
    d, reach = parameters.dimension, _rigid.half(shape)
    downhill, normal = (np.array([np.cos(steep), -np.sin(steep)]), np.array([np.sin(steep), np.cos(steep)]))

    def motion(times: np.ndarray) -> Trajectory:
        way, speed = 0.5 * acceleration * times**2, acceleration * times
        rolling = (-way[:, None] / reach, -speed[:, None] / reach)
        turning = rolling if isinstance(shape, Ball) else (-steep, 0.0)
        return _rigid.planar(d, times, *_rigid.along(reach * normal, downhill, way, speed), turning)

    return _rigid.moving(
        parameters,
        [shape],
        [parameters.mass],
        motion,
        planes=Planes(np.append(normal, 0.0)[None, :d], np.zeros(1)),
        **described,
    )
