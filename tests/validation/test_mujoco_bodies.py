"""Rigid bodies in MuJoCo, calibrated on closed forms: free motion in plane and space, friction, rest."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from comparisons import engine, isolation, run
from comparisons.bodies import Ball, Box, Planes, at_rest, rotations
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.scene import Scene, no_masses
from pbd.errors import InvalidInput

adapter = engine.load("mujoco")
if adapter.missing():
    pytest.skip(f"MuJoCo is absent: {adapter.missing()}", allow_module_level=True)
mujoco = pytest.importorskip("mujoco")

G = 9.81
ROUND_OFF = 1e-12
DIMENSIONS = [2, 3]


def simulate(scene, preset="matched", **changes):
    settings = engine.make_settings("mujoco", preset, changes)
    assert adapter.unsupported(scene, settings) == ""
    return adapter.prepare(scene, settings)()


def world(shapes, positions, planes=None, *, gravity=G, duration=1.0, samples=20, mu=0.0, **changes):
    """With gravity along -y, as all planar scenes have it."""
    positions = np.array(positions, dtype=float)
    d = positions.shape[1]
    masses = changes.pop("masses", np.ones(len(shapes)))
    bodies = at_rest(tuple(shapes), masses, positions, **changes)
    down = -gravity * np.eye(d)[1]
    return Scene("", "", no_masses(d), (), down, duration, samples, (), bodies, planes, mu, 0.0)


def floor(d):
    return Planes(np.eye(d)[1:2], np.zeros(1))


def cube(size, d):
    return Box((size,) * d)


@functools.cache
def known(name, **parameters):
    return run.build_scene(name, parameters)


def deviation(out, scene):
    return np.abs(out.positions - scene.exact(scene.times).positions).max()


# ------------------------------------------------------------------ free motion


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_free_body_kicks_first_and_moves_after(d):
    dt, v = 0.01, np.arange(1.0, d + 1.0)
    scene = world([cube(1.0, d)], [np.full(d, 0.5)], velocities=v[None])
    out, n = simulate(scene, "default", dt=dt), np.round(scene.times / dt)
    fallen = 0.5 + v[1] * scene.times - 0.5 * G * dt**2 * n * (n + 1.0)
    np.testing.assert_allclose(out.positions[:, 0, 1], fallen, atol=ROUND_OFF)
    np.testing.assert_allclose(out.positions[:, 0, 0], 0.5 + v[0] * scene.times, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0, 1], v[1] - G * scene.times, atol=ROUND_OFF)
    assert out.contact_forces is None


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("integrator", ["by_scene", "leapfrog", "RK4"])
@pytest.mark.parametrize("samples", [5, 20])
def test_leapfrog_and_runge_kutta_make_free_fall_exact(d, integrator, samples):
    """With a sample at each step, and between."""
    v = np.arange(1.0, d + 1.0)
    scene = world([Ball(0.5, d)], [np.full(d, 0.5)], velocities=v[None], samples=samples)
    out, t = simulate(scene, dt=0.05, integrator=integrator), scene.times[:, None]
    fall = np.eye(d)[1] * G
    np.testing.assert_allclose(out.positions[:, 0], 0.5 + v * t - 0.5 * fall * t**2, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0], v - fall * t, atol=ROUND_OFF)
    assert out.steps == 20


def test_turned_bodies_of_the_plane_keep_their_axes_and_spin():
    """Joints are along the world's axes and through the centre, whatever the angle and place at the start."""
    scene = world(
        [Box((1.0, 0.5)), Ball(0.5), Box((1.0, 0.5))],
        [[7.0, 3.0], [2.0, 3.0], [-7.0, 3.0]],
        gravity=0.0,
        velocities=np.array([[1.0, 2.0], [9.0, 9.0], [-1.0, 0.5]]),
        orientations=np.array([0.7, 0.4, -2.0]),
        spins=np.array([30.0, 9.0, -2.0]),
        fixed=(1,),
    )
    out, t = simulate(scene, dt=0.01), scene.times
    expected = scene.bodies.positions + t[:, None, None] * np.array([[1.0, 2.0], [0.0, 0.0], [-1.0, 0.5]])
    np.testing.assert_allclose(out.positions, expected, atol=ROUND_OFF)
    turned = np.array([0.7, 0.4, -2.0]) + np.outer(t, [30.0, 0.0, -2.0])
    np.testing.assert_allclose(out.orientations, turned, atol=1e-11)
    np.testing.assert_allclose(out.spins, np.broadcast_to([30.0, 0.0, -2.0], turned.shape), atol=ROUND_OFF)


QUATERNION = np.array([0.5, -0.1, 0.7, 0.5]) / np.linalg.norm([0.5, -0.1, 0.7, 0.5])
SPIN = np.array([0.3, 4.0, -1.5])
BRICK = Box((0.3, 1.0, 2.0))


@functools.cache
def top():
    """A brick that tumbles away from the origin, no torques; its orientations by DOP853, from Euler's equations."""
    scene = world(
        [BRICK],
        [[5.0, 1.0, -2.0]],
        gravity=0.0,
        orientations=QUATERNION[None],
        spins=SPIN[None],
        masses=np.array([3.0]),
    )
    inertia = BRICK.inertia(3.0)

    def rate(_, y):
        w, x, yy, z = y[:4]
        a, b, c = y[4:]
        turn = 0.5 * np.array(
            [-x * a - yy * b - z * c, w * a + yy * c - z * b, w * b + z * a - x * c, w * c + x * b - yy * a]
        )
        return np.concatenate([turn, np.cross(inertia * y[4:], y[4:]) / inertia])

    start = np.concatenate([QUATERNION, rotations(QUATERNION, 3).T @ SPIN])
    solved = solve_ivp(rate, (0.0, 1.0), start, "DOP853", scene.times, rtol=1e-12, atol=1e-12)
    return scene, solved.y[:4].T, np.einsum("sij,js->si", rotations(solved.y[:4].T, 3), solved.y[4:])


def test_a_tumbling_brick_turns_by_euler_s_equations_at_order_four_matched():
    scene, attitudes, spins = top()
    steps, errors = np.array([1e-2, 5e-3, 2.5e-3]), []
    for dt in steps:
        out = simulate(scene, dt=dt)
        np.testing.assert_allclose(
            out.positions, np.broadcast_to(scene.bodies.positions, out.positions.shape), atol=1e-9
        )
        errors.append(np.abs(rotations(out.orientations[:, 0], 3) - rotations(attitudes, 3)).max())
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 3.8
    assert errors[-1] < 1e-7
    np.testing.assert_allclose(out.spins[:, 0], spins, atol=1e-6)


def test_a_tumbling_brick_turns_at_order_one_by_default_and_loses_angular_momentum():
    scene, attitudes, _ = top()
    steps = np.array([1e-2, 5e-3, 2.5e-3])
    runs = [simulate(scene, "default", dt=dt) for dt in steps]
    errors = [np.abs(rotations(out.orientations[:, 0], 3) - rotations(attitudes, 3)).max() for out in runs]
    assert 0.85 < np.polyfit(np.log(steps), np.log(errors), 1)[0] < 1.15
    for out, limit in ((runs[-1], 1e-1), (simulate(scene, dt=2.5e-3), 1e-6)):
        subject = Subject(out, scene)
        momenta = np.einsum("sij,sj->si", rotations(out.orientations[:, 0], 3), subject.body_momenta[:, 0])
        drift = np.linalg.norm(momenta - momenta[0], axis=1).max() / np.linalg.norm(momenta[0])
        assert drift < limit
        assert limit < 1e-3 or drift > 1e-3


def test_bodies_of_space_keep_the_scene_s_order_around_a_fixed_one():
    shapes = [Ball(0.5, 3), cube(1.0, 3), Ball(0.25, 3)]
    spins = np.array([[1.0, 2.0, 3.0], [9.0, 9.0, 9.0], [0.0, -1.0, 0.5]])
    scene = world(
        shapes,
        [[0.0, 5.0, 0.0], [3.0, 5.0, 0.0], [6.0, 5.0, 0.0]],
        gravity=0.0,
        orientations=np.array([QUATERNION] * 3),
        velocities=spins,
        spins=spins,
        fixed=(1,),
    )
    out = simulate(scene, dt=0.01)
    moving = np.where(np.array([True, False, True])[:, None], spins, 0.0)
    np.testing.assert_allclose(out.velocities, np.broadcast_to(moving, out.velocities.shape), atol=ROUND_OFF)
    np.testing.assert_allclose(out.spins, np.broadcast_to(moving, out.spins.shape), atol=1e-11)
    assert np.all(out.positions[:, 1] == scene.bodies.positions[1])
    assert np.all(out.orientations[:, 1] == QUATERNION)


# ------------------------------------------------------------------ friction


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("ground", ["plane", "body"])
def test_a_box_slides_as_far_as_the_scene_s_friction_says(ground, d):
    """v0^2 / (2 mu g), whatever it slides on."""
    speed, mu, away = 2.0, 0.3, [0.0] * (d - 2)
    way = speed**2 / (2.0 * mu * G)
    shapes, positions = [cube(0.2, d)], [[0.0, 0.1, *away]]
    velocities = [[speed, 0.0, *away]]
    if ground == "body":
        shapes, positions, velocities = [*shapes, cube(20.0, d)], [*positions, [0.0, -10.0, *away]], velocities * 2
    fixed = (1,) if ground == "body" else ()
    planes = floor(d) if ground == "plane" else None
    scene = world(shapes, positions, planes, mu=mu, velocities=np.array(velocities), fixed=fixed)
    assert simulate(scene, dt=1.0 / 240.0).positions[-1, 0, 0] == pytest.approx(way, rel=1e-3)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_nothing_slows_a_box_without_friction(d):
    away = [0.0] * (d - 2)
    scene = world([cube(0.2, d)], [[0.0, 0.1, *away]], floor(d), velocities=np.array([[2.0, 0.0, *away]]))
    for preset in adapter.PRESETS:
        out = simulate(scene, preset, dt=1.0 / 240.0)
        np.testing.assert_allclose(out.velocities[:, 0, 0], 2.0, atol=ROUND_OFF)


@pytest.mark.parametrize(("d", "limit"), [(2, 1e-6), (3, 1e-6)])
def test_a_disc_and_a_sphere_roll_down_by_their_own_inertia(d, limit):
    """g sin / (1 + 1/2) and g sin / (1 + 2/5)."""
    scene = known("rolling", dimension=d)
    assert deviation(simulate(scene, dt=1.0 / 240.0), scene) < limit  # measured 2e-7 and 3e-7
    assert deviation(simulate(scene, "default", dt=1.0 / 240.0), scene) > 1e-3


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_box_sticks_on_a_slope_just_below_the_limit(d):
    """In 10 s the default creeps by a centimetre."""
    scene = known("incline_stick", dimension=d)
    assert deviation(simulate(scene, dt=1.0 / 240.0), scene) < 1e-6  # measured 8e-8 and 1.2e-7
    assert 1e-3 < deviation(simulate(scene, "default", dt=1.0 / 240.0), scene) < 0.1


@pytest.mark.parametrize("d", DIMENSIONS)
def test_what_slides_hops(d):
    """The convex cost lifts it: by a fifth of a metre at 5 m/s, whatever the step, if contacts take but two steps."""
    scene = known("slide", dimension=d)
    for dt in (1.0 / 240.0, 1.0 / 960.0):
        hop = {c: np.ptp(simulate(scene, dt=dt, contacts=c).positions[:, 0, 1]) for c in ("soft", "stiff", "rigid")}
        assert hop["stiff"] > 0.2  # measured 0.23
        assert hop["rigid"] < 0.05  # measured 0.03
        assert hop["soft"] < 0.03


# ------------------------------------------------------------------ rest


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_stack_stands_and_presses_with_its_weight(d):
    """Its drift is of second order in the step; matched, a hundredth of the default."""
    scene = known("stack", dimension=d)
    drift = {dt: deviation(simulate(scene, dt=dt), scene) for dt in (1.0 / 60.0, 1.0 / 120.0, 1.0 / 240.0)}
    assert drift[1.0 / 240.0] < 1e-5  # measured 4.5e-6 and 6.8e-6
    assert np.polyfit(np.log(list(drift)), np.log(list(drift.values())), 1)[0] == pytest.approx(2.0, abs=0.1)
    out = simulate(scene, dt=1.0 / 240.0)
    assert out.contact_forces[-1] == pytest.approx(10.0 * G, rel=1e-6)
    assert deviation(simulate(scene, "default", dt=1.0 / 240.0), scene) > 1e-3


@pytest.mark.parametrize("d", DIMENSIONS)
def test_what_starts_in_touch_is_found_in_touch(d):
    """Else a box would fall for a step and bounce: 10 sizes, on the floor to round-off."""
    sizes = 0.1 * np.arange(1, 11)
    positions = np.zeros((10, d))
    positions[:, 0], positions[:, 1] = 2.0 * np.arange(10), sizes / 2.0
    scene = world([cube(size, d) for size in sizes], positions, floor(d), mu=0.5)
    out = simulate(scene, dt=1.0 / 60.0)
    assert np.abs(out.positions - positions).max() < 2e-6  # the sinking that carries the weight, (1 - d) g / k


def test_forces_are_not_told_where_fixed_bodies_could_share_them():
    scene = world([cube(1.0, 2), cube(1.0, 2)], [[0.0, 0.5], [3.0, 0.5]], floor(2), fixed=(1,))
    assert simulate(scene, dt=0.01).contact_forces is None


@pytest.mark.parametrize("planes", [1, 2])
def test_forces_of_planes_are_summed_as_vectors(planes):
    """A disc of 2 kg in a corner of two frictionless planes at 45 degrees, or on one: they carry its weight."""
    s = np.sqrt(0.5)
    corner = Planes(np.array([[s, s], [-s, s]]), np.zeros(2)) if planes == 2 else floor(2)
    start = [[0.0, 0.5 / s]] if planes == 2 else [[0.0, 0.5]]
    out = simulate(world([Ball(0.5)], start, corner, masses=np.array([2.0]), duration=2.0), dt=1.0 / 240.0)
    assert out.contact_forces[-1] == pytest.approx(2.0 * G, rel=1e-6)
    assert out.contact_forces[0] == 0.0


# ------------------------------------------------------------------ the adapter


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_heap_drops_no_contact_and_writes_nothing(d, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    scene = known("pile", dimension=d, count=100, duration=0.5, samples=10)
    model = adapter.BodyModel(scene, {"timestep": 1.0 / 240.0}, "soft")
    mujoco.set_mju_user_warning(adapter.be_quiet)
    mujoco.mj_step(model.model, model.data, 120)
    assert model.data.ncon > 20
    assert [warning.number for warning in model.data.warning] == [0] * len(model.data.warning)
    assert not simulate(scene, "default", dt=1.0 / 240.0).diverged
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_a_run_that_starts_anew_is_a_status(capfd):
    """Accelerations beyond 1e10 m/s^2 make MuJoCo start anew at each step."""
    scene = world([cube(1.0, 2)], [[0.0, 5.0]], floor(2), gravity=1e12)
    assert simulate(scene, "default", dt=0.01).diverged
    assert capfd.readouterr() == ("", "")


def test_default_preset_is_the_engine_s_own():
    """Nothing of a shape or of the model is set but size, mass and friction."""
    model = adapter.BodyModel(known("stack"), {"timestep": 0.01}, "soft").model
    own, geom = mujoco.MjSpec().option, mujoco.MjSpec().worldbody.add_geom()
    assert (model.opt.cone, model.opt.impratio) == (own.cone, own.impratio)
    assert np.all(model.geom_solref == geom.solref)
    assert np.all(model.geom_solimp == geom.solimp)
    assert np.all(model.geom_margin == geom.margin)
    assert adapter.Settings().contacts == "soft"


@pytest.mark.parametrize("d", DIMENSIONS)
def test_what_is_switched_off_changes_no_bit(d):
    scene = known("stack", dimension=d, count=3, duration=0.5, samples=10)
    full, stripped = (simulate(scene, "matched", dt=0.01, stripped=flag) for flag in (False, True))
    assert np.array_equal(full.positions, stripped.positions)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_fixed_bodies_alone_and_no_bodies_run(d):
    held = simulate(world([cube(1.0, d)], [np.full(d, 5.0)], floor(d), fixed=(0,)), dt=0.01)
    assert np.all(held.positions == 5.0)
    nobody = {name: np.zeros((0, *more)) for name, more in (("orientations", (4,)), ("spins", (3,)))} if d == 3 else {}
    assert simulate(world([], np.zeros((0, d)), floor(d), **nobody), dt=0.01).positions.shape == (21, 0, d)


def test_child_process_gives_the_same_run():
    spec = RunSpec(scene="stack", engine="mujoco", parameters={"dimension": 3}, preset="matched", settings={"dt": 0.01})
    apart, here = isolation.run_apart(spec), simulate(known("stack", dimension=3), dt=0.01)
    assert np.array_equal(apart.positions, here.positions)
    assert np.array_equal(apart.velocities, here.velocities)
    assert np.array_equal(apart.orientations, here.orientations)
    assert np.array_equal(apart.contact_forces, here.contact_forces)


def test_restitution_is_unsupported_and_sweeps_are_distinct():
    scene = known("stack")
    bouncy = dataclasses.replace(scene, restitution=0.1)
    assert "restitution" in adapter.unsupported(bouncy, adapter.Settings())
    tried = [engine.make_settings("mujoco", "matched", changes) for changes in adapter.sweep(scene)]
    assert len(set(tried)) == len(tried) > 2


@pytest.mark.parametrize("check", [adapter.unsupported, adapter.prepare])
def test_bad_numbers_are_named(check):
    turned = np.array([[1.0, 0.1, 0.0, 0.0]])
    with pytest.raises(InvalidInput, match=r"scene\.bodies\.orientations"):
        check(world([Ball(0.5, 3)], [[0.0, 1.0, 0.0]], orientations=turned), adapter.Settings())
