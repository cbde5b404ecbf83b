"""PyBullet: Bullet in double precision, through its in-process client. Rigid serial planar chains, free masses, bodies.

A step kicks first and moves after: v <- v + h a(x, v), then x <- x + h v. With ``half_kick`` v lives
half a step before x: leapfrog. The scene's plane is z = 0. Two formulations of a chain:

articulated : one multi-body in joint angles (Featherstone), each mass at the far end of its massless link.
    With ``half_kick`` second order for one link; first for more, whose forces depend on the rates.
point_to_point : free dumbbell rods held together by ball joints, which Gauss-Seidel solves. A rod with end
    masses a (near) and b (far) is one body of mass a + b, its centre at b L / (a + b) from the near end.
    With ``half_kick`` and erp 1 second order for any number of links.

Rigid bodies have reduced coordinates if articulated, the engine's default, and else maximal ones, as rods have; see
`_pybullet_body_world`. With ``half_kick`` falling, sliding and rolling are of second order, and what rests stays at
rest, as a half step from there changes nothing. Impacts, found at the end of a step, stay of first. Of a fluid grains
take the place, see `_granular`; in the plane they are capsules, so the scene is a slab 1.5 diameters thick.

Damping c, on unless set to 0, is a deceleration c v (1 + |v|) of an articulated link, v in m/s, and
(1 - c)^h on the velocities of a free rod.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.engines import _granular
from comparisons.engines import _pybullet_bodies as rigid
from comparisons.engines._body_checks import check_bodies
from comparisons.engines._checks import check_scene
from comparisons.engines._pybullet_body_world import RECIPES
from comparisons.engines._pybullet_worlds import Articulated, FreeMasses, PointToPoint, World
from comparisons.record import Finding
from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory, from_samples
from pbd import fields

TITLE = "pybullet"
FOREIGN = True

MAX_ARTICULATED_LINKS = 127
"""createMultiBody drops what is beyond, silently."""

FORMULATIONS = ("articulated", "point_to_point", "by_links")


@dataclass(frozen=True)
class Settings:
    """What applies where.

    chains : ``iterations`` and ``erp`` to point_to_point, ``max_joint_velocity`` to articulated
    rigid bodies : all but ``erp``; ``max_joint_velocity`` to articulated, ``warm_starting`` and bounce to the others
    """

    formulation: str = fields.choice(
        "articulated", FORMULATIONS, "by_links: articulated for one link, else ball joints; for bodies the latter"
    )
    dt: float | None = fields.real(1e-3, "s", 1e-12, 1e3, "time step; none: of fluids, by their speed", optional=True)
    damping: float = fields.real(0.04, "1/s", 0.0, 1.0, "linear and angular damping of bodies")
    max_joint_velocity: float = fields.real(100.0, "rad/s", 0.0, 1e30, "joint rates are clamped to it", above=True)
    iterations: int = fields.whole(50, 1, 1_000_000, "solver iterations in each step")
    erp: float = fields.real(0.2, "1", 0.0, 1.0, "part of a joint's error that one step corrects")
    contact: str = fields.choice(
        "rest", tuple(RECIPES), "of bodies: the engine's own, or none before they touch and no speed from overlap"
    )
    restitution_threshold: float = fields.real(0.2, "m/s", 0.0, 1e30, "of bodies: what meets slower does not rebound")
    contact_slop: float = fields.real(1e-5, "m", 0.0, 1e3, "of bodies: overlap that is left alone")
    contact_breaking: float = fields.real(
        0.02, "1", 0.0, 1e3, "of bodies: farthest that a contact moves in a step, over a radius; else lost", above=True
    )
    warm_starting: float = fields.real(
        0.1, "1", 0.0, 1.0, "of bodies: part of a contact's impulse with which the next step starts"
    )
    half_kick: bool = fields.flag(False, "start with half a step: leapfrog")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


MATCHED: dict[str, Any] = {
    "formulation": "by_links",
    "damping": 0.0,
    "max_joint_velocity": 1e30,
    "erp": 1.0,
    "restitution_threshold": 0.0,
    "contact_slop": 1e-9,
    "contact_breaking": 0.1,
    "warm_starting": 0.85,
    "half_kick": True,
}
BOUNCE: dict[str, Any] = {"contact": "bounce", "half_kick": False}
PRESETS: dict[str, dict[str, Any]] = {"default": {}, "matched": MATCHED, "matched_bounce": {**MATCHED, **BOUNCE}}
SWEEP: list[dict[str, Any]] = [
    {"formulation": "articulated"},
    {"formulation": "point_to_point", "iterations": 10},
    {"formulation": "point_to_point", "iterations": 50},
]
BODY_SWEEP: list[dict[str, Any]] = [{"iterations": 10}, BOUNCE, {**BOUNCE, "iterations": 10}]
"""Beside what is matched, which rests and has 50 iterations."""


def missing() -> str:
    from importlib.util import find_spec

    return "" if find_spec("pybullet") else "use Python 3.11 on Linux x86-64, then pip install pybullet"


def version() -> str:
    from importlib.metadata import version as installed

    return installed("pybullet")


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers that Bullet would take silently."""
    if scene.fluid is not None:
        return _granular.unsupported(scene)
    if settings.dt is None and (scene.bodies is not None or len(scene.masses.masses) > 0):
        return "dt must be set for a scene without a fluid"
    if scene.bodies is not None:
        return rigid.unsupported(scene, settings)
    check_scene(scene)
    masses, links = scene.masses, scene.links
    n = len(masses.masses) - 1
    if len(scene.gravity) != 2:
        return "the adapter embeds planar scenes only"
    if scene.of(Springs):
        return "pybullet has no compliant distance joint"
    if n < 0 or not links:
        return ""
    serial = np.column_stack([np.arange(n), np.arange(1, n + 1)])
    if masses.pinned != (0,) or len(links) != 1 or not isinstance(links[0], Rods):
        return "the adapter takes one chain of rods, anchored at particle 0"
    if not np.array_equal(links[0].pairs, serial):
        return "the adapter takes serial chains only"
    if not np.allclose(np.linalg.norm(np.diff(masses.positions, axis=0), axis=1), links[0].lengths, rtol=1e-9):
        return "a link of rigid bodies cannot start stretched"
    if _articulated(n, settings) and n > MAX_ARTICULATED_LINKS:
        return f"pybullet's articulated bodies have at most {MAX_ARTICULATED_LINKS} links"
    return ""


def _articulated(links: int, settings: Settings) -> bool:
    """One link is exact in its angle; from two on, rates enter the forces, which costs an order of accuracy."""
    return links > 0 and (settings.formulation == "articulated" or (settings.formulation == "by_links" and links == 1))


def sweep(scene: Scene) -> list[dict[str, Any]]:
    return SWEEP if scene.bodies is None and scene.fluid is None else BODY_SWEEP


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Build the world in a client of its own, which disconnects when the returned run is dropped: never timed."""
    check_bodies(scene)
    settings = _granular.with_step(scene, settings)
    if scene.fluid is not None:
        return _granular.prepare(scene, settings, prepare)
    bullet = load()
    client = bullet.connect(bullet.DIRECT)
    try:
        _tune(client, settings)
        if scene.bodies is not None:
            run = rigid.runner(client, scene, settings)
        else:
            run = _runner(_build(client, scene, settings), scene, settings)
    except BaseException:
        bullet.disconnect(client)
        raise
    weakref.finalize(run, bullet.disconnect, client)
    return run


def calibrate() -> list[Finding]:
    from comparisons.engines._pybullet_findings import find

    return find()


def load() -> Any:
    """The package; what it writes to standard error from C when imported goes nowhere."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        import pybullet
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
    return pybullet


def _tune(client: int, settings: Settings) -> None:
    import pybullet as bullet

    # a residual threshold above 0 would end the iterations early
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=settings.dt,
        numSolverIterations=settings.iterations,
        solverResidualThreshold=0.0,
        erp=settings.erp,
        physicsClientId=client,
    )


def _build(client: int, scene: Scene, settings: Settings) -> World:
    import pybullet as bullet

    bullet.setGravity(*[*map(float, scene.gravity), 0.0][:3], physicsClientId=client)
    world = _kind(scene, settings)(client, scene, settings)
    if settings.half_kick:
        assert settings.dt is not None
        _half_kick(world, settings.dt)
    return world


def _kind(scene: Scene, settings: Settings) -> Callable[..., World]:
    if not scene.links:
        return FreeMasses
    return Articulated if _articulated(len(scene.masses.masses) - 1, settings) else PointToPoint


def _half_kick(world: World, dt: float) -> None:
    """Bring the rates to -h/2, from what a step of h/2 changes them by."""
    import pybullet as bullet

    coordinates, rates = world.read()
    bullet.setTimeStep(0.5 * dt, world.client)
    bullet.stepSimulation(world.client)
    bullet.setTimeStep(dt, world.client)
    world.write(coordinates, 2.0 * rates - world.read()[1])


def _runner(world: World, scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """With a half kick the rates at a sample are the mean of those half a step before and after it."""
    import pybullet as bullet

    step, read, client, half_kick = bullet.stepSimulation, world.read, world.client, settings.half_kick
    assert settings.dt is not None
    every, times = scene.steps_per_sample(settings.dt), scene.times
    states = np.repeat(world.read()[None], len(times), axis=0)

    def run() -> Trajectory:
        ahead = 0
        for k in range(1, len(times)):
            for _ in range(every - ahead):
                step(client)
            states[k] = read()
            if half_kick:
                step(client)
                states[k, 1] = 0.5 * (states[k, 1] + read()[1])
                ahead = 1
        positions, velocities = world.ends(states)
        positions[0], velocities[0] = scene.masses.positions, scene.masses.velocities
        return from_samples(times, positions, velocities, every * scene.samples)

    return run
