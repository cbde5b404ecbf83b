"""Rigid bodies with penalty contacts: what springs, dampers and sliders must give, at rest, in impacts and turning."""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comparisons import catalog, engine
from comparisons.bodies import Ball, Box, Planes, at_rest, rotations
from comparisons.engines import _symplectic_euler_bodies, symplectic_euler
from comparisons.engines._symplectic_euler_contacts import TANGENTIAL
from comparisons.engines._symplectic_euler_space import turn
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.run import build_scene, execute
from comparisons.scene import Scene, no_masses
from pbd.errors import InvalidInput

G = 9.81
K = 1e6
"""Stiffness of a contact point [N/m/kg]."""

PRESETS = list(symplectic_euler.PRESETS)
DIMENSIONS = [2, 3]


def described(bodies, planes=None, *, gravity=G, friction=0.0, restitution=0.0, duration=0.1, samples=1):
    """A scene without a name."""
    d = bodies.positions.shape[1]
    down = -gravity * np.eye(d)[1] if np.ndim(gravity) == 0 else np.asarray(gravity, dtype=float)
    return Scene(
        name="",
        title="",
        masses=no_masses(d),
        links=(),
        gravity=down,
        duration=duration,
        samples=samples,
        metrics=(),
        bodies=bodies,
        planes=planes,
        friction=friction,
        restitution=restitution,
    )


def run(scene, preset="matched", **changes):
    """The engine's trajectory of a scene."""
    found = symplectic_euler.prepare(scene, engine.make_settings("symplectic_euler", preset, changes))()
    assert found.diverged == ""
    return found


def floor(d):
    return Planes(np.eye(d)[1][None], np.zeros(1))


def cube(d, edge=1.0):
    return Box((edge,) * d)


def one(shape, height, d, *, speed=0.0, mass=2.0, **changes):
    """One body whose lowest point is at a height over the floor, moving down with a speed."""
    reach = shape.radius if isinstance(shape, Ball) else shape.size[1] / 2.0
    up = np.eye(d)[1]
    return at_rest((shape,), np.array([mass]), (reach + height) * up[None], velocities=-speed * up[None], **changes)


def shapes(d):
    return {"ball": Ball(0.5, d), "cube": cube(d), "slab": Box((1.0, 0.4, 0.7)[:d])}


def points(shape, d):
    """How many points touch a plane when it lies flat."""
    return 1 if isinstance(shape, Ball) else 2 ** (d - 1)


def fitted(xs, errors):
    """Slope of log(error) over log(x)."""
    return np.polyfit(np.log(xs), np.log(errors), 1)[0]


# ------------------------------------------------------------------ at rest


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("name", ["ball", "cube", "slab"])
@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_body_rests_at_a_depth_of_m_g_over_the_stiffness_of_its_points(d, name, preset):
    shape = shapes(d)[name]
    found = run(described(one(shape, 0.0, d, mass=3.0), floor(d), friction=0.5), preset)
    sunk = -(found.positions[-1, 0] - found.positions[0, 0])
    assert sunk[1] == pytest.approx(G / (points(shape, d) * K), rel=1e-9)
    assert np.abs(np.delete(sunk, 1)).max() < 1e-14
    assert found.contact_forces[-1] == pytest.approx(3.0 * G, rel=1e-9)
    assert found.contact_forces[0] == 0.0


@pytest.mark.parametrize("d", DIMENSIONS)
def test_boxes_rest_on_a_fixed_box_as_on_a_plane(d):
    bodies = at_rest(
        (Box((5.0,) * d), cube(d, 0.5)), np.ones(2), np.array([[0.0, -2.5, 0.0], [0.3, 0.25, 0.2]])[:, :d], fixed=(0,)
    )
    found = run(described(bodies, friction=0.5))
    sunk = found.positions[0] - found.positions[-1]
    assert sunk[1, 1] == pytest.approx(G / (2 ** (d - 1) * K), rel=1e-9)
    assert np.all(sunk[0] == 0.0)
    assert found.contact_forces[-1] == 0.0, "planes' forces only"


@pytest.mark.parametrize("degrees", [0.0, 1e-13, 1e-9, 1e-3, 10.0, 45.0])
def test_corners_that_split_or_appear_make_no_contact_stiffer(degrees):
    """Equal cubes on each other, one turned about the vertical: four corners of the overlap become eight."""
    half = math.radians(degrees) / 2.0
    turned = [[1.0, 0.0, 0.0, 0.0], [math.cos(half), 0.0, math.sin(half), 0.0]]
    positions = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    bodies = at_rest((cube(3), cube(3)), np.ones(2), positions, orientations=np.array(turned), fixed=(0,))
    found = run(described(bodies))
    assert 1.0 - found.positions[-1, 1, 1] == pytest.approx(G / (4.0 * K), rel=1e-6)
    assert np.abs(found.orientations[-1, 1] - turned[1]).max() < 1e-12


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_stack_of_three_sinks_by_its_weight_and_stands(d, preset):
    """Each joint bears what lies on it; without shifts nothing else moves."""
    scene = build_scene("stack", {"dimension": d, "count": 3, "jitter": 0.0, "duration": 0.5, "samples": 2})
    found = run(scene, preset)
    sunk = (scene.bodies.positions - found.positions[-1])[:, 1]
    joints = np.array([3.0, 2.0, 1.0]) * G / (2 ** (d - 1) * K)
    np.testing.assert_allclose(sunk, np.cumsum(joints), rtol=1e-6)
    shifted = build_scene("stack", {"dimension": d, "count": 3, "duration": 2.0, "samples": 2})
    later = run(shifted, preset)
    assert np.abs(later.positions[-1] - later.positions[1]).max() < 1e-9, "it has come to rest"
    assert np.abs(later.positions[-1] - shifted.bodies.positions).max() < 20.0 * G / K
    assert later.contact_forces[-1] == pytest.approx(3.0 * G, rel=1e-6)


@pytest.mark.parametrize("preset", PRESETS)
def test_what_sticks_settles_and_then_never_creeps(preset):
    """A square on a slope: the springs across stretch by g sin / 2 k_t, those along differ and tip it by g sin / k."""
    slope = math.atan(0.2)
    gravity = G * np.array([math.sin(slope), -math.cos(slope)])
    scene = described(one(cube(2), 0.0, 2), floor(2), gravity=gravity, friction=0.5, duration=10.0, samples=20)
    found = run(scene, preset)
    sideways = gravity[0] / (2.0 * K) * (1.0 / TANGENTIAL + 1.0)
    assert found.positions[-1, 0] - found.positions[0, 0] == pytest.approx([sideways, gravity[1] / (2.0 * K)], rel=1e-4)
    assert -found.orientations[-1, 0] == pytest.approx(gravity[0] / K, rel=1e-4)
    assert np.abs(found.positions[-1] - found.positions[1]).max() < 1e-14


@pytest.mark.parametrize("d", DIMENSIONS)
def test_it_sticks_up_to_the_limit_and_not_beyond(d):
    """At 0.97 of the angle of friction; at 1.03 of it the box slides."""
    for part, sticks in ((0.97, True), (1.03, False)):
        slope = part * math.atan(0.5)
        down = G * np.array([math.sin(slope), -math.cos(slope), 0.0])[:d]
        found = run(described(one(cube(d), 0.0, d), floor(d), gravity=down, friction=0.5, duration=2.0, samples=4))
        moved = np.abs(found.positions[-1] - found.positions[2]).max()
        assert moved < 1e-13 if sticks else moved > 0.1


# ------------------------------------------------------------------ impacts


def rebound_error(shape, d, e, dt, preset="matched"):
    """Worst over phases of the step grid of the departure from Newton's law, without gravity."""
    worst = 0.0
    for phase in (0.13, 0.37, 0.61, 0.89):
        bodies = one(shape, (3.0 + phase) * dt, d, speed=1.0)
        found = run(described(bodies, floor(d), gravity=0.0, restitution=e, duration=0.02), preset, dt=dt)
        worst = max(worst, abs(found.velocities[-1, 0, 1] - e))
        assert np.abs(found.spins[-1]).max() < 1e-9
    return worst


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("e", [0.2, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("name", ["ball", "cube", "slab"])
@pytest.mark.parametrize("d", DIMENSIONS)
def test_restitution_is_that_of_the_linear_spring_and_dashpot_to_second_order(d, name, e, preset):
    steps = [2e-5, 1e-5, 5e-6, 2.5e-6]
    errors = [rebound_error(shapes(d)[name], d, e, dt, preset) for dt in steps]
    assert fitted(steps, errors) > 1.85
    assert errors[-1] < 2e-5


@pytest.mark.parametrize("d", DIMENSIONS)
def test_critical_damping_leaves_no_rebound(d):
    for shape in shapes(d).values():
        assert rebound_error(shape, d, 0.0, 1e-4) < 1e-6


@pytest.mark.parametrize("name", ["ball on ball", "ball on box", "box on ball", "box on box"])
@pytest.mark.parametrize("d", DIMENSIONS)
def test_central_impacts_of_all_pairs_of_shapes(d, name):
    """v1 = v (m1 - e m2) / (m1 + m2), v2 = v m1 (1 + e) / (m1 + m2)."""
    e, v, masses = 0.5, 2.0, np.array([1.0, 3.0])
    pair = tuple(Ball(0.5, d) if word == "ball" else cube(d) for word in name.split(" on "))
    bodies = at_rest(pair, masses, np.array([[0.0] * d, [1.00123] + [0.0] * (d - 1)]), velocities=v * np.eye(2, d, 0))
    bodies.velocities[1] = 0.0
    found = run(described(bodies, gravity=0.0, restitution=e, duration=0.02), dt=1e-5)
    expected = v * np.array([masses[0] - e * masses[1], masses[0] * (1.0 + e)]) / masses.sum()
    assert found.velocities[-1, :, 0] == pytest.approx(expected, abs=1e-4)
    assert np.abs(found.velocities[-1, :, 1:]).max() < 1e-12
    assert found.work["contact forces"] > 0


def crash(d, seed, **described_by):
    """Two boxes and a ball that fly at each other, turning."""
    random = np.random.default_rng(seed)
    positions = 0.55 * np.array([[1.0, 0.0, 0.0], [-0.5, 0.8, 0.0], [-0.5, -0.8, 0.0]])[:, :d]
    positions += random.uniform(-0.05, 0.05, (3, d))
    turns = random.standard_normal((3, 4))
    bodies = at_rest(
        (cube(d, 0.4), Box((0.5, 0.3, 0.4)[:d]), Ball(0.25, d)),
        np.array([1.0, 2.0, 0.5]),
        positions,
        velocities=-3.0 * positions,
        spins=random.standard_normal(3 if d == 2 else (3, 3)),
        orientations=turns[:, 0] if d == 2 else turns / np.linalg.norm(turns, axis=1)[:, None],
    )
    return described(bodies, gravity=0.0, duration=0.5, samples=5, **described_by)


def total_momenta(scene, found):
    """Linear, and angular about the origin."""
    m, inertias, d = scene.bodies.masses, scene.bodies.inertias, len(scene.gravity)
    linear = np.einsum("n,snd->sd", m, found.velocities)
    if d == 2:
        x, v = found.positions, found.velocities
        orbital = (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]) @ m
        return linear, orbital + found.spins @ inertias[:, 0]
    r = rotations(found.orientations, 3)
    own = np.einsum("snij,nj,snkj,snk->si", r, inertias, r, found.spins)
    return linear, np.einsum("n,snd->sd", m, np.cross(found.positions, found.velocities)) + own


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), d=st.sampled_from(DIMENSIONS), friction=st.sampled_from([0.0, 0.5]))
def test_impacts_conserve_momentum_and_angular_momentum(seed, d, friction):
    scene = crash(d, seed, friction=friction, restitution=0.5)
    found = run(scene, "default")
    for momentum in total_momenta(scene, found):
        assert np.abs(momentum - momentum[0]).max() < 1e-12


@pytest.mark.parametrize("d", DIMENSIONS)
def test_elastic_impacts_of_turning_bodies_conserve_energy(d):
    """In the median of many to second order; a few in space touch near a rim, where stiffness varies."""
    changes = []
    for seed in range(20):
        scene = crash(d, seed, restitution=1.0)
        found = run(scene, dt=2e-5)
        kinetic = Subject(found, scene).kinetic
        changes.append(abs(kinetic[-1] / kinetic[0] - 1.0))
        assert found.work["contact forces"] > 0
    assert np.median(changes) < 1e-4
    assert max(changes) < 0.1


# ------------------------------------------------------------------ friction


def test_sliding_friction_is_mu_times_the_normal_force_in_every_step():
    """Sum of h mu N / m = mu (g t + v_y) whatever N does while the box settles, to round-off."""
    mu, v = 0.3, 4.0
    bodies = one(cube(2), 0.0, 2)
    bodies.velocities[0, 0] = v
    found = run(described(bodies, floor(2), friction=mu, duration=0.4, samples=400), "default")
    lost = v - found.velocities[:, 0, 0]
    np.testing.assert_allclose(lost, mu * (G * found.times + found.velocities[:, 0, 1]), atol=1e-12)
    assert lost[-1] == pytest.approx(mu * G * 0.4, rel=1e-9)


def slide_error(stiffness, preset="matched", part=0.05):
    """Of where the box stops, with steps that are a part of the contact's 1/frequency."""
    scene = build_scene("slide", {})
    interval = scene.duration / scene.samples
    dt = interval / math.ceil(interval / (part / math.sqrt(stiffness)))
    found = run(scene, preset, contact_stiffness=stiffness, dt=dt)
    return dt, abs(found.positions[-1, 0, 0] - scene.exact(scene.times).positions[-1, 0, 0])


def test_the_stop_converges_to_v_squared_over_2_mu_g_with_stiffness_and_step():
    stiffnesses = [1e4, 1e5, 1e6, 1e7, 1e8]
    assert fitted(stiffnesses, [slide_error(k)[1] for k in stiffnesses]) == pytest.approx(-1.0, abs=0.15)
    steps, errors = zip(*(slide_error(1e6, "default", 0.2 / 2**n) for n in range(4)), strict=True)
    assert fitted(steps, errors) == pytest.approx(1.0, abs=0.15)
    assert slide_error(1e8)[1] < 3e-8


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_ball_rolls_with_two_thirds_or_five_sevenths_of_the_slope(d):
    scene = build_scene("rolling", {"dimension": d})
    found, exact = run(scene), scene.exact(scene.times)
    assert found.velocities[-1, 0] == pytest.approx(exact.velocities[-1, 0], abs=1e-9)
    assert found.spins[-1] == pytest.approx(exact.spins[-1], abs=1e-9)
    stiffnesses = [1e4, 1e5, 1e6, 1e7]
    errors = []
    for k in stiffnesses:
        softer = run(scene, contact_stiffness=k, dt=scene.duration / scene.samples / math.ceil(math.sqrt(k)))
        errors.append(np.abs(softer.positions[-1] - exact.positions[-1]).max())
    assert fitted(stiffnesses, errors) == pytest.approx(-1.0, abs=0.15)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_ball_that_slides_through_its_impact_gets_mu_times_the_impulse(d):
    """Change of velocity along the plane: -mu (1 + e) v_n, of spin: m r / I times that; at e = 1 the damper is none."""
    mu, v, ball = 0.2, 1.0, Ball(0.5, d)
    bodies = one(ball, 0.00123, d, speed=v)
    bodies.velocities[0, 0] = 5.0
    found = run(described(bodies, floor(d), gravity=0.0, friction=mu, restitution=1.0, duration=0.02), dt=1e-5)
    impulse = mu * (found.velocities[-1, 0, 1] + v)
    assert impulse == pytest.approx(2.0 * mu * v, abs=1e-4)
    assert 5.0 - found.velocities[-1, 0, 0] == pytest.approx(impulse, rel=1e-12)
    spin = found.spins[-1, 0] if d == 2 else found.spins[-1, 0, 2]
    assert -spin == pytest.approx(2.0 * impulse * ball.radius / ball.inertia(2.0)[0], rel=1e-9)


# ------------------------------------------------------------------ turning


@pytest.mark.parametrize("preset", PRESETS)
def test_a_free_top_is_turned_to_second_order_without_drift(preset):
    found = {}
    for n in range(4):
        spec = RunSpec(scene="top", engine="symplectic_euler", preset=preset, settings={"dt": 0.01 / 2**n})
        record = execute(spec)
        assert record.status.code == "ok"
        assert record.metric("angular_momentum_drift") < 1e-12
        found[0.01 / 2**n] = record.metric("attitude_error")
    assert fitted(list(found), list(found.values())) == pytest.approx(2.0, abs=0.15)
    scene = build_scene("top", {"duration": 1000.0, "samples": 2000})
    long = Subject(run(scene, preset, dt=0.05), scene)
    errors = np.abs(long.energy / long.energy[0] - 1.0)
    assert 1e-6 < errors[:1000].max() < 0.01
    assert errors[1000:].max() < 1.1 * errors[:1000].max(), "no secular drift"


def test_a_plane_turn_counts_its_rounds():
    bodies = at_rest((cube(2),), np.ones(1), np.zeros((1, 2)), spins=np.array([7.0]))
    found = run(described(bodies, gravity=0.0, duration=10.0))
    assert found.orientations[-1, 0] == pytest.approx(70.0, rel=1e-12)
    assert found.spins[-1, 0] == pytest.approx(7.0, rel=1e-14)


def test_a_free_turn_goes_back_the_way_it_came():
    """The splitting is reversible; in plain Python, which kernels are too."""
    random = np.random.default_rng(1)
    q = random.standard_normal((1, 4))
    start = q / np.linalg.norm(q)
    bodies = at_rest((Box((1.0, 0.6, 0.3)),), np.ones(1), np.zeros((1, 3)), orientations=start)
    state = _symplectic_euler_bodies._state(bodies, 3)
    for axis in range(3):
        state.momentum[axis][0] = random.standard_normal()
    for h in (0.1, -0.1):
        _symplectic_euler_bodies.frame(state.q, state, 0)
        turn(state.q, state, 0, h)
        if h > 0.0:
            assert np.abs(np.ravel(state.q) - start).max() > 0.01
    np.testing.assert_allclose(np.ravel(state.q), start[0], atol=1e-15)


# ------------------------------------------------------------------ the list of neighbours, and what else


def heap(d, **changes):
    return build_scene("pile", {"count": 12, "dimension": d, "duration": 0.5, "samples": 5, **changes})


@pytest.mark.parametrize("d", DIMENSIONS)
def test_the_list_of_neighbours_changes_nothing_but_the_work(d, monkeypatch):
    """Renewed in every step, or with too little room at first: the same motion bit for bit, what sticks included."""
    scene = heap(d)
    found = run(scene)
    monkeypatch.setattr(_symplectic_euler_bodies, "SKIN", 1e-12)
    eager = run(scene)
    np.testing.assert_array_equal(eager.positions, found.positions)
    assert eager.work["contact forces"] == found.work["contact forces"] > 0
    assert eager.work["pairs tested"] < found.work["pairs tested"]
    monkeypatch.setattr(_symplectic_euler_bodies, "PAIRS", 1)
    cramped = run(scene)
    np.testing.assert_array_equal(cramped.positions, found.positions)
    assert cramped.work == eager.work


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_heap_comes_to_rest_and_gains_no_energy(d, preset):
    count = {2: 30, 3: 20}[d]
    record = execute(
        RunSpec(
            scene="pile",
            engine="symplectic_euler",
            preset=preset,
            parameters={"dimension": d, "count": count, "duration": 2.0, "samples": 40},
        )
    )
    assert record.status.code == "ok"
    assert record.metric("energy_rise") < 1e-4
    assert record.metric("settled_penetration") < 1e-3


def test_work_is_counted():
    found = run(described(one(cube(2), -1e-6, 2), floor(2), duration=0.1, samples=10))
    assert found.work == {"contact forces": 2 * 1001, "pairs tested": 0}
    assert found.steps == 1000


def test_fixed_bodies_never_move_and_do_not_touch_each_other():
    bodies = at_rest(
        (cube(2), cube(2), Ball(0.2)),
        np.ones(3),
        np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.8]]),
        velocities=np.ones((3, 2)),
        spins=np.ones(3),
        fixed=(0, 1),
    )
    found = run(described(bodies, floor(2)))
    assert np.all(found.positions[:, :2] == bodies.positions[:2])
    assert np.all(found.velocities[:, :2] == 0.0)
    assert np.all(found.orientations[:, :2] == 0.0)


def test_too_long_a_step_is_divergence_and_not_an_error():
    scene = build_scene("stack", {"count": 3})
    settings_of = engine.make_settings("symplectic_euler", "matched", {"dt": 0.05, "contact_stiffness": 1e12})
    found = symplectic_euler.prepare(scene, settings_of)()
    assert found.diverged or np.abs(found.positions).max() > 1e3
    assert len(found.times) == len(found.positions) == len(found.orientations) == len(found.contact_forces)
    record = execute(
        RunSpec(scene="stack", engine="symplectic_euler", settings={"dt": 0.05, "contact_stiffness": 1e12})
    )
    assert record.status.code == "diverged"


def test_bad_input_is_named():
    with pytest.raises(InvalidInput, match="contact_stiffness"):
        engine.make_settings("symplectic_euler", "default", {"contact_stiffness": 0.0})
    bodies = one(cube(2), 0.0, 2, mass=math.nan)
    with pytest.raises(InvalidInput, match="masses"):
        symplectic_euler.unsupported(described(bodies), symplectic_euler.Settings())


def test_what_work_precision_tries():
    stiffness = {"contact_stiffness"}
    assert {frozenset(c) for c in symplectic_euler.sweep(build_scene("stack", {}))} == {frozenset(stiffness)}
    assert symplectic_euler.sweep(build_scene("top", {})) == [{}]


def test_all_body_scenes_run_in_both_presets():
    for name, preset in itertools.product(catalog.names("scenes"), PRESETS):
        if build_scene(name, {}).bodies is not None and name not in ("pile", "falling_boxes"):
            assert execute(RunSpec(scene=name, engine="symplectic_euler", preset=preset)).status.code == "ok", name


def test_plain_python_gives_the_numbers_of_the_kernel():
    cases = [
        (name, {"dimension": d, "duration": 0.005, "samples": 5, **extra})
        for d in DIMENSIONS
        for name, extra in (("stack", {"count": 3}), ("bouncing_ball", {"lead": 0.45}))
    ]
    code = (
        "import json, sys, numba; from comparisons.record import RunSpec; from comparisons.run import execute\n"
        "assert numba.config.DISABLE_JIT\n"
        "for name, parameters in json.load(sys.stdin):\n"
        "    record = execute(RunSpec(scene=name, engine='symplectic_euler', parameters=parameters))\n"
        "    print(json.dumps([record.status.code, record.work, {k: v.value for k, v in record.metrics.items()}]))\n"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        input=json.dumps(cases),
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr
    for (name, parameters), line in zip(cases, done.stdout.splitlines(), strict=True):
        record = execute(RunSpec(scene=name, engine="symplectic_euler", parameters=parameters))
        status, work, metrics = json.loads(line)
        assert (status, work) == (record.status.code, record.work) == ("ok", work)
        assert work["contact forces"] > 0
        for key, value in metrics.items():
            assert value == pytest.approx(record.metric(key), rel=1e-9, abs=1e-12), key
