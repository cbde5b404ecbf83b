"""A fluid as engines of rigid bodies can have it, and as people build it: discs, in space balls, without friction.

Each particle is a ball that fills its cell of the lattice - its diameter is the spacing, its mass the particle's -,
walls are planes and obstacles fixed boxes; friction and restitution are 0. It is no fluid: grains roll off a heap but
bear each other, and a lattice of them, which stands for ever, packs closer as soon as it is disturbed. So where walls
and gravity hold the grains they are first poured: drawn apart upwards, each with a random velocity, they fall into the
walls and further ones at their bounds, and start from where they come to, at rest.
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

COURANT = 0.16
"""Way at the scene's speed in a step [spacing], where no step is set; a quarter of it moves no front beyond chance."""

POURING = 2.0
"""Time in which grains come to rest [sqrt(height/g)]: 1e-4 of a fall over the height is left of their energy."""

LOOSE = 1.5
"""Their heights before, over those of the lattice; each is off by up to half of what that leaves between rows."""

SPEED = 1.0
"""Standard deviation of their velocities before, along each axis [sqrt(g spacing)]."""

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
    limit = math.inf if scene.fluid is None else COURANT * scene.fluid.spacing / scene.fluid.speed
    return dataclasses.replace(settings, dt=scene.longest_step(limit))


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
    """Pour the grains if anything holds them; the run is the engine's own of rigid bodies, with a set dt."""
    n, built = len(scene.masses.masses), grains(scene)
    if scene.planes is not None and np.any(scene.gravity):
        built = poured(built, n, settings, prepare_bodies)
    run_bodies = prepare_bodies(built, settings)

    def run() -> Trajectory:
        out = run_bodies()
        x, v, work = out.positions[:, :n].copy(), out.velocities[:, :n].copy(), {"particle steps": out.steps * n}
        return Trajectory(out.times, x, v, out.steps, work, out.diverged, residue=out.residue)

    return run


def poured(built: Scene, n: int, settings: Any, prepare_bodies: Prepare) -> Scene:
    """The same with its first n bodies, at rest, where they come to; what diverges stays as it was."""
    bodies, g = built.bodies, float(np.linalg.norm(built.gravity))
    assert bodies is not None
    height = float(np.ptp(bodies.positions[:n] @ built.gravity)) / g + diameter(bodies)
    steps = math.ceil(POURING * math.sqrt(height / g) / settings.dt)
    held = dataclasses.replace(enclosed(built, n), duration=steps * settings.dt, samples=1)
    out = prepare_bodies(held, settings)()
    if out.diverged:
        return built
    positions, still = bodies.positions.copy(), np.zeros_like(bodies.velocities)
    positions[:n] = out.positions[-1, :n]
    return dataclasses.replace(built, bodies=dataclasses.replace(bodies, positions=positions, velocities=still))


def enclosed(built: Scene, n: int) -> Scene:
    """The same with its first n bodies drawn apart, and planes at their bounds along each axis but above them."""
    bodies, planes, d = built.bodies, built.planes, len(built.gravity)
    assert bodies is not None
    assert planes is not None
    x, sides = bodies.positions[:n], np.concatenate([np.eye(d), -np.eye(d)])
    sides = sides[sides @ built.gravity <= 0.0]
    offsets = (x @ sides.T).min(axis=0) - 0.5 * diameter(bodies)
    walls = Planes(np.concatenate([planes.normals, sides]), np.concatenate([planes.offsets, offsets]))
    positions, velocities = bodies.positions.copy(), np.zeros_like(bodies.velocities)
    positions[:n], velocities[:n] = loosened(x, built.gravity, diameter(bodies))
    loose = dataclasses.replace(bodies, positions=positions, velocities=velocities)
    return dataclasses.replace(built, bodies=loose, planes=walls)


def loosened(x: np.ndarray, gravity: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n, d) of a lattice x that is drawn apart upwards: the same for the same lattice."""
    random, g = np.random.default_rng(0), float(np.linalg.norm(gravity))
    up, room = -gravity / g, (LOOSE - 1.0) * spacing
    height = x @ up
    lifted = (LOOSE - 1.0) * (height - height.min()) + 0.5 * room * random.uniform(0.0, 1.0, len(x))
    return x + lifted[:, None] * up, random.normal(0.0, SPEED * math.sqrt(g * spacing), x.shape)


def diameter(bodies: Bodies) -> float:
    """Of the grains, which come first [m]."""
    first = bodies.shapes[0]
    assert isinstance(first, Ball)
    return 2.0 * first.radius
