"""MuJoCo: multi-body dynamics in minimal coordinates. Trees of rods, and springs as tendons, both without constraints;
rigid bodies, whose contacts are soft constraints: see `_mujoco_bodies`.

Euler kicks first and moves after: v <- v + h a(x, v), then x <- x + h v; implicit solves that kick for the velocity
dependence of the forces; RK4 is the classical Runge-Kutta scheme of order 4. Leapfrog is Euler from rates half a step
early: of order 2 where no force depends on velocities, at a quarter of the cost of RK4. A point mass on a massless rod
is exact, as a dumbbell: see `_mujoco_model`. A run that blows up starts anew, silently, unless ``stripped``; the clock
tells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.engines._body_checks import check_bodies
from comparisons.engines._checks import beyond_rods_and_springs
from comparisons.engines._mujoco_bodies import CONTACTS, BodyModel
from comparisons.engines._mujoco_model import Model, forest
from comparisons.record import Finding
from comparisons.scene import Rods, Scene
from comparisons.trajectory import Trajectory, from_samples
from pbd import fields

TITLE = "MuJoCo"
FOREIGN = True

DISTRIBUTION = "mujoco-core"
INTEGRATORS = {
    "Euler": "mjINT_EULER",
    "RK4": "mjINT_RK4",
    "implicit": "mjINT_IMPLICIT",
    "leapfrog": "mjINT_EULER",
}
BY_SCENE = "by_scene"
UNUSED = ("CONTACT", "CONSTRAINT", "SENSOR", "ACTUATION", "WARMSTART", "EULERDAMP", "AUTORESET")
"""What point masses on rods and springs have no use for."""

USED_BY_BODIES = ("CONTACT", "CONSTRAINT", "WARMSTART")

MAX_DEPTH = 2000
"""Rods one below the other: the joint-space mass matrix holds half of its square, and building takes as long."""


@dataclass(frozen=True)
class Settings:
    """``implicit`` differs from ``Euler`` where forces depend on velocities: rods below rods."""

    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    integrator: str = fields.choice(
        "Euler", (*INTEGRATORS, BY_SCENE), "MuJoCo's own is Euler; by scene: leapfrog where bodies can touch, else RK4"
    )
    stripped: bool = fields.flag(False, "switch off what the scene has no use for, and the silent restart")
    contacts: str = fields.choice(
        "soft", ("soft", *CONTACTS), "of bodies: MuJoCo's own are soft; the others go with the step"
    )

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "matched": {"integrator": BY_SCENE, "stripped": True, "contacts": "rigid"},
}
SWEEP: list[dict[str, Any]] = [{"integrator": name} for name in ("RK4", "Euler", "implicit")]
BODY_SWEEP: list[dict[str, Any]] = [
    {"integrator": "leapfrog"},
    {"integrator": "leapfrog", "contacts": "stiff"},
    {"integrator": "RK4"},
    {"integrator": "implicit"},
]


def missing() -> str:
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        installed(DISTRIBUTION)
    except PackageNotFoundError:
        return f"pip install {DISTRIBUTION}"
    return ""


def version() -> str:
    from importlib.metadata import version as installed

    return installed(DISTRIBUTION)


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers that MuJoCo would take silently."""
    check_bodies(scene)
    if scene.bodies is not None:
        return "MuJoCo's contacts have no coefficient of restitution" if scene.restitution > 0.0 else ""
    if reason := beyond_rods_and_springs(scene):
        return reason
    if scene.of(Rods) and len(scene.gravity) != 2:
        return "the adapter turns rods in the plane only"
    x, trees = scene.masses.positions, forest(scene)
    for rods in scene.of(Rods):
        lengths = np.linalg.norm(x[rods.pairs[:, 0]] - x[rods.pairs[:, 1]], axis=1)
        if not np.allclose(lengths, rods.lengths, rtol=1e-9):
            return "a link of rigid bodies cannot start stretched"
    if trees.loops:
        return "rods in a loop, or between pinned ends, are constraints, which MuJoCo softens"
    if trees.level.max(initial=0) > MAX_DEPTH:
        return f"at most {MAX_DEPTH} rods one below the other: the cost grows with the square of their number and more"
    return ""


def sweep(scene: Scene) -> list[dict[str, Any]]:
    """Without rods no force between point masses depends on velocities, and implicit is Euler."""
    if scene.bodies is not None:
        return BODY_SWEEP
    return SWEEP if scene.of(Rods) else SWEEP[:2]


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Compile the model; the run makes all steps between two samples in one call.

    With leapfrog the rates at a sample are the mean of those half a step before and after it.
    """
    import mujoco

    check_bodies(scene)
    mujoco.set_mju_user_warning(be_quiet)
    integrator = _integrator(scene, settings)
    world, leaps = _world(scene, settings, integrator), integrator == "leapfrog"
    model, data, step = world.model, world.data, mujoco.mj_step
    every, times = scene.steps_per_sample(settings.dt), scene.times
    coordinates = np.repeat(data.qpos[None], len(times), axis=0)
    rates = np.repeat(data.qvel[None], len(times), axis=0)
    clock = np.zeros(len(times))
    qpos, qvel = data.qpos, data.qvel
    push = world.push if isinstance(world, BodyModel) else qvel[:0]
    pushes = np.zeros((len(times), len(push)))
    if leaps:
        mujoco.mj_forward(model, data)
        qvel -= 0.5 * settings.dt * data.qacc

    def run() -> Trajectory:
        ahead = 0
        for k in range(1, len(times)):
            step(model, data, every - ahead)
            coordinates[k], rates[k], pushes[k], clock[k] = qpos, qvel, push, data.time
            if leaps:
                step(model, data, 1)
                rates[k] = 0.5 * (rates[k] + qvel)
                ahead = 1
        rates[np.abs(clock - times) > 0.5 * settings.dt] = np.nan  # started anew
        if isinstance(world, BodyModel):
            return world.trajectory(coordinates, rates, pushes, every * scene.samples)
        positions, velocities = world.ends(coordinates, rates)
        return from_samples(times, positions, velocities, every * scene.samples)

    return run


def calibrate() -> list[Finding]:
    from comparisons.engines._mujoco_findings import find

    return find()


def be_quiet(_: str) -> None:
    """Takes warnings, which would otherwise go into a log file in the working directory."""


def _integrator(scene: Scene, settings: Settings) -> str:
    if settings.integrator != BY_SCENE:
        return settings.integrator
    bodies = scene.bodies
    can_touch = bodies is not None and (scene.planes is not None or len(bodies.shapes) > 1)
    return "leapfrog" if can_touch else "RK4"


def _world(scene: Scene, settings: Settings, integrator: str) -> Model | BodyModel:
    import mujoco

    unused = [name for name in UNUSED if scene.bodies is None or name not in USED_BY_BODIES]
    bits = [getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}") for name in unused] if settings.stripped else []
    option = {
        "timestep": settings.dt,
        "integrator": getattr(mujoco.mjtIntegrator, INTEGRATORS[integrator]),
        "disableflags": sum(int(bit) for bit in bits),
    }
    return Model(scene, option) if scene.bodies is None else BodyModel(scene, option, settings.contacts)
