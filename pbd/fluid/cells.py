"""The neighbour search of fluids: particles sorted into cells, and the candidates of a cell side by side in memory.

A cell is h wide, but along x only h/FINE, so that the candidates of one - what lies within FINE cells along x and one
along the other axes - fill 2.5 h instead of 3 h along x. Cells that follow each other along x follow each other in
memory; candidates are 3 pieces of sorted arrays in 2D and 9 in 3D, copied side by side, and the end filled with points
so far away that nothing reaches them. There is no list of neighbours: distances from copied candidates, a whole
register of them at once, cost less than positions fetched through indices.

The grid moves with the particles and covers their bounds as far as its cells suffice; what lies outside stands in its
outermost cells, which keeps neighbours neighbours. No position, not even one that is no number, leads out of memory.
Two particles are each other's candidates or neither's, whatever they did since they were sorted: momentum is kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbd.jit import device
from pbd.routine import routine
from pbd.vector import aligned, blank, like

FINE = 2
"""Cells along x in a length h."""

MARGIN = 2
"""Free cells at the ends of each axis, >= FINE: the candidates of outermost cells lie within the arrays."""

PADDING = 64
"""Elements after the end of sorted arrays and of candidates, which whole registers may read and write."""

CELLS_PER_PARTICLE, LEAST_CELLS = 4, 4096


class Cells(NamedTuple):
    """Particles in cells; all arrays are filled by `sort`.

    inverse : cells in a metre along each axis, a tuple
    members (n,) : the particles that are sorted
    particle (n,) : them in sorted order
    cell (n,) : the cell of each member
    start (c + 2,) : sorted places start[k] to start[k + 1] are in cell k
    strides (d,) : from cell to cell along each axis; counts (d,) cells along it
    low (d,) : the grid's lower corner [m]; high (d,) the bounds of the particles there
    last, placed (1,) : no cell from this one on holds a particle, and how many do; 0 where a position is not finite
    near : candidates of two cells, in halves: d arrays of positions and as many as are asked for of other numbers
    """

    inverse: tuple
    members: np.ndarray
    particle: np.ndarray
    cell: np.ndarray
    start: np.ndarray
    strides: np.ndarray
    counts: np.ndarray
    low: np.ndarray
    high: np.ndarray
    last: np.ndarray
    placed: np.ndarray
    near: tuple


def new_cells(members: np.ndarray, dimension: int, h: float, more: int) -> Cells:
    """Room for the members and candidates with ``more`` numbers beside their positions."""
    n = len(members)
    cells = max(CELLS_PER_PARTICLE * n, LEAST_CELLS)
    half = -(-n // PADDING) * PADDING + PADDING  # both halves start on a cache line
    return Cells(
        (FINE / h,) + (1.0 / h,) * (dimension - 1),
        aligned(members, np.uint32),
        np.zeros(n, dtype=np.uint32),
        np.zeros(n, dtype=np.uint32),
        np.zeros(cells + 2, dtype=np.uint32),
        np.zeros(dimension, dtype=np.int64),
        np.zeros(dimension, dtype=np.int64),
        np.zeros(dimension),
        np.zeros(dimension),
        np.zeros(1, dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        tuple(np.zeros(2 * half) for _ in range(dimension + more)),
    )


def with_own_candidates(cells: Cells) -> Cells:
    """The same cells, to be filled by others, for a thread that has room of its own for candidates."""
    return cells._replace(near=tuple(blank(axis.shape, axis.dtype) for axis in cells.near))


def sorted_array(n: int) -> np.ndarray:
    """A number for each sorted particle, and room that whole registers may read."""
    return np.zeros(n + PADDING)


# ------------------------------------------------------------------ sorting


@routine
def sort(cells, x):
    """Sort the members by their cells at positions x."""
    if laid(cells, x):
        place(cells, x, 0, 1)
        fill(cells)


@routine
def laid(cells, x):
    """Lay the grid; False, and no particle is in a cell, where a position is not finite."""
    cells.last[0] = cells.placed[0] = 0
    sound = bounded(cells, x)
    if sound:
        lay(cells, x)
    return sound


@device
def bounded(cells, x):
    """Find the bounds of the members; False where one is not finite, or there is none."""
    members = cells.members
    for axis in range(len(x)):
        low = high = x[axis][members[0]]
        sound = low - low
        for i in range(members.shape[0]):
            value = x[axis][members[i]]
            low, high = min(low, value), max(high, value)
            sound += value - value
        cells.low[axis], cells.high[axis] = low, high
        if sound != like(sound, 0.0):  # infinity less itself is no number, and equals nothing
            return False
    return True


@device
def lay(cells, x):
    """Lay the grid over the bounds; where its cells do not suffice, over the part of them that holds most particles."""
    room = cells.start.shape[0] - 2
    while spread(cells, room) > room:
        longest = 0
        for axis in range(1, len(x)):
            longest = axis if cells.counts[axis] > cells.counts[longest] else longest
        halve(cells, x, longest)
    stride = 1
    for axis in range(len(x)):
        cells.strides[axis] = stride
        stride *= cells.counts[axis] + 2 * MARGIN


@device
def spread(cells, room):
    """Set the cells along each axis between the bounds; how many that makes, with the free ones at the ends."""
    whole = 1.0
    for axis in range(len(cells.inverse)):
        wide = (cells.high[axis] - cells.low[axis]) * cells.inverse[axis]
        cells.counts[axis] = int(min(wide, like(wide, room))) + 1
        whole *= cells.counts[axis] + 2 * MARGIN
    return whole


@device
def halve(cells, x, axis):
    """Go on with the half of the bounds along an axis in which more particles are."""
    half = like(cells.low[axis], 0.5)
    middle = half * cells.low[axis] + half * cells.high[axis]
    above, below = 0, 0
    for i in range(cells.members.shape[0]):
        value = x[axis][cells.members[i]]
        above += middle < value <= cells.high[axis]
        below += cells.low[axis] <= value <= middle
    if above > below:
        cells.low[axis] = middle
    else:
        cells.high[axis] = middle


@routine
def place(cells, x, piece, pieces):
    """Find the cell of each member of one of so many pieces."""
    first, last = members_of(cells, piece, pieces)
    for i in range(first, last):
        cells.cell[i] = cell_of(cells, x, cells.members[i])


@device
def cell_of(cells, x, i):
    """The cell of particle i, one of the outermost where it lies outside the grid or nowhere."""
    c = 0
    for axis in range(len(x)):
        place = (x[axis][i] - cells.low[axis]) * cells.inverse[axis]
        top = like(place, cells.counts[axis] - 1)
        place = place if place > like(place, 0.0) else like(place, 0.0)
        place = place if place < top else top
        c += (int(place) + MARGIN) * cells.strides[axis]
    return c


@routine
def fill(cells):
    """Write the members in sorted order; the starts are written one place too far, and move to where they belong."""
    count(cells)
    for i in range(cells.members.shape[0]):
        c = cells.cell[i] + 1
        k = cells.start[c]
        cells.start[c] = k + 1
        cells.particle[k] = cells.members[i]
    cells.last[0] = cells.strides[-1] * (cells.counts[-1] + MARGIN)
    cells.placed[0] = cells.members.shape[0]


@device
def count(cells):
    """How many members are in each cell and those before, two places on."""
    start, total = cells.start, cells.strides[-1] * (cells.counts[-1] + 2 * MARGIN)
    for c in range(total + 2):
        start[c] = 0
    for i in range(cells.members.shape[0]):
        start[cells.cell[i] + 2] += 1
    for c in range(1, total + 2):
        start[c] += start[c - 1]


# ------------------------------------------------------------------ parts


@device
def cut(cells, piece, pieces):
    """(low, high): cells low, ..., high-1 are this one of so many pieces with about equally many particles.

    Before ``high`` is a cell with a particle, or ``high`` is ``low``.
    """
    placed = cells.placed[0]
    low = first_place(cells.start, cells.last[0], placed * piece // pieces)
    return low, first_place(cells.start, cells.last[0], placed * (piece + 1) // pieces)


@device
def members_of(cells, piece, pieces):
    """(first, last): members first, ..., last-1 are this one of so many pieces."""
    count = cells.members.shape[0]
    return np.uint64(count * piece // pieces), np.uint64(count * (piece + 1) // pieces)


@device
def sorted_places(cells, low, high):
    """(first, last): sorted particles first, ..., last-1 are in cells low, ..., high-1.

    Without a sign: loops over indices that might be negative do not become vector loops.
    """
    return np.uint64(cells.start[low]), np.uint64(cells.start[high])


@device
def first_place(ascending, count, value):
    """The first of ``count`` places that holds at least ``value``; ``count`` if there is none."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low
