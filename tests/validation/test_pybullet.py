"""What Bullet does, calibrated on closed forms of its discrete equations and on the continuous motion."""

from __future__ import annotations

import dataclasses
import functools
import gc
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from comparisons import engine, isolation, reference, run
from comparisons import scene as vocabulary
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.scene import Rods
from pbd.errors import InvalidInput

adapter = engine.load("pybullet")
if adapter.missing():
    pytest.skip(adapter.missing(), allow_module_level=True)

G = 9.81
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)
BOTH = ("articulated", "point_to_point")


def simulate(scene, preset="matched", **changes):
    return adapter.prepare(scene, engine.make_settings("pybullet", preset, changes))()


@functools.cache
def chain(links, duration=1.0, angles=90.0, **more):
    return run.build_scene("pendulum_chain", {"links": links, "duration": duration, "angles": angles, **more})


@functools.cache
def truth(links, duration=1.0):
    return reference.solve(chain(links, duration))


def distance(one, other):
    """Largest over samples of the rms over particles; positions, then velocities."""
    return tuple(
        float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=2), axis=1)).max())
        for a, b in ((one.positions, other.positions), (one.velocities, other.velocities))
    )


def orders(scene, exact, **changes):
    """Fitted orders of the position and of the velocity error."""
    errors = [distance(simulate(scene, dt=dt, **changes), exact) for dt in STEPS]
    return tuple(np.polyfit(np.log(STEPS), np.log(column), 1)[0] for column in zip(*errors, strict=True))


def angle(out):
    """Angle of the first link from straight down [rad]."""
    return np.arctan2(out.positions[:, 1, 0], -out.positions[:, 1, 1])


def moving(scene, rate):
    """The scene, turning as a whole about its anchor at ``rate`` [rad/s]."""
    spin = rate * scene.masses.positions[:, ::-1] * np.array([-1.0, 1.0])
    return dataclasses.replace(scene, masses=dataclasses.replace(scene.masses, velocities=spin))


# ------------------------------------------------------------------ the discrete answers


@pytest.mark.parametrize("half_kick", [False, True])
def test_one_articulated_link_kicks_first_to_round_off(half_kick):
    """rate <- rate - h (g / L) sin(theta), then theta <- theta + h rate; a half kick takes h/2 from the start's."""
    dt, steps = 1e-2, 100
    theta = np.pi / 2.0
    rate = 0.5 * dt * G * np.sin(theta) if half_kick else 0.0
    thetas, rates = [theta], []
    for _ in range(steps + 1):
        rate -= dt * G * np.sin(theta)
        theta += dt * rate
        thetas.append(theta)
        rates.append(rate)
    out = simulate(chain(1), dt=dt, half_kick=half_kick)
    np.testing.assert_allclose(angle(out), thetas[: steps + 1], atol=1e-12)
    shown = 0.5 * (np.array(rates[:-1]) + rates[1:]) if half_kick else np.array(rates[:-1])
    speed = np.sum(out.velocities[1:, 1] * np.column_stack([np.cos(angle(out)), np.sin(angle(out))])[1:], axis=1)
    np.testing.assert_allclose(speed, shown, atol=1e-11)


@pytest.mark.parametrize("formulation", BOTH)
def test_first_step_already_falls(formulation):
    """From horizontal, a step h turns the link by g h^2 / L: a fresh body's inertia must be in force at once."""
    scene = dataclasses.replace(chain(1), duration=0.01, samples=1)
    out = simulate(scene, dt=0.01, half_kick=False, formulation=formulation)
    assert np.pi / 2.0 - angle(out)[1] == pytest.approx(G * 0.01**2, rel=1e-6)


@pytest.mark.parametrize("formulation", BOTH)
def test_free_spin_keeps_its_rate(formulation):
    """Without gravity a link turns uniformly; the ball joint lags by its linearised length, O(h^2)."""
    out = simulate(moving(chain(1, gravity=0.0), 3.0), formulation=formulation, dt=1e-3)
    expected = np.array(chain(1).times) * 3.0
    turned = np.unwrap(angle(out)) - np.pi / 2.0
    np.testing.assert_allclose(turned, expected, atol=1e-12 if formulation == "articulated" else 2e-5)


# ------------------------------------------------------------------ the continuous motion


@pytest.mark.parametrize("formulation", BOTH)
def test_pendulum_keeps_the_period_of_the_elliptic_integral(formulation):
    period = 4.0 * ellipk(0.5) / np.sqrt(G)
    scene = dataclasses.replace(chain(1), duration=period, samples=4)
    expected = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
    out = simulate(scene, formulation=formulation, dt=period / 4000)
    assert np.abs(out.positions[:, 1] - expected).max() < 2e-5


@pytest.mark.parametrize("links", [1, 2, 10])
def test_matched_is_of_second_order(links):
    position, velocity = orders(chain(links), truth(links))
    assert 1.85 < position < 2.15  # measured 2.00, 2.00, 2.03
    assert 1.85 < velocity < 2.15


@pytest.mark.parametrize("links", [1, 2, 10])
def test_ball_joints_are_of_second_order(links):
    order = orders(chain(links), truth(links), formulation="point_to_point")[0]
    assert 1.85 < order < 2.15  # measured 2.00, 2.00, 2.03


@pytest.mark.parametrize(("links", "half_kick"), [(1, False), (2, False), (2, True), (10, True)])
def test_articulated_chains_are_of_first_order(links, half_kick):
    """Undamped; the half kick helps one link only, see the module's head."""
    order = orders(chain(links), truth(links), formulation="articulated", half_kick=half_kick)[0]
    assert 0.85 < order < 1.15  # measured 1.00, 1.00, 1.00, 1.04


@pytest.mark.parametrize("formulation", BOTH)
def test_dumbbell_rods_are_point_masses_on_massless_rods(formulation):
    """Unequal masses, lengths and angles, and a start that turns: any slip in m, c or I shows at order 0."""
    parameters = {"lengths": (0.3, 0.5, 0.2), "masses": (1.0, 3.0, 0.5), "angles": (90.0, 40.0, -20.0)}
    scene = moving(run.build_scene("pendulum_chain", {"links": 3, "duration": 0.5, "samples": 50, **parameters}), 2.0)
    exact = reference.solve(scene)
    errors = [distance(simulate(scene, formulation=formulation, dt=dt), exact)[0] for dt in (1e-3, 2.5e-4)]
    expected, largest = (1.0, 5e-4) if formulation == "articulated" else (2.0, 2e-6)
    assert np.log(errors[0] / errors[1]) / np.log(4.0) == pytest.approx(expected, abs=0.15)  # measured 0.99, 2.00
    assert errors[1] < largest  # measured 3.5e-4, 1.0e-6


def test_energy_is_kept_matched():
    scene = chain(1, duration=10.0)
    for formulation in BOTH:
        energy = Subject(simulate(scene, formulation=formulation, dt=1e-3), scene).energy
        assert np.abs(energy - energy[0]).max() < 2e-5 * G  # measured 2.0e-6 and 1.4e-5 of m g L


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_a_hundred_links_run(preset):
    out = simulate(chain(100, duration=0.2, samples=20), preset, dt=1e-3)
    exact = reference.solve(chain(100, duration=0.2, samples=20))
    assert not out.diverged
    assert distance(out, exact)[0] < 1e-3  # measured 5.0e-4 and 8.3e-4


# ------------------------------------------------------------------ what the defaults hide


def damped(degrees, law):
    """Angles of a pendulum of 1 m under a deceleration law(v) of its end, every 0.1 s for 10 s."""
    times = np.linspace(0.0, 10.0, 101)
    rhs = lambda _, y: [y[1], -G * np.sin(y[0]) - law(y[1])]  # noqa: E731
    return solve_ivp(rhs, (0.0, 10.0), [np.deg2rad(degrees), 0.0], rtol=1e-10, atol=1e-12, t_eval=times).y[0]


def test_default_damping_takes_a_third_of_a_small_swing_s_energy_in_ten_seconds():
    scene = chain(1, duration=10.0, angles=0.5, samples=1000)
    energy = Subject(simulate(scene, "default", dt=1e-3), scene).energy + G
    assert energy[-1] / energy[0] == pytest.approx(np.exp(-0.04 * 10.0), rel=0.02)  # measured 0.664, predicted 0.670


@pytest.mark.parametrize("degrees", [0.5, 60.0, 90.0])
def test_damping_laws_of_both_formulations(degrees):
    scene = chain(1, duration=10.0, angles=degrees)
    size = np.deg2rad(degrees)
    out = simulate(scene, formulation="articulated", damping=0.04, dt=1e-3)
    assert np.abs(angle(out) - damped(degrees, lambda v: 0.04 * v * (1.0 + abs(v)))).max() < 2e-3 * size
    out = simulate(scene, formulation="point_to_point", damping=0.04, dt=1e-3)
    assert np.abs(angle(out) - damped(degrees, lambda v: -np.log(1.0 - 0.04) * v)).max() < 2e-3 * size


def test_default_does_not_converge_for_its_damping():
    errors = [distance(simulate(chain(10), "default", dt=dt), truth(10))[0] for dt in STEPS]
    assert min(errors) > 0.05  # measured 6.5e-2 rising to 8.7e-2
    assert errors[-1] > 0.9 * errors[-2]


def test_default_clamps_joint_rates_at_100():
    fast = moving(chain(1, gravity=0.0, lengths=0.01, duration=0.1, samples=10), 250.0)
    for preset, rate in (("default", 100.0), ("matched", 250.0)):
        out = simulate(fast, preset, damping=0.0, half_kick=False, dt=1e-4)
        assert np.linalg.norm(out.velocities[-1, 1]) / 0.01 == pytest.approx(rate, rel=1e-6)


# ------------------------------------------------------------------ the adapter


def test_articulated_limit_is_where_pybullet_drops_links_silently():
    bullet = adapter.load()
    client, n = bullet.connect(bullet.DIRECT), adapter.MAX_ARTICULATED_LINKS + 1
    try:
        body = bullet.createMultiBody(
            linkMasses=[1.0] * n,
            linkCollisionShapeIndices=[-1] * n,
            linkVisualShapeIndices=[-1] * n,
            linkPositions=[(0.0, -1.0, 0.0)] * n,
            linkOrientations=[(0.0, 0.0, 0.0, 1.0)] * n,
            linkInertialFramePositions=[(0.0, 0.0, 0.0)] * n,
            linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)] * n,
            linkParentIndices=list(range(n)),
            linkJointTypes=[bullet.JOINT_REVOLUTE] * n,
            linkJointAxis=[(0.0, 0.0, 1.0)] * n,
            physicsClientId=client,
        )
        assert bullet.getNumJoints(body, physicsClientId=client) == adapter.MAX_ARTICULATED_LINKS
    finally:
        bullet.disconnect(client)
    assert "127" in adapter.unsupported(chain(n), adapter.Settings())
    assert adapter.unsupported(chain(n - 1), adapter.Settings()) == ""
    assert adapter.unsupported(chain(n), engine.make_settings("pybullet", "matched", {})) == ""


def test_what_is_no_rigid_serial_chain_is_unsupported():
    scene, settings = chain(2), adapter.Settings()
    tree = dataclasses.replace(scene, links=(Rods(np.array([[0, 1], [0, 2]]), np.array([0.5, 1.0])),))
    free = dataclasses.replace(scene, masses=dataclasses.replace(scene.masses, pinned=()))
    reasons = {
        "compliant": run.build_scene("pendulum_chain", {"compliance": 1e-3}),
        "stretched": run.build_scene("pendulum_chain", {"stretch": 1.1}),
        "planar": dataclasses.replace(scene, gravity=np.zeros(3)),
        "serial": tree,
        "anchored": free,
    }
    assert adapter.unsupported(scene, settings) == ""
    for word, other in reasons.items():
        assert word in adapter.unsupported(other, settings)


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_empty_world_does_the_same_steps(preset):
    out = simulate(vocabulary.empty(chain(2)), preset, dt=1e-3)
    assert (out.steps, out.positions.shape, out.diverged) == (1000, (101, 0, 2), "")


def test_a_run_closes_its_client():
    bullet = adapter.load()
    runs = [adapter.prepare(chain(1), adapter.Settings()) for _ in range(2)]
    clients = [i for i in range(20) if bullet.isConnected(i)]
    assert len(clients) >= 2
    runs[0]()
    runs.clear()
    gc.collect()
    assert not any(bullet.isConnected(i) for i in clients)


def test_child_process_gives_the_same_run():
    spec = RunSpec(scene="pendulum_chain", engine="pybullet", parameters={"links": 2}, preset="matched")
    apart, here = isolation.run_apart(spec), simulate(chain(2))
    assert np.array_equal(apart.positions, here.positions)
    assert np.array_equal(apart.velocities, here.velocities)


def test_execute_measures_a_run_in_silence(capfd):
    record = run.execute(RunSpec(scene="pendulum_chain", engine="pybullet", preset="matched"))
    assert record.status.code == "ok"
    assert record.metric("position_error") < 2e-6  # measured 1.0e-6
    assert record.version == adapter.version()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("check", [adapter.unsupported, adapter.prepare])
def test_bad_masses_end_before_the_engine(check, monkeypatch):
    """Bullet would take nan or -1 for a static body, silently."""
    scene = chain(2)
    monkeypatch.setitem(sys.modules, "pybullet", None)  # an import would raise ImportError
    for bad in (np.nan, -1.0, np.inf):
        masses = dataclasses.replace(scene.masses, masses=np.array([1.0, bad, 1.0]))
        with pytest.raises(InvalidInput, match=r"scene\.masses\.masses.*number 1"):
            check(dataclasses.replace(scene, masses=masses), adapter.Settings())
