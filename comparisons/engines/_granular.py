"""A fluid as engines of rigid bodies can have it, and as people build it: discs, in space balls, without friction.

Each particle is a ball that fills its cell of the lattice - its diameter is the spacing, its mass the particle's -,
walls are planes and obstacles fixed boxes; friction and restitution are 0. It is no fluid: grains roll off a heap but
bear each other, and a lattice of them, which can stand for ever, packs closer as soon as it is disturbed. So where walls
and gravity hold the grains they are first shaken out of it and settle, in the walls and further ones at their bounds, and
start from there, at rest.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.bodies import Ball, Bodies, Box, Planes, at_rest
from comparisons.engines._checks import check_scene
from comparisons.scene import Scene, no_masses
from comparisons.trajectory import Trajectory

STAND_IN = "granular"
"""What labels say of such a run."""

COURANT = 0.04
"""Way at the scene's speed in a step [spacing], where no step is set."""

SETTLING = 2.0
"""Time in which grains settle [sqrt(height/g)]."""

SHAKE = 1.0
"""Standard deviation of the velocities with which they begin to, along each axis [sqrt(g spacing)]."""

Prepare = Callable[[Scene, Any], Callable[[], Trajectory]]


def unsupported(scene: Scene) -> str:
    """Raises `InvalidInput` for numbers that describe no particles."""
    check_scene(scene)
    assert scene.fluid is not None
    if scene.fluid.solids:
        return "the scene has solids in a fluid, and grains stand for the fluid alone"
    return "the scene has links in a fluid" if scene.links else ""


def with_step(scene: Scene, settings: Any) -> Any:
    """The settings with dt as set, or else the longest step by `COURANT` that divides the sample interval."""
    if settings.dt is not None:
        return settings
    assert scene.fluid is not None
    interval = scene.duration / scene.samples
    steps = math.ceil(interval * scene.fluid.speed / (COURANT * scene.fluid.spacing) - 1e-9)
    return dataclasses.replace(settings, dt=interval / steps)


def grains(scene: Scene) -> Scene:
    """The scene with a ball for each particle, in their order, and the obstacles after them."""
    fluid, masses, d = scene.fluid, scene.masses, len(scene.gravity)
    assert fluid is not None
    n, boxes = len(masses.masses), fluid.obstacles
    shapes = (Ball(0.5 * fluid.spacing, d),) * n + tuple(Box(tuple((high - low).tolist())) for low, high in boxes)
    corners = np.array(boxes).reshape(-1, 2, d)
    bodies = at_rest(
        shapes,
        np.concatenate([masses.masses, fluid.density * np.prod(corners[:, 1] - corners[:, 0], axis=1)]),
        np.concatenate([masses.positions, corners.mean(axis=1)]),
        velocities=np.concatenate([masses.velocities, np.zeros((len(boxes), d))]),
        fixed=tuple(range(n, n + len(boxes))),
    )
    changes: dict[str, Any] = {"masses": no_masses(d), "bodies": bodies, "fluid": None, "exact": None}
    return dataclasses.replace(scene, **changes, friction=0.0, restitution=0.0)


def prepare(scene: Scene, settings: Any, prepare_bodies: Prepare) -> Callable[[], Trajectory]:
    """Let the grains settle if anything holds them; the run is the engine's own of rigid bodies."""
    n, chosen, built = len(scene.masses.masses), with_step(scene, settings), grains(scene)
    if scene.planes is not None and np.any(scene.gravity):
        built = settled(built, n, chosen, prepare_bodies)
    run_bodies = prepare_bodies(built, chosen)

    def run() -> Trajectory:
        out = run_bodies()
        x, v, work = out.positions[:, :n].copy(), out.velocities[:, :n].copy(), {"particle steps": out.steps * n}
        return Trajectory(out.times, x, v, out.steps, work, out.diverged, residue=out.residue)

    return run


def settled(built: Scene, n: int, settings: Any, prepare_bodies: Prepare) -> Scene:
    """The same with its first n bodies where they have come to by `SETTLING`, at rest; what diverges stays as it was."""
    bodies, g = built.bodies, float(np.linalg.norm(built.gravity))
    assert bodies is not None
    height = float(np.ptp(bodies.positions[:n] @ built.gravity)) / g + diameter(bodies)
    steps = math.ceil(SETTLING * math.sqrt(height / g) / settings.dt)
    held = dataclasses.replace(enclosed(built, n), duration=steps * settings.dt, samples=1)
    out = prepare_bodies(held, settings)()
    if out.diverged:
        return built
    positions, still = bodies.positions.copy(), np.zeros_like(bodies.velocities)
    positions[:n] = out.positions[-1, :n]
    return dataclasses.replace(built, bodies=dataclasses.replace(bodies, positions=positions, velocities=still))


def enclosed(built: Scene, n: int) -> Scene:
    """The same with its first n bodies shaken, and planes at their bounds along each axis but above them."""
    bodies, planes, d = built.bodies, built.planes, len(built.gravity)
    assert bodies is not None
    assert planes is not None
    x, sides = bodies.positions[:n], np.concatenate([np.eye(d), -np.eye(d)])
    sides = sides[sides @ built.gravity <= 0.0]
    offsets = (x @ sides.T).min(axis=0) - 0.5 * diameter(bodies)
    walls = Planes(np.concatenate([planes.normals, sides]), np.concatenate([planes.offsets, offsets]))
    speed = SHAKE * math.sqrt(float(np.linalg.norm(built.gravity)) * diameter(bodies))
    velocities = np.zeros_like(bodies.velocities)
    velocities[:n] = np.random.default_rng(0).normal(0.0, speed, (n, d))
    return dataclasses.replace(built, bodies=dataclasses.replace(bodies, velocities=velocities), planes=walls)


def diameter(bodies: Bodies) -> float:
    """Of the grains, which come first [m]."""
    first = bodies.shapes[0]
    assert isinstance(first, Ball)
    return 2.0 * first.radius
