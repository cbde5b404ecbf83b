"""Position based fluids of this project: the density of each particle as a constraint (Macklin and Mueller 2013).

With ``method`` "xpbd" the constraints keep their multipliers in a step and may be compliant. Solids are held together
by shape matching (Macklin et al. 2014), obstacles and walls give back the density that is missing beside them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from comparisons.engines._checks import check_scene
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput

TITLE = "PBF"
FOREIGN = False
METHODS = ("pbf", "xpbd")
PRECISIONS = ("float64", "float32")
RESTS = ("lattice", "start")
KERNELS = ("wendland", "poly6_spiky")

SUPPORT = {2: 2.5, 3: 2.0}
"""Dimension -> reach of the kernel [spacing] unless it is set: 20 and 32 neighbours."""


@dataclass(frozen=True)
class Settings:
    """``dt`` none is ``courant`` spacing / speed, or the next shorter step that divides the sample interval."""

    method: str = fields.choice("pbf", METHODS, "PBF 2013, or XPBD with the same constraints")
    dt: float | None = fields.real(None, "s", 1e-12, 1e3, "time step; none: by courant", optional=True)
    courant: float = fields.real(0.16, "1", 1e-6, 10.0, "way in a step at the scene's speed [spacing]", above=True)
    iterations: int = fields.whole(4, 1, 1_000_000, "solver iterations in each sub-step")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    half_kick: bool = fields.flag(False, "start with half a step: exact in free fall")
    support: float | None = fields.real(
        None, "spacing", 1.2, 6.0, "reach of the kernel; none: 2.5, 3D 2", optional=True
    )
    kernel: str = fields.choice("wendland", KERNELS, "smoothing kernel")
    omega: float = fields.real(1.0, "1", 1e-6, 2.0, "relaxation")
    epsilon: float = fields.real(0.0, "1", 0.0, 1e6, "softening of the constraints")
    viscosity: float = fields.real(0.0, "1", 0.0, 1.0, "c of XSPH")
    confinement: float = fields.real(0.0, "1/s", 0.0, 1e6, "of vorticity")
    repulsion: float = fields.real(0.0, "1", 0.0, 1e6, "k of s_corr")
    rest: str = fields.choice("lattice", RESTS, "density at rest: a lattice's, or the start's")
    k: float = fields.real(1.0, "1", 0.0, 1.0, "PBD stiffness, with pbf")
    raw: bool = fields.flag(False, "apply k itself in each iteration instead of k'")
    compliance: float = fields.real(0.0, "1/J", 0.0, 1e12, "with xpbd")
    threads: int = fields.whole(1, 1, 64, "that share the work; the result is the same to the bit")
    precision: str = fields.choice("float64", PRECISIONS, "of positions, velocities and projections")

    def __post_init__(self) -> None:
        fields.check(self, "settings")
        if self.method != "pbf" and (self.k != 1.0 or self.raw):
            raise InvalidInput("settings.method", self.method, "pbf where k or raw is set", "XPBD takes compliance")
        if self.method == "pbf" and self.compliance:
            raise InvalidInput("settings.compliance", self.compliance, "0 with pbf", "use method xpbd")


PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"rest": "start", "precision": "float32"},
    "accurate": {"rest": "start", "courant": 0.04, "iterations": 2, "omega": 0.5},
}
SWEEP: list[dict[str, Any]] = [
    {},
    {"method": "xpbd", "omega": 0.7},
    {"iterations": 1, "omega": 0.25},
    {"iterations": 10},
]


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers that describe no particles."""
    check_scene(scene)
    is_empty = len(scene.masses.masses) == 0 and scene.bodies is None
    return "" if scene.fluid is not None or is_empty else "the scene has no fluid, and the engine moves nothing else"


def sweep(scene: Scene) -> list[dict[str, Any]]:
    return SWEEP


def describe(settings: Settings) -> str:
    """The method and its counts in words; what is usual is left out."""
    names = {"pbf": "PBF", "xpbd": "XPBD fluid"}
    counts = ((settings.iterations, "iterations"), (settings.substeps, "sub-steps"), (settings.threads, "threads"))
    said = [f"{n} {what}" if n > 1 else f"1 {what[:-1]}" for n, what in counts if n > 1 or what == "iterations"]
    said += [f"omega = {settings.omega:g}"] if settings.omega != 1.0 else []
    said += ["density from the start"] if settings.rest == "start" else []
    said += ["half kick"] if settings.half_kick else []
    said += [settings.precision] if settings.precision != "float64" else []
    return ", ".join([names[settings.method], *said])


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call."""
    dt = step_of(scene, settings)
    bound = _simulation(scene, settings, dt)
    every = scene.steps_per_sample(dt)
    at = np.arange(scene.samples + 1) * every

    def run() -> Trajectory:
        out = bound.run(every * scene.samples, at)
        times = scene.times[: len(out.times)]
        return Trajectory(
            times, out.positions, out.velocities, out.steps, {"projections": out.projections}, out.quantity
        )

    return run


def step_of(scene: Scene, settings: Settings) -> float:
    """dt [s]: as set, or by the Courant number."""
    if settings.dt is not None or scene.fluid is None:
        return settings.dt or scene.duration / scene.samples
    return scene.longest_step(settings.courant * scene.fluid.spacing / scene.fluid.speed)


def _simulation(scene: Scene, settings: Settings, dt: float) -> Any:
    """Particles, the fluid's constraints, and what holds its solids together."""
    import pbd

    masses = scene.masses
    particles = pbd.particles(masses.positions, masses=masses.masses, velocities=masses.velocities)
    steps = pbd.Settings(
        dt=dt,
        iterations=settings.iterations,
        substeps=settings.substeps,
        precision=settings.precision,
        threads=settings.threads if scene.fluid is not None else 1,
        integrator=pbd.Euler(half_kick=settings.half_kick),
    )
    batches = [] if scene.fluid is None else [_density(scene, particles, settings), *_solids(scene, particles)]
    return pbd.Simulation(particles, batches, gravity=scene.gravity, settings=steps)


def _density(scene: Scene, particles: Any, settings: Settings) -> Any:
    import pbd

    fluid, planes = scene.fluid, scene.planes
    assert fluid is not None
    law = pbd.Stiffness(settings.k, raw=settings.raw, relation="at_most")
    walls = {} if planes is None else {"normal": planes.normals, "offset": planes.offsets}
    return pbd.density(
        particles,
        spacing=fluid.spacing,
        support=settings.support or SUPPORT[len(scene.gravity)],
        kernel=settings.kernel,
        law=law if settings.method == "pbf" else pbd.Compliance(settings.compliance, relation="at_most"),
        omega=settings.omega,
        epsilon=settings.epsilon,
        viscosity=settings.viscosity,
        confinement=settings.confinement,
        repulsion=settings.repulsion,
        rest=settings.rest,
        solids=fluid.solid if fluid.solids else None,
        obstacles=fluid.obstacles,
        **walls,
    )


def _solids(scene: Scene, particles: Any) -> list[Any]:
    import pbd

    solids = scene.fluid.solids if scene.fluid is not None else ()
    return [pbd.shape_matching(particles, list(solids))] if solids else []
