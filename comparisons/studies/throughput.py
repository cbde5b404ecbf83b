"""Time of a constraint projection and of a particle's step, by order and precision, and the time to equal residual.

Every time is a difference of two runs from the same start, so that what a run costs before its first step drops out:

a projection       (time with MORE sweeps a step - time with one) / ((MORE - 1) x steps x links)
a particle's step  (time of three times as many steps - time of the steps) / (2 x steps x particles), one sweep each

A fast projection that converges slowly is worth nothing, so a second table gives the times in which each order
reaches the residual of some natural sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons.gather import ROUNDS, Gatherer, check, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.studies import _equal_residual as equal_residual
from comparisons.studies._sweeping import (
    METHODS,
    PEER,
    TITLES,
    Contender,
    Sized,
    chosen,
    contenders,
    difference,
    in_range,
    left_out,
    sized,
    step_pair,
    step_time,
)
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

PARTICLES = (10, 100, 1000, 10_000, 100_000, 1_000_000)
MORE = 11
WORK = 3_000_000
"""Projections of the run with MORE sweeps, at least: 3 ms at 1 ns each, far above what a clock misses."""

MOST_STEPS = 3000
"""Of the shortest run: more would time an engine's call from Python, which drops out."""

TIME = "time of a projection [ns]"
PANELS = (
    Panel(name="pbd", title="a projection, PBD (k = 1)", x="particles", y=TIME),
    Panel(name="xpbd", title="a projection, XPBD (rigid)", x="particles", y=TIME),
    Panel(name="step", title="a step with one sweep, PBD (k = 1)", x="particles", y="time of a particle's step [ns]"),
)


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    particles: Sequence[int] = PARTICLES,
    sweeps: Sequence[int] | None = None,
    rounds: int = ROUNDS,
    brief: bool = False,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure times of projections, and times to equal residual.

    Parameters
    ----------
    scene_name : a scene with links that can start stretched: "pendulum_chain" or "hanging_cloth"
    scene : parameters that differ; a size among them is that of the equal residual
    engines : of "pbd" and "pypbd"; default both
    settings : must be empty
    particles : sizes; those beyond the scene's range are left out
    sweeps : numbers of natural sweeps whose residual is to be reached; default by the scene
    rounds : interleaved timings of each run, of which the minimum counts
    brief : single precision in coloured order of PBD only, no wavefront of XPBD: half of the kernels to compile

    Raises
    ------
    InvalidInput : before anything runs
    """
    names = chosen(engines, settings, rounds)
    counts = in_range(scene_name, particles)
    if not counts:
        raise InvalidInput("particles", list(particles), "at least one size that the scene can have")
    contestants = [one for one in _contestants(brief) if one.engine in names]
    goal = equal_residual.prepare(scene_name, scene or {}, sweeps)
    plan = [(one, sized(scene_name, scene or {}, count)) for one in contestants for count in counts]
    check(_trio(*plan[0]))
    with Gatherer(names, f"throughput, {scene_name}", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(one.engine, through(_trio(one, size))) for one, size in plan])
        timed = iter(gatherer.times([record for group in groups for record in group], rounds))
        points = [
            Point(one, size, [next(timed) for _ in group]) for (one, size), group in zip(plan, groups, strict=True)
        ]
        contestants = [one for one in contestants if any(p.one is one and p.is_ok for p in points)]
        rivals = [one for one in contestants if one.method == "pbd"]
        arrivals = equal_residual.measure(gatherer, goal, rivals, rounds)
    series = [s for panel in PANELS for one in contestants if (s := _series(panel, one, points)).x]
    return Study(
        kind="throughput",
        title=f"Throughput on a {scene_name.replace('_', ' ')}",
        subject=scene_name.replace("_", " "),
        scene=scene_name,
        parameters=dict(scene or {}),
        head=head(),
        panels=[panel for panel in PANELS if panel.name in {s.panel for s in series}],
        series=series,
        records=[record for point in points for record in point.trio] + equal_residual.records(arrivals),
        omissions=left_out([(p.one, p.trio) for p in points]),
        sentences=_sentences(points) + equal_residual.sentences(goal, arrivals),
        tables=[_table(scene_name, contestants, points), equal_residual.table(goal, arrivals)],
    )


def _contestants(brief: bool) -> list[Contender]:
    every = [one for method in METHODS for one in contenders(method)]
    return [one for one in every if not brief or _is_worth_compiling(one.settings)]


def _is_worth_compiling(settings: Mapping[str, Any]) -> bool:
    """Whether a brief study shows it: all orders of PBD, two of XPBD, single precision where it pays most."""
    order, is_single = settings.get("order", ""), settings.get("precision") == "float32"
    if settings["method"] == "xpbd":
        return order != "wavefront" and not is_single
    return order == "coloured" or not is_single


def _steps(size: Sized) -> int:
    return min(MOST_STEPS, -(-WORK // (MORE * size.links)))


def _trio(one: Contender, size: Sized) -> list[RunSpec]:
    """The three runs whose differences are the times."""
    steps = _steps(size)
    return [*step_pair(one, size, steps), one.spec(size, steps, MORE)]


@dataclass(frozen=True)
class Point:
    """One contender at one size: the records of its three runs, with their times."""

    one: Contender
    size: Sized
    trio: list[Record]

    @property
    def is_ok(self) -> bool:
        """Whether its runs gave anything."""
        return all(record.status.code == "ok" for record in self.trio)

    @property
    def projection(self) -> float:
        """Time of one projection [ns]; nan where it was not measured."""
        first, _, swept = self.trio
        return difference(first, swept) / ((MORE - 1) * _steps(self.size) * self.size.links)

    @property
    def step(self) -> float:
        """Time of one particle's step with one sweep [ns]; nan where it was not measured."""
        return step_time(self.trio[:2], self.size, _steps(self.size))


def _series(panel: Panel, one: Contender, points: list[Point]) -> Series:
    if panel.name not in ("step", one.method) or (panel.name == "step" and one.method != "pbd"):
        return Series(panel=panel.name, label=one.label, engine=one.engine, x=[], y=[])
    mine = [(p.size.particles, p.step if panel.name == "step" else p.projection) for p in points if p.one == one]
    shown = [(float(n), ns) for n, ns in mine if ns > 0.0]
    return Series(
        panel=panel.name,
        label=one.label,
        engine=one.engine,
        method=one.method,
        x=[n for n, _ in shown],
        y=[ns for _, ns in shown],
    )


# ------------------------------------------------------------------ in words


def _table(scene_name: str, contestants: list[Contender], points: list[Point]) -> Table:
    counts = sorted({p.size.particles for p in points})
    rows = []
    for one in contestants:
        mine = {p.size.particles: p.projection for p in points if p.one == one}
        peer = {p.size.particles: p.projection for p in points if (p.one.engine, p.one.method) == (PEER, one.method)}
        ratio = peer.get(counts[-1], float("nan")) / mine[counts[-1]]
        rows.append([TITLES[one.method], one.label, *(_number(mine[n]) for n in counts), _number(ratio)])
    columns = ["method", "order", *(f"{n} particles" for n in counts), "pyPBD's / this one's, largest size"]
    return Table(title=f"Time of a projection [ns], {scene_name.replace('_', ' ')}", columns=columns, rows=rows)


def _number(value: float) -> str:
    return f"{value:.3g}" if value > 0.0 else "-"


def _sentences(points: list[Point]) -> list[str]:
    """Who projects fastest at the largest size, and what XPBD costs over PBD."""
    largest = max(p.size.particles for p in points)
    there = {(p.one.method, p.one.label): p.projection for p in points if p.size.particles == largest}
    said = []
    for method in METHODS:
        ranked = sorted((ns, label) for (m, label), ns in there.items() if m == method and ns > 0.0)
        times = ", ".join(f"{label} {ns:.3g} ns (x{ns / ranked[0][0]:.3g})" for ns, label in ranked)
        if ranked:
            said.append(f"A projection, {TITLES[method]}, {largest} particles: {times}.")
    ratios = [(label, ns / there.get(("pbd", label), math.nan)) for (m, label), ns in there.items() if m == "xpbd"]
    costs = ", ".join(f"x{ratio:.2f} in {label}" for label, ratio in ratios if ratio > 0.0)
    return [*said, f"A projection of XPBD over one of PBD, {largest} particles: {costs}."] if costs else said
