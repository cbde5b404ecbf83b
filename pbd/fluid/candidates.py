"""The candidates of a cell: sorted numbers of what may be within h of it, side by side in memory."""

from __future__ import annotations

from typing import Any

from pbd.dispatch import stage
from pbd.fluid.cells import FINE, sorted_places
from pbd.fluid.lanes import lanes, put_lanes, width
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import like

AT_ONCE = 32
"""Numbers copied at once. A row holds 16 to 20: a loop over registers would end after one or two of them at random, and
a wrong guess of the processor costs more than the copy."""

FAR = 1e15
"""[m] Where the points are that fill up the candidates; the square of it is finite in single precision."""


@device
def gather(cells, x, values, low, high):
    """values_k <- x of the k-th sorted particle, for those in cells low, ..., high-1."""
    first, last = sorted_places(cells, low, high)
    for axis in range(len(x)):
        for k in range(first, last):
            values[axis][k] = x[axis][cells.particle[k]]


@stage(required=True)
def visit(task, k, first, last):
    """What is to be done for the k-th sorted particle, whose candidates are near_first, ..., near_last-1."""


@device
def for_each(cells, values, task, low, high):
    """`visit` each sorted particle of cells low, ..., high-1, with candidates of sorted ``values``, positions first.

    Those of a cell are copied before the particles of the cell before are visited, to the other half of ``near``: read
    at once, while what was written in other pieces still waits to leave the processor, they cost half as much again.
    At the end, cell ``high`` is copied in vain; it is to be no further than the first after a particle's, see `cut`.
    """
    place, half = 0, cells.near[0].shape[0] // 2
    begin, end, first, last = 0, 0, 0, 0
    for c in range(low, high + 1 if low < high else low):
        start, stop = cells.start[c], cells.start[c + 1]
        if start < stop or c == high:
            filled = pick(cells, c, values, place)
            for k in range(begin, end):
                visit(task, k, first, last)
            begin, end, first, last = start, stop, place, filled
            place = half - place


@device
def pick(cells, c, values, place):
    """Copy sorted values of what may be within h of cell c to ``near`` from ``place`` on; returns where they end.

    They are filled up to a multiple of the lanes.
    """
    found = place
    for row in range(3 ** (len(cells.inverse) - 1)):
        middle = c + row_offset(cells, row)
        first, last = cells.start[middle - FINE], cells.start[middle + FINE + 1]
        copy_pieces(cells.near, found, values, first, last)
        found += last - first
    return close(cells, place, found)


@device
def row_offset(cells, row):
    """From a cell to the one in the middle of row 0, ..., 3^(d-1) - 1 about it."""
    offset = 0
    for axis in range(1, len(cells.inverse)):
        offset += (row % 3 - 1) * cells.strides[axis]
        row //= 3
    return offset


def copy_pieces(near: tuple, found: int, values: tuple, first: int, last: int) -> None:
    """near_found... <- values_first, ..., values_last-1, of each array, and more up to a multiple of AT_ONCE."""
    for target, source in zip(near, values):
        target[found : found + last - first] = source[first:last]


@typed(copy_pieces)
def _copy_pieces(near: Any, found: Any, values: Any, first: Any, last: Any) -> Any:
    if len(values) == 0:
        return lambda near, found, values, first, last: None

    def copy(near, found, values, first, last):
        for start in range(first, last, AT_ONCE):
            for k in range(start, start + AT_ONCE, width(values[0])):
                put_lanes(near[0], found + k - first, lanes(values[0], k))
        copy_pieces(near[1:], found, values[1:], first, last)

    return copy


@device
def close(cells, place, found):
    """Put points far away after the candidates, up to a multiple of the lanes."""
    near = cells.near
    for axis in range(len(cells.inverse)):
        put_lanes(near[axis], found, like(near[axis][0], FAR))
    step = width(near[0])
    return place + (found - place + step - 1) // step * step
