"""Boxes as particles, the lecture's way: corners and centre of a box are point masses of `pbd`, held together by PBD.

Two ways to hold them: distances between all, or shape matching ("Unified Particle Physics", Macklin et al. 2014).
Corners meet planes and the faces of other boxes; see `pbd.constraints.corner_contact`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from comparisons.bodies import Box
from comparisons.engines import _particle_boxes_motion as boxes
from comparisons.engines._body_checks import check_bodies
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory, from_samples
from pbd import fields
from pbd.errors import InvalidInput

TITLE = "PBD particle boxes"
FOREIGN = False
METHODS = ("shape_matching", "distance")


@dataclass(frozen=True)
class Settings:
    """``compliance`` takes the place of ``k`` (XPBD); shape matching, which is no constraint C, has k alone."""

    method: str = fields.choice("shape_matching", METHODS, "what holds the particles of a box together")
    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    iterations: int = fields.whole(30, 1, 1_000_000, "solver iterations in each sub-step")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    k: float = fields.real(1.0, "1", 0.0, 1.0, "PBD stiffness")
    raw: bool = fields.flag(False, "apply k itself in each iteration instead of k'")
    compliance: float | None = fields.real(None, "m/N", 0.0, 1e12, "XPBD compliance of each distance", optional=True)

    def __post_init__(self) -> None:
        fields.check(self, "settings")
        if self.compliance is None:
            return
        if self.method != "distance":
            raise InvalidInput("settings.compliance", self.compliance, f"none with {self.method}", "distance has it")
        if self.k != 1.0 or self.raw:
            raise InvalidInput("settings.compliance", self.compliance, "none where k or raw is set", "choose one")


PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"iterations": 5},
    "accurate": {"substeps": 10},
}
SWEEP: list[dict[str, Any]] = [
    {"iterations": 5},
    {},
    {"iterations": 1, "substeps": 30},
    {"method": "distance"},
]


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def sweep(scene: Scene) -> list[dict[str, Any]]:
    return SWEEP


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers that describe no bodies."""
    check_bodies(scene)
    if scene.bodies is None:
        return "the scene has no rigid bodies, and the engine makes particles of boxes only"
    return "" if all(isinstance(shape, Box) for shape in scene.bodies.shapes) else "a ball has no corners"


def describe(settings: Settings) -> str:
    """The method and its counts in words; what is usual is left out."""
    how = f"k = {settings.k:g}{', raw' if settings.raw else ''}" if settings.k != 1.0 else ""
    soft = f"compliance {settings.compliance:g} m/N" if settings.compliance is not None else ""
    counts = ((settings.iterations, "iterations"), (settings.substeps, "sub-steps"))
    said = [word for word in (how, soft, *(f"{n} {what}" for n, what in counts if n > 1)) if word]
    return ", ".join([f"{TITLE}, {settings.method.replace('_', ' ')}", *said])


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call, and then the motion of the boxes is read off their particles."""
    check_bodies(scene)
    bound = simulation(scene, settings)
    every = scene.steps_per_sample(settings.dt)
    samples = np.arange(scene.samples + 1) * every
    recorded = np.union1d(samples, np.maximum(samples - 1, 0))

    def run() -> Trajectory:
        out = bound.run(every * scene.samples, recorded)
        if scene.bodies is None:
            return Trajectory(scene.times, out.positions[:0], out.velocities[:0], out.steps)
        return _trajectory(scene, settings, out, samples, recorded)

    return run


def simulation(scene: Scene, settings: Settings) -> Any:
    """The scene's boxes as particles, what holds them together, and their contacts, bound."""
    import pbd

    steps = pbd.Settings(dt=settings.dt, iterations=settings.iterations, substeps=settings.substeps)
    bodies = scene.bodies
    if bodies is None:
        return pbd.Simulation(pbd.particles(np.zeros((0, len(scene.gravity)))), gravity=scene.gravity, settings=steps)
    made = boxes.particles_of(bodies)
    n, count = made.masses.shape
    x, v = (values.reshape(n * count, -1) for values in boxes.placed(bodies, made))
    index = np.arange(n * count).reshape(n, count)
    pinned = index[list(bodies.fixed)].ravel().tolist()
    particles = pbd.particles(x, masses=made.masses.ravel(), velocities=v, pinned=pinned)
    batches = [_held(particles, index[bodies.free], settings), *_contacts(scene, particles, index[:, :-1])]
    return pbd.Simulation(particles, batches, gravity=scene.gravity, settings=steps)


def _held(particles: Any, index: np.ndarray, settings: Settings) -> Any:
    """What holds the particles (n, P) of each box together."""
    import pbd

    law = pbd.Stiffness(settings.k, raw=settings.raw)
    if settings.method == "shape_matching":
        return pbd.shape_matching(particles, list(index), law=law)
    pairs = np.array(list(itertools.combinations(range(index.shape[1]), 2)))
    soft = None if settings.compliance is None else pbd.Compliance(settings.compliance)
    return pbd.distance(particles, index[:, pairs].reshape(-1, 2), law=soft or law)


def _contacts(scene: Scene, particles: Any, corners: np.ndarray) -> list[Any]:
    """Between boxes, and last, so that nothing is left below a plane, with the planes."""
    import pbd

    grip: dict[str, float] = {
        "friction": scene.friction,
        "restitution": scene.restitution,
        "gravity": float(np.linalg.norm(scene.gravity)),
    }
    found: list[Any] = [pbd.box_contacts(particles, corners, **grip)] if len(corners) > 1 else []
    if scene.planes is not None:
        planes = scene.planes
        found.append(pbd.corner_planes(particles, corners, normal=planes.normals, offset=planes.offsets, **grip))
    return found


def _trajectory(scene: Scene, settings: Settings, out: Any, samples: np.ndarray, recorded: np.ndarray) -> Trajectory:
    """The motion at the samples, as far as the run got; planes' forces from the momentum of the step before each."""
    bodies = scene.bodies
    assert bodies is not None
    made, reached = boxes.particles_of(bodies), len(out.times)
    shape = (reached, *made.rest.shape)
    x, v = out.positions.reshape(shape), out.velocities.reshape(shape)
    now = np.searchsorted(recorded, samples)
    now = now[now < reached]
    found = boxes.motion(made, out.times[now], x[now], v[now])
    of_bodies: dict[str, Any] = {"orientations": found.orientations, "spins": found.spins}
    if scene.planes is not None and bodies.free.all():
        momentum = np.einsum("np,snpi->si", made.masses, v)
        change = (momentum[now] - momentum[np.maximum(now - 1, 0)]) / settings.dt - bodies.masses.sum() * scene.gravity
        of_bodies["contact_forces"] = np.where(now > 0, np.linalg.norm(change, axis=1), 0.0)
    of_bodies["work"] = _counted(out)
    of_bodies["diverged"] = out.quantity
    return from_samples(out.times[now], found.centres, found.velocities, out.steps, **of_bodies)


def _counted(out: Any) -> dict[str, int]:
    """Projections, and contacts that found no room, if any."""
    left_out = sum(int(batch.filled[1]) for batch in out.scene.batches if hasattr(batch, "pair"))
    return {"projections": out.projections, **({"contacts left out": left_out} if left_out else {})}
