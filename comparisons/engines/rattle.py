"""This project's solver of rigid bodies: RATTLE with contacts, the position-based step made second order.

Impacts are resolved at their own times, contacts solved exactly one by one and together by conjugate sweeps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from comparisons.bodies import Ball, Bodies
from comparisons.engines._body_checks import check_bodies
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory
from pbd import fields

TITLE = "RATTLE contacts"
FOREIGN = False


@dataclass(frozen=True)
class Settings:
    """Two presets serve all scenes."""

    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step; contacts are found once in it")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    iterations: int = fields.whole(10, 1, 1_000_000, "sweeps of a position pass, at most")
    velocity_iterations: int = fields.whole(3, 1, 1_000_000, "sweeps of a velocity pass, at most")
    events: int = fields.whole(8, 0, 1000, "impacts in a sub-step that are resolved in time")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"substeps": 1, "events": 1},
    "accurate": {"substeps": 20, "iterations": 20, "velocity_iterations": 10},
}


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def unsupported(scene: Scene, settings: Settings) -> str:
    if scene.bodies is None:
        return "" if len(scene.masses.masses) == 0 else "it moves rigid bodies, and the scene has point masses"
    check_bodies(scene)
    return ""


def sweep(scene: Scene) -> list[dict[str, Any]]:
    """Both presets, over time steps."""
    return [PRESETS["fast"], PRESETS["accurate"]]


def describe(settings: Settings) -> str:
    """The method and its counts, in words."""
    counts = f"{settings.iterations} + {settings.velocity_iterations} sweeps"
    return f"{TITLE}, {counts}" + (f", {settings.substeps} sub-steps" if settings.substeps > 1 else "")


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call."""
    bound = _simulation(scene, settings)
    every = scene.steps_per_sample(settings.dt)
    at = np.arange(scene.samples + 1) * every

    def run() -> Trajectory:
        out = bound.run(every * scene.samples, at)
        motion = out.bodies
        work = {"projections": out.projections, "pairs": out.pairs}
        turned = {"orientations": motion.orientations, "spins": motion.spins}
        loads = np.linalg.norm(motion.loads, axis=1)
        return Trajectory(
            out.times,
            motion.positions,
            motion.velocities,
            out.steps,
            work,
            out.quantity,
            **turned,
            contact_forces=loads,
        )

    return run


def _simulation(scene: Scene, settings: Settings) -> Any:
    import pbd

    bodies = _bodies(scene.bodies, len(scene.gravity))
    planes = pbd.planes(scene.planes.normals, scene.planes.offsets) if scene.planes is not None else None
    pull = float(np.linalg.norm(scene.gravity))
    contacts = pbd.contacts(bodies, planes, friction=scene.friction, restitution=scene.restitution, gravity=pull)
    return pbd.Simulation(
        None,
        [contacts],
        bodies=bodies,
        gravity=scene.gravity,
        settings=pbd.Settings(
            dt=settings.dt,
            substeps=settings.substeps,
            iterations=settings.iterations,
            integrator=pbd.Rattle(settings.events),
            solver=pbd.ConjugateSweeps(settings.velocity_iterations),
        ),
    )


def _bodies(given: Bodies | None, dimension: int) -> Any:
    import pbd

    if given is None:
        return pbd.bodies([], np.zeros((0, dimension)))
    shapes = [pbd.Ball(s.radius) if isinstance(s, Ball) else pbd.Box(s.size) for s in given.shapes]
    return pbd.bodies(
        shapes,
        given.positions,
        masses=given.masses,
        orientations=given.orientations,
        velocities=given.velocities,
        spins=given.spins,
        fixed=given.fixed,
    )
