"""Orders of convergence: a slope fitted on the asymptotic levels, with its interval."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from scipy import stats

MIN_LEVELS = 4
SLOPE_SPREAD = 0.15
"""Levels belong to the asymptotic range while every local slope is this close to the fitted one (or 10 %)."""

SETTLED = 0.05
"""The two finest local slopes must agree this well (or to 5 %): else the order is still on its way."""

WHOLE = 0.15
"""Orders are whole numbers; a slope further from one is still on its way, however steady it looks."""

BEND = 2
"""Levels that may lie on the bend between the asymptotic range and the floor."""

FLOOR_SLOPE = 0.3
"""A finest level whose local slope is below this gained nothing: it lies at a floor."""


class Fit(msgspec.Struct, frozen=True, kw_only=True):
    """Slope of log(error) over log(x).

    order : None where fewer than MIN_LEVELS levels are asymptotic
    low, high : 95 % interval of the slope
    xs : the levels that were fitted
    floor : error of the finest level where it lies at a floor, else None
    """

    order: float | None = None
    low: float | None = None
    high: float | None = None
    xs: list[float] = []
    floor: float | None = None

    def text(self) -> str:
        """The result in words."""
        floor = f", floor {self.floor:.1e}" if self.floor is not None else ""
        if self.order is None or self.high is None:
            return f"no order, fewer than {MIN_LEVELS} asymptotic levels{floor}"
        return f"order {self.order:.2f} ± {self.high - self.order:.2f} on {len(self.xs)} levels{floor}"


def fit_order(xs: Sequence[float], errors: Sequence[float]) -> Fit:
    """Fit the order on the finest asymptotic levels above the floor.

    Levels with an error that is zero or not finite are left out. From the finest end, levels that gained
    nothing over their coarser neighbour are the floor. Up to BEND levels before it may bend towards it, or dip
    where round-off cancels the error. Of the rest, if the finest local slopes have settled near a whole number,
    the longest run of finest levels whose local slopes all agree with their fit is taken.
    """
    points = sorted((x, e) for x, e in zip(xs, errors, strict=True) if math.isfinite(e) and e > 0.0 and x > 0.0)
    x, e = (np.log(np.array(column)) for column in zip(*points, strict=True)) if points else (np.zeros(0),) * 2
    start = 0
    while start + 1 < len(x) and _slopes(x, e)[start] < FLOOR_SLOPE:
        start += 1
    for first in range(start, min(start + BEND, max(len(x) - MIN_LEVELS, start)) + 1):
        found = _fit(x[first:], e[first:])
        if found is not None:
            return msgspec.structs.replace(found, floor=math.exp(e[0]) if first > 0 else None)
    return Fit(floor=math.exp(e[0]) if start > 0 else None)


def _fit(x: np.ndarray, e: np.ndarray) -> Fit | None:
    """The fit of the longest run of finest levels that is asymptotic; None where there is none."""
    if len(x) < MIN_LEVELS or not _has_settled(_slopes(x, e)):
        return None
    for levels in range(len(x), MIN_LEVELS - 1, -1):
        regression = stats.linregress(x[:levels], e[:levels])
        slope = float(regression.slope)
        if _agree(_slopes(x[:levels], e[:levels]), slope):
            half = float(stats.t.ppf(0.975, levels - 2) * regression.stderr)
            return Fit(order=slope, low=slope - half, high=slope + half, xs=np.exp(x[:levels]).tolist())
    return None


def _has_settled(slopes: np.ndarray) -> bool:
    return bool(abs(slopes[0] - slopes[1]) <= SETTLED * max(1.0, abs(slopes[0])))


def _agree(slopes: np.ndarray, slope: float) -> bool:
    """Whether local slopes lie near their fit, and the fit near a whole order."""
    allowed = max(SLOPE_SPREAD, 0.1 * abs(slope))
    return bool(np.abs(slopes - slope).max() <= allowed and abs(slope - max(round(slope), 1)) <= WHOLE)


def _slopes(x: np.ndarray, e: np.ndarray) -> np.ndarray:
    return np.diff(e) / np.diff(x)
