"""Boxes in a fluid: the density and its gradient about them, the way out of them, and a dam break against one."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pbd
from pbd.fluid.kernels import new_kernel
from pbd.fluid.wall_input import read_walls
from pbd.fluid.walls import beside_walls, hold_back, new_walls
from pbd.vector import from_store, to_store

pytestmark = pytest.mark.slow

G = 9.81
S = 0.05
"""[m] Spacing."""

H = 2.5 * S


def block(counts):
    """(n, d) a lattice, half a spacing from the axes."""
    axes = [(np.arange(count) + 0.5) * S for count in counts]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(counts))


def solids(d, boxes, normal=None, offset=0.0):
    """The walls of a fluid, as plain Python and kernels take them."""
    return new_walls(read_walls(normal, offset, boxes, H, d), new_kernel("wendland", H, d), S, d, 1)


def cube(d, low, high):
    return [([low] * d, [high] * d)]


@pytest.mark.parametrize(("d", "count", "low", "high"), [(2, 20, 7, 13), (3, 12, 4, 8)])
def test_lattice_about_a_box_has_rest_density(d, count, low, high):
    """Beside faces, edges and corners within 0.3 %, what the rows' smearing leaves."""
    x = block((count,) * d)
    x = x[~np.all((x > low * S) & (x < high * S), axis=1)]
    density = pbd.densities(pbd.density(pbd.particles(x), spacing=S, obstacles=cube(d, low * S, high * S)), x)
    bulk = np.all((x > H) & (x < count * S - H), axis=1)
    assert density[bulk] == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize("d", [2, 3])
def test_gradient_against_finite_differences(d):
    """About a box that stands on the floor; values and slopes of linear tables differ by this much."""
    walls, e = solids(d, cube(d, 0.0, 4.0 * S), np.eye(d)[-1]), 1e-6 * S
    rng, found = np.random.default_rng(1), 0
    for point in rng.uniform(-H, 4.0 * S + H, (200, d)):
        if point[-1] < 0.0 or np.all((point > 0.0) & (point < 4.0 * S)):
            continue
        found += 1
        _, gradient = beside_walls(walls, tuple(point))
        for axis in range(d):
            step = e * np.eye(d)[axis]
            up, down = (beside_walls(walls, tuple(point + side * step))[0] for side in (1.0, -1.0))
            assert gradient[axis] == pytest.approx((up - down) / (2.0 * e), abs=5e-3 / H)
    assert found > 50


def test_far_from_a_box_there_is_nothing():
    walls = solids(2, cube(2, 0.0, 4.0 * S))
    for point in ((-H, 2.0 * S), (4.0 * S + H, 5.0 * S), (9.0, 9.0)):
        assert beside_walls(walls, point) == (0.0, (0.0, 0.0))


@pytest.mark.parametrize("d", [2, 3])
def test_the_way_out_is_by_the_nearest_face(d):
    """And never down, where the box stands on the floor."""
    walls = solids(d, cube(d, 0.0, 4.0 * S), np.eye(d)[-1])
    inside = np.random.default_rng(2).uniform(0.0, 4.0 * S, (100, d))
    x = to_store(inside)
    for i in range(len(inside)):
        hold_back(walls, x, i)
    moved = from_store(x) - inside
    room = np.minimum(inside, 4.0 * S - inside)
    room[:, -1] = 4.0 * S - inside[:, -1]
    assert np.count_nonzero(moved, axis=1).max() == 1
    assert np.abs(moved).max(axis=1) == pytest.approx(room.min(axis=1), abs=1e-12)
    assert moved[:, -1].min() >= 0.0


def test_what_is_inside_counts_as_on_the_nearest_face():
    walls = solids(2, cube(2, 0.0, 6.0 * S))
    on, within = (beside_walls(walls, (t, 3.0 * S)) for t in (0.0, 0.4 * S))
    assert within[0] == pytest.approx(on[0])
    assert within[1] == pytest.approx(on[1])
    assert on[0] == pytest.approx(0.5, abs=1e-2), "as far as rows, smeared, are a lattice"


def test_dam_break_against_a_box():
    """It runs over the box or stops; nobody ends inside, energy only falls, the water comes to rest at its density."""
    width, column = 40, (10, 20)
    low, high = np.array([20.0, 0.0]) * S, np.array([24.0, 5.0]) * S
    x = block(column)
    particles = pbd.particles(x, masses=1000.0 * S**2)
    walls = {"normal": [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], "offset": [0.0, -width * S, 0.0]}
    fluid = pbd.density(particles, spacing=S, obstacles=[(low, high)], **walls)
    dt = 0.16 * S / math.sqrt(2.0 * column[0] * S * G)
    settings = pbd.Settings(dt=dt, iterations=4)
    out = pbd.Simulation(particles, [fluid], gravity=[0.0, -G], settings=settings).run(4000, np.arange(0, 4001, 20))
    assert out.status == "ok"
    inside = np.all((out.positions > low + 1e-12) & (out.positions < high - 1e-12), axis=2)
    assert not inside.any()
    assert out.positions.min() >= -1e-12
    energy = (0.5 * (out.velocities**2).sum(axis=-1) + G * out.positions[..., 1]).mean(axis=1)
    assert np.diff(energy).max() < 1e-3 * energy[0]
    assert np.any(out.positions[-1][:, 0] > high[0])
    assert pbd.densities(fluid, out.positions[-1]).max() < 1.01
