"""The references against closed forms, another formulation and conservation; and how long they mean anything."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from comparisons import reference, store
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.run import build_scene, execute

pytestmark = pytest.mark.slow

G = 9.81


def chain(**parameters):
    return build_scene("pendulum_chain", parameters)


# ------------------------------------------------------------------ closed forms


@pytest.mark.parametrize("degrees", [5.0, 90.0, 170.0])
@pytest.mark.parametrize("length", [1.0, 0.3])
def test_one_rigid_link_is_the_elliptic_pendulum(degrees, length):
    """sin(theta/2) = k cd(w t, k^2) with k = sin(theta0/2), w = sqrt(g/L)."""
    scene = chain(angles=degrees, lengths=length, masses=3.0, duration=2.0)
    modulus, w = math.sin(0.5 * math.radians(degrees)), math.sqrt(G / length)
    _, cn, dn, _ = ellipj(w * scene.times, modulus**2)
    theta = 2.0 * np.arcsin(modulus * cn / dn)
    assert 4.0 * ellipk(modulus**2) / w < 5.0, "the closed form is used over a good part of a period"
    exact = length * np.column_stack([np.sin(theta), -np.cos(theta)])
    found = reference.solve(scene)
    assert np.abs(found.positions[:, 1] - exact).max() < 1e-11
    speed = np.sqrt(2.0 * G * length * (np.cos(theta) - math.cos(math.radians(degrees))).clip(0.0))
    assert np.abs(np.linalg.norm(found.velocities[:, 1], axis=1) - speed)[1:].max() < 1e-8  # sqrt near rest loses half
    assert np.all(found.positions[:, 0] == 0.0)


def test_one_hanging_spring_oscillates_about_its_rest():
    """y = -(L + m g alpha (1 - cos w t)), w = 1/sqrt(m alpha)."""
    m, alpha, length = 2.0, 1e-3, 0.7
    scene = chain(angles=0.0, lengths=length, masses=m, compliance=alpha)
    w = 1.0 / math.sqrt(m * alpha)
    found, t = reference.solve(scene), scene.times
    assert w * scene.duration > 6.0 * math.pi, "several periods"
    exact = -(length + m * G * alpha * (1.0 - np.cos(w * t)))
    assert np.abs(found.positions[:, 1, 1] - exact).max() < 1e-11
    assert np.abs(found.velocities[:, 1, 1] + m * G * alpha * w * np.sin(w * t)).max() < 1e-9
    assert np.abs(found.positions[:, 1, 0]).max() == 0.0


def test_a_stretched_spring_without_gravity():
    alpha, stretch = 1e-2, 1.25
    scene = chain(angles=0.0, compliance=alpha, stretch=stretch, gravity=0.0)
    exact = -(1.0 + (stretch - 1.0) * np.cos(scene.times / math.sqrt(alpha)))
    assert np.abs(reference.solve(scene).positions[:, 1, 1] - exact).max() < 1e-11


# ------------------------------------------------------------------ another formulation


def lagrangian(lengths, masses, angles, times):
    """Angles by the Lagrangian's dense mass matrix: M theta'' = -C theta'^2 - g L sin(theta), tails of masses."""
    lengths, masses = np.asarray(lengths), np.asarray(masses)
    n = len(lengths)
    below = np.array([[masses[max(i, j) :].sum() for j in range(n)] for i in range(n)])
    inertia = below * np.outer(lengths, lengths)

    def derivative(_, y):
        theta, rate = y[:n], y[n:]
        difference = theta[:, None] - theta
        force = (inertia * np.sin(difference)) @ rate**2 + np.diag(below) * G * lengths * np.sin(theta)
        return np.concatenate([rate, np.linalg.solve(inertia * np.cos(difference), -force)])

    start = np.concatenate([np.deg2rad(angles), np.zeros(n)])
    y, theta = start, [start]
    for one, other in pairwise(times):
        y = solve_ivp(derivative, (one, other), y, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        theta.append(y)
    theta = np.array(theta)[:, :n]
    steps = lengths[:, None] * np.stack([np.sin(theta), -np.cos(theta)], axis=-1)
    return np.cumsum(steps, axis=1)


@pytest.mark.parametrize(
    ("lengths", "masses", "angles"),
    [
        ([0.5, 0.5], [1.0, 1.0], [90.0, 90.0]),
        ([0.7, 0.2], [0.5, 3.0], [60.0, -40.0]),
        ([0.3, 0.5, 0.4], [2.0, 0.3, 1.0], [80.0, 30.0, 100.0]),
    ],
)
def test_rigid_chains_agree_with_the_dense_lagrangian(lengths, masses, angles):
    scene = chain(links=len(lengths), lengths=lengths, masses=masses, angles=angles)
    found = reference.solve(scene).positions[:, 1:]
    exact = lagrangian(lengths, masses, angles, scene.times)
    assert np.abs(exact[-1] - exact[0]).max() > 0.1, "it moved"
    assert np.abs(found - exact).max() < 1e-9


def test_stiffer_springs_come_nearer_to_the_rigid_chain():
    rigid = reference.solve(chain(links=2, duration=0.5)).positions
    gaps = []
    for compliance in (1e-4, 1e-5, 1e-6):
        elastic = reference.solve(chain(links=2, duration=0.5, compliance=compliance), 1e-9, 1e-10).positions
        gaps.append(np.abs(elastic - rigid).max())
    assert gaps[1] == pytest.approx(0.1 * gaps[0], rel=0.25)
    assert gaps[2] == pytest.approx(0.1 * gaps[1], rel=0.25)


# ------------------------------------------------------------------ energy and lengths


@pytest.mark.parametrize("compliance", [0.0, 1e-2])
@pytest.mark.parametrize("links", [1, 2, 10])
def test_references_conserve_energy_and_lengths(links, compliance):
    scene = chain(links=links, compliance=compliance / links**2)
    found = reference.solve(scene)
    subject = Subject(found, scene)
    assert len(found.times) == scene.samples + 1
    assert np.abs(found.velocities).max() > 1.0, "it moved"
    assert np.abs(subject.energy - subject.energy[0]).max() / subject.energy_scale < 1e-11
    if not compliance:
        assert np.abs(subject.extensions).max() < 1e-14


def test_velocities_are_the_derivative_of_positions():
    scene = chain(links=3, duration=0.3, samples=3000)
    found = reference.solve(scene)
    slope = (found.positions[2:] - found.positions[:-2]) / (2.0 * scene.times[1])
    assert np.abs(slope - found.velocities[1:-1]).max() < 1e-5


def test_samples_do_not_change_the_motion():
    coarse, fine = (reference.solve(chain(links=5, samples=samples)).positions for samples in (10, 100))
    assert np.abs(coarse - fine[::10]).max() < 1e-10


@pytest.mark.parametrize("links", [1, 4])
def test_the_error_of_dop853_falls_with_its_tolerance(links):
    exponents = range(4, 12, 2)
    errors = []
    for exponent in exponents:
        settings = {"rtol": 10.0**-exponent}
        spec = RunSpec(scene="pendulum_chain", engine="dop853", parameters={"links": links}, settings=settings)
        errors.append(execute(spec).metric("position_error"))
    assert all(fine < 0.2 * coarse for coarse, fine in pairwise(errors))
    assert errors[-1] < 1e-8
    assert all(error < 1e3 * 10.0**-exponent for error, exponent in zip(errors, exponents))


# ------------------------------------------------------------------ what has no reference


def test_a_chain_that_starts_stretched_or_is_no_chain_has_none():
    with pytest.raises(reference.NoReference, match="starts stretched"):
        reference.solve(chain(stretch=1.1))
    record = execute(
        RunSpec(scene="pendulum_chain", engine="dop853", parameters={"stretch": 1.1}, metrics=("position_error",))
    )
    assert record.status.code == "unsupported"
    assert "stretched" in record.status.quantity


# ------------------------------------------------------------------ horizon

PREDICTABLE = [(links, compliance) for links in (1, 2, 10) for compliance in (0.0, 1e-2)]


@pytest.mark.parametrize(("links", "compliance"), PREDICTABLE)
def test_the_usual_chains_are_predictable(links, compliance):
    assert reference.horizon(chain(links=links, compliance=compliance / links**2)) == math.inf


def test_a_single_pendulum_is_predictable_for_long():
    assert reference.horizon(chain(duration=10.0)) == math.inf


LATE = {"links": 2, "duration": 30.0, "samples": 100}
LONG = {"links": 10, "duration": 5.0, "samples": 50}


@pytest.mark.parametrize("parameters", [LATE, LONG])
def test_chaos_ends_predictability(parameters):
    scene = chain(**parameters)
    horizon = reference.horizon(scene)
    assert 1.0 < horizon < 0.75 * scene.duration
    assert np.abs(scene.times - horizon).min() == 0.0, "a sample time"
    shorter = chain(**{**parameters, "duration": horizon - 1.0, "samples": 10})
    assert reference.horizon(shorter) == math.inf


def test_past_its_horizon_a_run_has_no_error():
    spec = RunSpec(scene="pendulum_chain", engine="dop853", parameters=LONG)
    record = execute(spec)
    assert record.status.code == "refused"
    assert "horizon" in record.status.quantity
    assert record.metrics == {}
    limit = store.reference(chain(**LONG))[1]
    assert f"set scene.duration to at most {limit:g}" in record.status.remedy


def test_past_its_horizon_other_metrics_are_given():
    spec = RunSpec(scene="pendulum_chain", engine="dop853", parameters=LONG, metrics=("energy_drift",))
    record = execute(spec)
    assert record.status.code == "ok"
    assert record.metric("energy_drift") < 1e-3
