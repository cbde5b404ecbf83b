"""What MuJoCo does, calibrated on closed forms of its discrete equations and on the continuous motion."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from scipy.special import ellipk

from comparisons import engine, isolation, reference, run
from comparisons import scene as vocabulary
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.scene import PointMasses, Rods, Springs
from pbd.errors import InvalidInput

adapter = engine.load("mujoco")
if adapter.missing():
    pytest.skip(f"MuJoCo is absent: {adapter.missing()}", allow_module_level=True)
mujoco = pytest.importorskip("mujoco")

G = 9.81
ROUND_OFF = 1e-12


def simulate(scene, preset="default", **changes):
    settings = engine.make_settings("mujoco", preset, changes)
    assert adapter.unsupported(scene, settings) == ""
    return adapter.prepare(scene, settings)()


@functools.cache
def chain(links, **parameters):
    return run.build_scene("pendulum_chain", {"links": links, **parameters})


def distance(one, other):
    """Largest over samples of the rms over particles; positions, then velocities."""
    return tuple(
        float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=2), axis=1)).max())
        for a, b in ((one.positions, other.positions), (one.velocities, other.velocities))
    )


def orders(scene, steps, preset, **changes):
    exact = reference.solve(scene)
    errors = [distance(simulate(scene, preset, dt=dt, **changes), exact) for dt in steps]
    return tuple(np.polyfit(np.log(steps), np.log(column), 1)[0] for column in zip(*errors, strict=True))


def world(x, links, v=None, masses=None, pinned=(), gravity=(0.0, -G), duration=1.0, samples=10):
    x = np.asarray(x, dtype=float)
    v = np.zeros_like(x) if v is None else np.asarray(v, dtype=float)
    points = PointMasses(x, v, np.ones(len(x)) if masses is None else np.asarray(masses, dtype=float), pinned)
    return dataclasses.replace(
        chain(1), masses=points, links=links, gravity=np.array(gravity), duration=duration, samples=samples
    )


def rods(x, pairs):
    x, pairs = np.asarray(x, dtype=float), np.array(pairs)
    return Rods(pairs, np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1))


# ------------------------------------------------------------------ the discrete answers


def test_euler_kicks_first_and_moves_after():
    dt, scene = 0.01, world([[1.0, 2.0]], (), v=[[3.0, 4.0]], masses=[2.5])
    out = simulate(scene, dt=dt)
    n = np.round(scene.times / dt)
    np.testing.assert_allclose(
        out.positions[:, 0, 1], 2.0 + 4.0 * n * dt - 0.5 * G * dt**2 * n * (n + 1), atol=ROUND_OFF
    )
    np.testing.assert_allclose(out.positions[:, 0, 0], 1.0 + 3.0 * scene.times, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0, 1], 4.0 - G * n * dt, atol=ROUND_OFF)


def test_runge_kutta_makes_free_fall_exact_in_one_to_three_dimensions():
    for d in (1, 2, 3):
        v, g = np.arange(1.0, d + 1.0), -np.arange(2.0, d + 2.0)
        scene = world([[0.5] * d], (), v=[v], gravity=g)
        t = scene.times[:, None]
        np.testing.assert_allclose(
            simulate(scene, "matched", dt=0.05).positions[:, 0], 0.5 + v * t + 0.5 * g * t**2, atol=ROUND_OFF
        )


def test_runge_kutta_on_a_spring_is_the_taylor_polynomial_of_the_exponential():
    """One step of the oscillator multiplies (x, v) by exp(h A) cut after h^4."""
    compliance, mass, stretch, dt = 0.01, 2.0, 0.3, 0.02
    spring = Springs(np.array([[0, 1]]), np.ones(1), np.array([compliance]))
    scene = world(
        [[0.5, 0.0], [1.5 + stretch, 0.0]], (spring,), masses=[1.0, mass], pinned=(0,), gravity=(0.0, 0.0), samples=50
    )
    a = dt * np.array([[0.0, 1.0], [-1.0 / (compliance * mass), 0.0]])
    step = np.eye(2) + a + a @ a / 2.0 + a @ a @ a / 6.0 + a @ a @ a @ a / 24.0
    out, state = simulate(scene, "matched", dt=dt), np.array([stretch, 0.0])
    for k in range(1, 51):
        state = step @ state
        assert out.positions[k, 1, 0] - 1.5 == pytest.approx(state[0], abs=1e-11)
        assert out.velocities[k, 1, 0] == pytest.approx(state[1], abs=1e-10)


def test_default_preset_is_the_engine_s_own():
    own, ours = mujoco.MjSpec().option, adapter.Settings()
    assert own.integrator == getattr(mujoco.mjtIntegrator, adapter.INTEGRATORS[ours.integrator])
    assert own.disableflags == 0
    assert not ours.stripped


def test_what_is_switched_off_changes_no_bit():
    full, stripped = (simulate(chain(3), "matched", stripped=flag) for flag in (False, True))
    assert np.array_equal(full.positions, stripped.positions)
    assert np.array_equal(full.velocities, stripped.velocities)


# ------------------------------------------------------------------ dumbbells are point masses on massless rods


@pytest.mark.parametrize("links", [1, 2, 5])
def test_accelerations_are_those_of_point_masses(links):
    """Unequal lengths, masses and angles, in motion, against the equations in tensions, which know no inertia."""
    rng = np.random.default_rng(links)
    parameters = {
        "links": links,
        "lengths": 0.5 + rng.random(links),
        "masses": 0.1 + 3.0 * rng.random(links),
        "angles": 360.0 * rng.random(links),
    }
    still = run.build_scene("pendulum_chain", {k: np.asarray(v).tolist() for k, v in parameters.items()})
    turns = np.diff(still.masses.positions, axis=0)[:, ::-1] * np.array([-1.0, 1.0]) * rng.normal(size=(links, 1))
    v = np.vstack([np.zeros(2), np.cumsum(turns, axis=0)])
    scene = dataclasses.replace(still, masses=dataclasses.replace(still.masses, velocities=v))
    model = adapter.Model(scene, {})
    mujoco.mj_forward(model.model, model.data)
    equations = reference.form(scene)
    expected = equations.derivative(0.0, equations.initial)[links:]
    np.testing.assert_allclose(np.cumsum(model.data.qacc), expected, rtol=1e-11, atol=1e-11)


def test_a_free_tree_keeps_momenta_and_energy():
    """Five masses on a star with an arm, thrown and turning: linear, angular momentum and energy as of point masses."""
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-0.7, -0.2], [1.5, 0.5]])
    turn = 2.0 * x[:, ::-1] * np.array([-1.0, 1.0]) + np.array([1.0, 3.0])
    m = np.array([1.0, 2.0, 0.5, 3.0, 1.5])
    scene = world(x, (rods(x, [(0, 1), (2, 0), (0, 3), (1, 4)]),), v=turn, masses=m, samples=20)
    out = simulate(scene, "matched", dt=1e-3)
    momentum = m @ out.velocities
    np.testing.assert_allclose(momentum[:, 0], momentum[0, 0], rtol=1e-11)
    np.testing.assert_allclose(momentum[:, 1], momentum[0, 1] - m.sum() * G * scene.times, rtol=1e-11)
    energy = Subject(out, scene).energy
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
    centre = m @ out.positions / m.sum()
    lever, speed = out.positions - centre[:, None], out.velocities - (momentum / m.sum())[:, None]
    spin = (lever[..., 0] * speed[..., 1] - lever[..., 1] * speed[..., 0]) @ m
    np.testing.assert_allclose(spin, spin[0], rtol=1e-10)
    assert np.abs(Subject(out, scene).extensions).max() < ROUND_OFF


def test_euler_in_joint_angles_loses_momentum_at_first_order():
    scene = run.build_scene("free_pair", {})
    found = []
    for dt in (1e-3, 5e-4):
        momentum = scene.masses.masses @ simulate(scene, dt=dt).velocities
        found.append(np.abs(momentum - momentum[0]).max())
    assert 5e-3 < found[0] < 2e-2  # of 4 kg m/s, measured 1.0e-2
    assert found[0] / found[1] == pytest.approx(2.0, rel=0.02)


# ------------------------------------------------------------------ the continuous motion


def test_pendulum_keeps_the_period_of_the_elliptic_integral():
    period = 4.0 * ellipk(0.5) / np.sqrt(G)
    scene = dataclasses.replace(chain(1), duration=period, samples=4)
    expected = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
    assert np.abs(simulate(scene, "matched", dt=period / 400).positions[:, 1] - expected).max() < 1e-8
    assert np.abs(simulate(scene, "default", dt=period / 400).positions[:, 1] - expected).max() > 1e-3


@pytest.mark.parametrize("links", [1, 2, 10])
def test_rods_converge_with_order_one_by_default_and_four_matched(links):
    for order in orders(chain(links), (1e-3, 5e-4, 2.5e-4, 1.25e-4), "default"):
        assert 0.85 < order < 1.15
    for order in orders(chain(links), (1e-2, 5e-3, 2.5e-3, 1.25e-3) if links < 10 else (2e-3, 1e-3, 5e-4), "matched"):
        assert 3.7 < order < 4.5


@pytest.mark.parametrize("links", [1, 10])
def test_springs_converge_with_order_one_by_default_and_four_matched(links):
    scene = chain(links, compliance=1e-2 / links**2, duration=0.5)
    assert 0.85 < orders(scene, (5e-4, 2.5e-4, 1.25e-4), "default")[0] < 1.15
    assert min(orders(scene, (1e-3, 5e-4, 2.5e-4), "matched")) > 3.8


def test_implicit_is_euler_where_no_force_depends_on_velocity_and_first_order_elsewhere():
    one = [simulate(chain(1), integrator=name).positions for name in ("Euler", "implicit")]
    np.testing.assert_allclose(one[0], one[1], atol=1e-11)
    assert 0.85 < orders(chain(2), (1e-3, 5e-4, 2.5e-4), "default", integrator="implicit")[0] < 1.15


def test_rods_and_springs_share_a_scene():
    """A rod from a pinned particle and a spring to the next mass, against a stiff spring in place of the rod."""
    x = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    spring = Springs(np.array([[1, 2]]), np.ones(1), np.array([1e-2]))
    scene = world(x, (rods(x, [(0, 1)]), spring), pinned=(0,), duration=0.5)
    out = simulate(scene, "matched", dt=1e-3)
    stand_in = Springs(np.array([[0, 1]]), np.ones(1), np.array([1e-7]))
    exact = reference.solve(dataclasses.replace(scene, links=(stand_in, spring)), 1e-9, 1e-9)
    assert distance(out, exact)[0] < 1e-5
    energy = Subject(out, scene).energy
    np.testing.assert_allclose(energy, energy[0], atol=1e-7)


def test_energy_is_kept_matched():
    energy = Subject(simulate(chain(1, duration=10.0), "matched", dt=1e-3), chain(1, duration=10.0)).energy
    assert np.abs(energy - energy[0]).max() / G < ROUND_OFF  # measured 9e-14


def test_a_thousand_links_run():
    scene = dataclasses.replace(chain(1000), duration=0.002, samples=2)
    out = simulate(scene, "matched", dt=1e-3)
    assert distance(out, reference.solve(scene))[0] < 1e-4


# ------------------------------------------------------------------ the adapter


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_a_run_that_blows_up_is_a_status_though_the_engine_starts_anew(preset, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    scene = chain(1, compliance=1e-9)
    out = simulate(scene, preset, dt=1e-2)
    assert out.diverged
    assert list(tmp_path.iterdir()) == [], "the engine's own log file"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_empty_world_does_the_same_steps(preset):
    out = simulate(vocabulary.empty(chain(2)), preset, dt=1e-3)
    assert (out.steps, out.positions.shape, out.diverged) == (1000, (101, 0, 2), "")


def test_child_process_gives_the_same_run():
    spec = RunSpec(scene="pendulum_chain", engine="mujoco", parameters={"links": 2}, preset="matched")
    apart, here = isolation.run_apart(spec), simulate(chain(2), "matched")
    assert np.array_equal(apart.positions, here.positions)
    assert np.array_equal(apart.velocities, here.velocities)


def test_what_it_cannot_do_is_unsupported():
    square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    loop = world(square, (rods(square, [(0, 1), (1, 2), (2, 3), (3, 0)]),))
    bridge = world(square[:3], (rods(square, [(0, 1), (1, 2)]),), pinned=(0, 2))
    space = world([[0.0] * 3, [1.0, 0.0, 0.0]], (rods([[0.0] * 3, [1.0, 0.0, 0.0]], [(0, 1)]),), gravity=(0, 0, -G))
    reasons = [adapter.unsupported(scene, adapter.Settings()) for scene in (loop, bridge, space)]
    assert "loop" in reasons[0]
    assert "loop" in reasons[1]
    assert "plane" in reasons[2]
    assert "stretched" in adapter.unsupported(chain(1, stretch=1.1), adapter.Settings())
    assert "2000" in adapter.unsupported(chain(2001), adapter.Settings())


def test_bad_masses_end_before_the_engine(monkeypatch):
    monkeypatch.setattr(isolation, "_start", lambda: pytest.fail("the engine was reached"))
    spec = RunSpec(scene="pendulum_chain", engine="mujoco", parameters={"links": 2, "masses": float("nan")})
    with pytest.raises(InvalidInput, match=r"scene\.masses"):
        run.execute(spec)
