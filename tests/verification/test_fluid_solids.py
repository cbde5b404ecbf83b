"""Fluids with solids made of particles: sums by brute force, momentum, floating bodies, and pinned particles."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pbd
from pbd.fluid.kernels import lattice_sum, new_kernel, profile
from pbd.jit import kernel
from pbd.projection import begin, project
from pbd.state import State
from pbd.vector import from_store

pytestmark = pytest.mark.slow

G = 9.81
S = 0.05
"""[m] Spacing."""

RHO = 1000.0
WALLS = {"normal": [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]]}


def block(counts, corner=0.0):
    """(n, d) a lattice, half a spacing from its corner [m]."""
    axes = [(np.arange(count) + 0.5) * S for count in counts]
    return corner + np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(counts))


@kernel
def one_pass(fluid, state, h):
    begin(fluid, state, h)
    project(fluid, state, h)


@pytest.mark.parametrize("d", [2, 3])
def test_one_pass_against_all_pairs(d):
    """w_k sum_i l_i grad_k C_i over fluid i, l_i with each particle's own w; solids light, heavy and pinned."""
    rng = np.random.default_rng(5)
    x = rng.uniform(0.0, S * 60 ** (1 / d), (60, d))
    solids = rng.permutation(60)[:20]
    masses = np.ones(60)
    masses[solids] = rng.uniform(0.2, 5.0, 20)
    particles = pbd.particles(x, masses=masses, pinned=solids[:5])
    fluid = pbd.density(particles, spacing=S, solids=solids, omega=0.7)
    state = State(particles, None, np.zeros(4, dtype=np.int64))
    one_pass(fluid._replace(law=fluid.law.bind(fluid.size(), 1)), state, 0.01)
    density, gradients = all_pairs(x)
    multiplier = -0.7 * np.maximum(density - 1.0, 0.0) / np.einsum("j,ijk->i", particles.w, gradients**2)
    multiplier[solids] = 0.0
    moved = particles.w[:, None] * np.einsum("i,ijk->jk", multiplier, gradients)
    assert from_store(particles.p) - x == pytest.approx(moved, abs=1e-12 * S)
    assert np.abs(moved[solids[5:]]).max() > 0.01 * S
    assert np.array_equal(from_store(particles.p)[solids[:5]], x[solids[:5]])
    assert state.work[0] == 40


def all_pairs(x):
    """(density (n,), grad_j C_i (n, n, d)) from all pairs."""
    n, d = x.shape
    form = new_kernel("wendland", 2.5 * S, d)
    volume = S**d / lattice_sum(form, S, d)
    apart = x[:, None] - x[None]
    r = np.linalg.norm(apart, axis=-1)
    w, drop = profile(form, r.ravel())
    gradients = np.where(r > 0, drop.reshape(n, n) / np.where(r > 0, r, 1.0), 0.0)[..., None] * apart * volume
    gradients[np.arange(n), np.arange(n)] = -gradients.sum(axis=1)
    return volume * w.reshape(n, n).sum(axis=1), gradients


def flow(water, body, relative, *, steps, fixed=(), velocities=0.0, gravity=(0.0, -G), dt=2e-3, offset=(-9.0,) * 3):
    """(run, masses) of fluid, a body of a density relative to its own, and ``fixed`` particles, in this order."""
    n, solid = len(water), len(water) + np.arange(len(body))
    x = np.concatenate([water, body, np.reshape(fixed, (-1, 2))])
    masses = np.full(len(x), RHO * S**2)
    masses[solid] *= relative
    particles = pbd.particles(x, masses=masses, velocities=velocities, pinned=np.arange(n + len(body), len(x)))
    solids = np.arange(n, len(x))
    fluid = pbd.density(particles, spacing=S, solids=solids, viscosity=0.05, offset=offset, **WALLS)
    batches = [fluid, pbd.shape_matching(particles, [solid])]
    settings = pbd.Settings(dt=dt, iterations=4)
    return pbd.Simulation(particles, batches, gravity=gravity, settings=settings).run(steps), masses


def test_momentum_of_a_blob_that_hits_a_lighter_body():
    """To round-off, also through viscosity and shape matching, which keeps the body's shape."""
    water = block((8, 8), (-8.5 * S, -4.0 * S))
    water += np.random.default_rng(7).uniform(-0.2, 0.2, water.shape) * S
    body = block((6, 6), (0.5 * S, -2.0 * S))
    v = np.repeat([[1.0, 0.2], [-1.0, 0.0]], [len(water), len(body)], axis=0)
    out, masses = flow(water, body, 0.4, steps=40, velocities=v, gravity=(0.0, 0.0))
    momentum = masses @ out.velocities
    assert np.abs(out.velocities[-1, 64:] - v[64:]).max() > 0.5
    assert np.abs(momentum - momentum[0]).max() <= 1e-12 * (masses @ np.abs(out.velocities)).sum(axis=1).max()
    sides = np.linalg.norm(out.positions[:, 64:, None] - out.positions[:, None, 64:], axis=-1)
    assert np.ptp(sides, axis=0).max() < 1e-9


WIDTH, DEPTH, SIDE = 30, 15, 8
"""Of the tank, of its water and of the floating box, in spacings."""


def floated(relative, duration=10.0):
    """(centre of the box under the water's level, its tilt [rad]): (s,) over the second half of the time."""
    across, down = (WIDTH - SIDE) // 2, round(relative * SIDE)
    body = block((SIDE, SIDE), (across * S, (DEPTH - down) * S))
    water = block((WIDTH, DEPTH))
    inside = np.all(np.abs(water - body.mean(axis=0)) < 0.5 * SIDE * S, axis=1)
    water = water[~inside]
    n = len(water)
    dt = 0.16 * S / math.sqrt(DEPTH * S * G)
    steps = round(duration / dt)
    offset = (0.0, -WIDTH * S, 0.0)
    out, _ = flow(water, body, relative, steps=steps, dt=dt, offset=offset)
    half = out.positions[steps // 2 :]
    level = (n + relative * SIDE**2) * S / WIDTH
    edge = half[:, n + SIDE * (SIDE - 1)] - half[:, n]
    return level - half[:, n:, 1].mean(axis=1), np.arctan2(edge[:, 1], edge[:, 0])


@pytest.mark.parametrize(
    ("relative", "under", "tilt"),
    [
        (0.8, 0.3 * SIDE, 0.0),
        (0.5, 0.0, math.pi / 4),
        (0.3, (math.sqrt(0.3) - math.sqrt(0.5)) * SIDE, math.pi / 4),
    ],
)
def test_box_floats_at_the_depth_of_archimedes(relative, under, tilt):
    """Within half a spacing; a square of relative density 0.28 to 0.72 turns towards its edge, in some 10 s."""
    depth, turned = floated(relative)
    assert depth.mean() == pytest.approx(under * S, abs=0.5 * S)
    assert np.ptp(depth) < S
    assert abs(turned.mean()) == pytest.approx(tilt, abs=0.25)


def test_basin_of_pinned_particles_holds_water():
    """Two layers of them, 10 spacings apart; the water, on which a small body floats, stays inside, at its density."""
    walls = block((14, 18), -2.0 * S)
    walls = walls[(walls[:, 0] < 0.0) | (walls[:, 0] > 10.0 * S) | (walls[:, 1] < 0.0)]
    water = block((10, 8))
    out, _ = flow(water, block((3, 3), (4.0 * S, 8.0 * S)), 0.5, steps=500, fixed=walls)
    n, final = len(water), out.positions[-1]
    assert np.array_equal(final[n + 9 :], walls)
    assert np.all(np.abs(final[: n + 9, 0] - 5.0 * S) < 5.2 * S)
    assert np.all((final[: n + 9, 1] > 0.0) & (final[: n + 9, 1] < 10.0 * S))
    density = pbd.densities(out.scene.batches[0], final)
    assert density.shape == (n,)
    assert density.max() < 1.005
    assert density[final[:n, 1] < 3.0 * S].mean() == pytest.approx(1.0, abs=5e-3)
