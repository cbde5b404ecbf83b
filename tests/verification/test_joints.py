"""Joints of rigid bodies against DOP853 in minimal coordinates: orders, energy, momentum, springs, trees and loops."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import pbd
from comparisons.fit import fit_order
from pbd.rigid import joint_rows as at
from pbd.rigid.joint_kinds import SharedPoint
from pbd.rigid.pairs import WAIT
from pbd.state import SIGNALS, WORK, State

pytestmark = pytest.mark.slow

G = 9.81
EXACT = pbd.ConjugateSweeps(velocity_iterations=200, tolerance=1e-13)
LEVELS = (0.01, 0.005, 0.0025, 0.00125, 0.000625)
"""Time steps [s]"""


def with_contacts(bodies, batches):
    """The batches; to a ball joint in the plane alone contacts are added that are never sought, and so do nothing.

    Its tests then share the kernel of those where it has contacts: one takes half a minute to compile.
    """
    if len(batches) > 1 or len(bodies.x) == 3 or not isinstance(batches[0].kind, SharedPoint):
        return batches
    idle = pbd.contacts(bodies)
    idle.counts[WAIT] = 10**12
    return [*batches, idle]


def run(bodies, batches, dt, duration=1.0, samples=10, solver=EXACT, iterations=200, substeps=1, gravity=None):
    """A run with the given batches, recorded ``samples`` times and at the start."""
    d = len(bodies.x)
    pull = (0.0, -G, 0.0)[:d] if gravity is None else gravity
    method = pbd.Settings(dt=dt, substeps=substeps, iterations=iterations, integrator=pbd.Rattle(), solver=solver)
    outcome = pbd.simulate(
        None,
        with_contacts(bodies, batches),
        bodies=bodies,
        gravity=pull,
        settings=method,
        duration=duration,
        samples=samples,
    )
    assert outcome.status == "ok"
    return outcome


def rotated(q, v):
    """Vectors v turned by quaternions q (..., 4)."""
    w, u = q[..., :1], q[..., 1:]
    return v + 2.0 * np.cross(u, np.cross(u, v) + w * v)


def turned(angle, v):
    """Vectors v turned by angles (...)."""
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return np.concatenate([c * v[..., :1] - s * v[..., 1:], s * v[..., :1] + c * v[..., 1:]], axis=-1)


def integrate(rhs, start, times):
    solved = solve_ivp(rhs, (0.0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-13)
    assert solved.success
    return solved.y.T


def assert_second_order(simulated, exact, levels=LEVELS):
    """``simulated`` (dt -> tuple of arrays) against a tuple of arrays: every one of them of order 2."""
    runs = [simulated(dt) for dt in levels]
    for k, wanted in enumerate(exact):
        errors = [np.abs(found[k] - wanted).max() for found in runs]
        fit = fit_order(levels, errors)
        assert fit.order is not None, (k, errors)
        assert fit.order >= 1.85, (k, errors)
        assert len(fit.xs) >= 4, (k, errors)


def everything(outcome):
    motion = outcome.bodies
    return motion.positions, motion.velocities, motion.orientations, motion.spins


# ------------------------------------------------------------------ one body


BOX = pbd.Box((1.0, 0.2))
PIVOT = np.array([-0.5, 0.1])
"""Of `BOX`: a corner, in its frame."""


def plane_pendulum(angle=0.3, spin=1.0):
    """A box hung at its corner in the origin, turned by ``angle``."""
    x, v = -turned(np.array(angle), PIVOT), spin * turned(np.array(angle + np.pi / 2), -PIVOT)
    bodies = pbd.bodies([BOX], [x], masses=2.0, orientations=[angle], velocities=[v], spins=[spin])
    return bodies, pbd.ball_joint(bodies, [(0, None)], [(0.0, 0.0)])


def plane_pendulum_exact(times, angle=0.3, spin=1.0):
    """(positions, velocities, orientations, spins) of the physical pendulum."""
    moment = BOX.inertia(1.0, 2)[0] + PIVOT @ PIVOT

    def rhs(t, y):
        return y[1], -G * turned(np.array(y[0]), -PIVOT)[0] / moment

    angles, spins = integrate(rhs, (angle, spin), times).T
    arms = turned(angles, np.tile(-PIVOT, (len(times), 1)))
    velocities = spins[:, None] * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
    return arms[:, None], velocities[:, None], angles[:, None], spins[:, None]


def test_order_of_a_pendulum_in_the_plane():
    bodies, joint = plane_pendulum()
    exact = plane_pendulum_exact(np.linspace(0.0, 2.0, 11))
    assert_second_order(lambda dt: everything(run(bodies, [joint], dt, 2.0)), exact)


BRICK = pbd.Box((0.9, 0.5, 0.2))
CORNER = np.array([-0.45, 0.25, -0.1])
LEAN = np.array([0.8, 0.3, -0.4, 0.33166247903554]) / np.linalg.norm([0.8, 0.3, -0.4, 0.33166247903554])
SPIN = np.array([1.0, -2.0, 1.5])


def space_pendulum(pivot=CORNER):
    """A box with three unlike moments, hung at a point of it in the origin by a ball."""
    x = -rotated(LEAN, pivot)
    bodies = pbd.bodies([BRICK], [x], masses=2.0, orientations=[LEAN], velocities=[np.cross(SPIN, x)], spins=[SPIN])
    return bodies, pbd.ball_joint(bodies, [(None, 0)], [(0.0, 0.0, 0.0)])


def space_pendulum_exact(times, pivot=CORNER):
    """Euler's equations about the pivot, in the body's frame."""
    inertia = np.diag(BRICK.inertia(1.0, 3)) + pivot @ pivot * np.eye(3) - np.outer(pivot, pivot)

    def rhs(t, y):
        q, w = y[:4] / np.linalg.norm(y[:4]), y[4:]
        down = rotated(q * [1, -1, -1, -1], np.array([0.0, -G, 0.0]))
        turning = np.linalg.solve(inertia, np.cross(-pivot, down) - np.cross(w, inertia @ w))
        return np.r_[0.5 * np.r_[-y[1:4] @ w, y[0] * w + np.cross(y[1:4], w)], turning]

    y = integrate(rhs, np.r_[LEAN, rotated(LEAN * [1, -1, -1, -1], SPIN)], times)
    q = y[:, :4] / np.linalg.norm(y[:, :4], axis=1, keepdims=True)
    x, spins = rotated(q, np.tile(-pivot, (len(times), 1))), rotated(q, y[:, 4:])
    return x[:, None], np.cross(spins, x)[:, None], q[:, None], spins[:, None]


def test_order_of_a_pendulum_in_space():
    bodies, joint = space_pendulum()
    exact = space_pendulum_exact(np.linspace(0.0, 1.0, 11))
    assert_second_order(lambda dt: everything(run(bodies, [joint], dt)), exact)


AXIS = np.array([1.0, 2.0, 2.0]) / 3.0


def hinged(spin=1.0):
    """The same box turning about a skew axis through the origin."""
    x = -rotated(LEAN, CORNER)
    bodies = pbd.bodies([BRICK], [x], orientations=[LEAN], velocities=[np.cross(spin * AXIS, x)], spins=[spin * AXIS])
    return bodies, pbd.hinge(bodies, [(0, None)], [(0.0, 0.0, 0.0)], [5.0 * AXIS])


def hinged_exact(times, spin=1.0):
    x0, local = -rotated(LEAN, CORNER), rotated(LEAN * [1, -1, -1, -1], AXIS)
    across = x0 - x0 @ AXIS * AXIS
    moment = local @ (BRICK.inertia(1.0, 3) * local) + across @ across
    beside = np.cross(AXIS, across)

    def rhs(t, y):
        return y[1], -G * (-np.sin(y[0]) * across[1] + np.cos(y[0]) * beside[1]) / moment

    angle, rate = (column[:, None] for column in integrate(rhs, (0.0, spin), times).T)
    x = x0 - across + np.cos(angle) * across + np.sin(angle) * beside
    half = np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * AXIS], axis=1)
    w, u = half[:, :1], half[:, 1:]
    q = np.concatenate([w * LEAN[0] - u @ LEAN[1:, None], w * LEAN[1:] + LEAN[0] * u + np.cross(u, LEAN[1:])], axis=1)
    return x[:, None], np.cross(rate * AXIS, x)[:, None], q[:, None], (rate * AXIS)[:, None]


def test_order_of_a_hinge():
    bodies, joint = hinged()
    exact = hinged_exact(np.linspace(0.0, 1.0, 11))
    assert_second_order(lambda dt: everything(run(bodies, [joint], dt)), exact)


def test_a_hinge_keeps_its_axis_and_its_point():
    bodies, joint = hinged(spin=5.0)
    motion = run(bodies, [joint], 1 / 240, 20.0, 4800).bodies
    local = rotated(LEAN * [1, -1, -1, -1], AXIS)
    assert np.abs(rotated(motion.orientations[:, 0], local) - AXIS).max() <= 1e-12
    assert np.abs(motion.positions[:, 0] + rotated(motion.orientations[:, 0], CORNER)).max() <= 1e-12
    assert np.abs(np.cross(motion.spins[:, 0], AXIS)).max() <= 1e-11
    assert np.abs(motion.spins[:, 0] @ AXIS).max() > 5.0


def test_a_default_solver_keeps_them_too():
    bodies, joint = hinged(spin=5.0)
    motion = run(bodies, [joint], 1 / 240, 20.0, 4800, solver=pbd.ConjugateSweeps(), iterations=10).bodies
    local = rotated(LEAN * [1, -1, -1, -1], AXIS)
    assert np.abs(rotated(motion.orientations[:, 0], local) - AXIS).max() <= 1e-8
    assert np.abs(motion.positions[:, 0] + rotated(motion.orientations[:, 0], CORNER)).max() <= 1e-8


def kinetic(bodies, motion):
    """(s,) [J]"""
    n, d = motion.positions.shape[1:]
    masses = 1.0 / bodies.motion[:n, 3 * (d - 1)]
    moments = np.stack(bodies.inertia, axis=1)[:n]
    if d == 2:
        turning = moments[:, 0] * motion.spins**2
    else:
        back = motion.orientations * [1, -1, -1, -1]
        turning = (moments * rotated(back, motion.spins) ** 2).sum(axis=2)
    return 0.5 * (masses * (motion.velocities**2).sum(axis=2) + turning).sum(axis=1)


def energy(bodies, motion, gravity=G):
    masses = 1.0 / bodies.motion[: motion.positions.shape[1], 3 * (len(bodies.x) - 1)]
    return kinetic(bodies, motion) + gravity * motion.positions[:, :, 1] @ masses


@pytest.mark.parametrize("make", [plane_pendulum, space_pendulum, hinged])
def test_energy_of_a_pendulum_stays_for_a_hundred_seconds(make):
    """At 240 Hz: bounded, and its mean over the last ten seconds is that over the first ten."""
    bodies, joint = make()
    kept = energy(bodies, run(bodies, [joint], 1 / 240, 100.0, 12000).bodies)
    depth = G / bodies.motion[0, 3 * (len(bodies.x) - 1)] * np.linalg.norm([x[0] for x in bodies.x])
    assert np.abs(kept - kept[0]).max() <= 2e-3 * depth
    assert abs(kept[-1200:].mean() - kept[:1200].mean()) <= 1e-4 * depth
    assert np.ptp(energy(bodies, run(bodies, [joint], 1 / 480, 10.0, 1200).bodies)) <= 0.3 * np.ptp(kept)


@pytest.mark.parametrize(("share", "stable"), [(0.95, True), (1.05, False)])
def test_a_swing_across_the_force_must_be_resolved(share, stable):
    """The limit that the module states: the step is a leapfrog of angular frequency sqrt(m g r/I), stable below 2."""
    arm, moment = np.linalg.norm(PIVOT), BOX.inertia(1.0, 2)[0] + PIVOT @ PIVOT
    down = -np.pi / 2 - np.arctan2(-PIVOT[1], -PIVOT[0])
    bodies, joint = plane_pendulum(angle=down + 1e-6, spin=0.0)
    dt = share * 2.0 / np.sqrt(G * arm / moment)
    swing = np.abs(run(bodies, [joint], dt, 20 * dt, 20).bodies.orientations[:, 0] - down)
    assert bool(swing.max() <= 1e-5) is stable
    assert swing.max() <= np.pi


@pytest.mark.parametrize("make", [plane_pendulum, space_pendulum, hinged])
def test_a_rigid_joint_runs_backwards_as_forwards(make):
    bodies, joint = make()
    there = run(bodies, [joint], 0.005, 1.0, 1)
    motion = there.bodies
    back = pbd.bodies(
        [BOX if len(bodies.x) == 2 else BRICK],
        motion.positions[-1],
        masses=1.0 / bodies.motion[0, 3 * (len(bodies.x) - 1)],
        orientations=motion.orientations[-1],
        velocities=-motion.velocities[-1],
        spins=-motion.spins[-1],
    )
    again = everything(run(back, [joint], 0.005, 1.0, 1))
    for found, wanted, sign in zip(again, everything(there), (1, -1, 1, -1), strict=True):
        np.testing.assert_allclose(found[-1], sign * wanted[0], rtol=0.0, atol=1e-10)


# ------------------------------------------------------------------ chains


def box_chain(links, length=1.0, width=0.2):
    """Boxes of 1 kg hung end to end in the origin, all level."""
    x = np.zeros((links, 2))
    x[:, 0] = length * (np.arange(links) + 0.5)
    bodies = pbd.bodies([pbd.Box((length, width))] * links, x)
    return bodies, pbd.ball_joint(bodies, [(k - 1, k) for k in range(links)], x - [0.5 * length, 0.0])


def box_chain_exact(times, links, length=1.0, width=0.2):
    """Angles and spins: x_k = sum_l a_kl (cos, sin)(angle_l) in M(angles) angles'' = forces."""
    moment = pbd.Box((length, width)).inertia(1.0, 2)[0]
    a = length * (np.tril(np.ones((links, links)), -1) + 0.5 * np.eye(links))

    def rhs(t, y):
        angles, spins = y[:links], y[links:]
        along, across = np.stack([-np.sin(angles), np.cos(angles)]), -np.stack([np.cos(angles), np.sin(angles)])
        rates = a * along[:, None]
        mass = np.einsum("ckl,ckm->lm", rates, rates) + moment * np.eye(links)
        pull = np.array([0.0, -G])[:, None] - (a * across[:, None]) @ spins**2
        return np.r_[spins, np.linalg.solve(mass, np.einsum("ckl,ck->l", rates, pull))]

    y = integrate(rhs, np.zeros(2 * links), times)
    return y[:, :links], y[:, links:]


def test_order_of_a_triple_pendulum():
    bodies, joints = box_chain(3)
    exact = box_chain_exact(np.linspace(0.0, 1.0, 11), 3)

    def simulated(dt):
        motion = run(bodies, [joints], dt).bodies
        return motion.orientations, motion.spins

    assert_second_order(simulated, exact)


def test_sub_steps_keep_the_energy_of_a_triple_pendulum():
    """Claim 41 of Mueller et al. 2020, where one sub-step loses the energy; here the error falls as their square."""
    bodies, joints = box_chain(3)
    worst = []
    for substeps in (2, 4, 8, 16):
        kept = energy(bodies, run(bodies, [joints], 1 / 60, 10.0, 600, substeps=substeps).bodies)
        worst.append(np.abs(kept - kept[0]).max() / (3 * G))
    assert worst[-1] <= 5e-4
    assert worst[0] / worst[-1] >= 30.0, worst


def test_few_iterations_keep_a_triple_pendulum_together():
    """A tree is solved at once, so that iterations only straighten what turns within a sub-step."""
    bodies, joints = box_chain(3)
    for iterations, most in ((1, 1e-4), (2, 1e-5), (4, 1e-7)):
        method = pbd.ConjugateSweeps(velocity_iterations=1)
        motion = run(bodies, [joints], 1 / 240, 10.0, 2400, method, iterations).bodies
        assert np.abs(gaps(motion)).max() <= most
        kept = energy(bodies, motion)
        assert np.abs(kept - kept[0]).max() <= 0.03 * 3 * G


def gaps(motion):
    """Between neighbours of `box_chain` (s, links, 2)."""
    half = turned(motion.orientations, np.broadcast_to([0.5, 0.0], motion.positions.shape))
    ends = motion.positions + half
    return motion.positions - half - np.concatenate([np.zeros_like(ends[:, :1]), ends[:, :-1]], axis=1)


@pytest.mark.parametrize("ratio", [1e-6, 1.0, 1e6])
def test_a_hanging_chain_stays_whatever_its_masses(ratio):
    """Ten boxes, the last of which is much heavier, or lighter: one iteration is all it takes."""
    x = np.zeros((10, 2))
    x[:, 1] = -0.5 - np.arange(10)
    bodies = pbd.bodies([pbd.Box((0.2, 1.0))] * 10, x, masses=[1.0] * 9 + [ratio])
    joints = pbd.ball_joint(bodies, [(k - 1, k) for k in range(10)], x + [0.0, 0.5])
    motion = run(bodies, [joints], 1 / 60, 2.0, 10, pbd.ConjugateSweeps(1), 1).bodies
    np.testing.assert_allclose(motion.positions, np.broadcast_to(x, motion.positions.shape), rtol=0.0, atol=1e-10)


# ------------------------------------------------------------------ rods and springs


def rod_pendulum(compliance=0.0, length=0.7):
    """A box on a rod from the origin to its corner; the rod leans by 1 rad, the box is turned by 0.3."""
    end = length * turned(np.array(-1.0), np.array([1.0, 0.0]))
    x = end - turned(np.array(0.3), PIVOT)
    bodies = pbd.bodies([BOX], [x], orientations=[0.3])
    return bodies, pbd.distance_joint(bodies, [(-1, 0)], [(0.0, 0.0)], [end], compliance=compliance)


def pulled(bodies, times, force):
    """A box under gravity and a force(end) on its `PIVOT`, as `everything`."""
    moment = BOX.inertia(1.0, 2)[0]

    def rhs(t, y):
        arm = turned(y[2], PIVOT)
        f = force(y[:2] + arm)
        return *y[3:], f[0], f[1] - G, (arm[0] * f[1] - arm[1] * f[0]) / moment

    y = integrate(rhs, [bodies.x[0][0], bodies.x[1][0], 0.3, 0.0, 0.0, 0.0], times)
    return y[:, None, :2], y[:, None, 3:5], y[:, 2:3], y[:, 5:]


def test_order_of_a_box_on_a_rod():
    """Angles of rod and box are its coordinates: x = L u(a) - R(b) pivot."""
    bodies, joint = rod_pendulum()
    moment, length = BOX.inertia(1.0, 2)[0], 0.7

    def frames(a, b):
        u, arm = turned(a, np.array([1.0, 0.0])), -turned(b, PIVOT)
        rates = np.stack([length * np.array([-u[1], u[0]]), np.array([-arm[1], arm[0]])], axis=1)
        return length * u, arm, rates

    def rhs(t, y):
        rod, arm, rates = frames(*y[:2])
        pull = np.array([0.0, -G]) + rod * y[2] ** 2 + arm * y[3] ** 2
        return np.r_[y[2:], np.linalg.solve(rates.T @ rates + np.diag([0.0, moment]), rates.T @ pull)]

    y = integrate(rhs, (-1.0, 0.3, 0.0, 0.0), np.linspace(0.0, 1.0, 11))
    x = np.array([[frames(*row[:2])[0] + frames(*row[:2])[1]] for row in y])
    v = np.array([[frames(*row[:2])[2] @ row[2:]] for row in y])
    assert_second_order(lambda dt: everything(run(bodies, [joint], dt)), (x, v, y[:, 1:2], y[:, 3:4]))


def test_a_rod_keeps_its_length():
    bodies, joint = rod_pendulum()
    motion = run(bodies, [joint], 1 / 240, 20.0, 480).bodies
    ends = motion.positions[:, 0] + turned(motion.orientations[:, 0], np.tile(PIVOT, (481, 1)))
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 0.7, rtol=0.0, atol=1e-12)


def test_order_of_a_box_on_a_spring():
    """Not stiff, so no constraint is in the reference; recorded velocities too."""
    bodies, joint = rod_pendulum(compliance=0.02)
    exact = pulled(
        bodies,
        np.linspace(0.0, 1.0, 11),
        lambda end: (0.7 - np.linalg.norm(end)) / 0.02 * end / np.linalg.norm(end),
    )
    assert_second_order(lambda dt: everything(run(bodies, [joint], dt)), exact)


def test_order_of_a_box_on_a_compliant_point():
    bodies, _ = rod_pendulum()
    joint = pbd.ball_joint(bodies, [(0, -1)], [(0.3, -0.6)], compliance=0.02)
    local = turned(np.array(-0.3), np.array([0.3, -0.6]) - np.array([x[0] for x in bodies.x]))
    assert not np.allclose(local, PIVOT)
    start = np.array([0.3, -0.6])
    moment = BOX.inertia(1.0, 2)[0]

    def rhs(t, y):
        arm = turned(y[2], local)
        f = (start - y[:2] - arm) / 0.02
        return *y[3:], f[0], f[1] - G, (arm[0] * f[1] - arm[1] * f[0]) / moment

    y = integrate(rhs, [bodies.x[0][0], bodies.x[1][0], 0.3, 0.0, 0.0, 0.0], np.linspace(0.0, 1.0, 11))
    exact = y[:, None, :2], y[:, None, 3:5], y[:, 2:3], y[:, 5:]
    assert_second_order(lambda dt: everything(run(bodies, [joint], dt)), exact)


def hanging(masses, compliance, stretch, size=0.5, length=1.0):
    """Boxes side by side on springs of 1 m, stretched by ``stretch`` at the start; g = 10 m/s^2 in these tests."""
    n = len(masses)
    top = np.stack([2.0 * np.arange(n), np.zeros(n)], axis=1)
    bottom = top - np.stack([np.zeros(n), length + np.asarray(stretch)], axis=1)
    bodies = pbd.bodies([pbd.Box((size, size))] * n, bottom - [0.0, size / 2], masses=masses)
    pairs = [(None, k) for k in range(n)]
    return bodies, pbd.distance_joint(bodies, pairs, top, bottom, length, compliance)


TEN = (0.0, -10.0)


@pytest.mark.parametrize("iterations", [1, 10])
@pytest.mark.parametrize("substeps", [1, 4, 20])
def test_springs_stretch_by_force_times_compliance(substeps, iterations):
    """Claim 41: 1 and 1/8 kg at 0.01 m/N hang 0.1 and 0.0125 m lower, and stay there to round-off."""
    bodies, springs = hanging([1.0, 0.125], 0.01, [0.1, 0.0125])
    solver = pbd.ConjugateSweeps(iterations)
    motion = run(bodies, [springs], 1 / 60, 10.0, 10, solver, iterations, substeps, TEN).bodies
    assert np.abs(motion.positions - motion.positions[0]).max() <= 1e-12
    assert np.abs(motion.velocities).max() <= 1e-12


@pytest.mark.parametrize("dt", [0.5, 2.0, 10.0])
def test_springs_that_are_not_resolved_come_to_rest_there(dt):
    """From no stretch at all: steps much longer than their periods damp them, as XPBD does."""
    bodies, springs = hanging([1.0, 0.125], 0.01, [0.0, 0.0])
    motion = run(bodies, [springs], dt, 200 * dt, 1, gravity=TEN).bodies
    np.testing.assert_allclose(motion.positions[0, :, 1] - motion.positions[-1, :, 1], [0.1, 0.0125], rtol=1e-12)
    assert np.abs(motion.velocities[-1]).max() <= 1e-13


def test_springs_that_are_resolved_swing_about_it():
    """Undamped: the mean over a hundred of their periods is the elongation at rest, twice that their greatest."""
    for mass in (1.0, 0.125):
        rest = 0.01 * 10.0 * mass
        bodies, springs = hanging([mass], 0.01, [0.0])
        period = 2 * np.pi * np.sqrt(0.01 * mass)
        dt = 2 * np.tan(np.pi / 50) * period / (2 * np.pi)  # the trapezoidal rule makes it fifty steps
        motion = run(bodies, [springs], dt, 5000 * dt, 5000, gravity=TEN).bodies
        stretch = motion.positions[0, 0, 1] - motion.positions[1:, 0, 1]
        assert stretch.mean() == pytest.approx(rest, rel=2e-3)
        assert stretch.max() == pytest.approx(2 * rest, rel=1e-4)
        assert stretch[-50:].max() >= 1.98 * rest


@pytest.mark.parametrize("compliance", [0.01, 0.001, 0.0])
@pytest.mark.parametrize("iterations", [1, 20])
def test_one_gram_holds_a_kilogram(compliance, iterations):
    """Claim 41: two springs in line, a gram between them and a kilogram below; solved in one iteration."""
    stretch = np.array([10.01, 10.0]) * compliance
    tops = -np.array([0.0, 1.0 + stretch[0] + 0.1])
    x = np.array([[0.0, tops[1] + 0.05], [0.0, tops[1] - 1.0 - stretch[1] - 0.25]])
    bodies = pbd.bodies([pbd.Box((0.1, 0.1)), pbd.Box((0.5, 0.5))], x, masses=[1e-3, 1.0])
    ends = [(0.0, tops[0]), (0.0, tops[1])], x + [[0.0, 0.05], [0.0, 0.25]]
    springs = pbd.distance_joint(bodies, [(-1, 0), (0, 1)], *ends, 1.0, compliance)
    solver = pbd.ConjugateSweeps(iterations)
    motion = run(bodies, [springs], 1 / 60, 5.0, 10, solver, iterations, gravity=TEN).bodies
    assert np.abs(motion.positions - x).max() <= 1e-11
    raised = x + [[0.0, stretch[0]], [0.0, stretch.sum()]]
    fallen = bodies._replace(x=tuple(np.append(axis, 0.0) for axis in raised.T))
    motion = run(fallen, [springs], 1.0, 400.0, 1, solver, iterations, gravity=TEN).bodies
    assert np.abs(motion.positions[-1] - x).max() <= 1e-9, "dropped, and damped by long steps"


def scheme(z):
    """One step of a spring of unit mass with z = (h omega)^2: (x, h v) -> (x, h v)."""
    d = (at.RESOLVED / z) ** 2
    theta = 1.0 - 0.5 * d / (1.0 + d)
    x = np.array([1.0 - 0.5 * z * (1.0 - theta), 1.0]) / (1.0 + 0.5 * z * theta)
    middle = x - [1.0, 0.0]
    first = middle - [0.0, 1.0]
    return np.stack([x, middle + (d * first - middle) / (1.0 + d)])


@pytest.mark.parametrize("dt", [0.01, 0.1, 0.3, 1.0, 10.0])
def test_the_discrete_answer_of_a_spring(dt):
    """Two terms to round-off, from steps that resolve it to steps that see it rigid; all of them stable."""
    bodies, springs = hanging([1.0], 0.01, [0.05])
    motion = run(bodies, [springs], dt, 20 * dt, 20, gravity=(0.0, 0.0)).bodies
    z = dt * dt / 0.01
    wanted = [np.array([0.05, 0.0])]
    for _ in range(20):
        wanted.append(scheme(z) @ wanted[-1])
    x = motion.positions[0, 0, 1] - motion.positions[:, 0, 1] + 0.05
    np.testing.assert_allclose(x, np.array(wanted)[:, 0], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(-dt * motion.velocities[:, 0, 1], np.array(wanted)[:, 1], rtol=0.0, atol=1e-12)
    assert np.abs(np.linalg.eigvals(scheme(z))).max() < 1.0


@settings(max_examples=30, deadline=None)
@given(
    masses=st.lists(st.floats(-3.0, 3.0), min_size=5, max_size=5),
    stiffness=st.lists(st.floats(-6.0, 1.0), min_size=5, max_size=5),
    dt=st.floats(-4.0, 2.0),
    starts=st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5),
)
def test_energy_of_linear_springs_never_grows(masses, stiffness, dt, starts):
    """Any masses, compliances and steps, over six decades each, in one iteration: springs of no length, at centres."""
    mass, alpha, dt = 10.0 ** np.array(masses), 10.0 ** np.array(stiffness), 10.0**dt
    bodies = pbd.bodies([pbd.Ball(0.1)] * 5, np.zeros((5, 2)), masses=mass, velocities=np.array([starts] * 2).T)
    springs = pbd.ball_joint(bodies, [(k - 1, k) for k in range(5)], np.zeros((5, 2)), alpha)
    motion = run(bodies, [springs], dt, 50 * dt, 50, pbd.ConjugateSweeps(1), 1, gravity=(0.0, 0.0)).bodies
    stretch = np.diff(motion.positions, axis=1, prepend=0.0)
    kept = kinetic(bodies, motion) + 0.5 * ((stretch**2).sum(axis=2) / alpha).sum(axis=1)
    assert np.all(np.diff(kept) <= 1e-9 * kept[0])


def test_a_stiff_spring_tends_to_a_rod():
    rigid = everything(run(*(lambda b, j: (b, [j]))(*rod_pendulum()), 1 / 240))
    distances = []
    for compliance in (1e-5, 1e-6, 1e-7):
        bodies, joint = rod_pendulum(compliance)
        found = everything(run(bodies, [joint], 1 / 240))
        distances.append(max(np.abs(a - b).max() for a, b in zip(found, rigid, strict=True)))
    assert distances[-1] <= 1e-3
    assert distances[0] / distances[1] >= 5.0
    assert distances[1] / distances[2] >= 5.0


# ------------------------------------------------------------------ several bodies in space


def bricks(rng, count, d):
    """(shapes, positions, orientations, velocities, spins, masses) of boxes on a line, apart, turned at random."""
    shapes = [pbd.Box(tuple(rng.uniform(0.3, 0.6, d))) for _ in range(count)]
    x = np.zeros((count, d))
    x[:, 0] = 1.2 * np.arange(1, count + 1)
    turns = rng.uniform(-3.0, 3.0, count) if d == 2 else rng.normal(size=(count, 4))
    if d == 3:
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    spins = rng.normal(size=count if d == 2 else (count, 3))
    return shapes, x, turns, rng.normal(size=(count, d)), spins, rng.uniform(0.5, 3.0, count)


def free_bodies(rng, count, d):
    shapes, x, turns, v, spins, masses = bricks(rng, count, d)
    return pbd.bodies(shapes, x, masses=masses, orientations=turns, velocities=v, spins=spins)


def joined(bodies, pairs, kind, compliance=0.0):
    x = np.stack(bodies.x, axis=1)
    pairs = np.asarray(pairs)
    a, b = x[pairs[:, 0]], x[pairs[:, 1]]
    if kind == "distance":
        return pbd.distance_joint(bodies, pairs, 0.8 * a + 0.2 * b, 0.2 * a + 0.8 * b, compliance=compliance)
    if kind == "hinge":
        axes = np.tile([0.3, 1.0, 0.2], (len(pairs), 1))
        return pbd.hinge(bodies, pairs, 0.5 * (a + b), axes, compliance)
    return pbd.ball_joint(bodies, pairs, 0.5 * (a + b), compliance)


TREE = [(0, 1), (2, 1), (1, 3), (3, 4)]
KINDS = [("ball", 2), ("distance", 2), ("ball", 3), ("distance", 3), ("hinge", 3)]


def momenta(bodies, motion):
    """(s, d + 1 or 3): momentum, and angular momentum about the origin."""
    n, d = motion.positions.shape[1:]
    masses = 1.0 / bodies.motion[:n, 3 * (d - 1)]
    moments = np.stack(bodies.inertia, axis=1)[:n]
    p = masses[:, None] * motion.velocities
    if d == 2:
        own = moments[:, 0] * motion.spins
        x = motion.positions
        return np.c_[p.sum(axis=1), (own + x[..., 0] * p[..., 1] - x[..., 1] * p[..., 0]).sum(axis=1)]
    back = motion.orientations * [1, -1, -1, -1]
    own = rotated(motion.orientations, moments * rotated(back, motion.spins))
    return np.c_[p.sum(axis=1), (own + np.cross(motion.positions, p)).sum(axis=1)]


def lost_momentum(bodies, joint, dt, iterations):
    """(d + 1 or 3,) the greatest change of each component in 1 s without forces."""
    solver, still = pbd.ConjugateSweeps(iterations), np.zeros(len(bodies.x))
    kept = momenta(bodies, run(bodies, [joint], dt, 1.0, 10, solver, iterations, gravity=still).bodies)
    return np.abs(kept - kept[0]).max(axis=0)


@pytest.mark.parametrize("iterations", [1, 50])
@pytest.mark.parametrize(("kind", "d"), KINDS)
def test_momentum_and_angular_momentum_stay(kind, d, iterations):
    """Of five free bodies in a tree, however well it is solved."""
    bodies = free_bodies(np.random.default_rng(3), 5, d)
    assert lost_momentum(bodies, joined(bodies, TREE, kind), 1 / 240, iterations).max() <= 1e-12
    springs = joined(bodies, TREE, kind, 1e-2)
    lost = lost_momentum(bodies, springs, 1 / 240, iterations)
    assert lost[:d].max() <= 1e-12
    if kind == "distance":
        assert lost.max() <= 1e-12
    else:  # what little damping there is does not only act along a spring of length 0
        assert lost.max() <= 1e-4
        assert lost.max() >= 8.0 * lost_momentum(bodies, springs, 1 / 480, iterations).max()


@pytest.mark.parametrize(("kind", "d"), KINDS)
def test_free_bodies_keep_their_energy(kind, d):
    bodies = free_bodies(np.random.default_rng(3), 5, d)
    motion = run(bodies, [joined(bodies, TREE, kind)], 1 / 480, 5.0, 2400, gravity=np.zeros(d)).bodies
    kept = kinetic(bodies, motion)[1:]  # the joints stop at once what would part them
    assert np.abs(kept - kept[0]).max() <= 5e-3 * kept[0]


@pytest.mark.parametrize("compliance", [0.0, 1e-3])
@pytest.mark.parametrize(("kind", "d"), KINDS)
def test_a_tree_is_solved_as_its_whole_matrix_is(kind, d, compliance):
    """The velocity pass of a step against J M^-1 J^T, from bodies that fly apart, and one of a thousandth the mass."""
    bodies = free_bodies(np.random.default_rng(5), 5, d)
    bodies.motion[3, 3 * (d - 1) :] *= 1000.0
    made = joined(bodies, [*TREE, (0, -1)], kind, compliance)
    h = 1e-3
    outcome = run(bodies, [made], h, h, 1, pbd.ConjugateSweeps(1), 1, gravity=np.zeros(d))
    rows = outcome.scene.batches[0].rows
    m, count, size = rows.lever.shape[1], rows.lever.shape[3], rows.lever.shape[4]
    big, answers = np.zeros((m * count, 6 * size)), np.zeros((6 * size, m * count))
    for c in range(m):
        for side in range(2):
            columns = slice(size * rows.pair[c, side], size * (rows.pair[c, side] + 1))
            big[c * count : (c + 1) * count, columns] = rows.lever[at.GRADIENT, c, side]
            answers[columns, c * count : (c + 1) * count] = rows.lever[at.ANSWER, c, side].T
    number = rows.number.reshape(at.NUMBERS, -1)
    after = outcome.scene.state.bodies.motion[:, :size].reshape(-1)
    residual = big @ after + number[at.BIAS] + number[at.SOFT] * number[at.IMPULSE]
    before = big @ (after - answers @ number[at.IMPULSE]) + number[at.BIAS]
    assert np.abs(before).max() > 1e-3
    assert np.abs(residual).max() <= 1e-10 * np.abs(number[at.SOFT] * number[at.IMPULSE]).max() + 1e-10
    dense = np.linalg.solve(big @ answers + np.diag(number[at.SOFT]), -before)
    np.testing.assert_allclose(number[at.IMPULSE], dense, rtol=1e-7, atol=1e-9 * np.abs(dense).max())


# ------------------------------------------------------------------ loops


def test_a_four_bar_linkage_keeps_its_joints():
    """A parallelogram that swings from two pivots: its last joint closes a loop, and is swept."""
    x = np.array([[0.0, -0.5], [0.5, -1.0], [1.0, -0.5]])
    shapes = [pbd.Box((0.1, 1.0)), pbd.Box((1.0, 0.1)), pbd.Box((0.1, 1.0))]
    speed = 2.0
    v = speed * np.array([[0.5, 0.0], [1.0, 0.0], [0.5, 0.0]])
    bodies = pbd.bodies(shapes, x, velocities=v, spins=[speed, 0.0, speed])
    anchors = [(0.0, 0.0), (0.0, -1.0), (1.0, -1.0), (1.0, 0.0)]
    joints = pbd.ball_joint(bodies, [(-1, 0), (0, 1), (1, 2), (2, -1)], anchors)
    assert len(joints.forest.loops) == 1
    exact = integrate(
        lambda t, y: (y[1], -G * (2 * 0.5 + 1.0) * np.sin(y[0]) / (2 * (0.25 + shapes[0].inertia(1.0, 2)[0]) + 1.0)),
        (0.0, speed),
        np.linspace(0.0, 2.0, 11),
    )
    motion = run(bodies, [joints], 1 / 480, 2.0).bodies
    np.testing.assert_allclose(motion.orientations[:, 0], exact[:, 0], rtol=0.0, atol=2e-4)
    np.testing.assert_allclose(motion.spins[:, 2], exact[:, 1], rtol=0.0, atol=1e-3)
    assert np.abs(motion.orientations[:, 1]).max() <= 1e-9
    assert np.abs(motion.orientations[:, 0] - motion.orientations[:, 2]).max() <= 1e-9


def test_two_balls_are_a_hinge():
    """More constraints than motions: the rows along their common axis say the same twice."""
    bodies, joint = hinged()
    balls = pbd.ball_joint(bodies, [(0, -1), (0, -1)], np.stack([np.zeros(3), 0.4 * AXIS]))
    assert len(balls.forest.loops) == 1
    wanted, found = (everything(run(bodies, [made], 1 / 480)) for made in (joint, balls))
    for a, b in zip(found, wanted, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("compliance", [1e-2, 1e-4, 1e-6, 0.0])
@pytest.mark.parametrize(("braces", "iterations"), [((1,), 1), ((1, 2), 10)])
def test_a_ring_gains_no_energy(braces, iterations, compliance):
    """Eight balls, each joined to the next, and to the next but one: what closes loops is swept, as often as said."""
    rng, around = np.random.default_rng(1), 2 * np.pi * np.arange(8) / 8
    x, first = 1.3 * np.stack([np.cos(around), np.sin(around)], axis=1), np.arange(8)
    bodies = pbd.bodies([pbd.Ball(0.05)] * 8, x, velocities=0.1 * rng.normal(size=(8, 2)))
    pairs = np.concatenate([np.stack([first, (first + step) % 8], axis=1) for step in braces])
    springs = pbd.distance_joint(bodies, pairs, x[pairs[:, 0]], x[pairs[:, 1]], compliance=compliance)
    assert len(springs.forest.loops) == len(pairs) - 7
    solver = pbd.ConjugateSweeps(iterations)
    motion = run(bodies, [springs], 1 / 60, 10.0, 600, solver, iterations, gravity=(0.0, 0.0)).bodies
    between = motion.positions[:, pairs[:, 0]] - motion.positions[:, pairs[:, 1]]
    stretch = np.linalg.norm(between, axis=2) - np.linalg.norm(between[0], axis=1)
    moving = kinetic(bodies, motion)
    assert moving.max() <= moving[0] * (1.0 + 1e-3)
    if compliance:
        assert moving[-1] + 0.5 * (stretch[-1] ** 2).sum() / compliance <= moving[0] * (1.0 + 1e-3)
    assert np.abs(stretch).max() <= (1.0 if compliance > 1e-3 else 0.02)
    assert np.abs(momenta(bodies, motion) - momenta(bodies, motion)[0]).max() <= 1e-12


# ------------------------------------------------------------------ with contacts


FLOOR = pbd.planes((0.0, 1.0), 0.0)


def test_a_hinged_box_comes_to_rest_on_the_floor():
    """It swings down about a pivot at the height of its corner, hits the floor, and lies there level, held by both."""
    pivot = np.array([-0.5, 0.1])
    x = pivot + turned(np.array(0.5), np.array([0.5, 0.0]))
    bodies = pbd.bodies([pbd.Box((1.0, 0.2))], [x], orientations=[0.5])
    batches = [pbd.ball_joint(bodies, [(0, None)], [pivot]), pbd.contacts(bodies, FLOOR, friction=0.5)]
    motion = run(bodies, batches, 1 / 240, 3.0, 360).bodies
    assert motion.orientations[10, 0] < 0.5
    assert abs(motion.orientations[-1, 0]) <= 1e-6
    np.testing.assert_allclose(motion.positions[-1, 0], [0.0, 0.1], atol=1e-6)
    assert np.abs(motion.velocities[-1]).max() <= 1e-6
    half = turned(motion.orientations[:, 0], np.tile([-0.5, 0.0], (361, 1)))
    assert np.abs(motion.positions[:, 0] + half - pivot).max() <= 1e-8


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_two_joined_boxes_fall_on_a_floor(restitution):
    """They hang together by a point in the gap between them, bounce, and lie down side by side; energy never rises."""
    bodies = pbd.bodies([pbd.Box((0.4, 0.2))] * 2, [(-0.25, 0.6), (0.25, 0.6)], velocities=[(0.2, 0.0)] * 2)
    joint = pbd.ball_joint(bodies, [(0, 1)], [(0.0, 0.6)])
    contacts = pbd.contacts(bodies, FLOOR, friction=0.5, restitution=restitution)
    motion = run(bodies, [joint, contacts], 1 / 240, 5.0, 600).bodies
    reach = turned(motion.orientations, np.broadcast_to([0.25, 0.0], motion.positions.shape))
    apart = motion.positions[:, 1] - reach[:, 1] - motion.positions[:, 0] - reach[:, 0]
    assert np.abs(apart).max() <= 1e-6
    np.testing.assert_allclose(motion.positions[-1, :, 1], 0.1, atol=1e-5)
    assert np.abs(motion.velocities[-1]).max() <= 1e-5
    kept = energy(bodies, motion)
    assert np.diff(kept).max() <= 1e-3 * kept[0]


def lean_on_a_ball():
    """A box hinged to a fixed one sinks onto a ball on the floor, in space."""
    bodies = pbd.bodies(
        [pbd.Box((0.4, 0.4, 0.4)), pbd.Box((1.0, 0.1, 0.4)), pbd.Ball(0.2)],
        [(0.0, 1.0, 0.0), (0.8, 1.0, 0.0), (1.2, 0.2, 0.0)],
        fixed=[0],
    )
    hinge = pbd.hinge(bodies, [(0, 1)], [(0.25, 1.0, 0.0)], [(0.0, 0.0, 1.0)])
    contacts = pbd.contacts(bodies, pbd.planes((0.0, 1.0, 0.0)), friction=0.6)
    motion = run(bodies, [hinge, contacts], 1 / 240, 2.0, 120).bodies
    assert np.abs(motion.positions[:, 0] - [0.0, 1.0, 0.0]).max() == 0.0
    assert motion.positions[-1, 1, 1] < 0.9
    assert np.abs(motion.orientations[:, 1, 1:3]).max() <= 1e-9, "it turns about its axis only"
    arm = rotated(motion.orientations[:, 1], np.tile([-0.55, 0.0, 0.0], (121, 1)))
    assert np.abs(motion.positions[:, 1] + arm - [0.25, 1.0, 0.0]).max() <= 1e-7


def test_a_box_hinged_to_a_fixed_one_leans_on_a_ball_in_space():
    """As plain Python, which takes a tenth of the time to compile it; as a kernel joints meet contacts in the plane."""
    in_plain_python("t.lean_on_a_ball()")


# ------------------------------------------------------------------ anything


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), d=st.sampled_from([2, 3]), kind=st.sampled_from(["ball", "distance"]))
def test_random_trees_hold_together_and_gain_no_energy(seed, d, kind):
    """Six bodies, hung from the world or falling, under gravity; the default solver."""
    rng = np.random.default_rng(seed)
    bodies = free_bodies(rng, 6, d)
    hung = [(0, -1)] if rng.integers(2) else []
    joint = joined(bodies, hung + [(int(rng.integers(0, k)), k) for k in range(1, 6)], kind)
    outcome = run(bodies, [joint], 1 / 480, 2.0, 960, pbd.ConjugateSweeps(), 10)
    assert np.abs(outcome.scene.batches[0].rows.number[at.ERROR]).max() <= 1e-7
    kept = energy(bodies, outcome.bodies)[1:]
    scale = kinetic(bodies, outcome.bodies).max()
    assert (kept - kept[0]).max() <= 0.02 * scale


def test_errors_are_undone_at_the_rate_of_a_whole_sub_step():
    """In a part of one, up to an impact, where a spring keeps its law. And what an impact took is not remembered."""
    bodies = pbd.bodies([pbd.Box((1.0, 1.0))], [(1.0, 0.0)])
    state = State(None, bodies, np.zeros(WORK, dtype=np.int64), np.zeros(SIGNALS))
    for compliance, length in ((0.0, 1e-2), (10.0, 1e-4)):
        joint = pbd.distance_joint(bodies, [(-1, 0)], [(0.0, 0.0)], [(1.0, 0.0)], 0.5, compliance)
        number = joint.rows.number[:, 0, 0]
        joint.mark(state)
        joint.foresee(state, 1e-4, 1e-2)
        theta = 1.0 if compliance == 0.0 else 0.5
        assert number[at.BIAS] == pytest.approx(0.5 / (theta * length), rel=1e-6)
        number[at.IMPULSE] = 3.0
        joint.settle(state, 1e-2, False)
        assert number[at.FORCE] == 0.0
        joint.settle(state, 1e-2, True)
        assert number[at.FORCE] == 600.0


def in_plain_python(code):
    """What a program prints, of this module ``t``, that is not compiled."""
    head = "import sys, numba, numpy as np; sys.path.insert(0, sys.argv[1]); import test_joints as t\n"
    command = [sys.executable, "-c", f"{head}assert numba.config.DISABLE_JIT\n{code}", str(Path(__file__).parent)]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr
    return done.stdout


PLAIN = """
with_contacts = t.with_contacts
for make in (t.plane_pendulum, t.space_pendulum, t.hinged, t.rod_pendulum):
    bodies, joint = make()
    motions = []
    for t.with_contacts in (with_contacts, lambda bodies, batches: batches):
        motions.append(t.everything(t.run(bodies, [joint], 0.01, 0.05, 1, iterations=4)))
    assert all(np.array_equal(one, other) for one, other in zip(*motions)), "idle contacts do nothing"
    x, _, _, spins = motions[1]
    print(*x[-1].ravel().tolist(), *spins[-1].ravel().tolist())
"""


def test_plain_python_gives_the_same_numbers():
    """Of joints alone; the compiled ones have the idle contacts of `with_contacts`."""
    lines = in_plain_python(PLAIN).splitlines()
    for make, line in zip((plane_pendulum, space_pendulum, hinged, rod_pendulum), lines, strict=True):
        bodies, joint = make()
        motion = run(bodies, [joint], 0.01, 0.05, 1, iterations=4).bodies
        compiled = [*motion.positions[-1].ravel(), *motion.spins[-1].ravel()]
        np.testing.assert_allclose([float(number) for number in line.split()], compiled, rtol=1e-11, atol=1e-12)


# ------------------------------------------------------------------ input


def two(d=2, fixed=()):
    return pbd.bodies([pbd.Box((1.0,) * d)] * 2, np.eye(2, d), fixed=fixed)


POINT, AXES = [(0.0, 0.0)], [(0.0, 0.0, 1.0)]
BAD = {
    "index too great": (lambda: pbd.ball_joint(two(), [(0, 2)], POINT), "pairs = 2"),
    "index too small": (lambda: pbd.ball_joint(two(), [(0, -2)], POINT), "pairs = -2"),
    "index not whole": (lambda: pbd.ball_joint(two(), [(0, 0.5)], POINT), "pairs"),
    "three bodies": (lambda: pbd.ball_joint(two(), [(0, 1, -1)], POINT), "pairs"),
    "one pair, not a list": (lambda: pbd.ball_joint(two(), (0, 1), POINT), "pairs"),
    "a body with itself": (lambda: pbd.ball_joint(two(), [(1, 1)], POINT), "two bodies, one of them movable"),
    "the world with itself": (lambda: pbd.ball_joint(two(), [(None, -1)], POINT), "two bodies, one of them movable"),
    "nothing movable": (lambda: pbd.ball_joint(two(fixed=[0]), [(0, None)], POINT), "two bodies, one of them movable"),
    "too few anchors": (lambda: pbd.ball_joint(two(), [(0, 1), (1, -1)], POINT), "anchors"),
    "anchors in space": (lambda: pbd.ball_joint(two(), [(0, 1)], [(0.0, 0.0, 0.0)]), "anchors"),
    "anchor not finite": (lambda: pbd.ball_joint(two(), [(0, 1)], [(0.0, np.nan)]), "anchors[0, 1] = nan"),
    "compliance negative": (lambda: pbd.ball_joint(two(), [(0, 1)], POINT, -1e-9), "compliance = -1e-09"),
    "compliance infinite": (lambda: pbd.ball_joint(two(), [(0, 1)], POINT, np.inf), "compliance"),
    "compliances too many": (lambda: pbd.ball_joint(two(), [(0, 1)], POINT, [0.0, 0.0]), "compliance"),
    "hinge in the plane": (lambda: pbd.hinge(two(), [(0, 1)], POINT, AXES), "in 2D a ball_joint is one"),
    "axis of length 0": (lambda: pbd.hinge(two(3), [(0, 1)], [(0.0,) * 3], [(0.0,) * 3]), "axes = [0.0, 0.0, 0.0]"),
    "axes missing": (lambda: pbd.hinge(two(3), [(0, 1)], [(0.0,) * 3], np.zeros((0, 3))), "axes"),
    "ends that coincide": (lambda: pbd.distance_joint(two(), [(0, 1)], POINT, POINT), "use ball_joint"),
    "length 0": (lambda: pbd.distance_joint(two(), [(0, 1)], POINT, [(1.0, 0.0)], 0.0), "lengths = 0.0"),
    "length not a number": (lambda: pbd.distance_joint(two(), [(0, 1)], POINT, [(1.0, 0.0)], "long"), "lengths"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_one_line(case):
    make, says = BAD[case]
    with pytest.raises(pbd.InvalidInput) as refused:
        make()
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_no_joints_at_all():
    bodies = two()
    motion = run(bodies, [pbd.ball_joint(bodies, [], np.zeros((0, 2)))], 0.1, 1.0).bodies
    np.testing.assert_allclose(motion.positions[-1, :, 1], [-0.5 * G, 1.0 - 0.5 * G])


def test_a_length_that_is_not_the_distance_is_restored():
    """A rod that starts half as long again pulls its box in within a step, and hands it no speed along itself."""
    bodies, _ = rod_pendulum()
    end = 0.7 * turned(np.array(-1.0), np.array([1.0, 0.0]))
    joint = pbd.distance_joint(bodies, [(-1, 0)], [(0.0, 0.0)], [end], lengths=0.6)
    outcome = run(bodies, [joint], 1 / 240, 1.0, 240)
    ends = outcome.bodies.positions[:, 0] + turned(outcome.bodies.orientations[:, 0], np.tile(PIVOT, (241, 1)))
    assert np.linalg.norm(ends[0]) == pytest.approx(0.7)
    np.testing.assert_allclose(np.linalg.norm(ends[1:], axis=1), 0.6, atol=1e-9)
    assert energy(bodies, outcome.bodies)[1:].max() <= energy(bodies, outcome.bodies)[0] + 0.15 * G
