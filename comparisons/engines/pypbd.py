"""pyPBD: the C++ reference of position-based dynamics, through its Python bindings.

A step is cut into sub-steps of h = dt / substeps: v <- v + h g, x <- x + h v, projections, v <- (x - x_old) / h.
Distance constraints are projected in groups that share no particle, made greedily; see `projection_groups`.
``second_order`` takes v from three positions, which does not fit the prediction x + h v + h^2 g: all falls at 2 g.

Its gravity is fixed to 9.81 m/s^2 along -y. Other scenes are turned, and run on another clock: with t = s tau,
s = sqrt(9.81 / |g|), velocities and compliances scale by s and 1/s^2 and the motion x is the same. Without gravity s is
so large that what remains of it is below round-off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.engines._checks import beyond_rods_and_springs, check_scene
from comparisons.record import Finding
from comparisons.scene import Scene, Springs
from comparisons.trajectory import Trajectory, from_samples
from pbd import fields

TITLE = "pyPBD"
FOREIGN = True

GRAVITY = 9.81
"""m/s^2 along -y; the bindings can read it but not set it."""

WEIGHTLESS = 2.0**30
"""The clock's s for scenes without gravity: what remains is 9.81 / s^2 = 8.5e-18 m/s^2."""

VELOCITY_UPDATES = {"first_order": 0, "second_order": 1}


@dataclass(frozen=True)
class Settings:
    """``pbd`` is PBD with k = 1 for rods only; XPBD takes rods as springs of compliance 0, springs as they are."""

    method: str = fields.choice("xpbd", ("pbd", "xpbd"), "which of the two distance constraints")
    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    substeps: int = fields.whole(5, 1, 1_000_000, "sub-steps in each step")
    iterations: int = fields.whole(1, 1, 1_000_000, "projections of each constraint in each sub-step")
    velocity_iterations: int = fields.whole(5, 0, 1_000_000, "velocity passes, in which distances do nothing")
    velocity_update: str = fields.choice("first_order", tuple(VELOCITY_UPDATES), "from two positions, or three")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {"default": {}, "matched": {"substeps": 1, "velocity_iterations": 0}}
VARIANTS: list[dict[str, Any]] = [
    {},
    PRESETS["matched"],
    {**PRESETS["matched"], "iterations": 10},
]
SWEEP: list[dict[str, Any]] = [{}, {"substeps": 10}, {"iterations": 10}]


def missing() -> str:
    from importlib.util import find_spec

    return "" if find_spec("pypbd") else "use Python 3.11 to 3.13 on Linux or Windows x86-64, then pip install pypbd"


def version() -> str:
    from importlib.metadata import version as installed

    return installed("pypbd")


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers that spread silently."""
    check_scene(scene)
    if reason := beyond_rods_and_springs(scene):
        return reason
    if settings.method == "pbd" and scene.of(Springs):
        return "its PBD constraint has no compliance; xpbd has"
    return ""


def sweep(scene: Scene) -> list[dict[str, Any]]:
    return SWEEP


def describe(settings: Settings) -> str:
    """The method and its counts in words."""
    counts = ((settings.iterations, 1, "iterations"), (settings.substeps, 1, "sub-steps"))
    passes = (settings.velocity_iterations, 0, "velocity passes")
    words = [f"{n} {what}" for n, usual, what in (*counts, passes) if n > usual]
    second = ["second-order velocities"] if settings.velocity_update == "second_order" else []
    return ", ".join([f"pyPBD {settings.method.upper()}", *words, *second])


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Build the model; the run steps and samples it."""
    check_scene(scene)
    world = World(scene, settings)
    every, times, free = scene.steps_per_sample(settings.dt), scene.times, scene.masses.free
    positions = np.repeat(scene.masses.positions[None], len(times), axis=0)
    velocities = np.where(free[:, None], scene.masses.velocities, 0.0) + np.zeros_like(positions)
    velocities[0] = scene.masses.velocities

    def run() -> Trajectory:
        step = world.start()
        for k in range(1, len(times)):
            for _ in range(every - 1):
                step(world.model)
            before = world.x.copy()
            step(world.model)
            world.read(before, positions[k], velocities[k])
        return from_samples(times, positions, velocities, every * scene.samples)

    return run


def calibrate() -> list[Finding]:
    from comparisons.engines._pypbd_findings import find

    return find()


class World:
    """A model and its stepper; ``x`` (n, 3) are the engine's own positions, which it moves."""

    def __init__(self, scene: Scene, settings: Settings) -> None:
        import pypbd

        self.settings, self.free = settings, np.flatnonzero(scene.masses.free)
        pull = float(np.linalg.norm(scene.gravity))
        self.clock = math.sqrt(GRAVITY / pull) if pull > 0.0 else WEIGHTLESS
        self.turn = _turn(scene.gravity, pull)
        # a Simulation that is dropped takes the time manager of all others with it: only the shared one is used
        pypbd.Simulation.getCurrent()
        self.model, self.stepper = pypbd.SimulationModel(), pypbd.TimeStepController()
        self.model.init()
        self._set_up_stepper()
        self._add_particles(scene)
        self._add_links(scene)

    def _set_up_stepper(self) -> None:
        """Parameters by number: one of the wrong type ends the process."""
        from pypbd import TimeStepController as Names

        self.stepper.init()
        for name, value in (
            (Names.NUM_SUB_STEPS, self.settings.substeps),
            (Names.MAX_ITERATIONS, self.settings.iterations),
            (Names.MAX_ITERATIONS_V, self.settings.velocity_iterations),
        ):
            self.stepper.setValueUInt(name, value)
        self.stepper.setValueInt(Names.VELOCITY_UPDATE_METHOD, VELOCITY_UPDATES[self.settings.velocity_update])

    def _add_particles(self, scene: Scene) -> None:
        masses, particles = scene.masses, self.model.getParticles()
        positions, velocities = masses.positions @ self.turn, self.clock * masses.velocities @ self.turn
        for i, (x, v, m, free) in enumerate(zip(positions, velocities, masses.masses, masses.free)):
            particles.addVertex(x)
            particles.setMass(i, float(m) if free else 0.0)
            particles.setVelocity(i, v if free else np.zeros(3))
        self.particles = particles
        # the view of an empty vector would read beyond it
        self.x = np.asarray(particles.getVertices()) if len(positions) else np.zeros((0, 3))

    def _add_links(self, scene: Scene) -> None:
        """Rest lengths are set afterwards: the bindings take them from the positions at the start."""
        model, lengths = self.model, []
        for link in scene.links:
            stiffness = np.zeros(len(link.lengths))
            if isinstance(link, Springs):
                stiffness = self.clock**2 / link.compliances
            for (i, j), length, k in zip(link.pairs.tolist(), link.lengths, stiffness):
                if not (scene.masses.free[i] or scene.masses.free[j]):
                    continue
                if self.settings.method == "pbd":
                    model.addDistanceConstraint(i, j, 1.0)
                else:
                    model.addDistanceConstraint_XPBD(i, j, float(k))
                lengths.append(float(length))
        for constraint, length in zip(model.getConstraints(), lengths, strict=True):
            constraint.restLength = length

    def start(self) -> Callable[[Any], None]:
        """The function that does a step of the model; the step's length belongs to the process, hence set here."""
        import pypbd

        pypbd.TimeManager.getCurrent().setTimeStepSize(self.settings.dt / self.clock)
        step: Callable[[Any], None] = self.stepper.step
        return step

    def read(self, before: np.ndarray, x: np.ndarray, v: np.ndarray) -> None:
        """Copy positions and velocities; one call a particle where the velocity is not that of the whole step."""
        back = self.turn.T
        x[:] = self.x @ back
        if self.settings.substeps == 1 and self.settings.velocity_update == "first_order":
            v[:] = (self.x - before) @ back / self.settings.dt
            return
        for i in self.free:
            v[i] = self.particles.getVelocity(i) @ back / self.clock


def projection_groups(world: World) -> list[list[int]]:
    """Constraints, numbered as they were added, in the order in which each iteration projects them.

    The engine's greedy colouring: each constraint joins the first group that does not touch its particles.
    """
    world.model.initConstraintGroups()
    groups: list[list[int]] = world.model.getConstraintGroups()
    return groups


def _turn(gravity: np.ndarray, pull: float) -> np.ndarray:
    """(d, 3) that takes the scene's vectors, as rows, to the engine's: a reflection of gravity onto -y."""
    rows = np.eye(len(gravity), 3)
    if pull == 0.0:
        return rows
    difference = (gravity / pull) @ rows - np.array([0.0, -1.0, 0.0])
    square = float(difference @ difference)
    return rows if square == 0.0 else rows @ (np.eye(3) - 2.0 / square * np.outer(difference, difference))
