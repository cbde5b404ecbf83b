"""What a step must keep: momentum, rigid motion, the place of pinned particles.

P = sum m v is kept by whole steps. L is kept by every projection - sum r x m dp = 0 at the positions it
sees - and by rigid-mode damping, but not by a whole step: v = (p - x)/h damps rotation, by a law of its
own that is tested here too.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import pbd
from pbd.constraints.distance import Pairs, pair
from pbd.projection import project
from pbd.state import State
from pbd.vector import from_store

EPS = 1e-12
MASSES = np.array([1.0, 0.3, 7.0, 2.0, 50.0, 0.9])
PAIRS = [(0, 1), (1, 2), (2, 0), (3, 2), (3, 4), (4, 5), (5, 0), (1, 4)]
LAWS = [pbd.Stiffness(), pbd.Stiffness(0.3), pbd.Compliance(1e-3), pbd.Compliance(1e-3, 20.0)]


def cloud(dimension, *, spread=1.0, speed=1.0, pinned=()):
    """Six unequal particles with random positions and velocities."""
    rng = np.random.default_rng(5)
    x, v = spread * rng.normal(size=(6, 3)), speed * rng.normal(size=(6, 3))
    return pbd.particles(x[:, :dimension], masses=MASSES, velocities=v[:, :dimension], pinned=pinned)


def net(particles):
    """Every law on its own pairs; rest lengths that the cloud violates by up to 30 %."""
    x = from_store(particles.x)
    factor = np.linspace(0.7, 1.3, len(PAIRS))
    batches = []
    for n, law in enumerate(LAWS):
        pairs = np.array(PAIRS[2 * n : 2 * n + 2])
        rest = factor[2 * n : 2 * n + 2] * np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
        batches.append(pbd.distance(particles, pairs, rest_length=rest, law=law))
    return batches


def cross(a, b):
    """a x b of rows, lifted to 3D."""
    lifted = [np.pad(np.asarray(u), [(0, 0)] * (np.ndim(u) - 1) + [(0, 3 - np.shape(u)[-1])]) for u in (a, b)]
    return np.cross(*lifted)


def momentum(v, masses=MASSES):
    return masses @ v


def spin(x, v, masses=MASSES):
    return masses @ cross(x, v)


def scale(outcome):
    """The size that momentum errors are relative to: sum of |m v|."""
    return float((MASSES[:, None] * np.abs(outcome.velocities)).sum(axis=(1, 2)).max())


# ------------------------------------------------------------------ constraints


@pytest.mark.parametrize("dimension", [2, 3])
def test_steps_keep_linear_momentum(dimension):
    """Free-floating, unequal masses, every law at once: sum m v changes by round-off alone (claim 17)."""
    particles = cloud(dimension)
    settings = pbd.Settings(dt=0.01, iterations=3, substeps=2)
    outcome = pbd.Simulation(particles, net(particles), gravity=np.zeros(dimension), settings=settings).run(50)
    p = np.array([momentum(v) for v in outcome.velocities])
    # the kinetic energy does change, so the constraints did act
    assert np.ptp((MASSES[:, None] * outcome.velocities**2).sum(axis=(1, 2))) > 1.0
    assert np.abs(np.diff(p, axis=0)).max() <= EPS * scale(outcome)


@pytest.mark.parametrize("dimension", [2, 3])
def test_projections_keep_both_momenta(dimension):
    """Each projection alone: sum m dp = 0 and sum r x m dp = 0, r before and after it (claim 17)."""
    particles = cloud(dimension)
    for batch in net(particles):
        for c in range(batch.size()):
            one = batch._replace(pairs=Pairs(*np.array(pair(batch.pairs, c))[:, None]), rest=batch.rest[c : c + 1])
            bound = one._replace(law=one.law.bind(1, 1))
            before = from_store(particles.p)
            project(bound, State(particles, None, np.zeros(1, dtype=np.int64)), 0.01)
            moved = from_store(particles.p) - before
            assert np.abs(moved).max() > 1e-4
            for arms in (before, before + moved):
                assert np.abs(momentum(moved)).max() <= EPS
                assert np.abs(spin(arms, moved)).max() <= EPS


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_step_from_rest_of_one_constraint_keeps_angular_momentum(dimension):
    """With v = 0 the ray x -> p is along the constraint, and nothing turns."""
    particles = cloud(dimension, speed=0.0)
    batch = pbd.distance(particles, [(1, 4)], rest_length=0.5)
    settings = pbd.Settings(dt=0.01)
    outcome = pbd.Simulation(particles, [batch], gravity=np.zeros(dimension), settings=settings).run(1)
    assert np.abs(outcome.velocities[1]).max() > 1.0
    assert np.abs(momentum(outcome.velocities[1])).max() <= EPS * scale(outcome)
    assert np.abs(spin(outcome.positions[1], outcome.velocities[1])).max() <= EPS * scale(outcome)


def test_rotation_of_a_rod_is_damped_by_its_own_law():
    """v = (p - x)/h: the first step turns by atan(omega h), and each next by atan(sin a / (2 - cos a)).

    The discrete answer for a spinning rod: p = 2 x_n - x_(n-1) after the first step, pulled back radially.
    """
    h, omega, steps = 0.01, 5.0, 100
    particles = pbd.particles([[-0.5, 0.0], [0.5, 0.0]], velocities=[[0.0, -0.5 * omega], [0.0, 0.5 * omega]])
    batch = pbd.distance(particles, [(0, 1)])
    settings = pbd.Settings(dt=h)
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, 0.0), settings=settings).run(steps)
    turns = [math.atan(omega * h)]
    for _ in range(steps - 1):
        turns.append(math.atan(math.sin(turns[-1]) / (2.0 - math.cos(turns[-1]))))
    angle = np.cumsum([0.0, *turns])
    np.testing.assert_allclose(outcome.positions[:, 1], 0.5 * np.column_stack([np.cos(angle), np.sin(angle)]), atol=EPS)
    found = [spin(x, v, np.ones(2))[2] for x, v in zip(outcome.positions, outcome.velocities, strict=True)]
    np.testing.assert_allclose(found[1:], 0.5 * np.sin(turns) / h, rtol=1e-10)
    assert found[-1] < 0.9 * found[0]


def test_loss_of_angular_momentum_is_of_first_order():
    """Over a fixed time, the loss of the whole net is proportional to h."""
    particles = cloud(2, speed=0.3)
    x = from_store(particles.x)
    rest = [np.linalg.norm(x[i] - x[j]) for i, j in PAIRS]
    losses, counts = [], np.array([1000, 2000, 4000, 8000])
    for count in counts:
        batch = pbd.distance(particles, PAIRS, rest_length=rest, law=pbd.Compliance(0.01))
        settings = pbd.Settings(dt=0.2 / count, iterations=4)
        outcome = pbd.Simulation(particles, [batch], gravity=(0.0, 0.0), settings=settings).run(int(count), [0, count])
        start, end = (spin(outcome.positions[n], outcome.velocities[n])[2] for n in (0, 1))
        losses.append(abs(end - start))
    assert np.polyfit(np.log(1.0 / counts), np.log(losses), 1)[0] == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("dimension", [2, 3])
def test_pinned_particles_never_move(dimension):
    """Neither gravity nor any law moves what is pinned; bit for bit."""
    particles = cloud(dimension, speed=0.0, pinned=[2, 5])
    settings = pbd.Settings(dt=0.01, iterations=3)
    gravity = -9.81 * np.eye(dimension)[1]
    outcome = pbd.Simulation(particles, net(particles), gravity=gravity, settings=settings).run(100)
    assert outcome.status == "ok"
    assert np.array_equal(
        outcome.positions[:, [2, 5]], np.broadcast_to(outcome.positions[0, [2, 5]], (101, 2, dimension))
    )
    assert not outcome.velocities[:, [2, 5]].any()
    assert np.abs(outcome.positions[-1, [0, 1, 3, 4]] - outcome.positions[0, [0, 1, 3, 4]]).max() > 0.1


# ------------------------------------------------------------------ damping


def damped(particles, k, *, steps=1, plain=False):
    """Velocities and positions under damping alone."""
    dimension = len(particles.x)
    settings = pbd.Settings(dt=0.01, damping=pbd.Damping(k, plain=plain))
    outcome = pbd.Simulation(particles, gravity=np.zeros(dimension), settings=settings).run(steps)
    assert outcome.status == "ok"
    return outcome


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("k", [0.1, 0.5, 1.0])
def test_rigid_mode_damping_keeps_both_momenta_and_lowers_the_energy(dimension, k):
    """Mueller et al. 2006, section 3.5 (claim 19)."""
    outcome = damped(cloud(dimension), k, steps=20)
    p = np.array([momentum(v) for v in outcome.velocities])
    spins = np.array([spin(x, v) for x, v in zip(outcome.positions, outcome.velocities, strict=True)])
    assert np.abs(np.diff(p, axis=0)).max() <= EPS * scale(outcome)
    assert np.abs(np.diff(spins, axis=0)).max() <= EPS * scale(outcome) * np.abs(outcome.positions).max()
    energy = 0.5 * (MASSES[:, None] * outcome.velocities**2).sum(axis=(1, 2))
    assert energy[1] < energy[0]
    assert np.all(np.diff(energy) <= EPS * energy[0])


@pytest.mark.parametrize("dimension", [2, 3])
def test_full_rigid_mode_damping_leaves_a_rigid_motion(dimension):
    """k = 1: no pair of particles approaches or parts, yet the set still turns."""
    particles = cloud(dimension)
    outcome = damped(particles, 1.0)
    x, v = outcome.positions[0], outcome.velocities[1]
    arms, relative = x[:, None] - x[None], v[:, None] - v[None]
    assert np.abs((arms * relative).sum(axis=2)).max() <= EPS
    assert np.abs(relative).max() > 0.1


@pytest.mark.parametrize("dimension", [2, 3])
def test_rigid_mode_damping_does_not_touch_a_rigid_motion(dimension):
    x = from_store(cloud(dimension).x)
    omega = np.array([0.3, -0.2, 0.7]) if dimension == 3 else np.array([0.0, 0.0, 0.7])
    v = (cross(np.broadcast_to(omega, (6, 3)), x) + [1.0, -2.0, 0.5])[:, :dimension]
    outcome = damped(pbd.particles(x, masses=MASSES, velocities=v), 1.0)
    np.testing.assert_allclose(outcome.velocities[1], v, atol=EPS)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_collinear_sets_have_no_null_spin(dimension, count):
    """One particle, two, a line far from the origin: the pseudo-inverse stays finite and keeps L."""
    direction = np.array([1.0, 2.0, -0.5])[:dimension]
    x = np.array([3.0, -40.0, 5.0])[:dimension] + np.arange(count)[:, None] * direction
    v = np.random.default_rng(1).normal(size=(count, dimension))
    outcome = damped(pbd.particles(x, velocities=v, masses=MASSES[:count]), 1.0)
    after = outcome.velocities[1]
    assert np.abs(after).max() <= 2.0 * np.abs(v).max()
    size = MASSES[:count].sum() * 40.0
    np.testing.assert_allclose(momentum(after, MASSES[:count]), momentum(v, MASSES[:count]), atol=EPS * size)
    before = spin(x, v, MASSES[:count])
    np.testing.assert_allclose(spin(outcome.positions[1], after, MASSES[:count]), before, atol=EPS * size)
    # the line stays a line of constant length
    assert abs((x[-1] - x[0]) @ (after[-1] - after[0])) <= 1e-11
    if count == 1:
        np.testing.assert_allclose(after, v, atol=1e-11)


@pytest.mark.parametrize("dimension", [2, 3])
def test_coincident_particles_stay_finite(dimension):
    v = np.random.default_rng(1).normal(size=(3, dimension))
    outcome = damped(pbd.particles(np.ones((3, dimension)), velocities=v), 1.0)
    np.testing.assert_allclose(outcome.velocities[1], np.broadcast_to(v.mean(axis=0), v.shape), atol=1e-11)


def test_rigid_mode_damping_leaves_pinned_particles_out():
    particles = cloud(2, pinned=[4])
    outcome = damped(particles, 1.0)
    np.testing.assert_allclose(outcome.velocities[1, 4], outcome.velocities[0, 4], atol=EPS)
    free = [0, 1, 2, 3, 5]
    before, after = (momentum(outcome.velocities[n, free], MASSES[free]) for n in (0, 1))
    np.testing.assert_allclose(after, before, atol=1e-11)


@pytest.mark.parametrize("plain", [True, False])
def test_damping_does_not_brake_what_is_driven(plain):
    """A pinned particle follows its own velocity, whatever damps the others."""
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0]], velocities=[[0.0, 2.0], [1.0, 2.0]], pinned=[0])
    outcome = damped(particles, 0.5, steps=10, plain=plain)
    np.testing.assert_allclose(outcome.positions[:, 0, 1], 2.0 * outcome.times, atol=EPS)


@pytest.mark.parametrize("k", [0.1, 0.7])
def test_plain_damping_removes_exactly_k_of_the_momentum(k):
    """v <- (1 - k) v takes the fraction k of P and L: why it fails where rigid modes matter (claim 20)."""
    outcome = damped(cloud(2), k, plain=True)
    np.testing.assert_allclose(
        momentum(outcome.velocities[1]), (1.0 - k) * momentum(outcome.velocities[0]), rtol=EPS, atol=1e-11
    )
    before, after = (spin(outcome.positions[n], outcome.velocities[n])[2] for n in (0, 1))
    assert after == pytest.approx((1.0 - k) * before, rel=1e-11)
