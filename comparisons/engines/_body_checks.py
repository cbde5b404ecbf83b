"""What an engine must not be handed of rigid bodies: numbers on which several abort the process or err silently."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.bodies import Ball, Box
from comparisons.engines._checks import check_scene
from comparisons.scene import Scene
from pbd.errors import InvalidInput

UNIT_TOLERANCE = 1e-9
"""How far the length of a unit vector or quaternion may be from 1."""


def check_bodies(scene: Scene) -> None:
    """Raise `InvalidInput`, which names the array and the body, for numbers that describe no rigid bodies.

    These are: what is not finite; masses and sizes that are not > 0; shapes of another dimension than the scene's;
    quaternions and normals not of unit length; friction < 0; restitution outside [0, 1]. `check_scene` is asked first;
    it is all that a scene without bodies needs.
    """
    check_scene(scene)
    bodies, planes, dimension = scene.bodies, scene.planes, len(scene.gravity)
    if bodies is None:
        return
    _require("scene.bodies.masses", bodies.masses, _is_positive, "a finite number > 0 kg")
    for i, shape in enumerate(bodies.shapes):
        _check_shape(i, shape, dimension)
    _require("scene.bodies.positions", bodies.positions, np.isfinite, "finite numbers m")
    _require("scene.bodies.velocities", bodies.velocities, np.isfinite, "finite numbers m/s")
    _require("scene.bodies.spins", bodies.spins, np.isfinite, "finite numbers rad/s")
    if dimension == 2:
        _require("scene.bodies.orientations", bodies.orientations, np.isfinite, "a finite number rad")
    else:
        _require("scene.bodies.orientations", bodies.orientations, _is_unit, "a unit quaternion (w, x, y, z)")
    if planes is not None:
        _require("scene.planes.normals", planes.normals, _is_unit, "a unit vector")
        _require("scene.planes.offsets", planes.offsets, np.isfinite, "a finite number m")
    _require("scene.friction", [scene.friction], lambda x: np.isfinite(x) & (x >= 0.0), "a finite number >= 0")
    _require("scene.restitution", [scene.restitution], lambda x: (x >= 0.0) & (x <= 1.0), "a number in [0, 1]")


def _check_shape(i: int, shape: Box | Ball, dimension: int) -> None:
    d, size = (len(shape.size), shape.size) if isinstance(shape, Box) else (shape.dimension, [shape.radius])
    if d != dimension:
        raise InvalidInput("scene.bodies.shapes", shape, f"of dimension {dimension}", f"it is number {i}")
    _require(f"scene.bodies.shapes[{i}]", size, _is_positive, "finite numbers > 0 m")


def _require(field: str, values: Any, holds: Callable[[np.ndarray], np.ndarray], allowed: str) -> None:
    """``holds`` gives a truth value for each number, or for each row, of (n, ...) values."""
    array = np.asarray(values, dtype=float)
    bad = ~holds(array)
    if bad.any():
        i = int(np.argwhere(bad)[0, 0])
        raise InvalidInput(field, array[i].tolist(), allowed, f"it is number {i}" if len(array) > 1 else "")


def _is_positive(x: np.ndarray) -> np.ndarray:
    return np.isfinite(x) & (x > 0.0)


def _is_unit(x: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.norm(x, axis=-1) - 1.0) <= UNIT_TOLERANCE
