"""What the adapters of this project's solver share: scenes into particles, links and a simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.engines._checks import beyond_rods_and_springs
from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput

Law = Callable[[Rods | Springs, np.ndarray], Any]
"""How a link is enforced, from the link and the inverse masses [1/kg] of all particles."""


COUNTS = ("re-synchronised solves", "Newton solves", "Newton steps", "CG iterations")


def simulation(scene: Scene, settings: Any, law: Law) -> Any:
    """The scene bound to `pbd.Settings`, a batch for each of its links; raises `InvalidInput` where they do not fit."""
    import pbd

    masses = scene.masses
    particles = pbd.particles(
        masses.positions, masses=masses.masses, velocities=masses.velocities, pinned=masses.pinned
    )
    links = [
        pbd.distance(particles, link.pairs, rest_length=link.lengths, law=law(link, particles.w))
        for link in scene.links
    ]
    return pbd.Simulation(particles, links, gravity=scene.gravity, settings=settings)


def why_not(scene: Scene, settings: Any, law: Law) -> str:
    """Why the solver cannot take the scene with these settings; empty when it can."""
    reason = beyond_rods_and_springs(scene)
    if reason or len(scene.masses.masses) == 0:
        return reason
    try:
        simulation(scene, settings, law)
    except InvalidInput as refused:
        return str(refused)
    return ""


def _counted(out: Any) -> dict[str, int]:
    """What a solver counts of its own, and solves that failed, if any."""
    own = dict(zip(COUNTS, out.solver.counts.tolist(), strict=True)) if hasattr(out.solver, "counts") else {}
    return {**own, "unconverged solves": out.unconverged} if out.unconverged else own


def prepare(scene: Scene, settings: Any, law: Law) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call."""
    bound = simulation(scene, settings, law)
    every = scene.steps_per_sample(settings.dt)
    at = np.arange(scene.samples + 1) * every

    def run() -> Trajectory:
        out = bound.run(every * scene.samples, at)
        work = {"projections": out.projections, **_counted(out)}
        return Trajectory(out.times, out.positions, out.velocities, out.steps, work, out.quantity)

    return run
