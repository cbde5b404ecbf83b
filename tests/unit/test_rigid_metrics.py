"""Metrics of rigid bodies on trajectories made by hand, whose values are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial import ConvexHull

from comparisons import catalog
from comparisons.bodies import Ball, Box, Planes, at_rest, rotations
from comparisons.metrics import Refused, Subject, _overlap, front_speed
from comparisons.metrics.attitude_error import quaternion_angles
from comparisons.scene import Scene, no_masses
from comparisons.trajectory import Trajectory

G = 9.81
NEW = [
    "angular_momentum_drift", "apexes", "attitude_error", "contact_force_error", "creep", "drift", "energy_rise",
    "fallen", "front_speed", "heap_height", "impact_time", "out_of_plane", "penetration", "rebound",
    "residual_kinetic_energy", "settled_penetration", "stop_distance", "stop_time", "velocity_error",
]  # fmt: skip


def floor(d):
    return Planes(np.eye(d)[1:2], np.zeros(1))


def scene_of(bodies, planes=None, gravity=0.0, samples=1, **changes):
    d = bodies.positions.shape[1]
    pull = -gravity * np.eye(d)[1]
    return Scene("made", "made", no_masses(d), (), pull, 1.0, samples, (), bodies=bodies, planes=planes, **changes)


def motion(bodies, positions, velocities=None, orientations=None, spins=None, times=None, **changes):
    """A trajectory in which what is not given stays as in ``bodies``."""
    s = len(positions)

    def filled(value, start):
        return np.repeat(start[None], s, axis=0) if value is None else np.asarray(value, dtype=float)

    return Trajectory(
        np.linspace(0.0, 1.0, s) if times is None else times,
        np.asarray(positions, dtype=float),
        filled(velocities, bodies.velocities),
        s - 1,
        orientations=filled(orientations, bodies.orientations),
        spins=filled(spins, bodies.spins),
        **changes,
    )


def measure(name, scene, trajectory):
    return catalog.load("metrics", name).measure(Subject(trajectory, scene))


def boxes(*positions, size=1.0, **changes):
    x = np.array(positions, dtype=float)
    return at_rest((Box((size,) * x.shape[1]),) * len(x), np.ones(len(x)), x, **changes)


def turns(random, n, d):
    if d == 2:
        return random.uniform(-np.pi, np.pi, n)
    q = random.standard_normal((n, 4))
    return q / np.linalg.norm(q, axis=1)[:, None]


# ------------------------------------------------------------------ penetration


def corners(shape, centre, turn):
    signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * len(shape.size))).reshape(len(shape.size), -1).T
    return centre + signs * shape.size @ turn.T


def overlap_by_hull(one, other):
    """Least translation that parts two bodies: of boxes, from the hull of all differences of corners; < 0 apart."""
    if isinstance(one[0], Ball) and isinstance(other[0], Ball):
        return one[0].radius + other[0].radius - np.linalg.norm(one[1] - other[1])
    if isinstance(one[0], Ball):
        return overlap_by_hull(other, one)
    if isinstance(other[0], Ball):
        shape, centre, turn = one
        inside = -ConvexHull(corners(*one) - other[1]).equations[:, -1].max()
        if inside >= 0.0:
            return inside + other[0].radius
        half = np.array(shape.size) / 2.0
        nearest = lsq_linear(turn, other[1] - centre, (-half, half), method="bvls").x
        return other[0].radius - np.linalg.norm(centre + turn @ nearest - other[1])
    differences = (corners(*one)[:, None] - corners(*other)).reshape(-1, len(one[1]))
    return -ConvexHull(differences).equations[:, -1].max()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kinds", [(Box, Box), (Box, Ball), (Ball, Box), (Ball, Ball)])
def test_penetration_is_the_least_translation_that_parts_two_bodies(kinds, d):
    random = np.random.default_rng(5)
    overlapping = 0
    for _ in range(40):
        shapes = tuple(
            Box(tuple(random.uniform(0.5, 1.5, d))) if kind is Box else Ball(random.uniform(0.3, 0.7), d)
            for kind in kinds
        )
        x, q = random.uniform(-0.7, 0.7, (2, d)), turns(random, 2, d)
        bodies = at_rest(shapes, np.ones(2), x, orientations=q)
        expected = overlap_by_hull(*zip(shapes, x, rotations(q, d), strict=True))
        overlapping += expected > 0.0
        found = measure("penetration", scene_of(bodies), motion(bodies, x[None]))
        assert found == pytest.approx(max(0.0, expected), abs=1e-12)
    assert 12 <= overlapping <= 39 or kinds == (Ball, Ball)


def test_penetration_edge_against_edge_where_no_face_parts_them():
    """Two unit cubes, turned by 45 degrees about x and about z, one edge of each towards the other along y."""
    c, s = np.cos(np.pi / 8), np.sin(np.pi / 8)
    bodies = boxes([0, 0, 0], [0, np.sqrt(2.0) - 0.01, 0], orientations=np.array([[c, s, 0, 0], [c, 0, 0, s]]))
    scene, start = scene_of(bodies), bodies.positions[None]
    assert measure("penetration", scene, motion(bodies, start)) == pytest.approx(0.01, abs=1e-14)
    apart = motion(bodies, start + np.array([[0, 0, 0], [0, 0.02, 0]]))
    assert measure("penetration", scene, apart) == 0.0
    at = _overlap.placed(bodies, apart.positions[0], apart.orientations[0])
    one, other = np.array([0]), np.array([1])
    assert _overlap.boxes_faces(at, one, other)[0] > 0.1, "faces alone would call them overlapping"
    assert _overlap.boxes_edges(at, one, other)[0] == pytest.approx(-0.01, abs=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_penetration_of_a_crowd_is_that_of_all_its_pairs(d):
    random, n = np.random.default_rng(1), 24
    shapes = tuple(
        Ball(float(random.uniform(0.2, 0.8)), d) if i % 5 == 0 else Box(tuple(random.uniform(0.2, 1.6, d)))
        for i in range(n)
    )
    x, q = random.uniform(0.0, 4.0 if d == 2 else 3.0, (4, n, d)), np.stack([turns(random, n, d) for _ in range(4)])
    bodies = at_rest(shapes, np.ones(n), x[0], orientations=q[0], fixed=(2, 3))
    pairs = [(i, j) for i in range(n) for j in range(i) if {i, j} != {2, 3}]

    def alone(sample, i, j):
        two = at_rest((shapes[i], shapes[j]), np.ones(2), x[sample, [i, j]], orientations=q[sample, [i, j]])
        return measure("penetration", scene_of(two), motion(two, two.positions[None]))

    deepest = [max(alone(sample, i, j) for i, j in pairs) for sample in range(4)]
    run = motion(bodies, x, orientations=q)
    assert measure("penetration", scene_of(bodies), run) == pytest.approx(max(deepest), abs=1e-14)
    assert measure("settled_penetration", scene_of(bodies), run) == pytest.approx(deepest[-1], abs=1e-14)
    assert 0.0 < deepest[-1] < max(deepest)


@pytest.mark.parametrize("d", [2, 3])
def test_penetration_of_planes_is_the_depth_of_the_lowest_corner(d):
    q = np.pi / 4 if d == 2 else [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]
    x = np.zeros((2, d))
    x[:, 0], x[:, 1] = [0.0, 5.0], [0.5, 0.2]
    bodies = at_rest((Box((1.0,) * d), Ball(0.3, d)), np.ones(2), x, orientations=np.array([q, 0 * np.array(q)]))
    if d == 3:
        bodies.orientations[1, 0] = 1.0
    scene = scene_of(bodies, floor(d))
    assert measure("penetration", scene, motion(bodies, x[None])) == pytest.approx(np.sqrt(0.5) - 0.5, abs=1e-15)
    lower = x - np.eye(d)[1] * [[0.0], [0.25]]
    assert measure("penetration", scene, motion(bodies, lower[None])) == pytest.approx(0.35, abs=1e-15)
    wall = scene_of(bodies, Planes(np.stack([np.eye(d)[1], -np.eye(d)[0]]), np.array([-9.0, -5.1])))
    assert measure("penetration", wall, motion(bodies, x[None])) == pytest.approx(0.2, abs=1e-15)
    held = scene_of(dataclasses.replace(bodies, fixed=(0, 1)), floor(d))
    assert measure("penetration", held, motion(bodies, lower[None])) == 0.0, "what is fixed may be in the ground"


def test_penetration_of_a_ball_whose_centre_is_inside_a_box_is_out_of_the_nearest_face():
    bodies = at_rest((Box((2.0, 1.0)), Ball(0.2)), np.ones(2), np.array([[0.0, 0.0], [0.1, 0.4]]))
    assert measure("penetration", scene_of(bodies), motion(bodies, bodies.positions[None])) == pytest.approx(0.3)


# ------------------------------------------------------------------ attitude, displacement, velocity


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 1.0, 3.0])
def test_attitude_error_tells_small_angles(angle):
    random = np.random.default_rng(2)
    axis, p = np.array([0.6, 0.0, 0.8]), turns(random, 1, 3)[0]
    c, v = np.cos(angle / 2), np.sin(angle / 2) * axis
    q = np.concatenate([[p[0] * c - p[1:] @ v], p[0] * v + c * p[1:] + np.cross(p[1:], v)])
    assert quaternion_angles(p, -2.0 * q) == pytest.approx(angle, abs=1e-15, rel=1e-6)
    bodies = boxes([0, 0, 0], orientations=p[None])
    scene = scene_of(bodies, exact=lambda times: motion(bodies, np.zeros((len(times), 1, 3)), times=times))
    run = motion(bodies, np.zeros((2, 1, 3)), orientations=np.stack([p, q])[:, None])
    assert measure("attitude_error", scene, run) == pytest.approx(angle, abs=1e-15, rel=1e-6)
    flat = boxes([0, 0])
    scene = scene_of(flat, exact=lambda times: motion(flat, np.zeros((len(times), 1, 2)), times=times))
    run = motion(flat, np.zeros((2, 1, 2)), orientations=[[0.0], [2.0 * np.pi - angle]])
    assert measure("attitude_error", scene, run) == pytest.approx(angle, abs=1e-15)


def test_displacements():
    bodies = boxes([0, 0], [1, 0], [2, 0], [3, 0], size=0.5)
    bodies = dataclasses.replace(bodies, fixed=(3,))
    x = np.repeat(bodies.positions[None], 3, axis=0)
    x[1, 0] += [3.0, 4.0]
    x[2, :, 1] += [0.04, -0.06, 0.02, 9.0]
    scene, run = scene_of(bodies), motion(bodies, x)
    assert measure("drift", scene, run) == 5.0
    assert measure("creep", scene, run) == pytest.approx(0.06)
    assert measure("fallen", scene, run) == pytest.approx(1.0 / 3.0)
    mixed = at_rest((Box((2.0, 0.1)), Ball(0.5)), np.ones(2), np.zeros((2, 2)))
    assert measure("fallen", scene_of(mixed), motion(mixed, [np.zeros((2, 2)), np.full((2, 2), 0.05)])) == 0.5


def test_velocity_and_position_error_compare_with_the_closed_form():
    bodies = dataclasses.replace(boxes([0, 0], [1, 0]), fixed=(1,))

    def exact(times):
        x = np.repeat(bodies.positions[None], len(times), axis=0)
        return motion(bodies, x, np.ones((len(times), 2, 2)) * times[:, None, None], times=times)

    scene = scene_of(bodies, exact=exact)
    x = np.repeat(bodies.positions[None], 3, axis=0)
    x[1] += 0.5
    run = motion(bodies, x, np.array([0.0, 7.0, 1.0])[:, None, None] + [[0.3, 0.4], [9.0, 9.0]])
    assert measure("velocity_error", scene, run) == pytest.approx(0.5)
    assert measure("position_error", scene, run) == pytest.approx(np.sqrt(0.5))


# ------------------------------------------------------------------ bounces


def bouncing(e, seen=0.8, name="bouncing_ball", **changes):
    """A scene with restitution ``seen`` and the exact motion of another with ``e``."""
    load = catalog.load("scenes", name)
    scene, other = (load.build(load.Parameters(restitution=r, **changes)) for r in (seen, e))
    return scene, other.exact(scene.times)


def test_bounce_metrics_tell_another_restitution():
    """Of 0.79 instead of 0.8: apexes fall behind by the square of the ratio each time, and it stops earlier."""
    scene, run = bouncing(0.79)
    assert measure("apexes", scene, run) == pytest.approx(1.0 - (0.79 / 0.8) ** 10, rel=1e-9)
    assert measure("rebound", scene, run) == pytest.approx(1.0 - (0.79 / 0.8) ** 2, rel=1e-9)
    assert measure("stop_time", scene, run) == pytest.approx(1.0 - (1.79 / 0.21) / (1.8 / 0.2), abs=1e-9)
    box, flat = bouncing(0.45, 0.5, "rebound", dimension=3, height=3.0)
    assert measure("rebound", box, flat) == pytest.approx(1.0 - 0.81, rel=1e-9)


@pytest.mark.parametrize("lead", np.linspace(0.0, 0.05, 7))
def test_stop_time_depends_on_no_sample(lead):
    scene, run = bouncing(0.8, lead=lead)
    assert measure("stop_time", scene, run) < 1e-12
    for e in (0.7, 0.75, 0.78, 0.81, 0.83):
        scene, run = bouncing(e, lead=lead)
        t1, exact = np.sqrt(2.0 / G), 9.0 * np.sqrt(2.0 / G) - lead
        error = (t1 * (1 + e) / (1 - e) - lead) / exact - 1.0
        assert measure("stop_time", scene, run) == pytest.approx(abs(error), abs=1e-9)


def test_what_never_rests_stops_at_the_end_and_what_stops_at_once_has_no_rebounds():
    scene, run = bouncing(1.0)
    assert measure("stop_time", scene, run) == pytest.approx(5.0 / scene.known["stop_time"] - 1.0)
    scene, run = bouncing(0.0)
    assert measure("stop_time", scene, run) == pytest.approx(1.0 - 1.0 / 9.0)
    assert measure("apexes", scene, run) == pytest.approx(1.0)


@pytest.mark.parametrize("sign", [-1.0, 0.0, 1.0])
def test_impact_time_shows_the_order_of_the_updates(sign):
    """Euler's method falls by g t dt / 2 too much or too little, so it lands about dt/2 early or late."""
    load = catalog.load("scenes", "drop")
    scene, dt = load.build(load.Parameters()), 1.0 / 240.0
    run = scene.exact(scene.times)
    positions = run.positions.copy()
    positions[:, 0, 1] += sign * 0.5 * G * dt * scene.times * (scene.times < scene.known["impact_time"])
    found = measure("impact_time", scene, dataclasses.replace(run, positions=positions))
    assert found == pytest.approx(abs(sign) * dt / 2.0, rel=0.12, abs=1e-14)


def test_stop_distance_is_relative():
    load = catalog.load("scenes", "slide")
    scene = load.build(load.Parameters())
    run = scene.exact(scene.times)
    longer = dataclasses.replace(run, positions=run.positions * [1.1, 1.0])
    assert measure("stop_distance", scene, longer) == pytest.approx(0.1)


# ------------------------------------------------------------------ energy, momentum, forces


def test_energies_of_bodies_are_of_motion_turning_and_height():
    spin = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    q = turns(np.random.default_rng(3), 1, 3)[0]
    bodies = at_rest(
        (Box((1.0, 2.0, 3.0)), Ball(0.5, 3)), np.array([2.0, 4.0]), np.array([[0.0, 1.0, 0.0], [5.0, 3.0, 0.0]]),
        orientations=np.array([q, [1.0, 0, 0, 0]]), velocities=np.ones((2, 3)), spins=spin, fixed=(1,),
    )  # fmt: skip
    scene, run = scene_of(bodies, floor(3), G), motion(bodies, bodies.positions[None])
    turn = rotations(q, 3)
    tensor = turn @ np.diag(Box((1.0, 2.0, 3.0)).inertia(2.0)) @ turn.T
    kinetic = 0.5 * 2.0 * 3.0 + 0.5 * spin[0] @ tensor @ spin[0]
    subject = Subject(run, scene)
    assert subject.kinetic[0] == pytest.approx(kinetic)
    assert subject.energy[0] == pytest.approx(kinetic + 2.0 * G)
    assert subject.energy_scale == pytest.approx(kinetic + 2.0 * G)
    assert measure("residual_kinetic_energy", scene, run) == pytest.approx(kinetic / 2.0)


def test_the_scale_of_energy_does_not_depend_on_where_the_origin_is():
    bodies = boxes([0, -3.5])
    scene = scene_of(bodies, Planes(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([-9.0, -4.0])), G)
    run = motion(bodies, [[[0, -3.5]], [[0, -3.4]]])
    assert Subject(run, scene).energy_scale == pytest.approx(0.5 * G)
    assert measure("energy_drift", scene, run) == pytest.approx(0.2)


def test_energy_rise_is_above_the_least_before():
    bodies = boxes([0, 1])
    scene = scene_of(bodies, floor(2), G)
    heights = [1.0, 0.4, 0.7, 0.6, 0.2, 0.45, 0.2]
    run = motion(bodies, [[[0.0, y]] for y in heights])
    assert measure("energy_rise", scene, run) == pytest.approx(0.3)
    assert measure("energy_rise", scene, motion(bodies, [[[0.0, y]] for y in sorted(heights, reverse=True)])) == 0.0


def test_momenta_of_free_bodies_are_kept_and_their_changes_seen():
    random = np.random.default_rng(4)
    for d in (2, 3):
        bodies = at_rest(
            (Box((1.0,) * d), Box((0.5,) * d)), np.array([1.0, 3.0]), random.standard_normal((2, d)),
            velocities=random.standard_normal((2, d)), spins=random.standard_normal((2,) if d == 2 else (2, 3)),
        )  # fmt: skip
        t = np.linspace(0.0, 1.0, 5)[:, None, None]
        scene, x = scene_of(bodies), bodies.positions + t * bodies.velocities
        run = motion(bodies, x)
        assert measure("momentum_drift", scene, run) == 0.0
        assert measure("angular_momentum_drift", scene, run) < 1e-15
        faster = motion(bodies, x, bodies.velocities + t * [[0.0] * d, [1.0] + [0.0] * (d - 1)])
        assert measure("momentum_drift", scene, faster) == pytest.approx(3.0)
        inertia = bodies.inertias[0, 0]
        own = inertia * bodies.spins[0] + bodies.inertias[1, 0] * bodies.spins[1]
        cross = bodies.masses @ np.cross(
            np.pad(x[0], [(0, 0), (0, 3 - d)]), np.pad(bodies.velocities, [(0, 0), (0, 3 - d)])
        )
        total = np.linalg.norm(own + (cross[2] if d == 2 else cross))
        turned = bodies.spins + t.reshape((5,) + (1,) * bodies.spins.ndim) * (
            [1.0, 0.0] if d == 2 else [[0, 0, 1.0], [0] * 3]
        )
        spun = motion(bodies, x, spins=turned)
        assert measure("angular_momentum_drift", scene, spun) == pytest.approx(inertia / total)


def test_falling_bodies_gain_the_momentum_of_their_weight():
    bodies, t = boxes([0, 0], [3, 0]), np.linspace(0.0, 1.0, 5)[:, None, None]
    run = motion(bodies, np.zeros((5, 2, 2)), np.zeros((5, 2, 2)) - G * t * [0.0, 1.0])
    assert measure("momentum_drift", scene_of(bodies, gravity=G), run) < 1e-14


def test_contact_forces_are_compared_with_the_weight_over_the_last_quarter():
    bodies = dataclasses.replace(boxes([0, 0], [1, 0], [2, 0]), fixed=(2,))
    scene, weight = scene_of(bodies, floor(2), G), 2.0 * G
    forces = np.full(9, np.nan)
    forces[[7, 8]] = 1.1 * weight, 0.7 * weight
    run = motion(bodies, np.zeros((9, 3, 2)), contact_forces=forces)
    assert measure("contact_force_error", scene, run) == pytest.approx(0.2)


def test_heap_height_is_of_the_highest_corner_and_residue_is_passed_on():
    bodies = boxes([0, 2], [0, 0.5], orientations=np.array([np.pi / 4, 0.0]))
    planes = Planes(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([-9.0, -1.0]))
    run = motion(bodies, bodies.positions[None], residue=3e-5)
    assert measure("heap_height", scene_of(bodies, planes, G), run) == pytest.approx(3.0 + np.sqrt(0.5))
    assert measure("out_of_plane", scene_of(bodies, planes, G), run) == 3e-5


@pytest.mark.parametrize("d", [2, 3])
def test_the_front_of_dominoes_is_as_fast_as_it_was_made(d):
    n, speed = 5, 2.0
    x = np.zeros((n, d))
    x[:, 0] = 0.6 * np.arange(n)
    bodies, times = boxes(*x), np.linspace(0.0, 1.0, 21)
    begins = x[:, 0] / speed + 0.013
    tilts = np.maximum(0.0, times[:, None] - begins) * 3.0
    tilts[:, 4] = 0.0
    q = -tilts if d == 2 else np.stack([np.cos(tilts / 2), 0 * tilts, 0 * tilts, -np.sin(tilts / 2)], axis=-1)
    run = motion(bodies, np.repeat(x[None], 21, axis=0), orientations=q, times=times)
    began, places = front_speed.falls(Subject(run, scene_of(bodies, floor(d), G)))
    np.testing.assert_allclose(began, begins[:4] + np.deg2rad(10.0) / 3.0, atol=1e-12)
    np.testing.assert_array_equal(places, x[:4, 0])
    assert measure("front_speed", scene_of(bodies, floor(d), G), run) == pytest.approx(speed)
    still = motion(bodies, np.repeat(x[None], 21, axis=0), times=times)
    assert measure("front_speed", scene_of(bodies, floor(d), G), still) == 0.0


# ------------------------------------------------------------------ refusals


@pytest.mark.parametrize("name", NEW)
def test_metrics_of_bodies_are_refused_for_point_masses(name):
    load = catalog.load("scenes", "hanging_cloth")
    scene = load.build(load.Parameters(size=3, samples=2))
    x = np.repeat(scene.masses.positions[None], 3, axis=0)
    if name in ("energy_rise", "residual_kinetic_energy"):
        assert measure(name, scene, Trajectory(scene.times, x, 0 * x, 2)) == 0.0
        return
    with pytest.raises(Refused) as refused:
        measure(name, scene, Trajectory(scene.times, x, 0 * x, 2))
    assert refused.value.remedy


@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("position_error", scene_of(boxes([0, 0]))),
        ("attitude_error", scene_of(boxes([0, 0]))),
        ("velocity_error", scene_of(boxes([0, 0]))),
        ("stop_time", scene_of(boxes([0, 0]), floor(2), G)),
        ("apexes", scene_of(boxes([0, 0]), floor(2), G)),
        ("rebound", scene_of(boxes([0, 0]), known={"rebound": np.array([[0.5, 0.2]])})),
        ("stop_distance", scene_of(boxes([0, 0]), floor(2), G)),
        ("contact_force_error", scene_of(boxes([0, 0]), floor(2), G)),
        ("momentum_drift", scene_of(boxes([0, 0]), floor(2))),
        ("momentum_drift", scene_of(dataclasses.replace(boxes([0, 0]), fixed=(0,)))),
        ("angular_momentum_drift", scene_of(boxes([0, 0]), gravity=G)),
        ("angular_momentum_drift", scene_of(boxes([0, 0]))),
        ("heap_height", scene_of(boxes([0, 0]))),
        ("out_of_plane", scene_of(boxes([0, 0, 0]))),
    ],
)
def test_metrics_are_refused_where_they_mean_nothing(name, scene):
    run = motion(scene.bodies, np.zeros((2, *scene.bodies.positions.shape)))
    with pytest.raises(Refused) as refused:
        measure(name, scene, run)
    assert refused.value.remedy


@pytest.mark.parametrize("name", ["penetration", "attitude_error"])
def test_a_run_that_tells_no_attitudes_is_refused(name):
    bodies = boxes([0, 0])
    run = Trajectory(np.zeros(1), bodies.positions[None], bodies.velocities[None], 0)
    with pytest.raises(Refused):
        measure(name, scene_of(bodies, exact=lambda times: run), run)
