"""What an engine must not be handed: numbers on which several abort the process, links that it does not know."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.scene import Rods, Scene, Springs
from pbd.errors import InvalidInput


def check_scene(scene: Scene) -> None:
    """Raise `InvalidInput`, which names the array, for a number that is not finite or not positive."""
    masses = scene.masses
    _check("scene.masses.positions", masses.positions, "m")
    _check("scene.masses.velocities", masses.velocities, "m/s")
    _check("scene.masses.masses", masses.masses, "kg", positive=True)
    _check("scene.gravity", scene.gravity, "m/s^2")
    for link in scene.links:
        _check("scene.links.lengths", link.lengths, "m", positive=True)
        if isinstance(link, Springs):
            _check("scene.links.compliances", link.compliances, "m/N", positive=True)


def beyond_rods_and_springs(scene: Scene) -> str:
    """Why an engine that knows rods and springs cannot run the scene; empty when it can."""
    if scene.bodies is not None:
        return "the scene has rigid bodies, and the engine knows point masses only"
    if scene.fluid is not None:
        return "the scene has a fluid, and the engine knows point masses and links only"
    known = all(isinstance(link, Rods | Springs) for link in scene.links)
    return "" if known else "the scene has links that are neither rods nor springs"


def _check(field: str, values: Any, unit: str, positive: bool = False) -> None:
    array = np.asarray(values, dtype=float).ravel()
    bad = ~np.isfinite(array) | ((array <= 0.0) if positive else False)
    if bad.any():
        index = int(np.argmax(bad))
        allowed = f"finite numbers{' > 0' if positive else ''} {unit}"
        raise InvalidInput(field, float(array[index]), allowed, f"it is number {index}")
