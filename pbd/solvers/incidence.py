"""Which two particles each link joins, in chunks whose data stay in the processor's first cache.

Sums over links have no order to keep, unlike projections. So links are sorted by the distance j - i of their
particles' numbers and then by i: those of a grid, or of anything numbered row by row, then form runs that join
particles i, i + 1, ... to j, j + 1, ..., whose loops read and write whole vectors (3 times as fast on a cloth).
What forms no run is gathered one by one.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pbd.routine import routine

CHUNK = 256
"""Links at most in a chunk."""

SHORTEST = 8
"""Links: a shorter run costs more to enter than it saves."""


class Incidence(NamedTuple):
    """m links in r chunks.

    left, right (m,) : the particles of each link
    start (r + 1,) : where chunks begin
    is_run (r,) : whether link start[r] + c joins left[start[r]] + c and right[start[r]] + c
    """

    left: np.ndarray
    right: np.ndarray
    start: np.ndarray
    is_run: np.ndarray


def incidence(pairs: np.ndarray) -> tuple[Incidence, np.ndarray]:
    """The incidence of pairs (m, 2), and the order (m,) in which it holds them; the lower particle is left."""
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    order = np.lexsort((low, high - low))
    low, high = low[order], high[order]
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(low) != 1) | (np.diff(high) != 1)])[: len(low)])
    lengths = np.diff(np.concatenate([begins, [len(low)]]))
    in_run = np.repeat(lengths >= SHORTEST, lengths)
    sorting = np.argsort(~in_run, kind="stable")  # runs first, then what forms none
    runs = np.concatenate([[0], np.cumsum(lengths[lengths >= SHORTEST])])
    start = _chunks([*runs, len(low)] if runs[-1] < len(low) else [*runs])
    left, right = low[sorting].astype(np.uint64), high[sorting].astype(np.uint64)
    return Incidence(left, right, start, start[:-1] < runs[-1]), order[sorting]


def _chunks(bounds: list[int]) -> np.ndarray:
    """The bounds, with more between those that are more than CHUNK apart."""
    starts = [np.arange(low, high, CHUNK) for low, high in pairwise(bounds)]
    return np.concatenate([*starts, bounds[-1:]]).astype(np.uint64)


@routine
def differences(links, r, x, out):
    """out_c <- x_i - x_j for the links c of chunk r, one axis."""
    begin, count = links.start[r], links.start[r + 1] - links.start[r]
    if links.is_run[r]:
        i, j = links.left[begin], links.right[begin]
        for c in range(count):
            out[c] = x[i + c] - x[j + c]
    else:
        for c in range(count):
            out[c] = x[links.left[begin + c]] - x[links.right[begin + c]]


@routine
def spread(links, r, values, sign, y):
    """y_i <- y_i + values_c and y_j <- y_j + sign values_c for the links c of chunk r, one axis."""
    begin, count = links.start[r], links.start[r + 1] - links.start[r]
    if links.is_run[r]:
        i, j = links.left[begin], links.right[begin]
        for c in range(count):
            y[i + c] += values[c]
        for c in range(count):
            y[j + c] += sign * values[c]
    else:
        for c in range(count):
            y[links.left[begin + c]] += values[c]
            y[links.right[begin + c]] += sign * values[c]
