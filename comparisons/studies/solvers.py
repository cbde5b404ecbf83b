"""Residual against work and run time of every solver, from one stretched start, in one step.

Residual: rms of C / rest length over the links. Work: projections counted by the solver, over the number of links; so
one sweep is 1, and a cycle of the multilevel solver the sum of its sweeps on all levels.

A solver may win residual by moving the scene to some other state of right lengths. So where links outnumber freedoms,
a column gives the distance of its end from the exact projection of the start, which moves least of all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons.gather import ROUNDS, Gatherer, check, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.studies._sweeping import Contender, Sized, chosen, left_out, sized
from comparisons.study import Panel, Series, Study, Table, duration, head
from pbd.errors import InvalidInput

SWEEPS = (1, 3, 10, 30, 100, 300, 1000)
CYCLE = 10
"""Sweeps that stand beside one cycle of the multilevel solver, which does about as much work."""

RESIDUAL, DISTANCE = "link_rms", "projection_distance"
TARGETS = (1e-2, 1e-6)
ROUND_OFF = 1e-16

Y = "residual, rms C / rest"
PANELS = (
    Panel(name="work", title="residual against work", x="projections / links", y=Y, lowest=ROUND_OFF),
    Panel(name="time", title="residual against run time", x="run time [s]", y=Y, lowest=ROUND_OFF),
)


def _ours(label: str, **settings: Any) -> Contender:
    return Contender(label, "pbd", settings={"method": "pbd", **settings})


NATURAL = _ours("Gauss-Seidel, natural order")
MULTILEVEL = _ours("multilevel", solver="multilevel")
DIRECT = _ours("direct", solver="direct")
CONTENDERS = (
    NATURAL,
    _ours("Gauss-Seidel, coloured", order="coloured"),
    _ours("averaged Jacobi", solver="jacobi"),
    MULTILEVEL,
    DIRECT,
    Contender("pyPBD", "pypbd", "matched", {"method": "pbd"}),
)


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    sweeps: Sequence[int] = SWEEPS,
    rounds: int = ROUNDS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure what is left of a stretched start.

    Parameters
    ----------
    scene_name : a scene with links that can start stretched: "pendulum_chain" or "hanging_cloth"
    scene : parameters that differ, the size above all
    engines : of "pbd" and "pypbd"; default both
    settings : must be empty
    sweeps : numbers of iterations; a tenth of them for the multilevel solver, one for the direct solver
    rounds : interleaved timings of each run, of which the minimum counts

    Raises
    ------
    InvalidInput : before anything runs
    """
    names = chosen(engines, settings, rounds)
    if not sweeps:
        raise InvalidInput("sweeps", list(sweeps), "at least one number")
    size = sized(scene_name, scene or {})
    lines = [one for one in CONTENDERS if one.engine in names]
    ladders = [_specs(one, size, sorted(sweeps)) for one in lines]
    check([spec for specs in ladders for spec in specs])
    with Gatherer(names, f"solvers, {size.words}", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(one.engine, through(specs)) for one, specs in zip(lines, ladders, strict=True)])
        timed = iter(gatherer.times([record for group in groups for record in group], rounds))
        found = [Curve(one, size, [next(timed) for _ in group]) for one, group in zip(lines, groups, strict=True)]
    curves = [curve for curve in found if curve.points]
    return Study(
        kind="solvers",
        title=f"Residual against work: {size.words}",
        subject=size.words,
        scene=scene_name,
        parameters=size.parameters,
        head=head(),
        panels=list(PANELS) if curves else [],
        series=[_series(panel.name, curve) for panel in PANELS for curve in curves],
        records=[record for curve in found for record in curve.records],
        omissions=left_out([(curve.one, curve.records) for curve in found]),
        sentences=[_sentence(curves, target) for target in TARGETS] + _nearest(curves),
        tables=[_table(curves, size)] if curves else [],
    )


def _specs(one: Contender, size: Sized, sweeps: list[int]) -> list[RunSpec]:
    counts = sweeps
    if one is MULTILEVEL:
        counts = sorted({max(1, n // CYCLE) for n in sweeps})
    metrics = (RESIDUAL, DISTANCE) if _competes(size) else (RESIDUAL,)
    return [one.spec(size, 1, n, metrics) for n in ([1] if one is DIRECT else counts)]


def _competes(size: Sized) -> bool:
    """Whether links outnumber freedoms."""
    masses = size.built.masses
    return size.links > masses.positions.shape[1] * int(masses.free.sum())


@dataclass(frozen=True)
class Curve:
    """A solver and its records, from cheap to dear, with their times."""

    one: Contender
    size: Sized
    records: list[Record]

    @property
    def points(self) -> list[Record]:
        """The records that have a residual."""
        return [record for record in self.records if record.metric(RESIDUAL) > 0.0]

    def work(self, record: Record) -> float:
        """Projections over links; a solver that does not count them does one of each link in each iteration."""
        projections = record.work.get("projections", record.settings["iterations"] * self.size.links)
        return projections / self.size.links

    def first(self, target: float) -> Record | None:
        """The cheapest record whose residual is at most ``target``; nothing is extrapolated."""
        return next((record for record in self.points if record.metric(RESIDUAL) <= target), None)


def _series(panel: str, curve: Curve) -> Series:
    seconds = [record.seconds.min if record.seconds else math.nan for record in curve.points]
    xs = [curve.work(record) for record in curve.points] if panel == "work" else seconds
    ys = [max(record.metric(RESIDUAL), ROUND_OFF) for record in curve.points]
    points = [(x, y) for x, y in zip(xs, ys, strict=True) if x > 0.0]
    return Series(
        panel=panel,
        label=curve.one.label,
        engine=curve.one.engine,
        x=[x for x, _ in points],
        y=[y for _, y in points],
    )


# ------------------------------------------------------------------ in words


def _table(curves: list[Curve], size: Sized) -> Table:
    """Where each solver ends."""
    columns = ["solver", "iterations", "projections / links", "run time", "rms C / rest"]
    if _competes(size):
        columns += ["from the exact projection [m]", "over Gauss-Seidel's"]
    usual = next((_distance(curve) for curve in curves if curve.one is NATURAL), math.nan)
    rows = []
    for curve in curves:
        end = curve.points[-1]
        time = duration(end.seconds.min) if end.seconds else "-"
        row = [curve.one.label, str(end.settings["iterations"]), f"{curve.work(end):.4g}", time]
        row.append(f"{end.metric(RESIDUAL):.2e}")
        if _competes(size):
            row += [f"{_distance(curve):.2e}", f"{_distance(curve) / usual:.2g}"]
        rows.append(row)
    return Table(title=f"Where each solver ends, {size.words}", columns=columns, rows=rows)


def _distance(curve: Curve) -> float:
    return curve.points[-1].metric(DISTANCE)


def _sentence(curves: list[Curve], target: float) -> str:
    """Who gets to a residual, by work, and how far the others come."""
    there, short = [], []
    for curve in curves:
        record = curve.first(target)
        if record is None:
            least = min(curve.points, key=lambda r: r.metric(RESIDUAL))
            short.append((least.metric(RESIDUAL), f"{curve.one.label} {least.metric(RESIDUAL):.2g}"))
        else:
            time = f", {duration(record.seconds.min)}" if record.seconds else ""
            there.append((curve.work(record), f"{curve.one.label} {curve.work(record):.3g} sweeps' work{time}"))
    reached = "; ".join(words for _, words in sorted(there)) or "nobody"
    left = f" Not reached, best residual: {', '.join(words for _, words in sorted(short))}." if short else ""
    return f"To a residual of {target:g}: {reached}.{left}"


def _nearest(curves: list[Curve]) -> list[str]:
    """Whether a small residual was bought by going to another state."""
    ends = sorted((_distance(curve), curve.one.label) for curve in curves if _distance(curve) > 0.0)
    if not ends:
        return []
    words = ", ".join(f"{label} {distance:.2g} m" for distance, label in ends)
    return [f"From the exact projection of the start each ends: {words}."]
