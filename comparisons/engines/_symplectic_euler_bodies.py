"""Rigid bodies under Newtonian symplectic Euler: forces and torques, then momenta, then centres and orientations."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from comparisons.bodies import Ball, Bodies, Box, rotations
from comparisons.engines._symplectic_euler_contacts import Law, World, add_contacts
from comparisons.engines._symplectic_euler_neighbours import Memory, Neighbours
from comparisons.engines._symplectic_euler_shapes import Patch, Shapes
from comparisons.engines._symplectic_euler_space import State, frame, respond, turn
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory, from_samples
from pbd.collision.plane import Planes
from pbd.jit import device, kernel
from pbd.vector import Store, accumulate, add, dot, from_store, load, scale, store, to_store, zero, zeros

SKIN = 0.2
"""Margin of the list of neighbours, over the median bounding radius."""

PAIRS = 12
"""Room for so many neighbours of a body at first."""


@kernel
def integrate(world, times, counts, samples):
    """Run counts = (steps a sample, samples); record at the start and after each sample interval.

    v <- v + h (g + F/m), L <- L + h T, then x <- x + h v and a free turn for h. times = (h, offset): velocities and
    momenta are kept ``offset`` seconds behind, 0 for the lecture's scheme and h/2 for leapfrog, and recorded at the
    time of the positions. Ends at the first sample that is not finite; returns False as soon as there are more pairs
    than the list of neighbours has room for.
    """
    h, offset = times
    for n in range(counts[1] + 1):
        for _ in range(counts[0] if n > 0 else 1):
            step = h if n > 0 else 0.0
            kick(world, step)
            drift(world.state, step)
            if not exert(world, step):
                return False
        if n == 0:
            kick(world, -offset)
        if not sample(world, offset, samples, n):
            return True
    return True


@device
def exert(world, h):
    """Forces and torques at the present positions and velocities, which a step h has led to."""
    state = world.state
    store(world.reaction, 0, zero(world.reaction))
    for i in range(state.w.shape[0]):
        frame(state.q, state, i)
        store(state.spin, i, respond(load(state.momentum, i), state, i))
        store(state.force, i, zero(state.force))
        store(state.torque, i, zero(state.torque))
    return add_contacts(world, h)


@device
def acceleration(world, i):
    if world.state.w[i] > 0.0:
        return add(world.gravity, scale(world.state.w[i], load(world.state.force, i)))
    return zero(world.state.x)


@device
def kick(world, h):
    state = world.state
    for i in range(state.w.shape[0]):
        accumulate(state.v, i, h, acceleration(world, i))
        if state.w[i] > 0.0:
            accumulate(state.momentum, i, h, load(state.torque, i))


@device
def drift(state, h):
    for i in range(state.w.shape[0]):
        accumulate(state.x, i, h, load(state.v, i))
        turn(state.q, state, i, h)


@device
def sample(world, offset, samples, n):
    """Sample n: positions, velocities, orientations, spins, and the planes' total force; whether all is finite."""
    state, total = world.state, 0.0
    for i in range(state.w.shape[0]):
        momentum = add(load(state.momentum, i), scale(offset, load(state.torque, i)))
        write(samples[0], n, i, load(state.x, i))
        write(samples[1], n, i, add(load(state.v, i), scale(offset, acceleration(world, i))))
        write(samples[2], n, i, load(state.q, i))
        write(samples[3], n, i, respond(momentum, state, i))
        total += dot(load(state.x, i), load(state.v, i)) + dot(momentum, momentum)
    reaction = load(world.reaction, 0)
    samples[4][n] = math.sqrt(dot(reaction, reaction))
    return total - total == 0.0


@device
def write(samples, n, i, value):
    for k in range(len(samples)):
        samples[k][n, i] = value[k]


# ------------------------------------------------------------------ from the scene, and back


def prepare(scene: Scene, stiffness: float, dt: float, half_kick: bool) -> Callable[[], Trajectory]:
    """The run of a scene of bodies; ``stiffness`` of a contact point [N/m per kg of the lighter body]."""
    assert scene.bodies is not None
    every, offset = scene.steps_per_sample(dt), 0.5 * dt if half_kick else 0.0
    first = _world(scene, stiffness, PAIRS * len(scene.bodies.masses))
    samples = _samples(scene)

    def run() -> Trajectory:
        world = first
        while not integrate(world, (dt, offset), (every, scene.samples), samples):
            world = _world(scene, stiffness, 2 * len(world.neighbours.first))
        return _trajectory(scene, samples, every * scene.samples, world.work)

    return run


def _world(scene: Scene, stiffness: float, room: int) -> World:
    """All arrays; the list of neighbours has room for so many pairs, or for all that there are."""
    bodies, d = scene.bodies, len(scene.gravity)
    assert bodies is not None
    n, planes = len(bodies.masses), _planes(scene)
    points, pairs = 2**d, min(room, n * (n - 1) // 2)
    shapes = _shapes(bodies.shapes, d)
    e = scene.restitution
    ratio = -math.log(e) / math.hypot(math.pi, math.log(e)) if e > 0.0 else 1.0
    return World(
        _state(bodies, d),
        shapes,
        planes,
        tuple(float(g) for g in scene.gravity),
        Law(stiffness * np.where(bodies.free, bodies.masses, math.inf), ratio, float(scene.friction)),
        _patch(points, d),
        _memory(len(planes.offset) * n + pairs, points, d),
        _neighbours(n, pairs, points, d, SKIN * float(np.median(shapes.bound))),
        zeros(1, d),
        np.zeros(2, dtype=np.int64),
    )


def _planes(scene: Scene) -> Planes:
    if scene.planes is None:
        return Planes(zeros(0, len(scene.gravity)), np.zeros(0))
    return Planes(to_store(scene.planes.normals), np.array(scene.planes.offsets, dtype=float))


def _patch(points: int, d: int) -> Patch:
    depth, weight, part = np.zeros((3, points))
    return Patch(zeros(points, d), depth, weight, part, zeros(points, d), zeros(points, d), zeros(points, d))


def _neighbours(n: int, pairs: int, points: int, d: int, skin: float) -> Neighbours:
    """None listed yet, and no centre seen anywhere near."""
    first, second, spare_first, spare_second = (np.zeros(pairs, dtype=np.int64) for _ in range(4))
    seen, listed = to_store(np.full((n, d), math.inf)), np.zeros(1, dtype=np.int64)
    return Neighbours(first, second, listed, seen, skin, spare_first, spare_second, _memory(pairs, points, d))


def _memory(pairs: int, points: int, d: int) -> Memory:
    return Memory(np.zeros(pairs, dtype=np.int64), zeros(pairs * points, d), zeros(pairs * points, d))


def _shapes(shapes: tuple[Box | Ball, ...], d: int) -> Shapes:
    half = np.array([np.zeros(d) if isinstance(s, Ball) else np.array(s.size) / 2.0 for s in shapes]).reshape(-1, d)
    radius = np.array([s.radius if isinstance(s, Ball) else 0.0 for s in shapes])
    return Shapes(to_store(half), radius, np.hypot(np.linalg.norm(half, axis=1), radius))


def _state(bodies: Bodies, d: int) -> State:
    """Momenta from spins; what is fixed has none."""
    free = bodies.free
    inverse = np.where(free[:, None], 1.0 / bodies.inertias, 0.0)
    spins, moving = np.where(free, bodies.spins.T, 0.0).T, np.where(free[:, None], bodies.velocities, 0.0)
    if d == 2:
        momentum = bodies.inertias * spins[:, None]
    else:
        turns = rotations(bodies.orientations, d)
        momentum = np.einsum("nij,nj,nkj,nk->ni", turns, bodies.inertias, turns, spins)
    n, axes = len(free), inverse.shape[1]
    return State(
        to_store(bodies.positions),
        to_store(moving),
        zeros(n, d),
        to_store(bodies.orientations.reshape(n, -1)),
        tuple(zeros(n, d) for _ in range(d)),
        to_store(momentum),
        zeros(n, axes),
        zeros(n, axes),
        zeros(n, axes),
        np.where(free, 1.0 / bodies.masses, 0.0),
        to_store(inverse),
        inverse.max(axis=1),
    )


def _samples(scene: Scene) -> tuple[Store, Store, Store, Store, np.ndarray]:
    """Of positions, velocities, orientations, spins and the planes' force; what is not reached stays nan."""
    assert scene.bodies is not None
    d, shape = len(scene.gravity), (scene.samples + 1, len(scene.bodies.masses))
    x, v, q, spin = (
        tuple(np.full(shape, math.nan) for _ in range(axes)) for axes in (d, d, *((1, 1) if d == 2 else (4, 3)))
    )
    return x, v, q, spin, np.full(shape[0], math.nan)


def _trajectory(scene: Scene, samples: tuple, steps: int, work: np.ndarray) -> Trajectory:
    x, v, q, spins = (from_store(sampled) for sampled in samples[:4])
    if len(scene.gravity) == 2:
        q, spins = q[..., 0], spins[..., 0]
    counted = {"contact forces": int(work[0]), "pairs tested": int(work[1])}
    return from_samples(scene.times, x, v, steps, orientations=q, spins=spins, contact_forces=samples[4], work=counted)
