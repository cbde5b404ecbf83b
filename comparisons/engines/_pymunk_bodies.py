"""Rigid bodies in pymunk: boxes are polygons, planes large static polygons, fixed bodies static.

In a step positions move at the old velocities; then contacts are found, and impulses, with warm starting, make normal
velocities -e times the old ones, or 0, within friction. An overlap beyond ``collision_slop`` loses the share
1 - collision_bias^h, by a velocity that carries no momentum. Friction and restitution of a pair are products: square
roots on every shape give each pair the scene's.

A contact is found only where shapes overlap: one that rests within the slop stays, one that just touches comes and goes
with round-off. Hence ``skin``, a radius of the polygons' edges: at half of the slop boxes rest at their surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.bodies import Box
from comparisons.engines._synchronised import synchronised
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory, from_samples

REACH = 10.0
"""Half the width of a plane's polygon, over the farthest that anything is and goes in free flight."""


def prepare(scene: Scene, settings: Any) -> Callable[[], Trajectory]:
    """Build the space; the run steps and samples it. States are (x, y, angle) and their rates, (2, n, 3)."""
    bodies = scene.bodies
    assert bodies is not None
    space, dt, half_kick = _build(scene, settings), settings.dt, settings.half_kick
    if half_kick:
        _half_kick(space, dt)
    step, read, force = space.step, _reader(space, int(bodies.free.sum())), _force_reader(space)
    every, times, free = scene.steps_per_sample(dt), scene.times, np.flatnonzero(bodies.free)
    states = np.repeat(_start(scene)[None], len(times), axis=0)
    forces = np.zeros(len(times))

    def run() -> Trajectory:
        for k in range(1, len(times)):
            for _ in range(every - 1):
                step(dt)
            before = read() if half_kick else None
            step(dt)
            now = read()
            if before is not None:
                now[1] = synchronised(before[1], now[1], dt * scene.gravity)
            states[k][:, free] = now
            forces[k] = force() / dt
        return _trajectory(scene, states, forces, every * scene.samples)

    return run


def _start(scene: Scene) -> np.ndarray:
    """The scene's own state; what is fixed has it at all times, at rest."""
    bodies = scene.bodies
    assert bodies is not None
    rates = np.column_stack([bodies.velocities, bodies.spins]) * bodies.free[:, None]
    return np.stack([np.column_stack([bodies.positions, bodies.orientations]), rates])


def _trajectory(scene: Scene, states: np.ndarray, forces: np.ndarray, steps: int) -> Trajectory:
    x, v = states[:, 0], states[:, 1]
    of_bodies = {"orientations": x[..., 2].copy(), "spins": v[..., 2].copy()}
    if scene.planes is not None:
        of_bodies["contact_forces"] = forces
    return from_samples(scene.times, x[..., :2].copy(), v[..., :2].copy(), steps, **of_bodies)


def _build(scene: Scene, settings: Any) -> Any:
    """The space, with the free bodies as its moving bodies in the scene's order."""
    import pymunk

    space, bodies = pymunk.Space(), scene.bodies
    assert bodies is not None
    space.gravity, space.iterations = _pair(scene.gravity), settings.iterations
    space.collision_slop, space.collision_bias = settings.collision_slop, settings.collision_bias
    shapes, inertias = _half_spaces(space, scene, settings.skin), bodies.inertias[:, 0]
    for i, shape in enumerate(bodies.shapes):
        if bodies.free[i]:
            body = pymunk.Body(float(bodies.masses[i]), float(inertias[i]))
            body.velocity, body.angular_velocity = _pair(bodies.velocities[i]), float(bodies.spins[i])
        else:
            body = pymunk.Body(body_type=pymunk.Body.STATIC)
        body.position, body.angle = _pair(bodies.positions[i]), float(bodies.orientations[i])
        space.add(body)
        if isinstance(shape, Box):
            width, height = shape.size
            shapes.append(pymunk.Poly.create_box(body, (float(width), float(height)), settings.skin))
        else:
            shapes.append(pymunk.Circle(body, float(shape.radius)))
    for part in shapes:
        part.friction, part.elasticity = math.sqrt(scene.friction), math.sqrt(scene.restitution)
        space.add(part)
    return space


def _half_spaces(space: Any, scene: Scene, skin: float) -> list[Any]:
    """Polygons of the space's own static body, which has no others: as deep as they are wide, lest anything tunnel."""
    import pymunk

    if scene.planes is None:
        return []
    half, found = REACH * _farthest(scene), []
    for normal, offset in zip(scene.planes.normals, scene.planes.offsets):
        along, foot = half * np.array([-normal[1], normal[0]]), offset * normal
        below = foot - 2.0 * half * normal
        corners = (foot + along, foot - along, below - along, below + along)
        found.append(pymunk.Poly(space.static_body, [_pair(corner) for corner in corners], radius=skin))
    return found


def _farthest(scene: Scene) -> float:
    """From the origin, of bodies and planes, at the start and after free flight until the end [m]."""
    bodies, t = scene.bodies, scene.duration
    assert bodies is not None
    offsets = scene.planes.offsets if scene.planes is not None else np.zeros(0)
    sizes = [max(shape.size) if isinstance(shape, Box) else shape.radius for shape in bodies.shapes]
    flight = np.abs(bodies.velocities).max(initial=0.0) * t + float(np.abs(scene.gravity).max()) * t**2
    at_start = np.abs(bodies.positions).max(initial=0.0) + max(sizes, default=1.0)
    return float(at_start + np.abs(offsets).max(initial=0.0) + flight)


def _pair(vector: np.ndarray) -> tuple[float, float]:
    return float(vector[0]), float(vector[1])


def _half_kick(space: Any, dt: float) -> None:
    """Bring rates to h/2: step back by h/2 at the start's, so that a step of h/2 ends at the start and kicks there.

    It corrects no overlap: its share of a half step would be carried through a whole one.
    """
    for body in space.bodies:
        body.position, body.angle = (
            body.position - 0.5 * dt * body.velocity,
            body.angle - 0.5 * dt * body.angular_velocity,
        )
    bias, space.collision_bias = space.collision_bias, 1.0
    space.step(0.5 * dt)
    space.collision_bias = bias


def _reader(space: Any, count: int) -> Callable[[], np.ndarray]:
    """A function that gives the state of the moving bodies, which come first; (2, count, 3)."""
    from pymunk import batch

    each = batch.BodyFields
    wanted, buffer = each.POSITION | each.ANGLE | each.VELOCITY | each.ANGULAR_VELOCITY, batch.Buffer()

    def read() -> np.ndarray:
        buffer.clear()
        batch.get_space_bodies(space, wanted, buffer)
        return np.frombuffer(buffer.float_buf(), count=6 * count).reshape(count, 2, 3).swapaxes(0, 1).copy()

    return read


def _force_reader(space: Any) -> Callable[[], float]:
    """A function that gives the magnitude of the sum of the half-spaces' impulses in the last step [N s]."""
    from pymunk import batch

    each, ground, buffer = batch.ArbiterFields, space.static_body.id, batch.Buffer()
    wanted = each.BODY_A_ID | each.BODY_B_ID | each.TOTAL_IMPULSE

    def read() -> float:
        buffer.clear()
        batch.get_space_arbiters(space, wanted, buffer)
        pairs = np.frombuffer(buffer.int_buf(), dtype=np.uintp).reshape(-1, 2)
        impulses = np.frombuffer(buffer.float_buf()).reshape(-1, 2)
        sign = (pairs[:, 0] == ground).astype(float) - (pairs[:, 1] == ground)
        return float(np.linalg.norm(sign @ impulses))

    return read
