"""Pymunk, Python's Chipmunk: sequential impulses in the plane, by Gauss-Seidel with warm starting.

A step moves first and kicks after: x <- x + h v, then v <- v + h a(x) with the impulses that give every
rod the velocity -(1 - error_bias^h) C / h along itself. With ``half_kick`` a leading half step puts v half
a step after x: springs are then leapfrog, and rods with error_bias 0 are SHAKE with one Newton step a step.
Rigid bodies: see `_pymunk_bodies`. Of a fluid grains take the place, see `_granular`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.engines import _granular, _pymunk_bodies
from comparisons.engines._body_checks import check_bodies
from comparisons.engines._checks import beyond_rods_and_springs
from comparisons.record import Finding
from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory, from_samples
from pbd import fields

TITLE = "pymunk"
FOREIGN = True

ENGINE_ERROR_BIAS = float(1 - np.float32(0.1)) ** 60
"""Chipmunk's own: a joint loses a tenth of its error in each 1/60 s, in the single precision of its source.

So does an overlap.
"""

ENGINE_COLLISION_SLOP = float(np.float32(0.1))
"""Chipmunk's own, meant for lengths in pixels."""

FULL_CORRECTION = 0.5
"""Iterations, over links^2, from which Gauss-Seidel converges well enough for a full correction of the rods.

With fewer a full correction pumps energy, the sooner the smaller the step: 0.2 fails at 1e-4 s.
"""


@dataclass(frozen=True)
class Settings:
    """``error_bias`` None is 0 with at least links^2 / 2 iterations, and Chipmunk's own with fewer."""

    dt: float | None = fields.real(1e-3, "s", 1e-12, 1e3, "time step; none: of fluids, by their speed", optional=True)
    iterations: int = fields.whole(10, 1, 1_000_000, "solver iterations in each step")
    error_bias: float | None = fields.real(
        ENGINE_ERROR_BIAS, "1", 0.0, 1.0, "part of a rod's error left after 1 s; none: by links", optional=True
    )
    half_kick: bool = fields.flag(False, "start with half a step: leapfrog, second order")
    collision_slop: float = fields.real(ENGINE_COLLISION_SLOP, "m", 0.0, 1e3, "of bodies: overlap that is left alone")
    collision_bias: float = fields.real(
        ENGINE_ERROR_BIAS, "1", 0.0, 1.0, "of bodies: part of a deeper overlap left after 1 s"
    )
    skin: float = fields.real(0.0, "m", 0.0, 1e3, "of bodies: radius of the edges of boxes and planes")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "matched": {
        "iterations": 50,
        "error_bias": None,
        "half_kick": True,
        "collision_slop": 1e-4,
        "skin": 5e-5,
    },
}
SWEEP: list[dict[str, Any]] = [{"iterations": 10}, {"iterations": 50}, {"iterations": 10, "error_bias": 1e-15}]
BODY_SWEEP: list[dict[str, Any]] = [
    {"iterations": 10},
    {"iterations": 50},
    {"iterations": 50, "collision_slop": 1e-5, "skin": 0.0},
    {"iterations": 50, "half_kick": False},
]


def missing() -> str:
    from importlib.util import find_spec

    return "" if find_spec("pymunk") else "pip install pymunk"


def version() -> str:
    from importlib.metadata import version as installed

    return installed("pymunk")


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers on which Chipmunk aborts the process."""
    check_bodies(scene)
    if len(scene.gravity) != 2:
        return "pymunk is planar"
    if scene.fluid is not None:
        return _granular.unsupported(scene)
    if settings.dt is None and (scene.bodies is not None or len(scene.masses.masses) > 0):
        return "dt must be set for a scene without a fluid"
    return beyond_rods_and_springs(scene) if scene.bodies is None else ""


def sweep(scene: Scene) -> list[dict[str, Any]]:
    return SWEEP if scene.bodies is None and scene.fluid is None else BODY_SWEEP


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Build the space; the run steps and samples it."""
    check_bodies(scene)
    settings = _granular.with_step(scene, settings)
    if scene.fluid is not None:
        return _granular.prepare(scene, settings, prepare)
    if scene.bodies is not None:
        return _pymunk_bodies.prepare(scene, settings)
    space, rods = _build(scene, settings)
    half_kick, dt = settings.half_kick, settings.dt
    assert dt is not None
    if half_kick:
        _half_kick(space, rods, dt)
    step, read = space.step, _reader(space, scene)
    every, times = scene.steps_per_sample(dt), scene.times
    positions = np.repeat(scene.masses.positions[None], len(times), axis=0)
    velocities = np.zeros_like(positions)
    velocities[0] = scene.masses.velocities
    before = np.zeros((2, *positions[0].shape))

    def run() -> Trajectory:
        for k in range(1, scene.samples + 1):
            for _ in range(every - 1):
                step(dt)
            if half_kick:
                read(*before)
            step(dt)
            read(positions[k], velocities[k])
            if half_kick:
                velocities[k] = 0.5 * (before[1] + velocities[k])
        return from_samples(times, positions, velocities, every * scene.samples)

    return run


def calibrate() -> list[Finding]:
    from comparisons.engines._pymunk_findings import find

    return find()


def _build(scene: Scene, settings: Settings) -> tuple[Any, list[Any]]:
    """The space, with the free particles as its moving bodies in the scene's order, and its rods."""
    import pymunk

    space, masses, free = pymunk.Space(), scene.masses, scene.masses.free
    space.gravity, space.iterations = _pair(scene.gravity), settings.iterations
    # links act on centres, so nothing turns; there are no shapes, so nothing collides
    bodies = [
        pymunk.Body(float(m), float("inf")) if moves else space.static_body for m, moves in zip(masses.masses, free)
    ]
    anchors = [(0.0, 0.0) if moves else _pair(x) for x, moves in zip(masses.positions, free)]
    for i in np.flatnonzero(free):
        bodies[i].position, bodies[i].velocity = _pair(masses.positions[i]), _pair(masses.velocities[i])
        space.add(bodies[i])
    rods, error_bias = [], _error_bias(scene, settings)
    for link in scene.links:
        for c, (i, j) in enumerate(link.pairs):
            if not (free[i] or free[j]):
                continue
            ends, length = (bodies[i], bodies[j], anchors[i], anchors[j]), float(link.lengths[c])
            if isinstance(link, Springs):
                space.add(pymunk.DampedSpring(*ends, length, 1.0 / float(link.compliances[c]), 0.0))
                continue
            rod = pymunk.PinJoint(*ends)
            rod.distance, rod.error_bias = length, error_bias
            space.add(rod)
            rods.append(rod)
    return space, rods


def _pair(vector: np.ndarray) -> tuple[float, float]:
    return float(vector[0]), float(vector[1])


def _error_bias(scene: Scene, settings: Settings) -> float:
    if settings.error_bias is not None:
        return settings.error_bias
    count = sum(len(rods.lengths) for rods in scene.of(Rods))
    return 0.0 if settings.iterations >= FULL_CORRECTION * count**2 else ENGINE_ERROR_BIAS


def _half_kick(space: Any, rods: list[Any], dt: float) -> None:
    """Bring v to h/2: step back by h/2 at the start velocity, so that a step of h/2 ends at x and kicks there.

    The rods correct no length here: their share of a half step would be carried through a whole one.
    """
    for body in space.bodies:
        body.position = body.position - 0.5 * dt * body.velocity
    for rod in rods:
        rod.max_bias = 0.0
    space.step(0.5 * dt)
    for rod in rods:
        rod.max_bias = math.inf


def _reader(space: Any, scene: Scene) -> Callable[[np.ndarray, np.ndarray], None]:
    """A function that copies all positions and velocities; pinned particles stay where the scene has them."""
    from pymunk import batch

    free = scene.masses.free
    count, wanted, buffer = int(free.sum()), batch.BodyFields.POSITION | batch.BodyFields.VELOCITY, batch.Buffer()
    index = slice(None) if free.all() else np.flatnonzero(free)

    def read(x: np.ndarray, v: np.ndarray) -> None:
        buffer.clear()
        batch.get_space_bodies(space, wanted, buffer)
        values = np.frombuffer(buffer.float_buf(), count=4 * count).reshape(count, 4)
        x[index], v[index] = values[:, :2], values[:, 2:]

    return read
