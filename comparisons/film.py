"""What an animation shows of a planar scene: shapes, planes and poses, rounded so that records stay small."""

from __future__ import annotations

import msgspec
import numpy as np

from comparisons.bodies import Ball
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput

DIGITS = 3
"""After the point of a pose, in metres and radians: a millimetre is below any pixel."""


class Film(msgspec.Struct, frozen=True, kw_only=True):
    """One engine's motion.

    label, note : its panel's heading, and what to say of it
    times : [s]
    shapes : of each body, [width, height] of a box or [radius] of a disc [m]
    planes : [normal x, normal y, offset] of each solid half-space, n . y < offset [m]
    poses : at each time, of each body, [x, y, angle] [m, m, rad]
    """

    engine: str
    label: str
    note: str
    times: list[float]
    shapes: list[list[float]]
    planes: list[list[float]]
    poses: list[list[list[float]]]


def film(scene: Scene, trajectory: Trajectory, **named: str) -> Film:
    """All samples of a planar run, with its ``named`` engine, label and note.

    Raises `InvalidInput` for a scene in space or one of point masses.
    """
    bodies, planes, angles = scene.bodies, scene.planes, trajectory.orientations
    if bodies is None or angles is None or len(scene.gravity) != 2:
        raise InvalidInput("scene", scene.name, "a planar scene of rigid bodies", "set scene.dimension to 2")
    walls = [] if planes is None else np.column_stack([planes.normals, planes.offsets]).tolist()
    poses = np.concatenate([trajectory.positions, angles[..., None]], axis=2)
    return Film(
        **named,
        times=_rounded(trajectory.times),
        shapes=[[shape.radius] if isinstance(shape, Ball) else list(shape.size) for shape in bodies.shapes],
        planes=walls,
        poses=_rounded(poses),
    )


def _rounded(values: np.ndarray) -> list:
    return (np.round(values, DIGITS) + 0.0).tolist()
