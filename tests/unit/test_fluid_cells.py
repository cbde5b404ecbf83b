"""The neighbour search: what is within h is a candidate, relations are mutual, nothing leads out of memory."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pbd.fluid.candidates import FAR, for_each, gather
from pbd.fluid.cells import cut, new_cells, sort, sorted_array
from pbd.jit import kernel
from pbd.vector import to_store

pytestmark = pytest.mark.slow

H = 0.1
DIMENSIONS = pytest.mark.parametrize("d", [2, 3])


class Listing(NamedTuple):
    """``found``_ij counts how often j is among the candidates of i, ``seen`` the particles that were visited."""

    cells: Any
    found: np.ndarray
    seen: np.ndarray

    def visit(self, k, first, last):
        self.seen[0] += 1
        for a in range(first, last):
            if self.cells.near[0][a] < 0.1 * FAR:
                self.found[self.cells.particle[k], int(self.cells.near[-1][a])] += 1


@kernel
def all_candidates(cells, x, values, found, seen):
    sort(cells, x)
    low, high = cut(cells, 0, 1)
    gather(cells, x, values, low, high)
    for k in range(cells.particle.shape[0]):
        values[-1][k] = cells.particle[k]
    for_each(cells, values, Listing(cells, found, seen), low, high)


def candidates(points, members=None):
    """(n, n) how often each is a candidate of each, and how many particles were seen."""
    n, d = points.shape
    cells = new_cells(np.arange(n) if members is None else members, d, H, 1)
    values = tuple(sorted_array(n) for _ in range(d + 1))
    found, seen = np.zeros((n, n), dtype=np.int64), np.zeros(1, dtype=np.int64)
    all_candidates(cells, to_store(points), values, found, seen)
    return found, int(seen[0])


def check(points):
    found, seen = candidates(points)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    assert seen == len(points)
    assert found.max() == 1
    assert np.all(found[apart < (1.0 - 1e-9) * H] == 1)
    assert np.array_equal(found, found.T)


@DIMENSIONS
@given(seed=st.integers(0, 10**6), n=st.integers(1, 120), size=st.floats(1e-3, 30.0), place=st.floats(-1e3, 1e3))
@settings(max_examples=60, deadline=None)
def test_candidates_hold_all_neighbours(d, seed, n, size, place):
    rng = np.random.default_rng(seed)
    check(place + size * H * rng.uniform(-1.0, 1.0, (n, d)))


@DIMENSIONS
def test_candidates_are_few_where_cells_suffice(d):
    points = np.random.default_rng(1).uniform(0.0, 1.0, (2000, d))
    found, _ = candidates(points)
    assert found.sum() <= 2000 + 2000**2 * 2.5 * H * (3.0 * H) ** (d - 1)


@DIMENSIONS
@pytest.mark.parametrize("far", [1e3, 1e9, 1e200])
def test_runaways_cost_no_neighbours(d, far):
    """Two particles that fly off leave the grid where the others are."""
    rng = np.random.default_rng(2)
    points = np.concatenate([rng.uniform(0.0, 1.0, (500, d)), [[far] * d, [-0.3 * far] * d]])
    found, seen = candidates(points)
    apart = np.linalg.norm(points[:500, None] - points[None, :500], axis=-1)
    assert seen == 502
    assert np.all(found[:500, :500][apart < 0.999 * H] == 1)
    assert found[:500, :500].sum() < 0.6 * 500**2


@DIMENSIONS
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_has_no_cells(d, bad):
    points = np.random.default_rng(3).uniform(0.0, 1.0, (50, d))
    points[17, d - 1] = bad
    assert candidates(points)[1] == 0


@DIMENSIONS
def test_coincident_particles_are_candidates(d):
    check(np.zeros((70, d)))


def test_members_alone_are_sorted():
    points = np.random.default_rng(4).uniform(0.0, 0.3, (40, 2))
    found, seen = candidates(points, np.arange(0, 40, 2))
    assert seen == 20
    assert found[1::2].sum() == found[:, 1::2].sum() == 0


CHECKED = """
import numpy as np, pbd
rng = np.random.default_rng(0)
for bad in (1e30, np.nan):
    for d in (2, 3):
        x = rng.uniform(0.0, 1.0, (60, d))
        v = np.zeros((60, d))
        v[7, 0] = 1e300 if bad != bad else bad
        p = pbd.particles(x, velocities=v)
        fluid = pbd.density(p, spacing=0.2, normal=[np.eye(d)[1]], viscosity=0.1, confinement=0.1, repulsion=0.1)
        if bad != bad:
            p.x[0][5] = bad
        out = pbd.Simulation(p, [fluid], gravity=[0.0] * d, settings=pbd.Settings(dt=0.01)).run(3)
        print(out.status)
"""


@pytest.mark.parametrize("variable", ["NUMBA_BOUNDSCHECK", "NUMBA_DISABLE_JIT"])
def test_no_index_leaves_memory(variable):
    """With every index checked - in plain Python those of lanes too - particles that are lost end as diverged."""
    environment = {**os.environ, variable: "1"}
    done = subprocess.run([sys.executable, "-c", CHECKED], env=environment, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["ok", "ok", "diverged", "diverged"]
