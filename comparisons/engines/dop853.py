"""The numerical analyst's own tool: scipy's DOP853, rigid chains in minimal coordinates.

Drawn into every chain plot as a yardstick. It is no game engine: it needs the equations of motion
in a form made for the scene, and cannot take contacts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons import reference
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory
from pbd import fields

TITLE = "DOP853"
FOREIGN = False


@dataclass(frozen=True)
class Settings:
    """The step size is its own; ``rtol`` is what is asked for."""

    rtol: float = fields.real(1e-8, "1", 3e-14, 1e-1, "relative tolerance; the absolute one is a tenth, in m")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {"default": {}}
SWEEP: list[dict[str, Any]] = [{"rtol": 10.0**-exponent} for exponent in range(2, 12)]


def missing() -> str:
    return ""


def version() -> str:
    from importlib.metadata import version as installed

    return installed("scipy")


def unsupported(scene: Scene, settings: Settings) -> str:
    if scene.bodies is not None:
        return "it integrates point masses, and the scene has rigid bodies"
    if len(scene.masses.masses) == 0:
        return ""
    try:
        reference.form(scene)
    except reference.NoReference as reason:
        return str(reason)
    return ""


def sweep(scene: Scene) -> list[dict[str, Any]]:
    return SWEEP


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """The equations of motion; the run is one ``solve_ivp`` with the samples from its dense output."""
    if len(scene.masses.masses) == 0:
        nothing = np.zeros((0, 0, 2))
        return lambda: Trajectory(scene.times[:0], nothing, nothing, steps=0)
    equations = reference.form(scene)

    def run() -> Trajectory:
        return reference.integrate_dense(scene, equations, settings.rtol, 0.1 * settings.rtol)

    return run
