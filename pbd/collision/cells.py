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

from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import Vector, dot, subtract

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

BLOCK = 256
"""About so many pairs are written at a time: a short loop for each ball would cost more to end than to run."""

ROWS = {2: ((1,),), 3: ((1, 0), (-1, 1), (0, 1), (1, 1))}
"""Half of the rows of cells next to a cell's own, in steps along the second and third axis."""

LATTICES = {2: (1.618033988749895, 16, 512), 3: (1.324717957244746, 3, 24)}
"""Solution of x^d = x + 1, odd numbers tried on either side, and how far out cells that share a place are sought."""


class Cells(NamedTuple):
    """Memory of the broad phase of n balls, m of them ``large`` (m,), the others ``small`` (n - m,), all by index.

    strides (d,), rows : steps in the table of cells, along the axes and to the first cell of each neighbouring row
    cell (n,), key (n,) : the cells of the balls, in their order and as sorted
    start (table + COPIES + 1,) : where a cell begins in sorted order, which is the large balls, the small ones cell by
        cell, and those of the first cells again
    balls : x, y, (z,) r of one after the other in sorted order, near in memory where they are near in space
    indices : which ball that is
    hitter, hit (n + BLOCK,) : pairs not yet written, as places in sorted order
    """

    large: np.ndarray
    small: np.ndarray
    strides: tuple[int, ...]
    rows: tuple[int, ...]
    cell: np.ndarray
    key: np.ndarray
    start: np.ndarray
    balls: np.ndarray
    indices: np.ndarray
    hitter: np.ndarray
    hit: np.ndarray


def new_cells(radius: np.ndarray, dimension: int) -> Cells:
    """Memory for balls of ``radius`` (n,) [m] in 2 or 3 dimensions.

    Which of them are large is decided here, and concerns speed alone: `find_pairs` is right for any radii.
    """
    n = len(radius)
    is_large = radius > LARGE * np.median(radius) if n else np.zeros(0, dtype=bool)
    large, small = np.flatnonzero(is_large), np.flatnonzero(~is_large)
    table = max(FEWEST, 1 << max(n - 1, 0).bit_length())
    strides = lattice(table, dimension)
    room = n + len(small)
    return Cells(
        large=large,
        small=small,
        strides=(1, *strides),
        rows=tuple(int(np.dot(steps, strides)) - 1 for steps in ROWS[dimension]),
        cell=np.zeros(n, dtype=np.int32),
        key=np.zeros(n, dtype=np.int32),
        start=np.zeros(table + COPIES + 1, dtype=np.int32),
        balls=np.zeros(room * (dimension + 1)),
        indices=np.zeros(room, dtype=np.int32),
        hitter=np.zeros(n + BLOCK, dtype=np.uint32),
        hit=np.zeros(n + BLOCK, dtype=np.uint32),
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

    x is a store, radius (n,). Returns how many pairs there are; of more than the capacity the first are written. A
    position that is not finite has no partner.
    """
    sort_into_cells(cells, x, radius, margin)
    mask = cells.start.shape[0] - COPIES - 2
    count, hits, behind = 0, 0, cells.large.shape[0]
    for k in range(radius.shape[0]):
        if k < behind:
            hits = scan(cells, k, k + 1, radius.shape[0], margin, hits)
        else:
            c = cells.key[k]
            hits = scan(cells, k, k + 1, cells.start[c + 2], margin, hits)
            for r in range(len(cells.rows)):
                row = (c + cells.rows[r]) & mask
                hits = scan(cells, k, cells.start[row], cells.start[row + 3], margin, hits)
        if hits >= BLOCK:
            count = write_pairs(cells, hits, pairs, count)
            hits = 0
    return write_pairs(cells, hits, pairs, count)


@device
def scan(cells, k, first, last, margin, hits):
    """Note those from first to last that the k-th ball in sorted order reaches; returns the new number of hits.

    A candidate is noted before it is known to be near, since branches that go either way cost more than all else here;
    indices without a sign spare the test for negative ones.
    """
    step = len(cells.strides) + 1
    here = position(cells.balls, np.uint64(k * step), cells.strides)
    reach = cells.balls[np.uint64(k * step + step - 1)] + margin
    for m in range(first, last):
        away = subtract(position(cells.balls, np.uint64(m * step), cells.strides), here)
        total = reach + cells.balls[np.uint64(m * step + step - 1)]
        cells.hitter[np.uint64(hits)] = k
        cells.hit[np.uint64(hits)] = m
        hits += dot(away, away) <= total * total
    return hits


def position(balls: Any, start: Any, shape: tuple[int, ...]) -> Vector:
    """As many numbers as ``shape`` is long, from ``start`` on."""
    return tuple(balls[int(start) + k] for k in range(len(shape)))


@typed(position)
def _position(balls: Any, start: Any, shape: Any) -> Any:
    if len(shape) == 1:
        return lambda balls, start, shape: (balls[start],)
    return lambda balls, start, shape: (balls[start],) + position(balls, start + np.uint64(1), shape[1:])


@device
def write_pairs(cells, hits, pairs, count):
    """Append the pairs noted, as far as there is room; returns how many there would be."""
    for h in range(min(hits, pairs.shape[0] - count)):
        i, j = cells.indices[cells.hitter[h]], cells.indices[cells.hit[h]]
        pairs[count + h, 0] = min(i, j)
        pairs[count + h, 1] = max(i, j)
    return count + hits


@device
def sort_into_cells(cells, x, radius, margin):
    """Counting sort of the small balls by cell, stable in their index."""
    scale = 1.0 / max(SLACK * (2.0 * largest(radius, cells.small) + margin), NARROWEST)
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
def largest(values, chosen):
    """The largest of the chosen values, or 0; four at a time, since each maximum waits for the one before."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    whole = chosen.shape[0] - chosen.shape[0] % 4
    for s in range(0, whole, 4):
        a = max(a, values[chosen[s]])
        b = max(b, values[chosen[s + 1]])
        c = max(c, values[chosen[s + 2]])
        d = max(d, values[chosen[s + 3]])
    for s in range(whole, chosen.shape[0]):
        a = max(a, values[chosen[s]])
    return max(max(a, b), max(c, d))


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
    start = k * (len(x) + 1)
    for axis in range(len(x)):
        cells.balls[np.uint64(start + axis)] = x[axis][i]
    cells.balls[np.uint64(start + len(x))] = radius[i]
    cells.indices[k] = i


@device
def repeat_first_cells(cells):
    """Put the balls of the first cells behind all others once more."""
    start, first, n, step = cells.start, cells.large.shape[0], cells.key.shape[0], len(cells.strides) + 1
    start[0] = first
    for k in range(first, start[COPIES]):
        for part in range(step):
            cells.balls[(n + k - first) * step + part] = cells.balls[k * step + part]
        cells.indices[n + k - first] = cells.indices[k]
    for c in range(COPIES + 1):
        start[start.shape[0] - COPIES - 1 + c] = n + start[c] - first
