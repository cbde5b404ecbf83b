"""Boxes as particles: the solid's inertia, discrete answers on a plane, contacts of boxes, what is kept and refused."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pbd
from comparisons.bodies import Ball, Bodies, Box, Planes, at_rest, rotations
from comparisons.engines import _particle_boxes_motion as boxes
from comparisons.engines import particle_boxes
from comparisons.engines.particle_boxes import Settings
from comparisons.metrics import Subject, penetration
from comparisons.run import build_scene
from comparisons.scene import Scene, no_masses
from pbd.constraints import box_contact
from pbd.constraints.surface import gap_between
from pbd.errors import InvalidInput
from pbd.projection import begin, project
from pbd.state import State
from pbd.vector import from_store, to_store

pytestmark = pytest.mark.slow

G = 9.81
EPS = 1e-13
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])
METHODS = pytest.mark.parametrize("method", particle_boxes.METHODS)


def up(dimension):
    return np.eye(dimension)[1]


def in_plane(dimension, x, y):
    return np.array([x, y, 0.0][:dimension])


def scene(bodies, *, gravity=None, floor=0.0, friction=0.0, restitution=0.0, duration=1.0, samples=10):
    """Bodies over a floor at that height, or none, under gravity along -y."""
    d = bodies.positions.shape[1]
    return Scene(
        "test",
        "test",
        no_masses(d),
        (),
        -G * up(d) if gravity is None else np.asarray(gravity, dtype=float),
        duration,
        samples,
        (),
        bodies=bodies,
        planes=None if floor is None else Planes(up(d)[None], np.full(1, floor)),
        friction=friction,
        restitution=restitution,
    )


def one_box(dimension, height, **changes):
    """A unit box of 2 kg whose centre is that high, unturned."""
    return at_rest((Box((1.0,) * dimension),), np.array([2.0]), height * up(dimension)[None], **changes)


def ran(described, **changes):
    made = Settings(**changes)
    assert particle_boxes.unsupported(described, made) == ""
    trajectory = particle_boxes.prepare(described, made)()
    assert trajectory.diverged == ""
    return trajectory


def random_bodies(rng, dimension, count=4):
    sizes = rng.uniform(0.2, 2.0, (count, dimension))
    quaternions = rng.normal(size=(count, 4))
    quaternions *= np.sign(quaternions[:, :1]) / np.linalg.norm(quaternions, axis=1)[:, None]
    return Bodies(
        tuple(Box(tuple(size)) for size in sizes),
        rng.uniform(0.1, 10.0, count),
        rng.normal(size=(count, dimension)),
        rng.uniform(-3.0, 3.0, count) if dimension == 2 else quaternions,
        rng.normal(size=(count, dimension)),
        rng.normal(size=count if dimension == 2 else (count, 3)),
    )


# ------------------------------------------------------------------ particles for a box


@DIMENSIONS
@given(seed=st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_particles_have_the_mass_and_the_inertia_of_the_solid(dimension, seed):
    bodies = random_bodies(np.random.default_rng(seed), dimension)
    made = boxes.particles_of(bodies)
    np.testing.assert_allclose(made.masses.sum(axis=1), bodies.masses, rtol=1e-15)
    np.testing.assert_allclose(np.einsum("np,npi->ni", made.masses, made.rest), 0.0, atol=1e-15)
    for moment, shape, mass in zip(made.moments, bodies.shapes, bodies.masses, strict=True):
        np.testing.assert_allclose(moment, mass / 12.0 * np.diag(np.square(shape.size)), rtol=1e-14, atol=1e-16)
        about = np.trace(moment) - np.diag(moment) if dimension == 3 else [np.trace(moment)]
        np.testing.assert_allclose(about, shape.inertia(mass), rtol=1e-14)


@DIMENSIONS
@given(seed=st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_the_motion_of_the_boxes_is_read_off_their_particles(dimension, seed):
    """There and back: centre, velocity, orientation, and a spin about any axis, to round-off."""
    bodies = random_bodies(np.random.default_rng(seed), dimension)
    made = boxes.particles_of(bodies)
    x, v = boxes.placed(bodies, made)
    found = boxes.motion(made, np.zeros(1), x[None], v[None])
    for now, then in zip(
        (found.centres, found.velocities, found.orientations, found.spins),
        (bodies.positions, bodies.velocities, bodies.orientations, bodies.spins),
        strict=True,
    ):
        np.testing.assert_allclose(now[0], then, atol=1e-12)


def test_an_angle_goes_on_over_many_turns_between_samples():
    """The spin tells how often the box turned, which the orientation alone does not."""
    bodies = one_box(2, 0.0)
    made, times, spin = boxes.particles_of(bodies), np.linspace(0.0, 2.0, 5), 40.0
    states = [boxes.placed(one_box(2, 0.0, orientations=[spin * t], spins=np.array([spin])), made) for t in times]
    found = boxes.motion(made, times, *(np.array(values) for values in zip(*states, strict=True)))
    np.testing.assert_allclose(found.orientations[:, 0], spin * times, atol=1e-12)


# ------------------------------------------------------------------ one free box


@DIMENSIONS
@METHODS
def test_free_fall_is_that_of_symplectic_euler(dimension, method):
    """g t (t + h) / 2: what holds the box together does not disturb its fall."""
    described = scene(one_box(dimension, 0.0), floor=None)
    trajectory = ran(described, dt=0.01, method=method, iterations=3)
    t = trajectory.times
    np.testing.assert_allclose(trajectory.positions[:, 0, 1], -0.5 * G * t * (t + 0.01), atol=1e-12)
    np.testing.assert_allclose(trajectory.velocities[:, 0, 1], -G * t, atol=1e-11)
    np.testing.assert_allclose(np.abs(trajectory.spins), 0.0, atol=1e-11)


@DIMENSIONS
def test_a_box_spins_by_the_law_of_the_projection(dimension):
    """Each step turns by atan(sin a / (2 - cos a)) after one by a: the numerical damping of v = (p - x)/h."""
    h, omega = 0.01, 5.0
    spins = np.array([omega]) if dimension == 2 else np.array([[0.0, 0.0, omega]])
    described = scene(one_box(dimension, 0.0, spins=spins), floor=None, gravity=np.zeros(dimension), samples=100)
    trajectory = ran(described, dt=h)
    turns = [math.atan(omega * h)]
    for _ in range(99):
        turns.append(math.atan(math.sin(turns[-1]) / (2.0 - math.cos(turns[-1]))))
    assert trajectory.orientations is not None
    turned = rotations(trajectory.orientations, dimension)[:, 0]
    angles = np.unwrap(np.arctan2(turned[:, 1, 0], turned[:, 0, 0]))
    np.testing.assert_allclose(angles, np.append(0.0, np.cumsum(turns)), atol=1e-11)


# ------------------------------------------------------------------ one box on a plane


@DIMENSIONS
@pytest.mark.parametrize(("n", "k", "raw"), [(1, 1.0, False), (5, 1.0, False), (5, 0.4, False), (5, 0.4, True)])
def test_a_box_at_rest_lies_as_deep_as_n_iterations_leave_it(dimension, n, k, raw):
    """The lower corners, a sixth of the mass, are on the plane; the centre of the box sinks by

        5/6 g h^2 q^(n-1) / (1 - q^n),    q = 1 - k'/6,

    because each iteration leaves the share q of the distance between the corners and the rest. The plane bears m g.
    """
    h = 0.01
    described = scene(one_box(dimension, 0.5), duration=20.0, samples=1)
    trajectory = ran(described, dt=h, iterations=n, k=k, raw=raw)
    q = 1.0 - (k if raw else 1.0 - (1.0 - k) ** (1.0 / n)) / 6.0
    sunk = 5.0 / 6.0 * G * h**2 * q ** (n - 1) / (1.0 - q**n)
    assert 0.5 - trajectory.positions[-1, 0, 1] == pytest.approx(sunk, rel=1e-11)
    assert trajectory.contact_forces is not None
    assert trajectory.contact_forces[-1] == pytest.approx(2.0 * G, rel=1e-9)


@DIMENSIONS
@pytest.mark.parametrize("n", [20, 30, 100])
def test_a_flat_impact_rebounds_by_e_but_for_what_is_not_settled(dimension, n):
    """e - (1 + e) (5/6)^n of the speed, whatever the phase of the step in which it lands."""
    e, speed = 0.5, 3.0
    for height in np.linspace(1.0, 1.0 + 1e-3 * speed, 5):
        falling = one_box(dimension, height, velocities=-speed * up(dimension)[None])
        described = scene(falling, gravity=np.zeros(dimension), restitution=e, duration=0.4, samples=4)
        trajectory = ran(described, iterations=n)
        assert trajectory.velocities[-1, 0, 1] == pytest.approx(speed * (e - (1.0 + e) * (5.0 / 6.0) ** n), rel=1e-7)


@DIMENSIONS
@METHODS
def test_a_sliding_box_stops_where_friction_lets_it(dimension, method):
    """v^2 / (2 mu g), within half a step's way; then it lies still."""
    mu, speed, h = 0.4, 3.0, 1e-3
    bodies = one_box(dimension, 0.5, velocities=in_plane(dimension, speed, 0.0)[None])
    described = scene(bodies, friction=mu, duration=2.0, samples=20)
    trajectory = ran(described, dt=h, method=method)
    assert trajectory.positions[-1, 0, 0] == pytest.approx(speed**2 / (2.0 * mu * G), abs=0.6 * speed * h)
    np.testing.assert_allclose(trajectory.velocities[-1], 0.0, atol=1e-6)
    assert np.all(np.diff(trajectory.velocities[:, 0, 0]) <= 1e-6)


@DIMENSIONS
@pytest.mark.parametrize(("share", "n", "leans"), [(0.8, 30, 1e-6), (0.97, 100, 1e-7)])
def test_a_box_sticks_on_a_slope_without_creep(dimension, share, n, leans):
    """It leans by what the iterations leave, and then does not move at all; near the limit it takes more of them."""
    slope = math.radians(20.0)
    described = scene(
        one_box(dimension, 0.5),
        gravity=G * in_plane(dimension, math.sin(slope), -math.cos(slope)),
        friction=math.tan(slope) / share,
        duration=4.0,
        samples=4,
    )
    x = ran(described, iterations=n).positions[:, 0, 0]
    assert 0.0 < x[1] < leans
    np.testing.assert_allclose(x[2:], x[1], atol=1e-13)


def on_velocities(phase=0.0, *, gravity=(0.0, 0.0), speed=0.0, friction=0.0, restitution=0.0, n=30):
    """The motion of a 2D box on the contacts of PBD 2006, which change velocities, in 1 s of 1 ms steps."""
    body = one_box(2, 0.5 + phase, velocities=np.array([[0.0, -speed]]))
    made = boxes.particles_of(body)
    x, v = (values[0] for values in boxes.placed(body, made))
    particles = pbd.particles(x, masses=made.masses[0], velocities=v)
    plane = pbd.plane_contact(
        particles, normal=(0.0, 1.0), friction=friction, restitution=restitution, candidates=range(4)
    )
    batches = [pbd.shape_matching(particles, [range(5)]), plane]
    out = pbd.Simulation(particles, batches, gravity=gravity, settings=pbd.Settings(dt=1e-3, iterations=n)).run(1000)
    return boxes.motion(made, out.times, out.positions[:, None], out.velocities[:, None])


@pytest.mark.parametrize("n", [1, 30])
def test_friction_on_velocities_would_let_it_creep(n):
    """Why contacts act in the projection: where a box should stick on a slope, it would go on with 5 g h sin."""
    slope = math.radians(20.0)
    found = on_velocities(gravity=(G * math.sin(slope), -G * math.cos(slope)), friction=0.6, n=n)
    assert found.velocities[-1, 0, 0] == pytest.approx(5.0 * G * 1e-3 * math.sin(slope), rel=1e-6)


def test_restitution_on_velocities_would_depend_on_the_phase_of_the_step():
    """And an impact at the same speed rebounds with almost nothing, or with more than e."""
    phases = np.linspace(0.0, 3e-3, 16, endpoint=False)
    rebounds = [on_velocities(0.5 + p, speed=3.0, restitution=0.5).velocities[-1, 0, 1] / 3.0 for p in phases]
    assert min(rebounds) < 0.05
    assert max(rebounds) > 0.6


@DIMENSIONS
@METHODS
def test_a_box_dropped_tilted_comes_to_rest_flat(dimension, method):
    """It lands on a corner, tips, rocks, and lies on a face; its energy never rises."""
    turned = np.array([0.5]) if dimension == 2 else np.array([[0.9, 0.3, 0.1, 0.3]]) / math.sqrt(1.0)
    bodies = one_box(dimension, 1.5, orientations=turned)
    described = scene(bodies, friction=0.5, duration=6.0, samples=60)
    trajectory = ran(described, method=method)
    assert trajectory.positions[-1, 0, 1] == pytest.approx(0.5, abs=1e-5)
    np.testing.assert_allclose(trajectory.velocities[-1], 0.0, atol=1e-5)
    assert trajectory.orientations is not None
    turn = np.abs(rotations(trajectory.orientations, dimension)[-1, 0])
    np.testing.assert_allclose(turn[:, np.argmax(turn[1])], up(dimension), atol=1e-4)
    energy = Subject(trajectory, described).energy
    assert np.diff(energy).max() <= 1e-6 * energy[0]


# ------------------------------------------------------------------ boxes on boxes


def stack(dimension, count, jitter=0.01):
    shifts = np.random.default_rng(0).uniform(-jitter, jitter, (count, dimension))
    shifts[:, 1] = np.arange(count) + 0.5
    return at_rest((Box((1.0,) * dimension),) * count, np.ones(count), shifts)


@DIMENSIONS
@METHODS
@pytest.mark.parametrize("count", [2, 3])
def test_a_stack_stands(dimension, method, count):
    """Boxes shifted by 1 %, three seconds: they sink by about g h^2, do not creep, and the floor bears them all."""
    described = scene(stack(dimension, count), friction=0.5, duration=3.0, samples=3)
    trajectory = ran(described, method=method)
    moved = trajectory.positions[-1] - trajectory.positions[0]
    assert np.abs(moved).max() < 2e-5
    assert trajectory.contact_forces is not None
    assert trajectory.contact_forces[-1] == pytest.approx(count * G, rel=1e-3)
    assert np.abs(trajectory.positions[-1] - trajectory.positions[1]).max() < 5e-6


@DIMENSIONS
def test_momenta_are_kept_by_contacts_of_boxes(dimension):
    """A contact that rebounds: sum m dp = 0, sum r x m dp = 0; with friction, which acts across the gap, the first."""
    rng = np.random.default_rng(2)
    for friction in (0.0, 0.7):
        bodies = overlapping(rng, dimension)
        made = boxes.particles_of(bodies)
        x, v = (values.reshape(-1, dimension) for values in boxes.placed(bodies, made))
        masses, corners = made.masses.ravel(), np.arange(len(x)).reshape(made.masses.shape)[:, :-1]
        particles = pbd.particles(x, masses=masses, velocities=v)
        for axis, speed in zip(particles.p, v.T, strict=True):
            axis += 0.01 * speed
        before = from_store(particles.p)
        batch = pbd.box_contacts(particles, corners, friction=friction, restitution=0.3)
        state = State(particles, None, np.zeros(2, dtype=np.int64))
        begin(batch, state, 0.01)
        assert batch.filled[0] == 1
        project(batch, state, 0.01)
        change = from_store(particles.p) - before
        scale = np.abs(masses @ np.abs(change)).max()
        assert scale > 1e-4
        assert np.abs(masses @ change).max() <= EPS * scale
        if friction == 0.0:
            lifted = [np.pad(a, ((0, 0), (0, 3 - dimension))) for a in (before, change)]
            assert np.abs(masses @ np.cross(*lifted)).max() <= 10.0 * EPS * scale


def overlapping(rng, dimension):
    """Two boxes, the corner of one a little inside the other, closing in."""
    turn = math.pi / 4.0 if dimension == 2 else math.atan(math.sqrt(2.0))
    axis = np.array([1.0, 0.0, -1.0]) / math.sqrt(2.0)
    reach = math.sqrt(dimension) / 2.0
    positions = np.array([np.zeros(dimension), in_plane(dimension, 0.03, 0.5 + reach - 0.01)])
    upright = np.array([math.cos(0.5 * turn), *(math.sin(0.5 * turn) * axis)])
    orientations = np.array([0.0, turn]) if dimension == 2 else np.array([[1.0, 0.0, 0.0, 0.0], upright])
    velocities = np.array([np.zeros(dimension), in_plane(dimension, 0.5, -1.0)])
    masses = rng.uniform(0.5, 2.0, 2)
    return at_rest((Box((1.0,) * dimension),) * 2, masses, positions, orientations=orientations, velocities=velocities)


def test_an_impact_of_two_boxes_shares_momentum_as_newton_says():
    """v1' = v (m1 - e m2)/(m1 + m2), v2' = v m1 (1 + e)/(m1 + m2), face to face in free space."""
    m1, m2, e, speed = 1.0, 3.0, 0.5, 2.0
    for dimension in (2, 3):
        positions = np.array([in_plane(dimension, 0.0, 0.0), in_plane(dimension, 1.2, 0.0)])
        velocities = np.array([in_plane(dimension, speed, 0.0), np.zeros(dimension)])
        bodies = at_rest((Box((1.0,) * dimension),) * 2, np.array([m1, m2]), positions, velocities=velocities)
        described = scene(bodies, gravity=np.zeros(dimension), restitution=e, duration=0.4, samples=4)
        v = ran(described, iterations=200).velocities[-1, :, 0]
        expected = speed * np.array([m1 - e * m2, m1 * (1.0 + e)]) / (m1 + m2)
        np.testing.assert_allclose(v, expected, atol=1e-6)
        assert m1 * v[0] + m2 * v[1] == pytest.approx(m1 * speed, abs=1e-9)


@DIMENSIONS
def test_a_box_rests_on_a_fixed_one(dimension):
    """And the fixed one, whose velocity counts for nothing, stays exactly where it is."""
    shapes = (Box((3.0, 1.0, 3.0)[:dimension]), Box((1.0,) * dimension))
    positions = np.array([in_plane(dimension, 0.0, 5.0), in_plane(dimension, 0.3, 6.0)])
    velocities = np.array([np.ones(dimension), np.zeros(dimension)])
    bodies = at_rest(shapes, np.ones(2), positions, velocities=velocities, fixed=(0,))
    trajectory = ran(scene(bodies, friction=0.5))
    np.testing.assert_array_equal(trajectory.positions[:, 0], np.tile(positions[0], (11, 1)))
    np.testing.assert_allclose(trajectory.positions[:, 1], np.tile(positions[1], (11, 1)), atol=1e-6)
    assert trajectory.contact_forces is None, "momentum does not tell the floor's force from the fixed box's"


@DIMENSIONS
def test_a_heap_never_gains_energy_however_small_the_step(dimension):
    """A contact that is none, beside a face or across edges that do not touch, would move a box by d in one step.

    It then has the velocity d/h, which small steps show.
    """
    described = build_scene("pile", {"count": 40, "dimension": dimension, "duration": 1.5, "samples": 150})
    trajectory = ran(described, dt=0.01, substeps=50, iterations=5)
    subject = Subject(trajectory, described)
    assert np.diff(subject.energy).max() <= 1e-6 * subject.energy[0]
    assert penetration.measure(subject) < 1e-3
    assert subject.energy[-1] < 0.7 * subject.energy[0], "they do fall"


def test_planks_that_cross_carry_each_other():
    """In 3D: no corner of either is over the other; it rests on the four crossings of their edges."""
    shapes = (Box((3.0, 0.5, 0.4)), Box((0.4, 0.5, 3.0)))
    positions = np.array([[0.0, 0.25, 0.0], [0.1, 0.75, 0.1]])
    trajectory = ran(scene(at_rest(shapes, np.ones(2), positions), friction=0.5, duration=2.0))
    np.testing.assert_allclose(trajectory.positions[-1], positions, atol=2e-5)


def test_an_edge_falls_on_an_edge():
    """In 3D: two boxes that lie on their edges, crosswise, far above the floor, meet where the edges cross.

    They do so at the time of free fall.
    """
    turned = math.sqrt(0.5)
    corner = [math.cos(math.pi / 8.0), 0.0, 0.0, math.sin(math.pi / 8.0)]
    across = [math.cos(math.pi / 8.0), math.sin(math.pi / 8.0), 0.0, 0.0]
    positions = np.array([[0.0, 0.0, 0.0], [0.1, 2.0 * turned + 0.2, -0.05]])
    bodies = at_rest((Box((1.0,) * 3),) * 2, np.ones(2), positions, orientations=np.array([corner, across]), fixed=(0,))
    trajectory = ran(scene(bodies, floor=-10.0, restitution=1.0, duration=0.3, samples=300), iterations=300)
    upward = trajectory.velocities[:, 1, 1]
    landed = int(np.argmax(np.diff(upward) > 0.1))
    assert trajectory.times[landed] == pytest.approx(math.sqrt(2.0 * 0.2 / G), abs=2e-3)
    assert trajectory.spins is not None
    arm = np.array(
        [-0.1, -turned, 0.0]
    )  # it meets the other's edge 0.1 from the middle of its own, and is set spinning
    point = upward[landed + 1] + np.cross(trajectory.spins[landed + 1, 1], arm)[1]
    assert point == pytest.approx(-upward[landed], rel=0.01), "the point of contact rebounds with e = 1"
    assert trajectory.positions[:, 1, 1].min() > 2.0 * turned - 2e-3, "the edges do not pass through each other"


@DIMENSIONS
def test_no_room_for_contacts_is_said(dimension, monkeypatch):
    """What finds no slot is left out and counted; nothing is written beyond the end."""
    monkeypatch.setattr(box_contact, "PER_CORNER", 0)
    trajectory = ran(scene(stack(dimension, 2), duration=0.1), iterations=1)
    assert trajectory.work["contacts left out"] >= 4 * 100
    monkeypatch.undo()
    monkeypatch.setattr(box_contact, "PER_BOX", 0)
    assert ran(scene(stack(dimension, 2), duration=0.1), iterations=1).work["contacts left out"] == 100


# ------------------------------------------------------------------ distances between parts


def gradients(x, indices, are_lines, step=1e-6):
    """Central differences of C with respect to all coordinates, (particles, d)."""
    found = np.zeros_like(x)
    for j, k in np.ndindex(*x.shape):
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[j, k] += sign * step
            ends.append(gap_between(to_store(moved), indices, are_lines)[0])
        found[j, k] = (ends[0] - ends[1]) / (2.0 * step)
    return found


@pytest.mark.parametrize(("dimension", "are_lines"), [(2, False), (3, False), (3, True)])
@given(seed=st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_gradients_of_distances(dimension, are_lines, seed):
    """grad_j C = b_j n by finite differences; neither force nor torque in sum."""
    x = 5.0 * np.random.default_rng(seed).normal(size=(dimension + 1, dimension))
    indices = tuple(range(dimension + 1))
    _, normal, weights = gap_between(to_store(x), indices, are_lines)
    rows = np.outer(weights, normal)
    # near-degenerate triples have gradients that differences cannot resolve
    size = max(1.0, float(np.abs(weights).max()))
    np.testing.assert_allclose(gradients(x, indices, are_lines), rows, atol=1e-5 * size**2)
    np.testing.assert_allclose(rows.sum(axis=0), 0.0, atol=1e-12 * size)
    lifted = [np.pad(a, ((0, 0), (0, 3 - dimension))) for a in (x, rows)]
    np.testing.assert_allclose(np.cross(*lifted).sum(axis=0), 0.0, atol=1e-10 * size)


def test_parts_without_a_direction_are_left_alone():
    """Coinciding particles, and parallel lines: the normal is 0, and no number is not finite."""
    flat = to_store(np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 1.0]]))
    parallel = to_store(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 1.0, 0.0]]))
    for x, indices, are_lines in ((flat, (0, 1, 2), False), (parallel, (0, 1, 2, 3), True)):
        gap, normal, weights = gap_between(x, indices, are_lines)
        assert gap == 0.0
        np.testing.assert_array_equal(normal, 0.0)
        assert np.isfinite(weights).all()


# ------------------------------------------------------------------ what is refused, and plain Python


def test_balls_and_scenes_without_bodies_are_refused():
    balls = at_rest((Ball(0.5),), np.ones(1), np.zeros((1, 2)))
    assert "ball" in particle_boxes.unsupported(scene(balls), Settings())
    nothing = Scene("test", "test", no_masses(2), (), np.zeros(2), 1.0, 10, ())
    assert "no rigid bodies" in particle_boxes.unsupported(nothing, Settings())
    assert particle_boxes.prepare(nothing, Settings(dt=0.01))().steps == 100, "an empty world runs, for its overhead"


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"compliance": 1e-3}, "settings.compliance"),
        ({"method": "distance", "compliance": 1e-3, "k": 0.5}, "settings.compliance"),
        ({"k": 1.5}, "settings.k"),
        ({"method": "shape"}, "settings.method"),
    ],
)
def test_settings_that_contradict_are_refused(changes, field):
    with pytest.raises(InvalidInput) as refused:
        Settings(**changes)
    assert refused.value.field == field


@pytest.mark.parametrize(
    ("corners", "field"), [([[0, 1, 2]], "corners"), ([[0, 1, 2, 9]], "corners"), ([0, 1, 2, 3], "corners")]
)
def test_corners_are_checked(corners, field):
    particles = pbd.particles(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]))
    with pytest.raises(InvalidInput) as refused:
        pbd.box_contacts(particles, corners)
    assert refused.value.field == field
    with pytest.raises(InvalidInput) as refused:
        pbd.corner_planes(particles, corners, normal=(0.0, 1.0))
    assert refused.value.field == field


@pytest.mark.parametrize(
    "changes", [{"normal": (0.0, 0.0)}, {"friction": -1.0}, {"restitution": 1.5}, {"gravity": math.nan}]
)
def test_planes_and_coefficients_are_checked(changes):
    particles = pbd.particles(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]))
    with pytest.raises(InvalidInput) as refused:
        pbd.corner_planes(particles, [[0, 1, 2, 3]], **{"normal": (0.0, 1.0), **changes})
    assert refused.value.field == next(iter(changes))


def test_the_method_is_said_in_words():
    assert particle_boxes.describe(Settings()) == "PBD particle boxes, shape matching, 30 iterations"
    soft = Settings(method="distance", compliance=1e-3, iterations=1, substeps=4)
    assert particle_boxes.describe(soft) == "PBD particle boxes, distance, compliance 0.001 m/N, 4 sub-steps"
    assert "k = 0.5, raw" in particle_boxes.describe(Settings(k=0.5, raw=True))


PLAIN = """
import json, sys, numba
from comparisons.run import build_scene
from comparisons.engines import particle_boxes as engine
found = []
for dimension in (2, 3):
    scene = build_scene("stack", {"count": 2, "dimension": dimension, "duration": 0.05, "samples": 1})
    for changes in json.loads(sys.argv[1]):
        run = engine.prepare(scene, engine.Settings(dt=0.025, **changes))()
        found.append([run.positions.tolist(), run.orientations.tolist(), run.spins.tolist(), run.work])
print(json.dumps([bool(numba.config.DISABLE_JIT), found]))
"""


def test_plain_python_gives_the_numbers_of_the_kernel():
    changes = json.dumps([{"iterations": 2}, {"method": "distance", "k": 0.9, "iterations": 2}])
    answers = []
    for disabled in ("1", "0"):
        done = subprocess.run(
            [sys.executable, "-c", PLAIN, changes],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled}, capture_output=True, text=True, timeout=200,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        answers.append(json.loads(done.stdout))
    assert [plain for plain, _ in answers] == [True, False]
    for one, other in zip(answers[0][1], answers[1][1], strict=True):
        assert one[3] == other[3]
        for a, b in zip(one[:3], other[:3], strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)
