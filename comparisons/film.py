"""What an animation shows of a planar scene: shapes, planes and poses, rounded so that records stay small."""

from __future__ import annotations

from typing import Any

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
    times : [s], or in the unit of ``clock``, which says how a time is written
    shapes : of each body, [width, height] of a box or [radius] of a disc [m]
    planes : [normal x, normal y, offset] of each solid half-space, n . y < offset [m]
    poses : at each time, of each body, [x, y, angle] [m, m, rad]
    view : x from and to, y from and to, that are shown [m]; without it what bodies reach
    moments : indices of the times at which stills tell the story
    """

    engine: str
    label: str
    note: str
    times: list[float]
    shapes: list[list[float]]
    planes: list[list[float]]
    poses: list[list[list[float]]]
    clock: str = "{:.1f} s"
    view: list[float] = []
    moments: list[int] = []


def film(scene: Scene, trajectory: Trajectory, **named: Any) -> Film:
    """All samples of a planar run of rigid bodies or of a fluid, with its ``named`` engine, label, note and more.

    Raises `InvalidInput` for a scene in space or one of point masses.
    """
    planes, angles = scene.planes, trajectory.orientations
    if scene.fluid is not None:
        angles = np.zeros(trajectory.positions.shape[:2])
    if angles is None or len(scene.gravity) != 2 or (scene.bodies is None and scene.fluid is None):
        raise InvalidInput("scene", scene.name, "a planar scene of bodies or a fluid", "set scene.dimension to 2")
    walls = [] if planes is None else np.column_stack([planes.normals, planes.offsets]).tolist()
    poses = np.concatenate([trajectory.positions, angles[..., None]], axis=2)
    return Film(
        **{"times": _rounded(trajectory.times), **named}, shapes=_shapes(scene), planes=walls, poses=_rounded(poses)
    )


def _shapes(scene: Scene) -> list[list[float]]:
    if scene.bodies is not None:
        return [[shape.radius] if isinstance(shape, Ball) else list(shape.size) for shape in scene.bodies.shapes]
    assert scene.fluid is not None
    return [[scene.fluid.spacing / 2.0]] * len(scene.masses.masses)


def _rounded(values: np.ndarray) -> list:
    return (np.round(values, DIGITS) + 0.0).tolist()
