"""What a step of a fluid costs: time of a particle's step against the number of particles, and on several threads.

A dam break runs for a short while in each engine, so that particles are in disorder only a little; neighbours are
counted. A particle's step is one time step of one particle, whatever a method does in it; PBF makes 4 iterations.
What its stages cost is in ``tests/benchmarks/fluid.py``, which `make bench` runs.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from comparisons.gather import ROUNDS, Gatherer, Ladder, check
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.studies import _fluids
from comparisons.studies._fluids import FAST, PBF, WCSPH, Contender
from comparisons.study import Panel, Series, Study, Table, head

SCENE, METRICS = "dam_break", ("neighbours",)
ACROSS, SOLIDS, THREADS = (10, 30, 100), (12, 24), 2
SHORT = 0.3
"""T at the end."""

CAP = 10.0
GROWTH = 3.2
"""Exponent with which cost grows with the particles across, at least; in 3D it is one more."""

Y = "time of a particle's step [ns]"


@dataclass(frozen=True)
class Run:
    """A contender's run in 2D or 3D, and its record."""

    one: Contender
    dimension: int
    record: Record

    @cached_property
    def particles(self) -> int:
        """Of the column."""
        return len(build_scene(self.record.scene, self.record.parameters).masses.masses)

    @property
    def cost(self) -> float:
        """[ns], nan where it was not measured."""
        seconds = self.record.seconds
        return 1e9 * seconds.min / (self.record.steps * self.particles) if seconds else math.nan


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    across: Sequence[int] = ACROSS,
    solids: Sequence[int] | None = SOLIDS,
    threads: int = THREADS,
    cap: float = CAP,
    rounds: int = ROUNDS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure costs.

    Parameters
    ----------
    engines : of "pbf" and "symplectic_euler"; default both
    settings : must be empty
    across, solids : particles across in 2D and in 3D
    threads : of our solver in single precision, beside one
    cap : seconds; a run that would take longer, by the coarser one, is left out
    rounds : interleaved timings of each run, of which the minimum counts

    Raises
    ------
    InvalidInput : before anything runs
    """
    team = dataclasses.replace(FAST, label=f"{FAST.label}, {threads} threads", settings={"threads": threads})
    contenders = _fluids.chosen(engines, settings, (PBF, FAST, team, WCSPH))
    _fluids.counts("across", across)
    _fluids.counts("rounds, threads", [rounds, threads])
    plans = [
        (one, d, _specs(one, d, many)) for d, many in ((2, across), (3, solids or ())) if many for one in contenders
    ]
    check(spec for _, _, specs in plans for spec in specs)
    names = list(dict.fromkeys(one.engine for one in contenders))
    with Gatherer(names, "fluid throughput", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(one.engine, _ladder(specs, d, cap)) for one, d, specs in plans])
        timed = {r.key: r for r in gatherer.times([r for group in groups for r in group], rounds)}
        omissions = gatherer.omissions
    found = [Run(one, d, timed[r.key]) for (one, d, _), group in zip(plans, groups, strict=True) for r in group]
    return Study(
        kind="fluid_throughput",
        title="What a particle's step costs in a dam break",
        subject="dam break",
        scene=SCENE,
        parameters={},
        head=head(),
        panels=[
            Panel(name=f"{d}D", title=f"{d}D", x="particles", y=Y)
            for d in (2, 3)
            if any(r.dimension == d for r in found)
        ],
        series=_series(found),
        records=[r.record for r in found],
        omissions=omissions,
        sentences=_sentences(found, team),
        tables=[_table(found)],
    )


def _specs(one: Contender, dimension: int, across: Sequence[int]) -> list[RunSpec]:
    place = {"dimension": dimension, "duration": SHORT, "samples": 1}
    return [one.spec(SCENE, {**place, "across": n}, METRICS) for n in sorted(across)]


def _ladder(specs: Sequence[RunSpec], dimension: int, cap: float) -> Ladder:
    """It ends before a run that would take longer than ``cap`` seconds, going by the one before."""

    def following(found: list[Record]) -> RunSpec | None:
        k = len(found)
        if k == len(specs) or (k and found[-1].status.code != "ok"):
            return None
        if k == 0:
            return specs[0]
        finer = specs[k].parameters["across"] / specs[k - 1].parameters["across"]
        return None if found[-1].wall * finer ** (GROWTH + dimension - 2) > cap else specs[k]

    return following


def _series(found: Sequence[Run]) -> list[Series]:
    series = []
    for d in (2, 3):
        for one in dict.fromkeys(r.one for r in found if r.dimension == d):
            mine = [r for r in found if r.one is one and r.dimension == d and math.isfinite(r.cost)]
            xs, ys = [float(r.particles) for r in mine], [r.cost for r in mine]
            if xs:
                series.append(Series(panel=f"{d}D", label=one.label, engine=one.engine, preset=one.preset, x=xs, y=ys))
    return series


def _table(found: Sequence[Run]) -> Table:
    rows = [
        [
            f"{r.dimension}D, {r.particles}",
            r.one.label,
            f"{r.cost:.0f}" if math.isfinite(r.cost) else f"- {r.record.status.code}",
            f"{r.record.metric('neighbours'):.1f}" if r.record.status.code == "ok" else "",
            str(r.record.steps),
        ]
        for r in sorted(found, key=lambda r: (r.dimension, r.particles))
    ]
    return Table(title="A particle's step", columns=["particles", "engine", Y, "neighbours", "steps"], rows=rows)


def _sentences(found: Sequence[Run], team: Contender) -> list[str]:
    """Of each dimension's largest column: what threads bring, and what WCSPH costs beside it."""
    said = []
    for d in (2, 3):
        costs = {(r.one.label, r.particles): r.cost for r in found if r.dimension == d and math.isfinite(r.cost)}
        n = max((n for _, n in costs), default=0)
        alone, shared, other = (costs.get((one.label, n)) for one in (FAST, team, WCSPH))
        if alone and shared:
            threads = team.settings["threads"]
            said.append(f"{d}D, {n} particles: {alone:.0f} ns on one thread, {shared:.0f} ns on {threads} threads.")
        if alone and other:
            times = other / alone
            said.append(f"{d}D, {n} particles: a step of WCSPH costs {other:.0f} ns, {times:.1f} times as much.")
    return said
