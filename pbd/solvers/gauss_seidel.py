"""Gauss-Seidel in natural order: each projection sees the one before (PBD 2006, section 3.2)."""

from __future__ import annotations

from typing import NamedTuple

from pbd.projection import project


class GaussSeidel(NamedTuple):
    """``iterations`` sweeps over all batches, in their order, each in the order of its constraints.

    Limit: information travels along a chain once per sweep in the order's direction and one link a sweep
    against it, so a chain of N links needs O(N^2) sweeps to converge.
    """

    iterations: int

    def solve(self, batches, state, h):
        for _ in range(self.iterations):  # (9)
            project(batches, state, h)  # (10)
