"""The closed forms of the scenes of rigid bodies, against integrations of the equations of motion and identities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from comparisons import catalog
from comparisons.bodies import Ball, Box, rotations
from comparisons.metrics import Subject
from comparisons.scenes import _rigid
from comparisons.scenes._bounce import Bounces
from comparisons.scenes._rocking import Rocking
from comparisons.scenes._top import Top
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput

G = 9.81
TIGHT = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}


def module(name):
    return catalog.load("scenes", name)


def of_bodies(name):
    return isinstance(module(name).Parameters, type) and issubclass(module(name).Parameters, _rigid.Common)


NAMES = [name for name in catalog.names("scenes") if of_bodies(name)]
PAIRS = [(name, d) for name in NAMES for d in ((3,) if name == "top" else (2, 3))]


def build(name, **parameters):
    return module(name).build(module(name).Parameters(**parameters))


def has(name, field):
    return field in fields.rules(module(name).Parameters)


EXACT = [pair for pair in PAIRS if build(pair[0]).exact is not None]
LED = [pair for pair in EXACT if has(pair[0], "lead")]


def held(scene):
    """The scene's start, for all its samples."""

    def always(value):
        return np.repeat(value[None], len(scene.times), axis=0)

    b = scene.bodies
    turns = {"orientations": always(b.orientations), "spins": always(b.spins)}
    return Trajectory(scene.times, always(b.positions), always(b.velocities), 0, **turns)


def measured(name, scene, trajectory):
    return catalog.load("metrics", name).measure(Subject(trajectory, scene))


# ------------------------------------------------------------------ what holds for every scene


def test_there_are_the_scenes_there_should_be():
    assert len(NAMES) == 16
    assert [name for name in NAMES if build(name).exact is None] == ["dominoes", "falling_boxes", "pile"]


@pytest.mark.parametrize(("name", "d"), PAIRS)
def test_a_scene_is_complete_and_its_bodies_are_apart(name, d):
    scene = build(name, dimension=d)
    bodies, n = scene.bodies, len(scene.bodies.masses)
    assert len(bodies.shapes) == n
    assert bodies.positions.shape == bodies.velocities.shape == (n, d)
    assert bodies.orientations.shape == ((n,) if d == 2 else (n, 4))
    assert bodies.spins.shape == ((n,) if d == 2 else (n, 3))
    assert {len(shape.size) if isinstance(shape, Box) else shape.dimension for shape in bodies.shapes} == {d}
    assert scene.gravity.shape == (d,)
    assert np.all(scene.gravity[np.arange(d) != 1] == 0.0)
    assert scene.planes is None or np.allclose(np.linalg.norm(scene.planes.normals, axis=1), 1.0, atol=1e-15)
    assert set(scene.known) <= set(catalog.names("metrics"))
    assert {"energy_drift", "energy_rise"} & set(scene.metrics)
    assert ("position_error" in scene.metrics) == (scene.exact is not None)
    assert measured("penetration", scene, held(scene)) < 1e-15
    for dt in (1 / 60, 1 / 240, 1 / 1000):
        scene.steps_per_sample(dt)


@pytest.mark.parametrize(("name", "d"), EXACT)
def test_the_closed_form_starts_where_the_bodies_do_and_moves_as_its_velocities_say(name, d):
    scene, h = build(name, dimension=d), 1e-5
    start = scene.exact(np.zeros(1))
    for field in ("positions", "velocities", "orientations", "spins"):
        np.testing.assert_array_equal(getattr(start, field)[0], getattr(scene.bodies, field))
    times = np.random.default_rng(0).uniform(h, scene.duration - h, 1000)
    before, at, after = (scene.exact(times + step) for step in (-h, 0.0, h))
    off = [(after.positions - before.positions) / (2 * h) - at.velocities]
    change = (after.orientations - before.orientations) / (2 * h)
    off.append(change - at.spins if d == 2 else change - 0.5 * spun(at.spins, at.orientations))
    largest = np.max([np.abs(o).reshape(len(times), -1).max(axis=1) for o in off], axis=0)
    assert np.sum(largest > 1e-6) <= 5, "but for the few times near an impact"
    np.testing.assert_array_equal(at.times, times)


def spun(spins, q):
    """(0, spin) times q."""
    w, v = q[..., :1], q[..., 1:]
    return np.concatenate([-np.sum(spins * v, axis=-1, keepdims=True), w * spins + np.cross(spins, v)], axis=-1)


@pytest.mark.parametrize(("name", "d"), EXACT)
def test_the_closed_form_overlaps_nothing_gains_no_energy_and_has_no_error(name, d):
    scene = build(name, dimension=d)
    motion = scene.exact(scene.times)
    assert measured("penetration", scene, motion) < 1e-13
    assert measured("energy_rise", scene, motion) < 1e-12
    for metric in scene.metrics:
        assert abs(measured(metric, scene, motion)) < 1e-12, metric


@pytest.mark.parametrize("lead", [0.0, 0.013, 0.4515, 0.9, 2.7, 30.0])
@pytest.mark.parametrize(("name", "d"), LED)
def test_a_lead_shifts_the_motion_and_nothing_else(name, d, lead):
    """Events that a lead, or a short run, leaves out of the run are not asked for either."""
    short = {"duration": 0.1, "samples": 10}
    for changes in ({}, short):
        plain, shifted = build(name, dimension=d, **changes), build(name, dimension=d, lead=lead, **changes)
        ours, theirs = shifted.exact(shifted.times), plain.exact(plain.times + lead)
        for field in ("positions", "velocities", "orientations", "spins"):
            np.testing.assert_array_equal(getattr(ours, field), getattr(theirs, field))
            np.testing.assert_allclose(getattr(shifted.bodies, field), getattr(ours, field)[0], atol=1e-14)
        for metric in shifted.metrics:
            assert abs(measured(metric, shifted, ours)) < 1e-11, metric


@pytest.mark.parametrize(("name", "d"), PAIRS)
def test_short_runs_of_large_bodies_can_be_measured(name, d):
    wanted = {"dimension": d, "duration": 0.1, "samples": 10, "size": 4}
    scene = build(name, **{key: value for key, value in wanted.items() if has(name, key)})
    for metric in scene.metrics:
        assert np.isfinite(measured(metric, scene, held(scene)))


@pytest.mark.parametrize(
    "name", sorted({name for name, _ in LED} - {"top", "rolling"})
)  # a sphere rolls faster than a disc
def test_the_motion_in_space_is_that_in_the_plane(name):
    flat, deep = build(name, dimension=2), build(name, dimension=3)
    two, three = flat.exact(flat.times), deep.exact(deep.times)
    np.testing.assert_array_equal(three.positions[..., :2], two.positions)
    np.testing.assert_array_equal(three.velocities[..., :2], two.velocities)
    np.testing.assert_array_equal(three.spins[..., 2], two.spins)
    np.testing.assert_allclose(
        rotations(three.orientations, 3)[..., :2, :2], rotations(two.orientations, 2), atol=1e-15
    )
    for still in (three.positions[..., 2], three.velocities[..., 2], three.spins[..., :2]):
        assert np.all(still == 0.0)


# ------------------------------------------------------------------ bounces


def bounced(height, e, until, samples):
    """Height and velocity at times up to ``until``, from impact to impact by event location."""

    def impact(_, y):
        return y[0]

    impact.terminal, impact.direction = True, -1
    times = np.linspace(0.0, until, samples)
    found, start, state = np.zeros((samples, 2)), 0.0, np.array([height, 0.0])
    while start < until:
        run = solve_ivp(lambda _, y: [y[1], -G], (start, until), state, events=impact, dense_output=True, **TIGHT)
        inside = (times >= start) & (times <= run.t[-1])
        found[inside] = run.sol(times[inside]).T
        if run.status == 0 or e == 0.0:
            break
        start, state = run.t[-1], np.array([0.0, -e * run.y[1, -1]])
    return times, found


@pytest.mark.parametrize(("height", "e", "until"), [(1.0, 0.0, 1.0), (1.0, 0.5, 1.2), (0.7, 0.8, 2.9), (2.0, 1.0, 9.0)])
def test_bounces_are_those_of_an_integration_with_events(height, e, until):
    times, (y, v) = (run := bounced(height, e, until, 701))[0], run[1].T
    ours, speed = Bounces(height, G, e).at(times)
    np.testing.assert_allclose(ours, y, atol=1e-10)
    np.testing.assert_allclose(speed, v, atol=1e-9)


@pytest.mark.parametrize("e", [0.3, 0.8, 0.99])
def test_rebounds_end_at_the_sum_of_all_flights(e):
    bounces = Bounces(1.0, G, e)
    n = np.arange(int(np.log(1e-17) / np.log(e)))
    assert bounces.stop_time == pytest.approx(bounces.impact_time + np.sum(2.0 * bounces.impact_time * e ** (n + 1)))
    np.testing.assert_allclose(
        bounces.impact(n)[1:] - bounces.impact(n)[:-1], 2 * bounces.impact_time * e ** n[1:], atol=1e-13
    )
    assert np.all(np.array(bounces.at(np.array([bounces.stop_time, 100.0]))) == 0.0)
    heights, speeds = bounces.at(bounces.apexes()[:, 0])
    np.testing.assert_allclose(heights, e ** (2 * np.arange(1, 6)))
    np.testing.assert_allclose(speeds, 0.0, atol=1e-13)


def test_bounces_know_their_events_in_the_scenes_time():
    ball = build("bouncing_ball", lead=0.5)
    t1 = np.sqrt(2.0 / G)
    assert ball.known["stop_time"] == pytest.approx(9.0 * t1 - 0.5)
    np.testing.assert_allclose(ball.known["apexes"][:, 1], 0.64 ** np.arange(1, 6))
    np.testing.assert_allclose(ball.known["apexes"][:2, 0], [1.8 * t1 - 0.5, (2.6 + 0.64) * t1 - 0.5])
    assert "impact_time" not in ball.known, "it is over"
    assert build("drop").known == {"impact_time": pytest.approx(t1)}
    assert "rebound" not in build("rebound", duration=0.5, samples=10).known
    np.testing.assert_allclose(build("rebound", height=2.0).known["rebound"][0, 1], 0.5)


# ------------------------------------------------------------------ friction


def forces(scene, times):
    """Contact force over weight (s, n, 2) and torque (s, n), by differences of the closed form's velocities."""
    h, bodies = 1e-4, scene.bodies
    before, after = scene.exact(times - h), scene.exact(times + h)
    weight = (bodies.masses * G)[:, None]
    force = bodies.masses[:, None] * ((after.velocities - before.velocities) / (2 * h) - scene.gravity) / weight
    return force, bodies.inertias[:, 0] * (after.spins - before.spins) / (2 * h) / weight[:, 0]


def test_a_slide_is_that_of_an_integration_until_its_velocity_is_0():
    def stop(_, y):
        return y[1]

    stop.terminal = True
    scene = build("slide", speed=3.0, friction=0.4)
    run = solve_ivp(lambda _, y: [y[1], -0.4 * G], (0.0, 9.0), [0.0, 3.0], events=stop, dense_output=True, **TIGHT)
    times = np.linspace(0.0, scene.duration, 200)
    expected = np.where(times < run.t[-1], run.sol(np.minimum(times, run.t[-1]))[0], run.y[0, -1])
    np.testing.assert_allclose(scene.exact(times).positions[:, 0, 0], expected, atol=1e-11)
    assert scene.known["stop_distance"] == pytest.approx(9.0 / (2 * 0.4 * G), rel=1e-14)
    assert build("slide", lead=0.5).known["stop_distance"] == pytest.approx(
        25.0 / G - (5.0 * 0.5 - 0.25 * G * 0.25), rel=1e-13
    )
    assert build("slide", lead=2.0).known == {}


@pytest.mark.parametrize("changes", [{}, {"ratio": 1.03, "friction": 0.5}, {"angle": 60.0, "friction": 0.9}])
def test_a_box_slides_down_by_the_force_of_the_friction_cones_edge(changes):
    scene = build("incline_slip", **changes)
    force, torque = forces(scene, np.linspace(0.1, 0.9, 9))
    normal = scene.planes.normals[0]
    downhill = np.array([normal[1], -normal[0]])
    assert scene.exact(np.ones(1)).positions[0, 0] @ downhill > 0.0, "it does slide, downhill"
    np.testing.assert_allclose(force @ downhill, -scene.friction * force @ normal, atol=1e-9)
    np.testing.assert_allclose(force @ normal, normal[1], atol=1e-9)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12)


@pytest.mark.parametrize(("ratio", "angle"), [(0.97, np.arctan(0.97 * 0.5)), (None, np.deg2rad(20.0))])
def test_a_box_that_sticks_needs_less_than_its_friction(ratio, angle):
    scene = build("incline_stick", ratio=ratio)
    normal = scene.planes.normals[0]
    assert np.arctan2(normal[0], normal[1]) == pytest.approx(angle, rel=1e-14)
    assert scene.bodies.orientations[0] == pytest.approx(-angle)
    force, _ = forces(scene, np.array([1.0]))
    assert abs(force[0, 0] @ [normal[1], -normal[0]]) < scene.friction * force[0, 0] @ normal
    assert np.ptp(scene.exact(scene.times).positions, axis=0).max() == 0.0


@pytest.mark.parametrize("d", [2, 3])
def test_a_ball_rolls_without_slipping_by_a_force_at_the_contact(d):
    scene = build("rolling", dimension=d)
    times = np.linspace(0.1, 0.9, 9)
    motion, (normal, r) = scene.exact(times), (scene.planes.normals[0], scene.bodies.shapes[0].radius)
    spins = motion.spins if d == 2 else motion.spins[..., 2]
    at_contact = motion.velocities[..., :2] + spins[..., None] * r * np.array([normal[1], -normal[0]])
    np.testing.assert_allclose(at_contact, 0.0, atol=1e-14)
    h = 1e-4
    before, after = scene.exact(times - h), scene.exact(times + h)
    force = (after.velocities - before.velocities)[:, 0] / (2 * h) - scene.gravity
    turn = np.asarray((after.spins - before.spins) / (2 * h)).reshape(len(times), -1)[:, -1]
    arm = -r * normal
    np.testing.assert_allclose(
        arm[0] * force[:, 1] - arm[1] * force[:, 0], scene.bodies.inertias[0, -1] * turn, atol=1e-8
    )
    downhill = np.zeros(d)
    downhill[:2] = normal[1], -normal[0]
    assert np.all(np.abs(force @ downhill) < scene.friction * force @ normal)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("slide", {"friction": 0.0}),
        ("slide", {"friction": 1.0}),
        ("incline_slip", {"friction": 0.6}),
        ("incline_slip", {"ratio": 0.99}),
        ("incline_slip", {"angle": 60.0, "friction": 1.2}),
        ("incline_stick", {"angle": 27.0}),
        ("incline_stick", {"ratio": 1.01}),
        ("incline_stick", {"angle": 46.0, "friction": 2.0}),
        ("rolling", {"angle": 60.0, "friction": 0.55}),
        ("rocking", {"friction": 0.18}),
        ("stack", {"jitter": 0.25}),
        ("dominoes", {"spacing": 0.2}),
        ("top", {"dimension": 2}),
    ],
)
def test_parameters_for_which_the_closed_form_does_not_hold_are_refused(name, changes):
    with pytest.raises(InvalidInput):
        build(name, **changes)


def test_the_limits_of_friction_are_allowed():
    assert build("incline_stick", ratio=1.0).exact is not None
    assert build("rolling", friction=1.001 * np.tan(np.deg2rad(20.0)) / 3.0).exact is not None


# ------------------------------------------------------------------ rocking


def rocked(box, mass, tilt, until):
    """Tilt and spin of a block at 400 times, integrated; at an impact momentum about the new edge is kept."""
    b, h = box.size[0] / 2.0, box.size[1] / 2.0
    inertia = box.inertia(mass)[-1]
    about_edge = inertia + mass * (b**2 + h**2)

    def rates(_, y):
        x = -np.sign(y[2]) * b * np.cos(y[0]) - h * np.sin(y[0])  # y[2] is the edge: 1 right, -1 left
        return [y[1], -mass * G * x / about_edge, 0.0]

    def upright(_, y):
        return y[0]

    upright.terminal = True
    times, found = np.linspace(0.0, until, 400), []
    start, state = 0.0, np.array([tilt, 0.0, -1.0])
    while True:
        run = solve_ivp(rates, (start, until), state, events=upright, dense_output=True, **TIGHT)
        inside = times[(times >= start) & (times < run.t[-1])]
        found.append(run.sol(inside)[:2].T)
        if run.status == 0:
            break
        start, state = run.t[-1], run.y[:, -1].copy()
        edge = state[2]
        velocity = state[1] * np.array([-h, -edge * b])  # spin x (centre - edge)
        arm = np.array([edge * b, h])  # centre - new edge
        state[1] = (inertia * state[1] + mass * (arm[0] * velocity[1] - arm[1] * velocity[0])) / about_edge
        state[0], state[2] = 1e-300 * -edge, -edge
        step = 1e-7  # away from the event at the start
        state[0] += step * state[1]
        state[1] += step * rates(0.0, state)[1]
        start += step
    return times[: sum(map(len, found))], np.concatenate(found)


@pytest.mark.parametrize(
    ("d", "changes"),
    [
        (2, {}),
        (3, {}),
        (2, {"width": 0.5, "tilt": 0.9, "duration": 1.6, "samples": 32}),
        (2, {"size": 4.0, "tilt": 0.2}),
    ],
)
def test_rocking_is_that_of_an_integration_through_its_impacts(d, changes):
    scene = build("rocking", dimension=d, **changes)
    box = scene.bodies.shapes[0]
    tilt = np.arctan(box.size[0] / box.size[1]) * changes.get("tilt", 0.5)
    times, found = rocked(box, 1.0, tilt, scene.duration)
    motion = scene.exact(times)
    angles = motion.orientations[:, 0] if d == 2 else 2.0 * np.arcsin(motion.orientations[:, 0, 3])
    spins = motion.spins[:, 0] if d == 2 else motion.spins[:, 0, 2]
    near = np.abs(times[:, None] - module("rocking").Parameters(**changes).motion.impacts()).min(axis=1) < 1e-5
    assert near.sum() < 5
    np.testing.assert_allclose(angles, found[:, 0], atol=1e-9)
    np.testing.assert_allclose(spins[~near], found[~near, 1], atol=1e-8)


def test_rocking_has_three_impacts_by_default_and_comes_to_rest():
    parameters = module("rocking").Parameters()
    impacts = parameters.motion.impacts()
    assert np.sum(impacts < parameters.duration) >= 3
    at_end = module("rocking").build(parameters).exact(np.array([impacts[-1], 1e3]))
    np.testing.assert_allclose(at_end.positions[:, 0, 1], 0.5, atol=1e-15)
    assert np.all(at_end.velocities == 0.0)
    assert np.all(np.abs(at_end.orientations) < 1e-15)


@pytest.mark.parametrize("width", [0.1, 0.25, 1.0])
def test_an_edge_needs_no_more_friction_than_is_asked_for(width):
    """Forces on the edge by differences, over the arcs that there are; the last are those that need the most."""
    rocking = Rocking(width / 2.0, 0.5, 0.9, G)
    _, halves, highest = rocking.arcs
    seen = halves > 1e-3 * halves[0]
    halves, highest = halves[seen], highest[seen]
    times = (highest + halves * np.linspace(-0.999, 0.999, 101)[:, None]).ravel()
    h = 1e-4 * np.broadcast_to(halves, (101, len(halves))).ravel()
    force = (rocking.at(times + h)[1] - rocking.at(times - h)[1]) / (2 * h)[:, None] + [0.0, G]
    needed = np.abs(force[:, 0]) / force[:, 1]
    started = times - h > 0.0
    assert np.all(force[started, 1] > 0.0)
    assert needed[started].max() == pytest.approx(rocking.friction, rel=0.02)
    assert needed[started].max() < rocking.friction * (1.0 + 1e-5)
    before = np.array([-1.0, -width])  # of the centre over spin and half height; then kept * (-1, width)
    impulse = rocking.kept * np.array([-1.0, width]) - before
    assert abs(impulse[0] / impulse[1]) == pytest.approx(rocking.friction)


# ------------------------------------------------------------------ impacts, rest


@pytest.mark.parametrize(("m1", "m2", "e"), [(1.0, 2.0, 0.5), (5.0, 0.1, 1.0), (1.0, 1.0, 0.0)])
def test_an_impact_keeps_momentum_and_the_boxes_part_with_e_times_their_approach(m1, m2, e):
    scene = build("box_impact", mass=m1, other_mass=m2, restitution=e, speed=2.0)
    before, at, after = (scene.exact(np.array([t])) for t in (0.249, 0.25, 0.251))
    v, w = before.velocities[0, :, 0], after.velocities[0, :, 0]
    assert np.diff(at.positions[0, :, 0])[0] == pytest.approx(1.0, abs=1e-15), "they touch"
    assert m1 * w[0] + m2 * w[1] == pytest.approx(m1 * v[0] + m2 * v[1], rel=1e-14)
    assert w[1] - w[0] == pytest.approx(e * (v[0] - v[1]), abs=1e-14)
    np.testing.assert_array_equal(v, [2.0, 0.0])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_a_stack_stands_by_forces_within_its_faces(d, seed):
    scene = build("stack", dimension=d, seed=seed, count=40)
    x = scene.bodies.positions
    assert np.ptp(np.delete(x, 1, axis=1), axis=0).min() > 0.005, "it is jittered"
    assert np.abs(np.delete(x, 1, axis=1)).max() <= 0.01
    np.testing.assert_allclose(x[:, 1], np.arange(40) + 0.5)
    for i in range(39):  # the face between i and i + 1 carries all above where their centre of mass is
        centre = np.delete(x[i + 1 :].mean(axis=0), 1)
        assert np.all(np.abs(centre - np.delete(x[[i, i + 1]], 1, axis=1)) < 0.5)


def test_a_heavy_box_is_on_a_light_one():
    scene = build("mass_ratio", dimension=3)
    np.testing.assert_array_equal(scene.bodies.masses, [1.0, 1000.0])
    np.testing.assert_allclose(scene.bodies.positions, [[0.0, 0.5, 0.0], [0.01, 1.5, 0.0]])


# ------------------------------------------------------------------ heaps, dominoes


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", ["pile", "falling_boxes"])
def test_heaps_are_seeded_dense_alike_and_inside_their_walls(name, d):
    scene, again, other = (build(name, dimension=d, count=50, seed=seed) for seed in (3, 3, 4))
    assert scene.bodies.shapes == again.bodies.shapes != other.bodies.shapes
    np.testing.assert_array_equal(scene.bodies.orientations, again.bodies.orientations)
    balls = [shape for shape in scene.bodies.shapes if isinstance(shape, Ball)]
    assert bool(balls) == (name == "falling_boxes")
    edges = np.concatenate([s.size if isinstance(s, Box) else [2 * s.radius] for s in scene.bodies.shapes])
    assert 0.2 <= edges.min() < 0.21
    assert 0.29 < edges.max() <= 0.3
    density = [
        m / (np.prod(s.size) if isinstance(s, Box) else np.pi * s.radius**d * (1.0 if d == 2 else 4.0 / 3.0))
        for s, m in zip(scene.bodies.shapes, scene.bodies.masses, strict=True)
    ]
    np.testing.assert_allclose(density, 0.25**-d)
    assert measured("penetration", scene, held(scene)) == 0.0
    assert len(scene.planes.offsets) == (1 if name == "falling_boxes" else 2 * d - 1)


def test_a_pile_lies_in_a_heap_about_as_wide_as_high():
    scene = build("pile", count=100)
    width = -2.0 * scene.planes.offsets[1]
    assert 10 * 0.25 < width < 20 * 0.25
    assert sum(np.prod(shape.size) for shape in scene.bodies.shapes) / width**2 < 0.7


@pytest.mark.parametrize("d", [2, 3])
def test_the_first_domino_turns_about_its_edge_fast_enough_to_fall(d):
    scene = build("dominoes", dimension=d)
    bodies, (w, h) = scene.bodies, scene.bodies.shapes[0].size[:2]
    spin = bodies.spins[0] if d == 2 else bodies.spins[0, 2]
    arm = np.array([w / 2.0, -h / 2.0])
    edge = bodies.velocities[0, :2] + spin * np.array([-arm[1], arm[0]])
    np.testing.assert_allclose(edge, 0.0, atol=1e-15)
    assert bodies.velocities[0, 0] > 0.0
    lift = G * (np.hypot(w, h) - h) / 2.0
    assert Subject(held(scene), scene).kinetic[0] / bodies.masses[0] > lift
    assert np.all(bodies.velocities[1:] == 0.0)


# ------------------------------------------------------------------ the top


@pytest.mark.parametrize("changes", [{}, {"tilt": 0.5}, {"tilt": 60.0, "middle": 0.95, "short": 0.1, "mass": 7.0}])
def test_the_top_turns_as_eulers_equations_say(changes):
    scene = build("top", **changes)
    inertia = scene.bodies.inertias[0]

    def rates(_, y):
        q, w = y[:4], y[4:]
        turn = np.concatenate([[-q[1:] @ w], q[0] * w + np.cross(q[1:], w)])
        return np.concatenate([0.5 * turn, -np.cross(w, inertia * w) / inertia])

    start = np.concatenate([scene.bodies.orientations[0], scene.bodies.spins[0]])
    tight = {**TIGHT, "rtol": 1e-13, "atol": 1e-14}
    run = solve_ivp(rates, (0.0, 10.0), start, t_eval=scene.times, **tight).y.T
    motion = scene.exact(scene.times)
    q = motion.orientations[:, 0]
    assert np.minimum(np.abs(q - run[:, :4]).max(axis=1), np.abs(q + run[:, :4]).max(axis=1)).max() < 2e-12
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-14)
    world = np.einsum("sij,sj->si", rotations(run[:, :4], 3), run[:, 4:])
    np.testing.assert_allclose(motion.spins[:, 0], world, atol=2e-11)


def test_the_top_flips_and_its_precession_is_the_quadrature_of_its_rate():
    scene = build("top")
    flips = rotations(scene.exact(scene.times).orientations[:, 0], 3)[:, 1, 1]
    assert flips.min() < -0.9, "the middle axis points the other way"
    top = Top(tuple(scene.bodies.inertias[0]), 3.0, 0.2)
    for time in (0.3, 4.0, 9.7):
        rate = quad(lambda t: top._precession_rate(np.array([t]))[0], 0.0, time, epsabs=1e-13, epsrel=1e-13, limit=400)
        assert top.precession(np.array([time]))[0] == pytest.approx(rate[0], abs=1e-12)
