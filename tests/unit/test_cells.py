"""The broad phase finds each near pair once, wherever the balls are, and never leaves its arrays."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pbd.collision import cells as broad
from pbd.collision.cells import find_pairs, new_cells
from pbd.jit import kernel
from pbd.vector import to_store

UNSURE = 1e-9
"""Pairs whose distance is so near to the limit, relative to the coordinates, may be found or not."""


@kernel
def found(cells, x, radius, margin, pairs):
    return find_pairs(cells, x, radius, margin, pairs)


def pairs_of(positions, radius, margin=0.0, capacity=None, cells=None):
    """(count, rows written) of points (n, d)."""
    n, d = positions.shape
    radius = np.broadcast_to(np.asarray(radius, dtype=float), (n,)).copy()
    pairs = np.full((n * n if capacity is None else capacity, 2), -1, dtype=np.int32)
    count = found(cells or new_cells(radius, d), to_store(positions), radius, margin, pairs)
    return count, pairs


def brute(positions, radius, margin):
    """(pairs surely near, pairs perhaps near) as sets."""
    n = len(positions)
    radius = np.broadcast_to(radius, (n,))
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    excess = distance - (radius[:, None] + radius[None] + margin)
    unsure = UNSURE * np.maximum(np.abs(positions).max(axis=1, initial=0.0), 1.0)[:, None]
    upper = np.triu(np.ones((n, n), dtype=bool), 1)
    sure, perhaps = (set(map(tuple, np.argwhere(upper & (excess <= t)).tolist())) for t in (-unsure, unsure))
    return sure, perhaps


def check(positions, radius, margin=0.0):
    count, pairs = pairs_of(positions, radius, margin)
    rows = list(map(tuple, pairs[:count].tolist()))
    assert all(i < j for i, j in rows)
    assert len(set(rows)) == len(rows), "a pair is found once"
    sure, perhaps = brute(positions, radius, margin)
    assert sure <= set(rows) <= perhaps
    return rows


@st.composite
def scenes(draw):
    """Clusters of balls of similar or of very different radii, far apart, on a grid, or all over the place."""
    d, n = draw(st.sampled_from([2, 3])), draw(st.integers(0, 80))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    spread = draw(st.sampled_from([0.0, 0.3, 3.0, 30.0, 1e4, 1e9]))
    centres = rng.uniform(-spread, spread, (max(1, n // draw(st.integers(1, 10))), d))
    positions = centres[rng.integers(len(centres), size=n)] + rng.uniform(-1.0, 1.0, (n, d))
    if draw(st.booleans()):
        positions = np.round(positions)
    radius = rng.uniform(0.1, 0.6, n) * np.where(rng.random(n) < draw(st.sampled_from([0.0, 0.1])), 100.0, 1.0)
    return positions, radius, draw(st.sampled_from([0.0, 0.05, 1.0]))


@settings(max_examples=300, deadline=None)
@given(scenes())
def test_the_pairs_are_those_of_brute_force(scene):
    check(*scene)


SHAPES = {
    2: {"block": (32, 32), "slab": (128, 8), "tall slab": (8, 128), "row": (1024, 1), "column": (1, 1024)},
    3: {"block": (10, 10, 10), "slab": (32, 32, 1), "wall": (1, 32, 32), "row": (1024, 1, 1), "column": (1, 1, 1024)},
}


def lattice_of(shape):
    axes = np.meshgrid(*[np.arange(count) for count in shape], indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, len(shape)) * 1.0


def candidates(cells):
    """How many distances were taken, a ball."""
    begin, mask = cells.start, len(cells.start) - broad.COPIES - 2
    own = [begin[c + 2] - k - 1 for k, c in enumerate(cells.key)]
    rows = [begin[row + 3] - begin[row] for c in cells.key for row in ((c + step) & mask for step in cells.rows)]
    return (sum(own) + sum(rows)) / len(cells.key)


@pytest.mark.parametrize(("d", "shape"), [(d, shape) for d in SHAPES for shape in SHAPES[d]])
def test_regions_of_any_proportions_cost_the_same(d, shape):
    rng = np.random.default_rng(1)
    grid = lattice_of(SHAPES[d][shape])
    most = 2.0 * {2: 4.5, 3: 13.5}[d]
    for turn in (np.eye(d), np.linalg.qr(rng.normal(size=(d, d)))[0]):
        positions = grid @ turn.T + rng.uniform(-0.2, 0.2, grid.shape)
        radius = np.full(len(grid), 0.5)
        cells = new_cells(radius, d)
        count, pairs = pairs_of(positions, radius, cells=cells)
        sure, perhaps = brute(positions, radius, 0.0)
        assert len(sure) > 100
        assert sure <= set(map(tuple, pairs[:count].tolist())) <= perhaps
        assert candidates(cells) <= most, "twice what half the neighbouring cells hold, with one ball each"


def test_one_ball_and_none():
    for d in (2, 3):
        for n in (0, 1):
            assert pairs_of(np.zeros((n, d)), 1.0)[0] == 0


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("radius", [0.0, 1.0])
def test_balls_in_one_place_are_all_pairs(d, radius):
    n = 30
    rows = pairs_of(np.full((n, d), 7.25), radius)[1][: n * (n - 1) // 2].tolist()
    assert sorted(rows) == [[i, j] for i in range(n) for j in range(i + 1, n)]
    assert pairs_of(np.full((n, d), 7.25), radius)[0] == n * (n - 1) // 2


def test_touching_is_near():
    assert pairs_of(np.array([[0.0, 0.0], [2.0, 0.0]]), 1.0)[0] == 1
    assert pairs_of(np.array([[0.0, 0.0], [2.5, 0.0]]), 1.0, margin=0.5)[0] == 1
    assert pairs_of(np.array([[0.0, 0.0], [np.nextafter(2.0, 3.0), 0.0]]), 1.0)[0] == 0


@pytest.mark.parametrize("large", [0.0, 50.0])
@pytest.mark.parametrize("capacity", [0, 1, 37, 434, 435])
def test_overflow_tells_how_much_is_needed(capacity, large):
    n = 30
    radius = np.ones(n)
    radius[3] += large
    count, pairs = pairs_of(np.zeros((n, 2)), radius, capacity=capacity)
    assert count == n * (n - 1) // 2 == 435
    assert len(set(map(tuple, pairs.tolist()))) == capacity
    assert (pairs >= 0).all()


def test_the_arrays_may_be_used_again_and_give_the_same_order():
    rng = np.random.default_rng(2)
    positions, radius = rng.uniform(0.0, 10.0, (200, 2)), np.full(200, 0.4)
    cells = new_cells(radius, 2)
    first = pairs_of(positions, radius, cells=cells)
    pairs_of(positions + 100.0, radius, cells=cells)
    again = pairs_of(positions, radius, cells=cells)
    assert first[0] == again[0] > 0
    assert (first[1] == again[1]).all()


def test_the_order_is_that_of_places():
    """Pairs that follow one another are near one another, however the balls are numbered."""
    rng = np.random.default_rng(3)
    side = 60
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2) * 1.0
    positions = grid[rng.permutation(side * side)]
    count, pairs = pairs_of(positions, 0.55, capacity=8 * side * side)
    steps = np.linalg.norm(np.diff(positions[pairs[:count, 0]], axis=0), axis=1)
    assert np.median(steps) <= 2.0


@pytest.mark.parametrize("d", [2, 3])
def test_positions_that_are_not_finite_or_far_away_do_no_harm(d):
    rng = np.random.default_rng(4)
    positions, radius = rng.uniform(-3.0, 3.0, (60, d)), np.full(60, 0.5)
    good = [(i, j) for i, j in check(positions, radius) if min(i, j) >= 10]
    for k, value in enumerate([np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, 2.0**62, -(2.0**63), 1e-320, 1e9]):
        positions[k, k % d] = value
    count, pairs = pairs_of(positions, radius)
    rows = list(map(tuple, pairs[:count].tolist()))
    assert sorted(pair for pair in rows if min(pair) >= 10) == sorted(good)
    assert not any({0, 1, 2} & set(pair) for pair in rows)
    positions[:] = np.nan
    assert pairs_of(positions, radius)[0] == 0


def test_far_from_the_origin_neighbours_are_still_found():
    """Also where cells are no longer told apart."""
    for far in (1e6, 1e9, 2.0**31, 1e13):
        rows = check(np.array([[far, -far], [far + 0.5, -far], [far + 3.0, -far], [-far, far]]), 0.5)
        assert rows == [(0, 1)]


@pytest.mark.parametrize("scale", [1e-150, 1e100])
def test_any_unit_of_length(scale):
    positions = np.random.default_rng(5).uniform(0.0, 6.0, (80, 2))
    usual, other = pairs_of(positions, 0.5), pairs_of(positions * scale, 0.5 * scale)
    assert usual[0] == other[0] > 0
    assert sorted(usual[1][: usual[0]].tolist()) == sorted(other[1][: usual[0]].tolist())


def test_one_wall_does_not_widen_the_cells():
    rng = np.random.default_rng(6)
    positions, radius = rng.uniform(0.0, 20.0, (300, 2)), np.full(300, 0.3)
    positions[7], radius[7] = (0.0, -50.0), 50.0
    cells = new_cells(radius, 2)
    assert cells.large.tolist() == [7]
    check(positions, radius)
    assert pairs_of(positions, radius, cells=cells)[0] > 0
    assert candidates(cells) < 10.0


@pytest.mark.parametrize("d", [2, 3])
def test_radii_may_change(d):
    """Of any ball, in any direction, after the memory was made."""
    rng = np.random.default_rng(7)
    positions, radius = rng.uniform(0.0, 8.0, (150, d)), rng.uniform(0.1, 0.3, 150)
    radius[11] = 20.0
    cells = new_cells(radius, d)
    for factors in (1.0, 3.0, rng.uniform(0.1, 4.0, 150), np.where(np.arange(150) % 50 == 7, 30.0, 1.0), 0.01):
        count, pairs = pairs_of(positions, radius * factors, cells=cells)
        sure, perhaps = brute(positions, radius * factors, 0.0)
        assert sure <= set(map(tuple, pairs[:count].tolist())) <= perhaps


@pytest.mark.parametrize("d", [2, 3])
def test_neighbours_have_places_of_their_own(d):
    """Or else a pair would be found twice; and what shares a place is far away."""
    for power in range(6, 25):
        table = 2**power
        strides = np.array([1, *broad.lattice(table, d)])
        near = {int(np.dot(steps, strides)) % table for steps in itertools.product((-1, 0, 1), repeat=d)}
        assert len(near) == 3**d
        reach = {2: 12, 3: 5}[d]
        around = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * d), axis=-1).reshape(-1, d)
        around = around[around.any(axis=1)]
        extent = np.maximum(np.abs(around), 1).prod(axis=1)
        shared = extent[(around @ strides) % table == 0]
        assert shared.size == 0 or shared.min() >= table * {2: 0.25, 3: 0.02}[d]


PROGRAM = """
import sys
import numba
import numpy as np
sys.path.insert(0, sys.argv[1])
import test_cells
assert bool(numba.config.BOUNDSCHECK) == (sys.argv[2] == "bounds")
assert bool(numba.config.DISABLE_JIT) == (sys.argv[2] == "plain")
for d in (2, 3):
    rng = np.random.default_rng(d)
    positions, radius = rng.uniform(-4.0, 4.0, (100, d)), rng.uniform(0.1, 0.4, 100)
    radius[5] = 30.0
    test_cells.check(positions, radius, 0.1)
    count = test_cells.pairs_of(positions, radius)[0]
    test_cells.pairs_of(positions, radius, capacity=count // 2)
    positions[:4, 0] = np.nan, np.inf, -1e300, 1e18
    test_cells.pairs_of(positions, radius)
    test_cells.pairs_of(np.zeros((100, d)), radius)
    for n in (0, 1, 2):
        test_cells.pairs_of(np.zeros((n, d)), 1.0)
print("done")
"""


@pytest.mark.parametrize(("kind", "variable"), [("bounds", "NUMBA_BOUNDSCHECK"), ("plain", "NUMBA_DISABLE_JIT")])
def test_no_index_out_of_range_and_no_need_of_a_compiler(kind, variable):
    command = [sys.executable, "-c", PROGRAM, os.path.dirname(__file__), kind]
    done = subprocess.run(command, env={**os.environ, variable: "1"}, capture_output=True, text=True, timeout=120)
    assert done.stdout == "done\n", done.stderr
