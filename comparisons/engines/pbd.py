"""The subject: this project's PBD solver, as published - PBD 2006, XPBD 2016, Small Steps 2019."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from comparisons.engines._checks import beyond_rods_and_springs
from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput

TITLE = "PBD"
FOREIGN = False
METHODS = ("pbd", "xpbd", "small_steps")


@dataclass(frozen=True)
class Settings:
    """``pbd`` takes k from each link's compliance where k is not given, so that its first projection is XPBD's."""

    method: str = fields.choice("pbd", METHODS, "PBD 2006; XPBD 2016; XPBD with one iteration a sub-step (2019)")
    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    iterations: int = fields.whole(1, 1, 1_000_000, "solver iterations in each sub-step")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    k: float | None = fields.real(None, "1", 0.0, 1.0, "PBD stiffness; default from the compliance", optional=True)
    raw: bool = fields.flag(False, "apply k itself in each iteration instead of k'")
    damping: float = fields.real(0.0, "1", 0.0, 1.0, "k_damp of the plain velocity damping")

    def __post_init__(self) -> None:
        fields.check(self, "settings")
        if self.method == "small_steps" and self.iterations != 1:
            raise InvalidInput("settings.iterations", self.iterations, "1 with small_steps", "set substeps instead")
        if self.method != "pbd" and (self.k is not None or self.raw):
            raise InvalidInput("settings.method", self.method, "pbd where k or raw is set", "XPBD takes compliance")


NAMES = {"pbd": "PBD 2006", "xpbd": "XPBD", "small_steps": "Small Steps"}

PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"method": "small_steps", "substeps": 1},
    "accurate": {"method": "small_steps", "substeps": 20},
}
VARIANTS: list[dict[str, Any]] = [
    {"method": "pbd"},
    {"method": "xpbd", "iterations": 10},
    {"method": "small_steps", "substeps": 10},
]
SWEEP: list[dict[str, Any]] = [
    {"method": "pbd", "iterations": 1},
    {"method": "pbd", "iterations": 10},
    {"method": "xpbd", "iterations": 10},
    {"method": "small_steps", "substeps": 10},
]


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def unsupported(scene: Scene, settings: Settings) -> str:
    return beyond_rods_and_springs(scene)


def sweep(scene: Scene) -> list[dict[str, Any]]:
    """Without compliance XPBD is PBD with k = 1, to the last bit: one of the two is enough."""
    return SWEEP if scene.of(Springs) else [chosen for chosen in SWEEP if chosen["method"] != "xpbd"]


def describe(settings: Settings) -> str:
    """The method and its counts in words."""
    counts = ((settings.iterations, "iterations"), (settings.substeps, "sub-steps"))
    return ", ".join([NAMES[settings.method], *(f"{n} {what}" for n, what in counts if n > 1)])


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call."""
    import pbd

    masses = scene.masses
    particles = pbd.particles(
        masses.positions, masses=masses.masses, velocities=masses.velocities, pinned=masses.pinned
    )
    links = [
        pbd.distance(particles, link.pairs, rest_length=link.lengths, law=_law(link, particles.w, settings))
        for link in scene.links
    ]
    simulation = pbd.Simulation(
        particles,
        links,
        gravity=scene.gravity,
        settings=pbd.Settings(
            dt=settings.dt,
            iterations=settings.iterations,
            substeps=settings.substeps,
            damping=pbd.Damping(settings.damping, plain=True),
        ),
    )
    every = scene.steps_per_sample(settings.dt)
    at = np.arange(scene.samples + 1) * every

    def run() -> Trajectory:
        out = simulation.run(every * scene.samples, at)
        return Trajectory(
            out.times, out.positions, out.velocities, out.steps, {"projections": out.projections}, out.quantity
        )

    return run


def _law(link: Rods | Springs, w: np.ndarray, settings: Settings) -> Any:
    """The enforcement of a link that the method calls for."""
    import pbd
    from pbd.stiffness import stiffness_of_compliance

    compliance = link.compliances if isinstance(link, Springs) else np.zeros(len(link.lengths))
    if settings.method != "pbd":
        return pbd.Compliance(compliance)
    if settings.k is not None:
        return pbd.Stiffness(settings.k, raw=settings.raw)
    weight = w[link.pairs].sum(axis=1)
    return pbd.Stiffness(stiffness_of_compliance(compliance, weight, settings.dt / settings.substeps), raw=settings.raw)
