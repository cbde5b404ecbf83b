"""How high a jittered stack stands, and how far it drifts: every engine and preset, against the number of boxes.

A stack is run from several seeds, each of which shifts the boxes by other hundredths of an edge; the worst counts. It
stands if after DURATION no box has fallen and none has ever been further than a tenth of an edge from its start. The
line of what has not stood ends there.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons import engine
from comparisons.gather import Gatherer, Ladder, check
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.studies import _rigid
from comparisons.studies._rigid import AT_ONE_PRESET, Contender, chosen
from comparisons.study import Panel, Series, Study, Table, head

COUNTS = (5, 10, 20, 40, 80, 160)
RATES = (60.0, 240.0)
SEEDS = 5
CAP = 20.0
"""Seconds that the runs of all seeds of a stack may take."""

DURATION, SAMPLES = 5.0, 20
EDGE = 1.0
STANDS = 0.1 * EDGE
"""Of drift [m]."""

APART = 2.0
"""Ratio of the heights at which the ends of two lines are drawn."""

LOWEST = 1e-12
METRICS = ("drift", "fallen")


@dataclass(frozen=True)
class Line:
    """A contender at a rate [Hz], with stacks of all sizes."""

    contender: Contender
    rate: float
    counts: tuple[int, ...]
    seeds: int

    def specs(self, count: int) -> list[RunSpec]:
        """A stack of ``count`` boxes from each seed."""
        given = {"count": count, "size": EDGE, "duration": DURATION, "samples": SAMPLES}
        return [
            self.contender.spec("stack", {**given, "seed": seed}, self.contender.presets[0], 1.0 / self.rate, METRICS)
            for seed in range(self.seeds)
        ]

    def ladder(self, cap: float) -> Ladder:
        """From low stacks to high ones, until one has not stood, or would take longer than ``cap`` seconds."""

        def following(found: list[Record]) -> RunSpec | None:
            level, seed = divmod(len(found), self.seeds)
            if level == len(self.counts):
                return None
            if level and seed == 0:
                below = found[-self.seeds :]
                growth = self.counts[level] / self.counts[level - 1]
                if not all(map(stands, below)) or growth * sum(record.wall for record in below) > cap:
                    return None
            return self.specs(self.counts[level])[seed]

        return following

    def stacks(self, records: Sequence[Record]) -> list[Stack]:
        """What its ladder found."""
        parts = [records[k : k + self.seeds] for k in range(0, len(records), self.seeds)]
        return [Stack(count, part) for count, part in zip(self.counts, parts, strict=False)]


@dataclass(frozen=True)
class Stack:
    """A size and its records, one of each seed."""

    count: int
    records: Sequence[Record]

    @property
    def stands(self) -> bool:
        """From every seed."""
        return all(map(stands, self.records))

    @property
    def drift(self) -> float:
        """The largest [m], nan where one has none."""
        return _rigid.worst(self.records, "drift").metric("drift")


def stands(record: Record) -> bool:
    """Whether a run is ok, no box has fallen, and none has drifted far."""
    return record.metric("fallen") == 0.0 and record.metric("drift") < STANDS


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    counts: Sequence[int] = COUNTS,
    rates: Sequence[float] = RATES,
    seeds: int = SEEDS,
    cap: float = CAP,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Stack boxes ever higher.

    Parameters
    ----------
    engines : names; default all that move rigid bodies
    settings : must be empty
    counts : boxes of a stack
    rates : steps per second [Hz]; a quarter of a second must be a whole number of steps
    seeds : stacks of each size
    cap : seconds that the stacks of a size may take together; higher ones are left out

    Raises
    ------
    InvalidInput : before anything runs
    """
    contenders = chosen(engines, settings, AT_ONE_PRESET)
    _rigid.positive(counts=counts, rates=rates, seeds=[seeds], cap=[cap])
    heights = tuple(sorted(set(counts)))
    lines = [Line(one, rate, heights, seeds) for rate in sorted(set(rates)) for one in contenders]
    check(line.specs(heights[-1])[0] for line in lines)
    names = list(dict.fromkeys(one.engine for one in contenders))
    with Gatherer(names, "stacking", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(line.contender.engine, line.ladder(cap)) for line in lines])
    found = {line: line.stacks(group) for line, group in zip(lines, groups, strict=True)}
    series = [one for line, stacks in found.items() if (one := _series(line, stacks)).x] + _falls(found)
    return Study(
        kind="stacking",
        title=f"Stacks of boxes after {DURATION:g} s, the worst of {_rigid.counted(seeds, 'seed')}",
        subject="stacks",
        scene="stack",
        parameters={"duration": DURATION},
        head=head(),
        panels=[_panel(rate) for rate in sorted(set(rates)) if any(s.panel == _panel(rate).name for s in series)],
        series=series,
        records=[record for group in groups for record in group],
        omissions=gatherer.omissions + _rigid.others_left_out(),
        sentences=_sentences(found),
        tables=[_table(found, seeds)],
    )


def _panel(rate: float) -> Panel:
    return Panel(
        name=f"{rate:g} Hz", title=f"{rate:g} Hz", x="boxes in the stack", y="drift [m], edge 1 m", lowest=LOWEST
    )


def _series(line: Line, stacks: Sequence[Stack]) -> Series:
    """The stacks that stand."""
    kept = [stack for stack in stacks if stack.stands]
    return Series(
        panel=_panel(line.rate).name,
        label=line.contender.label,
        engine=line.contender.engine,
        preset=line.contender.presets[0],
        x=[float(stack.count) for stack in kept],
        y=[max(stack.drift, LOWEST) for stack in kept],
    )


def _falls(found: Mapping[Line, Sequence[Stack]]) -> list[Series]:
    """Where a line ends because the next stack does not stand; those that end together above each other."""
    series: list[Series] = []
    places: Counter[tuple[float, int]] = Counter()
    for line, stacks in found.items():
        end = stacks[-1]
        if end.stands or end.records[0].status.code == "unsupported":
            continue
        places[line.rate, end.count] += 1
        stood = _series(line, stacks)
        series.append(
            Series(
                panel=stood.panel,
                label=f"falls, or drifts {STANDS:g} m" if stood.x else f"{stood.label}: none stands",
                engine=stood.engine,
                preset=stood.preset,
                x=[*stood.x[-1:], float(end.count)],
                y=[*stood.y[-1:], STANDS * APART ** places[line.rate, end.count]],
                kind="lost",
            )
        )
    return series


# ------------------------------------------------------------------ in words


def highest(stacks: Sequence[Stack]) -> int:
    """Boxes of the highest that stands; 0 where none does."""
    return max((stack.count for stack in stacks if stack.stands), default=0)


def _table(found: Mapping[Line, Sequence[Stack]], seeds: int) -> Table:
    """A row for each contender, a column for each rate."""
    rates = list(dict.fromkeys(line.rate for line in found))
    rows = []
    for one in dict.fromkeys(line.contender for line in found):
        mine = {line.rate: stacks for line, stacks in found.items() if line.contender is one}
        rows.append([one.label, *(_words(line_stacks) for line_stacks in mine.values())])
    title = f"Boxes of the highest stack that stands {DURATION:g} s, and its drift"
    title += f", worst of {_rigid.counted(seeds, 'seed')}; ≥: no higher one was tried; {_rigid.PENALTY}"
    return Table(title=title, columns=["engine", *(f"{rate:g} Hz" for rate in rates)], rows=rows)


def _words(stacks: Sequence[Stack]) -> str:
    """The highest, its drift, and why there is no higher one."""
    top = highest(stacks)
    last = stacks[-1]
    if last.stands:
        return f"≥ {top}, {last.drift:.1e} m"
    code = next((r.status.code for r in last.records if r.status.code != "ok"), "falls")
    if code == "unsupported":
        return "- unsupported"
    ends = f"{last.count}: {code}"
    kept = [stack for stack in stacks if stack.count == top]
    return f"{top}, {kept[0].drift:.1e} m ({ends})" if kept else f"none ({ends})"


def _sentences(found: Mapping[Line, Sequence[Stack]]) -> list[str]:
    """At each rate: how high each engine's best preset gets, and who drifts least on the highest that two reach."""
    said = []
    for rate in dict.fromkeys(line.rate for line in found):
        best: dict[str, tuple[int, bool]] = {}
        for line, stacks in found.items():
            if line.rate == rate:
                name = line.contender.engine
                best[name] = max((highest(stacks), stacks[-1].stands), best.get(name, (0, False)))
        order = sorted(best.items(), key=lambda item: item[1], reverse=True)
        heights = ", ".join(f"{engine.load(name).TITLE} {'≥ ' * more}{top}" for name, (top, more) in order)
        said.append(f"{rate:g} Hz, boxes of the highest stack that stands: {heights}.{_least(found, rate)}")
    return said


def _least(found: Mapping[Line, Sequence[Stack]], rate: float) -> str:
    drifts = {
        line.contender.label: {stack.count: stack.drift for stack in stacks if stack.stands}
        for line, stacks in found.items()
        if line.rate == rate
    }
    shared = [n for n in sorted({n for d in drifts.values() for n in d}) if sum(n in d for d in drifts.values()) > 1]
    if not shared:
        return ""
    n = shared[-1]
    order = sorted((d[n], label) for label, d in drifts.items() if n in d and math.isfinite(d[n]))
    return f" With {n} boxes {order[0][1]} drifts least, {order[0][0]:.1e} m; then {order[1][1]}, {order[1][0]:.1e} m."
