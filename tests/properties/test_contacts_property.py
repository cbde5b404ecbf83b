"""What holds for any few rigid bodies: they stay calm, and their motion has the symmetries of mechanics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pbd

G = 9.81
FAR = 1e6
seeds = st.integers(0, 2**32 - 1)
counts = st.integers(1, 5)


class Few:
    """A few bodies of random shape, mass, attitude and motion over a floor, between walls; ``spread`` is their room."""

    def __init__(self, seed, d, n, spread=1.5, moving=1.0):
        rng = np.random.default_rng(seed)
        self.d, self.n = d, n
        self.edges = rng.uniform(0.4, 1.0, (n, d))
        self.is_ball = rng.uniform(size=n) < 0.3
        self.positions = rng.uniform(-spread / 2, spread / 2, (n, d))
        self.positions[:, 1] += 0.7 + spread / 2
        self.masses = rng.uniform(0.5, 2.0, n)
        q = rng.normal(size=(n, 4))
        self.orientations = rng.uniform(-np.pi, np.pi, n) if d == 2 else q / np.linalg.norm(q, axis=1)[:, None]
        self.velocities = moving * rng.uniform(-1.0, 1.0, (n, d))
        self.spins = moving * rng.uniform(-3.0, 3.0, n if d == 2 else (n, 3))
        self.friction = rng.uniform(0.0, 1.0)
        self.normals = np.array([np.eye(d)[1], np.eye(d)[0], -np.eye(d)[0]])
        self.offsets = np.array([0.0, -2.0, -2.0])
        self.gravity = -G * np.eye(d)[1]
        self.mirror = 1.0 - 2.0 * np.eye(d)[0]

    def simulation(self, *, restitution=0.0, dt=1 / 64, substeps=1, depenetration=1.0, sweeps=10, tolerance=1e-6):
        shapes = [
            pbd.Ball(edges[0] / 2) if ball else pbd.Box(tuple(edges))
            for ball, edges in zip(self.is_ball, self.edges, strict=True)
        ]
        bodies = pbd.bodies(
            shapes,
            self.positions,
            masses=self.masses,
            orientations=self.orientations,
            velocities=self.velocities,
            spins=self.spins,
        )
        contacts = pbd.contacts(
            bodies,
            pbd.planes(self.normals, self.offsets),
            friction=self.friction,
            restitution=restitution,
            gravity=float(np.linalg.norm(self.gravity)),
            depenetration=depenetration,
        )
        chosen = pbd.Settings(
            dt=dt,
            substeps=substeps,
            iterations=sweeps,
            integrator=pbd.Rattle(),
            solver=pbd.ConjugateSweeps(sweeps, tolerance),
        )
        return pbd.Simulation(None, [contacts], bodies=bodies, gravity=self.gravity, settings=chosen)

    def run(self, steps=64, **chosen):
        outcome = self.simulation(**chosen).run(steps)
        assert outcome.status == "ok"
        return outcome.bodies

    def reaches(self):
        """(n,) radii of the bounding balls [m]."""
        return np.where(self.is_ball, self.edges[:, 0] / 2, np.linalg.norm(self.edges, axis=1) / 2)


def speeds(moving, reaches):
    """(s,) of the fastest point of all bodies, at most."""
    spins = np.abs(moving.spins) if moving.spins.ndim == 2 else np.linalg.norm(moving.spins, axis=2)
    return (np.linalg.norm(moving.velocities, axis=2) + spins * reaches).max(axis=1, initial=0.0)


def same(one, other, tolerance=0.0):
    """Bit for bit, or within a tolerance."""
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, rtol=0.0, atol=tolerance)


# ------------------------------------------------------------------ calm


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=counts)
def test_overlapping_starts_stay_calm(d, seed, n):
    """Bodies that start in one another are pushed apart, and are little faster than by falling."""
    few = Few(seed, d, n, spread=0.5, moving=0.0)
    moving = few.run(64, substeps=2)
    times = np.arange(65) / 64
    assert (speeds(moving, few.reaches()) <= 2.0 + 1.5 * G * times).all()


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("depth", [1e-3, 0.05, 0.3])
@pytest.mark.parametrize("shape", ["ball", "box"])
@pytest.mark.parametrize("d", [2, 3])
def test_what_starts_in_the_floor_does_not_jump(d, shape, depth, speed):
    """It is lifted to the floor, at 1 m/s at most, and has no speed there: whether it was at rest or going down."""
    few = Few(0, d, 1, moving=0.0)
    few.is_ball[:], few.edges[:], few.orientations = shape == "ball", 1.0, None
    few.positions[:] = (0.5 - depth) * np.eye(d)[1]
    few.velocities[:] = -speed * np.eye(d)[1]
    moving = few.run(64)
    heights = moving.positions[:, 0, 1] - 0.5
    assert np.abs(heights[-1]) <= 1e-9
    assert heights.max() <= 1e-9
    assert np.diff(heights).max() <= 1.0 / 64 + 1e-9
    assert np.abs(moving.velocities[1:]).max() <= 1e-9


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=25, deadline=None)
@given(seed=seeds)
def test_a_pair_that_overlaps_parts_without_speed(d, seed):
    """In free space; what was pushed is taken back, but for what turning makes of it."""
    few = Few(seed, d, 2, spread=0.6, moving=0.0)
    few.gravity[:] = 0.0
    few.offsets[:] = -FAR
    moving = few.run(64)
    assert speeds(moving, few.reaches())[1:].max() <= 0.5


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=counts)
def test_a_few_bodies_come_to_rest(d, seed, n):
    few = Few(seed, d, n, spread=2.5)
    few.friction = 0.5
    moving = few.run(64 * 6, substeps=4)
    lowest = (moving.positions[-1] @ few.normals.T - few.offsets).min()
    assert lowest >= 0.19  # half the shortest edge there can be: nothing is in a wall
    balls_roll = few.is_ball.any()
    assert balls_roll or speeds(moving, few.reaches())[-1] <= 1e-3


# ------------------------------------------------------------------ the same again


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=10, deadline=None)
@given(seed=seeds, n=counts)
def test_the_same_run_gives_the_same_bits(d, seed, n):
    few = Few(seed, d, n)
    made = few.simulation(restitution=0.3)
    same(made.run(48).bodies, made.run(48).bodies)
    same(made.run(48).bodies, few.simulation(restitution=0.3).run(48).bodies)


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=10, deadline=None)
@given(seed=seeds, n=counts)
def test_a_run_does_not_depend_on_what_is_sampled(d, seed, n):
    few = Few(seed, d, n)
    made = few.simulation()
    whole, end = made.run(48).bodies, made.run(48, [48]).bodies
    same([a[-1:] for a in whole], end)


# ------------------------------------------------------------------ units


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=15, deadline=None)
@given(seed=seeds, n=counts, restitution=st.sampled_from([0.0, 0.5]))
def test_time_has_no_unit(d, seed, n, restitution):
    """Twice as fast under four times the gravity: the same way in half the time."""
    few = Few(seed, d, n)
    slow = few.run(48, restitution=restitution, depenetration=1.0)
    few.velocities, few.spins, few.gravity = 2.0 * few.velocities, 2.0 * few.spins, 4.0 * few.gravity
    fast = few.run(48, restitution=restitution, dt=1 / 128, depenetration=2.0)
    same((slow.positions, slow.orientations), (fast.positions, fast.orientations), 1e-9)
    same((2.0 * slow.velocities, 2.0 * slow.spins, 4.0 * slow.loads), (fast.velocities, fast.spins, fast.loads), 1e-9)


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=15, deadline=None)
@given(seed=seeds, n=counts)
def test_mass_has_no_unit(d, seed, n):
    few = Few(seed, d, n)
    light = few.run(48)
    few.masses = 1024.0 * few.masses
    same(light._replace(loads=1024.0 * light.loads), few.run(48))


# ------------------------------------------------------------------ space
# Two bodies at most: pairs are found cell by cell, so that more come in another order elsewhere, and sweeps over them
# end elsewhere within their tolerance. In space a contact that slides is iterated, and what of it is left over may
# switch what pushes or slides; then the motions part, as they do in the plane where two corners meet.

TIGHT = {"sweeps": 50, "tolerance": 0.0, "substeps": 2}
SEEDS = range(40)


def mirrored(few):
    """x turned round."""
    few.positions = few.positions * few.mirror
    few.velocities = few.velocities * few.mirror
    if few.d == 2:
        few.orientations, few.spins = -few.orientations, -few.spins
    else:
        few.orientations = few.orientations * [1.0, 1.0, -1.0, -1.0]
        few.spins = few.spins * [1.0, -1.0, -1.0]
    return few


def assert_mostly(errors, largest):
    """Three in four at round-off, none far away."""
    assert np.quantile(errors, 0.75) <= 1e-11
    assert max(errors) <= largest


@pytest.mark.parametrize(("d", "n", "largest"), [(2, 1, 1e-11), (2, 2, 1e-11), (3, 1, 1e-3)])
def test_mirrored_bodies_move_as_in_the_mirror(d, n, largest):
    errors = []
    for seed in SEEDS:
        one, other = Few(seed, d, n).run(24, **TIGHT), mirrored(Few(seed, d, n)).run(24, **TIGHT)
        errors.append(np.abs(other.positions - one.positions * Few(seed, d, n).mirror).max())
    assert_mostly(errors, largest)


@pytest.mark.parametrize(("d", "n", "largest"), [(2, 1, 1e-11), (2, 2, 1e-11), (3, 1, 1e-3)])
def test_everything_may_be_elsewhere(d, n, largest):
    errors, shift = [], np.array([13.7, -5.3, 0.5])[:d]
    for seed in SEEDS:
        few = Few(seed, d, n)
        here = few.run(16, **TIGHT)
        few.positions, few.offsets = few.positions + shift, few.offsets + few.normals @ shift
        errors.append(np.abs(few.run(16, **TIGHT).positions - shift - here.positions).max())
    assert_mostly(errors, largest)


@pytest.mark.parametrize("d", [2, 3])
def test_everything_may_move_on(d):
    """Free bodies that hit each other, seen from a train: no floor, no gravity."""
    errors, train = [], np.array([0.25, -0.5, 0.125])[:d]
    way = np.arange(49)[:, None, None] / 64 * train
    for seed in SEEDS:
        few = Few(seed, d, 2)
        few.positions[1] += 2.0 * np.eye(d)[0]
        few.velocities[0] += 3.0 * np.eye(d)[0]
        few.gravity[:], few.offsets[:] = 0.0, -FAR
        still = few.run(48, **TIGHT)
        few.velocities = few.velocities + train
        errors.append(np.abs(few.run(48, **TIGHT).positions - way - still.positions).max())
    assert_mostly(errors, 1e-2)
