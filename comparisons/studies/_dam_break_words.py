"""The dam break's tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from comparisons.metrics import _water
from comparisons.studies._fluids import GRAINS
from comparisons.study import Table, duration
from comparisons.water import FRONTS, HEIGHTS, TABLE_2, experiment, front_reference

if TYPE_CHECKING:
    from comparisons.studies.dam_break import Break

AT = (1.0, 2.0, 3.0)


def accuracy(found: Sequence[Break]) -> Table:
    """A row for each contender and resolution; the reference is the first."""
    reference = front_reference()
    gap = np.interp(AT, reference.times, reference.uncertainty)
    values = np.interp(AT, reference.times, reference.values)
    told = [f"{value:.3f} ± {each:.3f}" for value, each in zip(values, gap, strict=True)]
    rows = [["numerical reference", "", "", *told, "", "", "", "", ""]]
    for b in found:
        record, curves = b.record, b.curves
        seconds = duration(record.seconds.min) if record.seconds else "-"
        if curves is None:
            rows.append([b.contender.label, str(b.across), seconds, f"- {record.status.code}", *[""] * 7])
            continue
        fronts = [f"{z:.3f}" for z in np.interp(AT, curves.times, curves.fronts)]
        tail = f"{np.interp(2.0, curves.times, curves.percentiles):.3f}"
        parts = [record.metric(name) for name in ("front_error", "density_error", "density_peak", "volume_loss")]
        rows.append([b.contender.label, str(b.across), seconds, *fronts, tail, *(_percent(part) for part in parts)])
    columns = ["engine", "across", "run time", "Z(1)", "Z(2)", "Z(3)", "99.5th percentile, T = 2", "error at T = 1, 2"]
    columns += ["mean compression", "largest", "volume lost"]
    return Table(title="Dam break: front Z = x/a of the farthest attached particle", columns=columns, rows=rows)


def experiments(found: Sequence[Break]) -> Table:
    """Raw distance, shift and what it leaves, for each contender and experiment."""
    reference = front_reference()
    curves: list[tuple] = [("numerical reference", reference.times, reference.values, None)]
    curves += [(b.contender.label, b.curves.times, b.curves.fronts, b.curves.heights) for b in found if b.curves]
    rows = []
    for label, times, fronts, heights in curves:
        for name, file in FRONTS.items():
            rows.append([label, name, *_against(times, fronts, experiment(file))])
        if heights is not None:
            for name, file in HEIGHTS.items():
                rows.append([label, f"{name} (height)", *_against(times / math.sqrt(2.0), heights, experiment(file))])
    columns = ["engine", "experiment", "rms as it is", "ahead by", "rms after that shift"]
    return Table(title="Against experiments, as far as the run goes", columns=columns, rows=rows)


def sentences(found: Sequence[Break], shown: int) -> list[str]:
    """How shifts agree over resolutions and with the reference's, and what grains do."""
    reference = front_reference()
    own, left = _water.fitted(reference.times, reference.values, experiment(TABLE_2))
    said = [f"The numerical reference is {own:.3f} ahead of Martin and Moyce's table 2 in T; {left:.3f} a rms is left."]
    for one in dict.fromkeys(b.contender for b in found if b.contender not in GRAINS):
        mine = [b.record for b in found if b.contender is one and b.record.status.code == "ok"]
        shifts = [record.metric("front_offset") for record in mine]
        if shifts:
            worst = max(record.metric("front_fitted_rms") for record in mine)
            spread = f", between {min(shifts):.3f} and {max(shifts):.3f}" if len(shifts) > 1 else ""
            said.append(f"{one.label}: ahead by {shifts[-1]:.3f} at the finest{spread}; at most {worst:.3f} a is left.")
    for b in found:
        if b.contender in GRAINS and b.across == shown and b.curves is not None:
            short = 1.0 - np.interp(2.0, b.curves.times, b.curves.fronts) / np.interp(
                2.0, reference.times, reference.values
            )
            lost = b.record.metric("volume_loss")
            way = "short of" if short > 0.0 else "beyond"
            said.append(
                f"{b.contender.label} are grains, not water: at T = 2 their front is {abs(short):.0%} {way} the "
                f"reference, and {lost:.0%} of the volume is gone at the end."
            )
    return said


def _against(times: np.ndarray, values: np.ndarray, measured: np.ndarray) -> list[str]:
    offset, left = _water.fitted(times, values, measured)
    return [f"{_water.misfit(times, values, measured, 0.0):.3f}", f"{offset:.3f}", f"{left:.3f}"]


def _percent(value: float) -> str:
    return f"{100.0 * value:.2f} %" if math.isfinite(value) else "-"
