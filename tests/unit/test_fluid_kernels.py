"""Smoothing kernels and walls against quadrature, lanes against numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import dblquad, quad

from pbd.collision.plane import Planes
from pbd.fluid.kernels import KERNELS, lattice_sum, new_kernel, profile
from pbd.fluid.lanes import fused, inverse, lanes, no_lanes, positive, put_lanes, square_root, totals, width
from pbd.fluid.walls import beside_walls, new_walls, plane_integrals
from pbd.jit import kernel as compiled
from pbd.vector import to_store

H = 0.1
CASES = pytest.mark.parametrize(("name", "d"), [(name, d) for name in KERNELS for d in (2, 3)])


def sphere(d, r):
    return 2.0 * math.pi * r if d == 2 else 4.0 * math.pi * r**2


def at(form, r):
    w, drop = profile(form, np.array([r]))
    return float(w[0]), float(drop[0])


@CASES
def test_kernel_integrates_to_one(name, d):
    form = new_kernel(name, H, d)
    assert quad(lambda r: at(form, r)[0] * sphere(d, r), 0.0, H)[0] == pytest.approx(1.0, abs=1e-6)


@CASES
def test_gradient_has_the_moment_of_a_kernel_with_integral_one(name, d):
    """The integral of x . grad W is -d times that of W; spiky is the gradient of another W than poly6."""
    form = new_kernel(name, H, d)
    assert quad(lambda r: at(form, r)[1] * r * sphere(d, r), 0.0, H)[0] == pytest.approx(d, abs=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_gradient_of_wendland_is_its_derivative(d):
    form, r, e = new_kernel("wendland", H, d), np.linspace(0.05 * H, 0.95 * H, 19), 1e-6 * H
    slope = (profile(form, r - e)[0] - profile(form, r + e)[0]) / (2.0 * e)
    assert slope == pytest.approx(profile(form, r)[1], rel=1e-6)


@CASES
def test_kernel_ends_at_h(name, d):
    w, drop = profile(new_kernel(name, H, d), np.array([H, 1.1 * H, 1e15]))
    assert np.all(w == 0.0)
    assert np.all(drop == 0.0)


def test_value_at_the_centre_is_no_fraction():
    assert at(new_kernel("poly6_spiky", 0.1, 3), 0.0)[0] == pytest.approx(315 / (64 * math.pi * 0.1**3))


@CASES
def test_integral_over_planes(name, d):
    form, t = new_kernel(name, H, d), 0.3 * H

    def over_line(y):
        r = math.hypot(t, y)
        return 2.0 * at(form, min(r, H))[0]

    def over_plane(r):
        return 2.0 * math.pi * r * at(form, min(r, H))[0]

    reach = math.sqrt(H**2 - t**2)
    expected = quad(over_line, 0.0, reach)[0] if d == 2 else quad(over_plane, t, H)[0]
    assert float(plane_integrals(form, np.array([t]), d)[0][0]) == pytest.approx(expected, rel=1e-8)


def wall_of(form, spacing, d, normals):
    planes = Planes(to_store(np.array(normals, dtype=float)), np.zeros(len(normals)))
    return new_walls((planes, None), form, spacing, d, 1)


@CASES
def test_lattice_beside_a_wall_has_the_density_of_the_bulk(name, d):
    """Rows of a half-space of lattice and what the wall gives add up, but for the smearing along the wall."""
    s = H / 2.5
    form = new_kernel(name, H, d)
    walls = wall_of(form, s, d, [np.eye(d)[0]])
    grid = np.stack(np.meshgrid(*[np.arange(-3, 4)] * d, indexing="ij"), -1).reshape(-1, d) * s
    for row in range(3):
        inside = grid[grid[:, 0] >= -(row + 0.1) * s]
        own = profile(form, np.linalg.norm(inside, axis=1))[0].sum() * s**d
        given = beside_walls(walls, ((row + 0.5) * s,) + (0.0,) * (d - 1))[0]
        assert own + given == pytest.approx(lattice_sum(form, s, d), abs=3e-3 if name == "wendland" else 2e-2)


@pytest.mark.parametrize("d", [2, 3])
def test_wall_gradient_is_its_derivative(d):
    form = new_kernel("wendland", H, d)
    walls, e = wall_of(form, H / 2.5, d, [np.eye(d)[0], np.eye(d)[1]]), 1e-7 * H
    point = np.full(d, 0.31 * H)
    gradient = beside_walls(walls, tuple(point))[1]
    for axis in range(d):
        step = e * np.eye(d)[axis]
        slope = (beside_walls(walls, tuple(point + step))[0] - beside_walls(walls, tuple(point - step))[0]) / (2.0 * e)
        assert gradient[axis] == pytest.approx(slope, abs=1e-2 / H)


def test_corner_is_not_counted_twice():
    """What two walls at a right angle fill, against the integral of W over their union."""
    form = new_kernel("wendland", 1.0, 2)
    walls = wall_of(form, 0.02, 2, [[1.0, 0.0], [0.0, 1.0]])
    for a, b in ((0.0, 0.0), (0.0, 0.5), (0.1, 0.2), (1 / 3, 1 / 3), (0.6, 0.1)):
        free = dblquad(lambda y, x: at(form, min(math.hypot(x, y), 1.0))[0], -a, 1.0, -b, 1.0, epsabs=1e-5)[0]
        assert beside_walls(walls, (a, b))[0] == pytest.approx(1.0 - free, abs=1.4e-3)


@pytest.mark.parametrize("t", [0.0, -1.0, 0.99999999 * H, H, 5.0, math.inf, math.nan])
def test_wall_at_any_distance_stays_in_its_table(t):
    walls = wall_of(new_kernel("wendland", H, 2), H / 2.5, 2, [[1.0, 0.0]])
    filled, pull = beside_walls(walls, (t, 0.0))
    assert 0.0 <= filled <= 0.51
    assert np.all(np.isfinite(pull)) or not np.isfinite(t)


# ------------------------------------------------------------------ lanes


@compiled
def mixed(a, out):
    sums = no_lanes(a)
    for k in range(0, a.shape[0], width(a)):
        part = lanes(a, k)
        sums = fused(part - a[0], 2.0 * part, sums) + square_root(part * part) + inverse(positive(part) + 1.0)
    put_lanes(out, 1, sums)
    return totals((sums, 2.0 * sums, -1.0 * sums))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lanes_do_what_numpy_does(dtype):
    a, out = np.random.default_rng(0).normal(size=64).astype(dtype), np.zeros(20, dtype=dtype)
    expected = (a - a[0]) * 2 * a + abs(a) + 1 / (np.maximum(a, 0) + 1)
    whole = expected.sum() * np.array([1.0, 2.0, -1.0])
    assert mixed(a, out) == pytest.approx(whole, rel=20 * float(np.finfo(dtype).eps))
    count = 64 // a.itemsize
    assert out[1 : 1 + count] == pytest.approx(
        expected.reshape(-1, count).sum(axis=0), rel=20 * float(np.finfo(dtype).eps)
    )
    assert out[0] == 0.0
    assert np.all(out[1 + count :] == 0.0)
