"""Tridiagonal systems by elimination from both ends (the twisted form of Thomas' algorithm; no pivoting).

Row c:  lower_c y_(c-1) + diagonal_c y_c + upper_c y_(c+1) = right_c.  The two recurrences do not depend on each
other until they meet in the middle row, so the processor works on one while the other waits for its division.
Limit: stable for diagonally dominant and for positive definite systems, such as a chain's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbd.intrinsics import multiply_add
from pbd.jit import device


class Tridiagonal(NamedTuple):
    """Arrays (m,); `eliminate` leaves the solution in ``right`` and spoils ``lower`` and ``upper``."""

    lower: np.ndarray
    diagonal: np.ndarray
    upper: np.ndarray
    right: np.ndarray


@device
def eliminate(system):
    """Solve in place."""
    lower, diagonal, upper, right = system
    last = right.shape[0] - 1
    middle = last // 2
    low, high = 0.0, 0.0  # the neighbours' solutions are  low_right - low y_c  and  high_right - high y_c
    low_right, high_right = 0.0, 0.0
    for k in range(last - middle):
        high, high_right = from_above(system, last - k, high, high_right)
        if k < middle:
            low, low_right = from_below(system, k, low, low_right)
    pivot = diagonal[middle] - lower[middle] * low - upper[middle] * high
    solution = (right[middle] - lower[middle] * low_right - upper[middle] * high_right) / pivot
    right[middle] = solution
    up = solution
    for k in range(1, last - middle + 1):
        up = multiply_add(-lower[middle + k], up, right[middle + k])
        right[middle + k] = up
        if k <= middle:
            solution = multiply_add(-upper[middle - k], solution, right[middle - k])
            right[middle - k] = solution


@device
def from_below(system, c, before, right_before):
    """Eliminate row c's lower neighbour; (upper_c, right_c) over the pivot, also kept in the system."""
    lower, diagonal, upper, right = system
    inverse = 1.0 / multiply_add(-lower[c], before, diagonal[c])
    after = upper[c] * inverse
    right_after = multiply_add(-lower[c], right_before, right[c]) * inverse
    upper[c], right[c] = after, right_after
    return after, right_after


@device
def from_above(system, c, before, right_before):
    """Eliminate row c's upper neighbour; (lower_c, right_c) over the pivot, also kept in the system."""
    lower, diagonal, upper, right = system
    inverse = 1.0 / multiply_add(-upper[c], before, diagonal[c])
    after = lower[c] * inverse
    right_after = multiply_add(-upper[c], right_before, right[c]) * inverse
    lower[c], right[c] = after, right_after
    return after, right_after
