"""Broad phase: all pairs of bounding balls that are nearer than a margin, at a cost linear in their number.

Balls are counting-sorted into cubic cells at least as wide as two of them can reach, so that partners lie in
neighbouring cells. There are about as many cells as balls, whatever the extent of the scene: cell (i, j, k) of the
unbounded grid shares its place with all others of the same i + s j + t k modulo the table's size, and the distance
tells them apart. With s and t from a good lattice rule (Niederreiter 1992, chapter 5) a region with fewer cells than
the table meets itself hardly ever, be it a block, a slab or a column. Cells that follow one another along the first
axis do so in the table, so that three neighbours are one range.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from pbd.jit import device
from pbd.vector import Store, dot, load, store, subtract, zeros

LARGE = 8.0
"""Balls larger than this times the median are tested against all others, so that one wall does not widen every cell."""

FARTHEST = 2.0**30
"""Cells are counted so far from the origin; what lies beyond is put into the last one."""

SLACK = 1.0 + 1e-6
"""Cells are wider than the reach by this factor, more than rounding can shift a cell's border that far out."""

NARROWEST = 1e-300
"""[m] Width of a cell where nothing has an extent."""

FEWEST = 64
"""Size of the smallest table: large enough for the 27 places of a cell and its neighbours to differ."""

COPIES = 2
"""The first cells stand once more behind the last, so that no range of three neighbours is cut in two."""

ROWS = {2: ((1,),), 3: ((1, 0), (-1, 1), (0, 1), (1, 1))}
"""Half of the rows of cells next to a cell's own, in steps along the second and third axis."""

LATTICES = {2: (1.618033988749895, 16, 512), 3: (1.324717957244746, 3, 24)}
"""Solution of x^d = x + 1, odd numbers tried on either side, and how far out cells that share a place are sought."""


class Cells(NamedTuple):
    """Memory of the broad phase of n balls, m of them ``large`` (m,), the others ``small`` (n - m,), all by index.

    widest : largest radius among the small ones [m]
    strides (d,), rows : steps in the table of cells, along the axes and to the first cell of each neighbouring row
    cell (n,), key (n,) : the cells of the balls, in their order and as sorted
    start (table + COPIES + 1,) : where a cell begins in the sorted arrays ``position``, ``radius`` and ``ball``, which
        hold first the large balls, then the small ones cell by cell, then those of the first cells again
    hit (n,) : the sorted balls that one of them reaches
    """

    large: np.ndarray
    small: np.ndarray
    widest: float
    strides: tuple[int, ...]
    rows: tuple[int, ...]
    cell: np.ndarray
    key: np.ndarray
    start: np.ndarray
    position: Store
    radius: np.ndarray
    ball: np.ndarray
    hit: np.ndarray


def new_cells(radius: np.ndarray, dimension: int) -> Cells:
    """Memory for balls of ``radius`` (n,) [m] in 2 or 3 dimensions."""
    n = len(radius)
    is_large = radius > LARGE * np.median(radius) if n else np.zeros(0, dtype=bool)
    large, small = np.flatnonzero(is_large), np.flatnonzero(~is_large)
    table = max(FEWEST, 1 << max(n - 1, 0).bit_length())
    strides = lattice(table, dimension)
    room = n + len(small)
    return Cells(
        large=large,
        small=small,
        widest=float(np.max(radius[small], initial=0.0)),
        strides=(1, *strides),
        rows=tuple(int(np.dot(steps, strides)) - 1 for steps in ROWS[dimension]),
        cell=np.zeros(n, dtype=np.int32),
        key=np.zeros(n, dtype=np.int32),
        start=np.zeros(table + COPIES + 1, dtype=np.int32),
        position=zeros(room, dimension),
        radius=np.zeros(room),
        ball=np.zeros(room, dtype=np.int32),
        hit=np.zeros(n, dtype=np.int32),
    )


def lattice(table: int, dimension: int) -> tuple[int, ...]:
    """Steps in the table of ``table`` cells along all axes but the first.

    Powers of a golden ratio times the table's size, rounded to those odd numbers nearby for which cells that share a
    place are farthest apart, by the product of their steps along the axes (Zaremba's figure of merit).
    """
    ratio, near, reach = LATTICES[dimension]
    axes = [np.arange(-reach, reach + 1)] * (dimension - 1)
    steps = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, dimension - 1)
    steps = steps[steps.any(axis=1)]
    extent = np.maximum(np.abs(steps), 1).prod(axis=1)
    ideal = [int(table / ratio**k) | 1 for k in range(1, dimension)]
    best, found = 0, tuple(ideal)
    for shifts in itertools.product(range(-2 * near, 2 * near + 1, 2), repeat=dimension - 1):
        strides = np.add(ideal, shifts)
        along = (steps @ strides + table // 2) % table - table // 2
        merit = int((extent * np.maximum(np.abs(along), 1)).min())
        if merit > best:
            best, found = merit, tuple(int(stride) for stride in strides)
    return found


@device
def find_pairs(cells, x, radius, margin, pairs):
    """Write all i < j with |x_i - x_j| <= r_i + r_j + margin to ``pairs`` (capacity, 2), in the order of cells.

    x is a store, radius (n,) the one ``cells`` was made for. Returns how many pairs there are; of more than the
    capacity, the first are written. A ball whose position is not finite has no partner.
    """
    sort_into_cells(cells, x, radius, margin)
    mask = cells.start.shape[0] - COPIES - 2
    count, behind = 0, cells.large.shape[0]
    for k in range(behind):
        hits = scan(cells, k, k + 1, radius.shape[0], margin, 0)
        count = write_pairs(cells, k, hits, pairs, count)
    for k in range(behind, radius.shape[0]):
        c = cells.key[k]
        hits = scan(cells, k, k + 1, cells.start[c + 2], margin, 0)
        for r in range(len(cells.rows)):
            row = (c + cells.rows[r]) & mask
            hits = scan(cells, k, cells.start[row], cells.start[row + 3], margin, hits)
        count = write_pairs(cells, k, hits, pairs, count)
    return count


@device
def scan(cells, k, first, last, margin, hits):
    """Add those from first to last that the sorted ball k reaches to ``hit``; returns the new number of hits.

    A candidate is written before it is known to be near, since branches that go either way cost more than all else
    here; indices without a sign spare the test for negative ones.
    """
    here, reach = load(cells.position, k), cells.radius[k] + margin
    for candidate in range(first, last):
        m: Any = np.uint64(candidate)
        away = subtract(load(cells.position, m), here)
        total = reach + cells.radius[m]
        cells.hit[np.uint64(hits)] = candidate
        hits += dot(away, away) <= total * total
    return hits


@device
def write_pairs(cells, k, hits, pairs, count):
    """Append the pairs of the sorted ball k and its hits, as far as there is room; returns how many there would be."""
    i = cells.ball[k]
    for h in range(min(hits, pairs.shape[0] - count)):
        j = cells.ball[cells.hit[h]]
        pairs[count + h, 0] = min(i, j)
        pairs[count + h, 1] = max(i, j)
    return count + hits


@device
def sort_into_cells(cells, x, radius, margin):
    """Counting sort of the small balls by cell, stable in their index."""
    scale = 1.0 / max(SLACK * (2.0 * cells.widest + margin), NARROWEST)
    find_cells(cells, x, scale)
    count_cells(cells)
    for k in range(cells.large.shape[0]):
        place(cells, x, radius, cells.large[k], k)
    for s in range(cells.small.shape[0]):
        i = cells.small[s]
        c = cells.cell[i]
        k = cells.start[c + 1]
        cells.start[c + 1] = k + 1
        cells.key[k] = c
        place(cells, x, radius, i, k)
    repeat_first_cells(cells)


@device
def find_cells(cells, x, scale):
    """The place in the table of every ball's cell."""
    mask = cells.start.shape[0] - COPIES - 2
    for i in range(cells.cell.shape[0]):
        place = 0
        for k in range(len(x)):
            place += cells.strides[k] * step_of(scale * x[k][i])
        cells.cell[i] = place & mask


@device
def step_of(distance):
    """The whole number of cells below a distance counted in cells; a number in range even for nan."""
    if not distance > -FARTHEST:
        distance = -FARTHEST
    if distance > FARTHEST:
        distance = FARTHEST
    return math.floor(distance)


@device
def count_cells(cells):
    """start[c + 1] <- where cell c begins. Placing its balls moves that to its end, where the next one begins."""
    start = cells.start
    for c in range(start.shape[0]):
        start[c] = 0
    for s in range(cells.small.shape[0]):
        start[cells.cell[cells.small[s]] + 2] += 1
    total = cells.large.shape[0]
    for c in range(1, start.shape[0] - COPIES):
        total += start[c]
        start[c] = total


@device
def place(cells, x, radius, i, k):
    """Ball i is the k-th in sorted order."""
    store(cells.position, k, load(x, i))
    cells.radius[k] = radius[i]
    cells.ball[k] = i


@device
def repeat_first_cells(cells):
    """Put the balls of the first cells behind all others once more."""
    start, first, n = cells.start, cells.large.shape[0], cells.key.shape[0]
    start[0] = first
    for k in range(first, start[COPIES]):
        store(cells.position, n + k - first, load(cells.position, k))
        cells.radius[n + k - first] = cells.radius[k]
        cells.ball[n + k - first] = cells.ball[k]
    for c in range(COPIES + 1):
        start[start.shape[0] - COPIES - 1 + c] = n + start[c] - first
