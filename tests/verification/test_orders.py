"""Orders and floors as the studies measure them, and the discrete answers of the integrators to round-off."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

import comparisons
from comparisons import engine, store
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.run import build_scene, execute

G = 9.81
DURATION, SAMPLES, LEVELS = 0.5, 50, 5
FIRST = {1: 0, 10: 3}
"""Halvings of the sample interval from which a chain of so many links is asymptotic."""

COMPLIANCE = {1: 1e-2, 10: 1e-4}
SPREAD = 0.15


@functools.cache
def convergence(name, links, compliant):
    interval = DURATION / SAMPLES
    return comparisons.convergence(
        "pendulum_chain",
        scene={
            "links": links,
            "compliance": COMPLIANCE[links] if compliant else 0.0,
            "duration": DURATION,
            "samples": SAMPLES,
        },
        engines=[name],
        dt=[interval / 2**k for k in range(FIRST[links], FIRST[links] + LEVELS)],
        substeps=None,
        iterations=None,
        quiet=True,
    )


def assert_order(fit, declared):
    assert fit.order == pytest.approx(declared, abs=SPREAD)
    assert len(fit.xs) >= 4
    assert fit.low <= fit.order <= fit.high
    assert fit.floor is None


@pytest.mark.parametrize("compliant", [False, True])
@pytest.mark.parametrize("links", [1, 10])
@pytest.mark.parametrize("method", ["pbd", "xpbd", "small_steps"])
def test_pbd_and_xpbd_are_of_first_order(method, links, compliant):
    study = convergence("pbd", links, compliant)
    assert_order(study.fit("pbd", method=method), 1.0)
    assert {r.status.code for r in study.records} == {"ok"}


@pytest.mark.parametrize("links", [1, 10])
@pytest.mark.parametrize(("preset", "order"), [("default", 1.0), ("matched", 2.0)])
def test_symplectic_euler_is_of_first_order_and_of_second_with_a_half_kick(preset, order, links):
    assert_order(convergence("symplectic_euler", links, True).fit("symplectic_euler", preset=preset), order)


@pytest.mark.parametrize("links", [1, 10])
def test_xpbd_and_symplectic_euler_converge_to_the_same_elastic_motion(links):
    for name, which in (("pbd", "xpbd"), ("symplectic_euler", "symplectic_euler")):
        (series,) = [s for s in convergence(name, links, True).series if s.method == which and s.preset == "default"]
        assert all(fine < 0.7 * coarse for coarse, fine in zip(series.y[:-1], series.y[1:]))
        assert series.y[-1] < 2e-3


def test_sub_steps_are_steps():
    """Halving dt and doubling sub-steps are the same thing for an error at the samples."""
    one, other = (
        position_error("pbd", method="small_steps", dt=dt, substeps=substeps)
        for dt, substeps in ((0.01, 8), (0.00125, 1))
    )
    assert one == pytest.approx(other, rel=1e-9)


def test_sub_steps_are_steps_for_k_from_the_compliance():
    """k depends on the time step, which is that of a sub-step."""
    one, other = (
        position_error("pbd", {"compliance": 1e-2}, dt=dt, substeps=substeps)
        for dt, substeps in ((0.01, 8), (0.00125, 1))
    )
    assert one == pytest.approx(other, rel=1e-9)


def position_error(name, parameters=None, preset="default", **settings):
    parameters = {"duration": DURATION, "samples": SAMPLES, **(parameters or {})}
    spec = RunSpec(scene="pendulum_chain", engine=name, parameters=parameters, preset=preset, settings=settings)
    record = execute(spec)
    assert record.status.code == "ok", record.status
    return record.metric("position_error")


@pytest.mark.parametrize("links", [1, 2])
def test_the_floor_of_springs_for_rods_falls_with_their_stiffness(links):
    """A stiff spring is off by about m g / stiffness, however small the step."""
    floors = []
    for stiffness in (1e4, 1e5, 1e6):
        coarse, fine = (
            position_error("symplectic_euler", {"links": links}, "matched", dt=dt, stiffness=stiffness)
            for dt in (1e-4, 5e-5)
        )
        assert fine == pytest.approx(coarse, rel=0.02), "a floor"
        floors.append(fine)
    assert floors[0] == pytest.approx(10.0 * floors[1], rel=0.15)
    assert floors[1] == pytest.approx(10.0 * floors[2], rel=0.15)
    assert floors[0] > G / 1e4


# ------------------------------------------------------------------ discrete answers


def trajectory(name, scene, preset="default", **settings):
    return engine.load(name).prepare(scene, engine.make_settings(name, preset, settings))()


@pytest.mark.parametrize(("preset", "shift"), [("default", 0.5), ("matched", 0.0)])
@pytest.mark.parametrize("wh", [0.1, 1.0, 1.9])
def test_symplectic_euler_of_a_spring_is_a_cosine_to_round_off(wh, preset, shift):
    """x_n = A cos((n + s) phi) / cos(s phi) about its rest, 2 cos(phi) = 2 - (w h)^2; s = 1/2, or 0 for leapfrog."""
    m, alpha, h, steps = 2.0, 1e-3, 0.01, 200
    alpha = (h / wh) ** 2 / m
    scene = build_scene(
        "pendulum_chain",
        {"angles": 0.0, "masses": m, "compliance": alpha, "duration": h * steps, "samples": steps},
    )
    rest = -(1.0 + m * G * alpha)
    phi = math.acos(1.0 - 0.5 * wh**2)
    n = np.arange(steps + 1)
    exact = rest + m * G * alpha * np.cos((n + shift) * phi) / math.cos(shift * phi)
    found = trajectory("symplectic_euler", scene, preset, dt=h)
    x, v = found.positions[:, 1, 1], found.velocities[:, 1, 1]
    tolerance = 1e-11 * (1.0 + m * G * alpha) / math.cos(shift * phi)
    assert np.abs(x - exact).max() < tolerance
    # velocities at the time of the positions: centred with the half kick, else of the step that led there
    slope = (x[2:] - x[:-2]) / (2.0 * h) if preset == "matched" else (x[1:-1] - x[:-2]) / h
    assert np.abs(v[1:-1] - slope).max() < tolerance / h


def test_a_damped_spring_for_a_rod_follows_its_recurrence_to_round_off():
    """v <- v + h (g - w^2 y - 2 zeta w v), y <- y + h v, y below the rest length."""
    h, stiffness, zeta, steps = 1e-3, 1e4, 0.3, 100
    scene = build_scene("pendulum_chain", {"angles": 0.0, "duration": h * steps, "samples": steps})
    found = trajectory("symplectic_euler", scene, dt=h, stiffness=stiffness, damping_ratio=zeta)
    y, v, w = 0.0, 0.0, math.sqrt(stiffness)
    for n in range(1, steps + 1):
        v += h * (G - w**2 * y - 2.0 * zeta * w * v)
        y += h * v
        assert found.positions[n, 1, 1] == pytest.approx(-1.0 - y, abs=1e-12)
        assert found.velocities[n, 1, 1] == pytest.approx(-v, abs=1e-10)


@pytest.mark.parametrize("links", [1, 10])
def test_rigid_xpbd_is_pbd_at_one_iteration(links):
    scene = build_scene("pendulum_chain", {"links": links, "duration": 0.2, "samples": 20})
    one, other = (trajectory("pbd", scene, method=method, dt=1e-3).positions for method in ("pbd", "xpbd"))
    assert np.abs(one - one[0]).max() > 0.1, "it moved"
    assert np.abs(one - other).max() < 1e-12


def test_a_compliant_link_of_pbd_takes_its_k_from_the_compliance():
    """At one iteration k = 1 / (1 + alpha / (w h^2)) makes PBD's projection that of XPBD."""
    scene = build_scene("pendulum_chain", {"links": 5, "compliance": 1e-4, "duration": 0.2, "samples": 20})
    one, other = (trajectory("pbd", scene, method=method, dt=1e-3).positions for method in ("pbd", "xpbd"))
    assert np.abs(one - other).max() < 1e-12


def test_work_is_counted():
    scene = build_scene("pendulum_chain", {"links": 7, "duration": 0.1, "samples": 10})
    assert trajectory("pbd", scene, method="xpbd", iterations=3, substeps=2, dt=0.005).work == {
        "projections": 7 * 3 * 2 * 20
    }
    assert trajectory("symplectic_euler", scene, dt=0.001).work == {"spring forces": 7 * 100}


# ------------------------------------------------------------------ what k does


@functools.cache
def stiffness(k):
    counts = (1, 5, 100)
    study = comparisons.stiffness("pendulum_chain", k=k, iterations=counts, quiet=True)
    assert {r.status.code for r in study.records} == {"ok"}
    return {(s.panel, s.label): dict(zip(s.x, s.y, strict=True)) for s in study.series if s.engine}


@pytest.mark.parametrize("k", [0.4, 0.5])
def test_one_link_keeps_1_minus_k_with_k_prime_and_its_power_with_raw_k(k):
    corrected, raw = (stiffness(k)["link", label] for label in ("PBD, k'", "PBD, raw k"))
    assert corrected == pytest.approx({1.0: 1.0 - k, 5.0: 1.0 - k, 100.0: 1.0 - k}, rel=1e-12)
    assert raw[1.0] == pytest.approx(1.0 - k, rel=1e-12)
    assert raw[5.0] == pytest.approx((1.0 - k) ** 5, rel=1e-12)


def test_k_prime_of_a_chain_depends_on_the_iterations():
    """The largest residual over the initial one of a chain of 10, stretched by 10 % and pinned at one end."""
    found = stiffness(0.5)["chain", "PBD, k'"]
    assert found == pytest.approx({1.0: 1.09375, 5.0: 1.1617, 100.0: 1.1827}, abs=5e-5)
    assert found == pytest.approx({n: swept(1.0 - 0.5 ** (1.0 / n), int(n)) for n in found}, rel=1e-10)


def test_raw_k_of_a_chain_fades_with_the_iterations():
    found = stiffness(0.5)["chain", "PBD, raw k"]
    assert found == pytest.approx({n: swept(0.5, int(n)) for n in found}, rel=1e-8)
    assert found[1.0] == pytest.approx(1.09375)
    assert found[100.0] < 0.6


def swept(k, iterations, links=10):
    """Gauss-Seidel on the errors of a straight chain of equal masses, of which the first end is pinned."""
    w = [0.0] + [1.0] * links
    c = [1.0] * links
    for _ in range(iterations):
        for i in range(links):
            pull = k * c[i] / (w[i] + w[i + 1])
            for neighbour, weight in ((i - 1, w[i]), (i, -w[i] - w[i + 1]), (i + 1, w[i + 1])):
                if 0 <= neighbour < links:
                    c[neighbour] += weight * pull
    return max(map(abs, c))


@pytest.mark.parametrize("k", [0.4, 0.5])
@pytest.mark.parametrize(("panel", "dt"), [("mass", 1.0 / 60.0), ("mass, dt/2", 1.0 / 120.0)])
def test_a_hung_mass_stretches_by_its_closed_form(panel, dt, k):
    lines, fall = stiffness(k), G * dt**2
    assert lines[panel, "PBD, k'"] == pytest.approx(dict.fromkeys((1.0, 5.0, 100.0), fall * (1.0 - k) / k), rel=1e-6)
    raw = {n: fall * (1.0 - k) ** n / (1.0 - (1.0 - k) ** n) for n in (1.0, 5.0)}
    assert {n: lines[panel, "PBD, raw k"][n] for n in raw} == pytest.approx(raw, rel=1e-6)
    weight = G * (1.0 / 60.0) ** 2 * (1.0 - k) / k
    for label in ("XPBD compliance", "symplectic Euler spring"):
        assert list(lines[panel, label].values()) == pytest.approx([weight] * len(lines[panel, label]), rel=1e-6)
        assert lines[panel, label]


# ------------------------------------------------------------------ the metrics behind all this


def test_position_error_is_the_largest_over_time_of_the_rms_over_what_is_free():
    scene = build_scene("pendulum_chain", {"links": 2, "duration": 0.1, "samples": 4})
    exact, _ = store.reference(scene)
    shifted = exact.copy()
    shifted[2, 1] += [3e-3, 4e-3]
    shifted[3, 2] += [1e-3, 0.0]
    shifted[:, 0] += 7.0  # the anchor is pinned and does not count
    found = trajectory("dop853", scene)
    subject = Subject(found.__class__(scene.times, shifted, found.velocities, 1), scene)
    measure = comparisons.catalog.load("metrics", "position_error").measure
    assert measure(subject) == pytest.approx(5e-3 / math.sqrt(2.0), rel=1e-12)
