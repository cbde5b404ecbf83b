"""How the dam break converges: over particles, time step, sub-steps and iterations, each method towards its own limit.

A line's error is the rms distance of its front, from T = 0.5 to 2, from that of its own finest point, which is not
drawn. Particles are counted by the spacing, dx/a. What a line leaves out - the finest spacing's own error, which the
gap between two methods' limits tells - is in the dam break's numerical reference. Compression, whose limit is 0 with
constraints, needs no finest point, and is smooth where a front is a single particle that jumps.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from comparisons import engine
from comparisons.fit import fit_order
from comparisons.gather import by_engine, check
from comparisons.isolation import Workers, lent
from comparisons.metrics import Subject, _water
from comparisons.record import Record, RunSpec
from comparisons.studies import _fluids
from comparisons.studies._fluids import PBF, REST, WCSPH, XPBD, Contender
from comparisons.study import Panel, Series, Study, head
from pbd import fields

SCENE, METRICS = "dam_break", ("front_error", "density_error", "density_peak")
PLACE = {"duration": 2.0, "samples": 20}
ACROSS = (5, 10, 20, 40)
COURANT = (0.64, 0.32, 0.16, 0.08, 0.04)
COUNTS = (1, 2, 4, 8, 16)
FROM = 0.5
"""T from which fronts are compared."""

RESOLUTION = 20
"""Particles across where something else varies."""

METHODS = (PBF, REST, XPBD, WCSPH)
AXES = {
    "across": "spacing dx/a",
    "courant": "time step, c = dt √(a g)/dx",
    "substeps": "sub-steps in each step",
    "iterations": "iterations in each step",
}
SQUEEZED, Y_SQUEEZED = "density_error", "mean compression"
Y = "front, rms from the finest [a]"


@dataclass(frozen=True)
class Line:
    """A method along an axis, from coarse to fine."""

    one: Contender
    axis: str
    specs: Sequence[RunSpec]


Runs = list[tuple[Record, np.ndarray | None]]
"""Records of a line, and fronts of those that have one."""


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    across: Sequence[int] = ACROSS,
    courant: Sequence[float] = COURANT,
    substeps: Sequence[int] = COUNTS,
    iterations: Sequence[int] = COUNTS,
    resolution: int = RESOLUTION,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure distances along each axis and fit orders.

    Parameters
    ----------
    engines : of "pbf" and "symplectic_euler"; default both
    settings : must be empty
    across, courant, substeps, iterations : points of each axis, from coarse to fine
    resolution : particles across where something else varies

    Raises
    ------
    InvalidInput : before anything runs
    """
    methods = _fluids.chosen(engines, settings, METHODS)
    _fluids.counts("across", across)
    _fluids.counts("resolution", [resolution])
    points = {"across": across, "courant": courant, "substeps": substeps, "iterations": iterations}
    lines = [
        _line(one, axis, values, resolution) for axis, values in points.items() for one in methods if _has(one, axis)
    ]
    check(spec for line in lines for spec in line.specs)
    with lent(workers) as pool:
        jobs = [(line.one.engine, partial(_runs, pool, line)) for line in lines]
        found = list(zip(lines, by_engine("fluid convergence", jobs, quiet=quiet), strict=True))
    records = [record for _, runs in found for record, _ in runs]
    series = [s for line, runs in found for s in _series(line, runs)]
    series += [s for line, runs in found if line.axis != "across" for s in _compressions(line, runs)]
    used = [axis for axis in AXES if any(s.panel == axis for s in series)]
    return Study(
        kind="fluid_convergence",
        title=f"Convergence of the dam break; {resolution} particles across where something else varies",
        subject="dam break",
        scene=SCENE,
        parameters=PLACE,
        head=head(),
        panels=_panels(used),
        series=series,
        records=records,
        omissions=_fluids.lost(records),
        sentences=[f"{s.label}: {s.fit.text()} in {s.panel}." for s in series if s.fit],
    )


def _panels(used: Sequence[str]) -> list[Panel]:
    """Of the front over each axis, and of compression over all but the particles."""
    squeezed = [axis for axis in used if axis != "across"]
    return [Panel(name=axis, title=f"front against {axis}", x=AXES[axis], y=Y) for axis in used] + [
        Panel(name=_squeezed(axis), title=f"compression against {axis}", x=AXES[axis], y=Y_SQUEEZED)
        for axis in squeezed
    ]


def _has(one: Contender, axis: str) -> bool:
    return axis == "across" or axis in fields.rules(engine.load(one.engine).Settings)


def _line(one: Contender, axis: str, values: Sequence[float], resolution: int) -> Line:
    if axis == "across":
        return Line(one, axis, [one.spec(SCENE, {**PLACE, "across": n}, METRICS) for n in values])
    chosen = [dataclasses.replace(one, settings={**one.settings, axis: value}) for value in values]
    return Line(one, axis, [each.spec(SCENE, {**PLACE, "across": resolution}, METRICS) for each in chosen])


def _runs(pool: Workers, line: Line) -> Runs:
    return [_fluids.measured(pool, spec, _front) for spec in line.specs]


def _front(subject: Subject) -> np.ndarray:
    """(s,) Z from T = FROM on."""
    times, fronts = _water.dimensionless(subject)
    return fronts[times >= FROM - 1e-9]


def _series(line: Line, runs: Runs) -> list[Series]:
    """A line's points and fit; iterations and sub-steps are fitted over 1/n."""
    kept = [(_place(line.axis, record), front) for record, front in runs if front is not None]
    if len(kept) < 2:
        return []
    limit = kept[-1][1]
    xs = [x for x, _ in kept[:-1]]
    ys = [float(np.sqrt(np.mean((front - limit) ** 2))) for _, front in kept[:-1]]
    return [_fitted(line, line.axis, xs, ys)]


def _compressions(line: Line, runs: Runs) -> list[Series]:
    """The same of the mean compression."""
    kept = [(_place(line.axis, record), record.metric(SQUEEZED)) for record, front in runs if front is not None]
    points = [(x, y) for x, y in kept if y > 0.0]
    return [_fitted(line, _squeezed(line.axis), *zip(*points, strict=True))] if len(points) > 1 else []


def _fitted(line: Line, panel: str, xs: Sequence[float], ys: Sequence[float]) -> Series:
    over = xs if line.axis in ("across", "courant") else [1.0 / x for x in xs]
    one, fit = line.one, fit_order(over, ys)
    return Series(panel=panel, label=one.label, engine=one.engine, preset=one.preset, x=list(xs), y=list(ys), fit=fit)


def _squeezed(axis: str) -> str:
    return f"compression, {axis}"


def _place(axis: str, record: Record) -> float:
    return 1.0 / record.parameters["across"] if axis == "across" else float(record.settings[axis])
