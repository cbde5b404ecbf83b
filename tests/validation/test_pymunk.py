"""What Chipmunk does, calibrated on closed forms of its discrete equations and on the continuous motion."""

from __future__ import annotations

import dataclasses
import functools
import sys

import numpy as np
import pytest
from scipy.special import ellipk

from comparisons import engine, isolation, reference, run
from comparisons import scene as vocabulary
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.scene import PointMasses, Rods, Springs
from pbd.errors import InvalidInput

pymunk = pytest.importorskip("pymunk")
adapter = engine.load("pymunk")

G = 9.81
ROUND_OFF = 1e-12


def simulate(scene, preset="default", **changes):
    return adapter.prepare(scene, engine.make_settings("pymunk", preset, changes))()


@functools.cache
def chain(links, duration=1.0, compliance=0.0, angles=90.0):
    parameters = {"links": links, "duration": duration, "compliance": compliance, "angles": angles}
    return run.build_scene("pendulum_chain", parameters)


@functools.cache
def truth(links, duration=1.0, compliance=0.0, angles=90.0):
    return reference.solve(chain(links, duration, compliance, angles))


def distance(one, other):
    """Largest over samples of the rms over particles; positions, then velocities."""
    return tuple(
        float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=2), axis=1)).max())
        for a, b in ((one.positions, other.positions), (one.velocities, other.velocities))
    )


def orders(scene, exact, steps, preset, **changes):
    """Fitted orders of the position and of the velocity error."""
    errors = [distance(simulate(scene, preset, dt=dt, **changes), exact) for dt in steps]
    return tuple(np.polyfit(np.log(steps), np.log(column), 1)[0] for column in zip(*errors, strict=True))


def world(masses, links, gravity, duration, samples):
    return dataclasses.replace(
        chain(1), masses=masses, links=links, gravity=np.array(gravity), duration=duration, samples=samples
    )


def free_mass(velocity=(3.0, 4.0), samples=10):
    masses = PointMasses(np.array([[1.0, 2.0]]), np.array([velocity]), np.array([2.5]))
    return world(masses, (), [0.0, -G], 1.0, samples)


def oscillator(compliance=0.01, mass=2.0, stretch=0.3):
    """A mass on a spring along x, without gravity, stretched and at rest."""
    masses = PointMasses(np.array([[0.5, 0.0], [1.5 + stretch, 0.0]]), np.zeros((2, 2)), np.array([1.0, mass]), (0,))
    spring = Springs(np.array([[0, 1]]), np.ones(1), np.array([compliance]))
    return world(masses, (spring,), [0.0, 0.0], 1.0, 20)


STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)


# ------------------------------------------------------------------ the discrete answers


def test_free_fall_moves_first_and_kicks_after():
    dt, scene = 0.01, free_mass()
    out = simulate(scene, dt=dt)
    n = np.round(scene.times / dt)
    fallen = 2.0 + 4.0 * n * dt - 0.5 * G * dt**2 * n * (n - 1.0)
    np.testing.assert_allclose(out.positions[:, 0, 1], fallen, atol=ROUND_OFF)
    np.testing.assert_allclose(out.positions[:, 0, 0], 1.0 + 3.0 * scene.times, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0, 1], 4.0 - G * n * dt, atol=ROUND_OFF)


def test_half_kick_makes_free_fall_exact():
    scene = free_mass()
    out = simulate(scene, dt=0.01, half_kick=True)
    t = scene.times
    np.testing.assert_allclose(out.positions[:, 0, 1], 2.0 + 4.0 * t - 0.5 * G * t**2, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0, 1], 4.0 - G * t, atol=ROUND_OFF)


@pytest.mark.parametrize("half_kick", [False, True])
def test_spring_is_symplectic_euler_or_leapfrog_to_round_off(half_kick):
    dt, stretch, scene = 0.01, 0.3, oscillator()
    omega = np.sqrt(1.0 / (0.01 * 2.0))
    phase = 2.0 * np.arcsin(0.5 * dt * omega)
    n = np.round(scene.times / dt)
    if half_kick:
        x = stretch * np.cos(n * phase)
        v = -stretch * np.sin(phase) * np.sin(n * phase) / dt
    else:
        x = stretch * np.cos((n - 0.5) * phase) / np.cos(0.5 * phase)
        v = -2.0 * stretch * np.tan(0.5 * phase) * np.sin(n * phase) / dt
    out = simulate(scene, dt=dt, half_kick=half_kick)
    np.testing.assert_allclose(out.positions[:, 1, 0] - 1.5, x, atol=1e-11)
    np.testing.assert_allclose(out.velocities[:, 1, 0], v, atol=1e-10)


def test_undamped_spring_keeps_its_amplitude():
    """DampedSpring at damping 0 damps nothing: the closed form cos(omega t) at second order, over 14 periods."""
    scene = dataclasses.replace(oscillator(), duration=12.5, samples=50)
    omega = np.sqrt(1.0 / (0.01 * 2.0))
    exact = 1.5 + 0.3 * np.cos(omega * scene.times)
    steps = (1e-2, 5e-3, 2.5e-3, 1.25e-3)
    errors = [np.abs(simulate(scene, "matched", dt=dt).positions[:, 1, 0] - exact).max() for dt in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 1.9 < order < 2.1  # measured 2.00
    assert errors[-1] < 2e-4 * 0.3 * omega  # a phase that runs ahead by omega^3 h^2 t / 24


def test_default_preset_is_the_engine_s_own():
    rod = pymunk.PinJoint(pymunk.Body(1.0, 1.0), pymunk.Body(1.0, 1.0), (0.0, 0.0), (1.0, 0.0))
    settings, space = adapter.Settings(), pymunk.Space()
    assert (settings.error_bias, settings.iterations) == (rod.error_bias, space.iterations)
    assert (space.damping, rod.max_bias) == (1.0, np.inf)
    assert not settings.half_kick


# ------------------------------------------------------------------ the continuous motion


def test_pendulum_keeps_the_period_of_the_elliptic_integral():
    period = 4.0 * ellipk(0.5) / np.sqrt(G)
    scene = dataclasses.replace(chain(1), duration=period, samples=4)
    expected = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
    matched = np.abs(simulate(scene, "matched", dt=period / 4000).positions[:, 1] - expected).max()
    default = np.abs(simulate(scene, "default", dt=period / 4000).positions[:, 1] - expected).max()
    assert matched < 2e-5  # measured 1.2e-5, and 2.9e-3 by default
    assert 1e-3 < default < 1e-2


@pytest.mark.parametrize("links", [1, 2, 10])
def test_rods_converge_with_order_one_by_default_and_two_matched(links):
    scene, exact = chain(links), truth(links)
    position, velocity = orders(scene, exact, STEPS, "default")
    assert 0.85 < position < 1.15  # measured 1.00, 1.00, 0.95
    assert 0.85 < velocity < 1.15
    position, velocity = orders(scene, exact, STEPS, "matched")
    assert 1.85 < position < 2.15  # measured 2.00 for each
    assert 1.85 < velocity < 2.15


@pytest.mark.parametrize("links", [1, 10])
def test_springs_converge_with_order_one_by_default_and_two_matched(links):
    scene, exact = chain(links, compliance=1e-2 / links), truth(links, compliance=1e-2 / links)
    assert 0.85 < orders(scene, exact, STEPS, "default")[0] < 1.15
    assert min(orders(scene, exact, STEPS, "matched")) > 1.85


def test_half_kick_holds_for_a_moving_start():
    """Two rods that spin as one: a start whose velocities are not zero, and whose rods pull."""
    still = chain(2)
    spin = 4.0 * still.masses.positions[:, ::-1] * np.array([-1.0, 1.0])
    scene = dataclasses.replace(
        still, masses=dataclasses.replace(still.masses, velocities=spin), duration=0.5, samples=50
    )
    exact = reference.solve(scene)
    position, velocity = orders(scene, exact, STEPS, "matched")
    assert 1.85 < position < 2.15
    assert 1.85 < velocity < 2.15
    assert 0.85 < orders(scene, exact, STEPS, "matched", half_kick=False)[0] < 1.15


def test_half_kick_corrects_a_stretched_rod_once():
    """A link 10 % too long, without gravity: the leading half step leaves it, the first whole one mends it."""
    scene = run.build_scene("pendulum_chain", {"stretch": 1.1, "gravity": 0.0, "samples": 4, "duration": 0.4})
    out = simulate(scene, "matched", dt=0.1)
    np.testing.assert_allclose(out.positions[:, 1, 0], [1.1, 1.1, 1.0, 1.0, 1.0], atol=ROUND_OFF)


def test_particles_keep_the_scene_s_order_around_a_pinned_one():
    """Unequal masses and springs, two pinned particles in between, one link between the pinned."""
    x = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5], [3.0, 0.0]])
    masses = PointMasses(x, np.zeros_like(x), np.array([1.0, 5.0, 3.0, 2.0]), (1, 3))
    links = Springs(np.array([[0, 1], [1, 2], [2, 3], [1, 3]]), np.array([0.8, 1.0, 1.2, 1.0]), np.full(4, 0.01))
    scene = world(masses, (links,), [0.0, -G], 0.5, 10)
    out = simulate(scene, "matched", dt=5e-4)
    assert distance(out, reference.solve(scene))[0] < 2e-5
    assert np.all(out.positions[:, [1, 3]] == x[[1, 3]])


def test_energy_is_kept_matched_and_raised_by_default():
    scene = chain(1, duration=10.0)
    drift = {}
    for preset in ("default", "matched"):
        energy = Subject(simulate(scene, preset, dt=1e-3), scene).energy
        drift[preset] = np.abs(energy - energy[0]).max() / G
    assert drift["matched"] < 3e-5  # measured 1.9e-5
    assert drift["default"] > 1e-2  # measured 1.6e-2


def test_full_correction_needs_the_iterations_that_the_setting_none_asks_for():
    """Under-converged, a full correction pumps energy; None then takes the engine's own."""
    scene = chain(10)
    pumped = Subject(simulate(scene, "matched", dt=5e-4, iterations=10, error_bias=0.0), scene).energy
    assert (pumped - pumped[0]).max() > G
    error = {n: distance(simulate(scene, "matched", dt=5e-4, iterations=n), truth(10))[0] for n in (49, 50)}
    assert error[50] < 3e-5  # full correction, measured 1.8e-5
    assert 1e-3 < error[49] < 1e-2  # the engine's own, measured 4.5e-3


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_a_hundred_links_run(preset):
    """First order in both presets; the error is that of the under-converged solver."""
    out = simulate(chain(100), preset, dt=1e-3)
    assert not out.diverged
    assert distance(out, truth(100))[0] < 0.05  # measured 2.6e-2 and 1.9e-2


# ------------------------------------------------------------------ the adapter


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_empty_world_does_the_same_steps(preset):
    out = simulate(vocabulary.empty(chain(2)), preset, dt=1e-3)
    assert (out.steps, out.positions.shape, out.diverged) == (1000, (101, 0, 2), "")


def test_child_process_gives_the_same_run():
    spec = RunSpec(scene="pendulum_chain", engine="pymunk", parameters={"links": 2}, preset="matched")
    apart, here = isolation.run_apart(spec), simulate(chain(2), "matched")
    assert np.array_equal(apart.positions, here.positions)
    assert np.array_equal(apart.velocities, here.velocities)


def test_too_stiff_a_spring_is_a_status():
    record = run.execute(RunSpec(scene="pendulum_chain", engine="pymunk", parameters={"compliance": 1e-9}))
    assert record.status.code == "diverged"
    assert not record.metrics


def test_other_links_and_three_dimensions_are_unsupported():
    scene = chain(2)
    solid = dataclasses.replace(scene, gravity=np.zeros(3))
    strange = dataclasses.replace(
        scene, links=(dataclasses.make_dataclass("Ropes", [("lengths", object)])(np.ones(1)),)
    )
    assert "planar" in adapter.unsupported(solid, adapter.Settings())
    assert "neither rods nor springs" in adapter.unsupported(strange, adapter.Settings())
    assert adapter.unsupported(scene, adapter.Settings()) == ""


@pytest.mark.parametrize("masses", [float("nan"), -1.0, 0.0, float("inf"), [1.0, -1.0]])
def test_bad_masses_end_before_the_engine(masses, monkeypatch):
    """Chipmunk would end the process; nothing may be started for them."""
    monkeypatch.setattr(isolation, "_start", lambda: pytest.fail("the engine was reached"))
    spec = RunSpec(scene="pendulum_chain", engine="pymunk", parameters={"links": 2, "masses": masses})
    with pytest.raises(InvalidInput, match=r"scene\.masses"):
        run.execute(spec)


BAD = {
    "scene.masses.masses": ("masses", "masses", -1.0),
    "scene.masses.positions": ("masses", "positions", np.nan),
    "scene.masses.velocities": ("masses", "velocities", np.inf),
    "scene.links.lengths": ("rods", "lengths", 0.0),
    "scene.links.compliances": ("springs", "compliances", -1.0),
    "scene.gravity": ("scene", "gravity", np.nan),
}


@pytest.mark.parametrize("field", BAD)
@pytest.mark.parametrize("check", [adapter.unsupported, adapter.prepare])
def test_a_bad_number_in_any_array_ends_before_the_engine(field, check, monkeypatch):
    part, name, value = BAD[field]
    masses = PointMasses(np.eye(2), np.zeros((2, 2)), np.ones(2), (0,))
    rods, springs = Rods(np.array([[0, 1]]), np.ones(1)), Springs(np.array([[0, 1]]), np.ones(1), np.ones(1))
    scene = world(masses, (rods, springs), [0.0, 0.0], 1.0, 10)
    getattr({"masses": masses, "rods": rods, "springs": springs, "scene": scene}[part], name).flat[-1] = value
    monkeypatch.setitem(sys.modules, "pymunk", None)  # an import would raise ImportError
    with pytest.raises(InvalidInput) as error:
        check(scene, adapter.Settings())
    assert error.value.field == field


@pytest.mark.parametrize("changes", [{"iterations": 0}, {"error_bias": -0.1}, {"dt": float("nan")}])
def test_settings_that_would_end_the_process_are_refused(changes):
    with pytest.raises(InvalidInput, match=r"pymunk\."):
        engine.make_settings("pymunk", "default", changes)
