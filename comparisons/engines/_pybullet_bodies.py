"""Scenes of rigid bodies in PyBullet: what it refuses, how they run, and what is read back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.bodies import Bodies
from comparisons.engines._body_checks import check_bodies
from comparisons.engines._pybullet_body_world import BodyWorld, in_space, radius
from comparisons.engines._synchronised import synchronised
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory, from_samples

MAX_FRICTION = 10.0
"""Bullet cuts a pair's coefficient to it, silently."""

MAX_TURN = 0.25 * np.pi
"""Of a body within one step [rad]: what spins faster is turned by a wrong angle, silently."""


def unsupported(scene: Scene, settings: Any) -> str:
    """Raises `InvalidInput` for numbers that Bullet would take silently."""
    check_bodies(scene)
    bodies = scene.bodies
    assert bodies is not None
    if len(scene.masses.masses) or scene.links:
        return "the adapter takes either point masses or rigid bodies"
    if scene.friction > MAX_FRICTION:
        return f"pybullet cuts coefficients of friction to {MAX_FRICTION:g}"
    spin = float(np.linalg.norm(bodies.spins.reshape(len(bodies.masses), -1), axis=1).max(initial=0.0))
    if spin * settings.dt > MAX_TURN:
        return f"pybullet turns a body by at most pi/4 in a step: dt must be at most {MAX_TURN / spin:.3g} s"
    return ""


def runner(client: int, scene: Scene, settings: Any) -> Callable[[], Trajectory]:
    """Build the world; the returned function steps and samples it."""
    import pybullet as bullet

    world = BodyWorld(client, scene, settings)
    half_kick, kick = settings.half_kick, settings.dt * np.array(in_space(scene.gravity))
    if half_kick:
        _half_kick(world, settings.dt)
    step, read, force = bullet.stepSimulation, world.read, world.force
    every, times = scene.steps_per_sample(settings.dt), scene.times
    states, forces = np.repeat(world.start[None], len(times), axis=0), np.zeros(len(times))

    def run() -> Trajectory:
        ahead = 0
        world.take_over()
        for k in range(1, len(times)):
            for _ in range(every - ahead):
                step(client)
            states[k], forces[k] = read(), force()
            if half_kick:
                step(client)
                states[k, :, 7:] = synchronised(states[k, :, 7:], read()[:, 7:], kick)
                ahead = 1
        return _trajectory(scene, states, forces, every * scene.samples)

    return run


def _half_kick(world: BodyWorld, dt: float) -> None:
    """Bring the rates to -h/2, from what a step of h/2 changes them by; contact keeps what rests at rest."""
    import pybullet as bullet

    bullet.setTimeStep(0.5 * dt, world.client)
    bullet.stepSimulation(world.client)
    bullet.setTimeStep(dt, world.client)
    before = world.start.copy()
    before[:, 7:] = 2.0 * world.start[:, 7:] - world.read()[:, 7:]
    world.write(before)


def _trajectory(scene: Scene, states: np.ndarray, forces: np.ndarray, steps: int) -> Trajectory:
    d, bodies = len(scene.gravity), scene.bodies
    assert bodies is not None
    more: dict[str, Any] = {} if scene.planes is None else {"contact_forces": forces}
    if d == 2:
        turned = continuous(2.0 * np.arctan2(states[..., 5], states[..., 6]), states[..., 12], scene.times)
        more["orientations"], more["spins"] = bodies.orientations + turned, states[..., 12].copy()
        more["residue"] = residue(states, bodies)
    else:
        more["orientations"], more["spins"] = np.roll(states[..., 3:7], 1, axis=-1), states[..., 10:].copy()
    return from_samples(scene.times, states[..., :d].copy(), states[..., 7 : 7 + d].copy(), steps, **more)


def continuous(angles: np.ndarray, spins: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(s, n) turns since the start [rad], from angles that lack whole turns, and from spins [rad/s].

    Of the turns that fit the angles those count that are nearest to the mean spin between two samples.
    """
    turned = np.diff(angles, axis=0)
    expected = 0.5 * (spins[1:] + spins[:-1]) * np.diff(times)[:, None]
    turned += 2.0 * np.pi * np.round((expected - turned) / (2.0 * np.pi))
    return np.concatenate([np.zeros_like(angles[:1]), np.cumsum(turned, axis=0)])


def residue(states: np.ndarray, bodies: Bodies) -> float:
    """Farthest that a body, or by tilting a point of it, got out of the plane [m]."""
    tilts = 2.0 * np.hypot(states[..., 3], states[..., 4]) * [radius(shape) for shape in bodies.shapes]
    return float(np.nanmax(np.maximum(np.abs(states[..., 2]), tilts), initial=0.0))
