"""What a heap costs: time of a body's step against overlap and remaining motion, and against the number of boxes.

Boxes fall into a container for 3 s. No two engines' heaps agree, so there is no error: but in the end nothing should
overlap, and nothing move. A body's step is one time step of one body, whatever an engine does in it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons.gather import ROUNDS, Gatherer, Ladder, check
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.studies import _rigid
from comparisons.studies._rigid import AT_ONE_PRESET, FAST, OURS, PARTICLES, Contender, chosen
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

RATE = 240.0
COUNTS, SOLIDS, SIZES = (100, 1000), (100,), (100, 300, 1000, 3000, 10_000)
CAP = 30.0
LONG = 0.5
"""Seconds: a run that takes longer is timed once."""

GROWTH = 1.5
"""Exponent with which cost is taken to grow with the number of boxes; that of dense solvers grows faster."""

LARGE, PROBE = 200, 10
"""A first pile so large is preceded by one of PROBE times fewer boxes, so that no engine starts on hours of work."""

CONTENDERS = tuple(Contender(one.label, one.engine, ("default",)) if one is PARTICLES else one for one in AT_ONE_PRESET)
"""Particle boxes at their default, which costs a tenth of their accurate preset."""

OVERLAP, MOTION, DEEPEST = "settled_penetration", "residual_kinetic_energy", "penetration"
METRICS = (OVERLAP, MOTION, DEEPEST)
X = {OVERLAP: "overlap at the end [m]", MOTION: "kinetic energy at the end [J/kg]"}
Y = "time of a body's step [µs]"
LOWEST = 1e-9


@dataclass(frozen=True)
class Pile:
    """``count`` boxes in 2D or 3D."""

    count: int
    dimension: int

    @property
    def words(self) -> str:
        """For headings."""
        return f"{self.count} boxes, {self.dimension}D"


@dataclass(frozen=True)
class Ascent:
    """A contender and its piles of one dimension, from small to large."""

    contender: Contender
    piles: tuple[Pile, ...]

    def specs(self) -> list[RunSpec]:
        """Its runs."""
        preset = self.contender.presets[0]
        given = [{"count": pile.count, "dimension": pile.dimension} for pile in self.piles]
        return [self.contender.spec("pile", each, preset, 1.0 / RATE, METRICS) for each in given]

    def ladder(self, cap: float) -> Ladder:
        """It ends before a pile that would take longer than ``cap`` seconds, going by the one before."""
        specs = self.specs()

        def following(found: list[Record]) -> RunSpec | None:
            k = len(found)
            if k == len(specs):
                return None
            growth = (self.piles[k].count / self.piles[k - 1].count) ** GROWTH if k else 0.0
            return None if k and found[-1].wall * growth > cap else specs[k]

        return following


@dataclass(frozen=True)
class Heap:
    """A contender's pile and its record."""

    contender: Contender
    pile: Pile
    record: Record

    @property
    def cost(self) -> float:
        """Time of a body's step [µs], nan where it was not measured."""
        seconds = self.record.seconds
        return 1e6 * seconds.min / (self.record.steps * self.pile.count) if seconds else math.nan


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    counts: Sequence[int] = COUNTS,
    solids: Sequence[int] | None = SOLIDS,
    sizes: Sequence[int] | None = SIZES,
    cap: float = CAP,
    rounds: int = ROUNDS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Let boxes fall on a heap.

    Parameters
    ----------
    engines : names; default all that move rigid bodies
    settings : must be empty
    counts, solids : boxes of piles in 2D and in 3D, of every engine
    sizes : boxes of the piles, in 2D, over which our cost is shown
    cap : seconds; what would take longer, by a smaller pile, is left out, and what took longer is not timed
    rounds : interleaved timings of each run, of which the minimum counts

    Raises
    ------
    InvalidInput : before anything runs
    """
    contenders = chosen(engines, settings, CONTENDERS)
    _rigid.positive(counts=counts, cap=[cap], rounds=[rounds])
    if any(count < 1 for count in [*(solids or ()), *(sizes or ())]):
        raise InvalidInput("solids, sizes", [*(solids or ()), *(sizes or ())], "numbers >= 1, or none")
    ascents = _ascents(contenders, counts, solids or (), sizes or ())
    check(spec for ascent in ascents for spec in ascent.specs())
    names = list(dict.fromkeys(one.engine for one in contenders))
    with Gatherer(names, "piles", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(ascent.contender.engine, ascent.ladder(cap)) for ascent in ascents])
        records = [record for group in groups for record in group]
        timed = {record.key: record for record in gatherer.times_by_length(records, rounds, LONG, cap)}
        omissions = gatherer.omissions
    found = [
        Heap(ascent.contender, pile, timed[record.key])
        for ascent, group in zip(ascents, groups, strict=True)
        for pile, record in zip(ascent.piles, group, strict=False)
    ]
    shown = [Pile(n, d) for d, many in ((2, counts), (3, solids or ())) for n in sorted(set(many))]
    panels, series = _figure(found, shown, bool(sizes))
    return Study(
        kind="piles",
        title=f"Piles of boxes at {RATE:g} Hz, after 3 s",
        subject="piles",
        scene="pile",
        parameters={},
        head=head(),
        panels=panels,
        series=series,
        records=list({heap.record.key: heap.record for heap in found}.values()),
        omissions=omissions + _rigid.others_left_out(),
        sentences=[said for pile in shown if (said := _sentence(pile, found))],
        tables=[_table(found)],
    )


def _ascents(
    contenders: Sequence[Contender], counts: Sequence[int], solids: Sequence[int], sizes: Sequence[int]
) -> list[Ascent]:
    """Everybody's piles; our fast preset's go on to all sizes."""
    found = []
    for one in contenders:
        for d, many in ((2, {*counts, *(sizes if one is FAST else ())}), (3, set(solids))):
            if many:
                probe = {min(many) // PROBE} if min(many) >= LARGE else set()
                found.append(Ascent(one, tuple(Pile(n, d) for n in sorted(many | probe))))
    return found


# ------------------------------------------------------------------ what is shown


def _figure(found: Sequence[Heap], shown: Sequence[Pile], has_sizes: bool) -> tuple[list[Panel], list[Series]]:
    """Cost against overlap and against motion of each pile, then our cost against size."""
    panels, series = [], []
    for pile in shown:
        for metric, x in X.items():
            name = f"{pile.words}, {metric}"
            heaps = [h for h in found if h.pile == pile and math.isfinite(h.cost)]
            points = [_point(name, heap, max(heap.record.metric(metric), LOWEST)) for heap in heaps]
            if points:
                panels.append(Panel(name=name, title=pile.words, x=x, y=Y))
                series += points
    ours = [h for h in found if h.contender.engine == OURS and h.pile.dimension == 2 and math.isfinite(h.cost)]
    if has_sizes and ours:
        panels.append(Panel(name="sizes", title="2D, cost against size", x="boxes", y=Y))
        for one in dict.fromkeys(heap.contender for heap in ours):
            line = sorted((float(h.pile.count), h.cost) for h in ours if h.contender is one)
            xs, ys = [x for x, _ in line], [y for _, y in line]
            series.append(Series(panel="sizes", label=one.label, engine=OURS, preset=one.presets[0], x=xs, y=ys))
    return panels, series


def _point(name: str, heap: Heap, x: float) -> Series:
    one = heap.contender
    return Series(
        panel=name, label=one.label, engine=one.engine, preset=one.presets[0], x=[x], y=[heap.cost], kind="trade"
    )


def _table(found: Sequence[Heap]) -> Table:
    """A row for each pile and contender."""
    rows = []
    for pile in sorted({heap.pile for heap in found}, key=lambda p: (p.dimension, p.count)):
        for heap in (h for h in found if h.pile == pile):
            record = heap.record
            values = [record.metric(metric) for metric in METRICS]
            texts = [f"{value:.1e}" if math.isfinite(value) else f"- {record.status.code}" for value in values]
            cost = f"{heap.cost:.3g}" if math.isfinite(heap.cost) else "-"
            rows.append([pile.words, heap.contender.label, cost, *texts])
    columns = ["pile", "engine", Y, X[OVERLAP], X[MOTION], "deepest overlap on the way [m]"]
    return Table(title=f"Piles at {RATE:g} Hz after 3 s; {_rigid.PENALTY}", columns=columns, rows=rows)


def _sentence(pile: Pile, found: Sequence[Heap]) -> str:
    """Who is fastest, who overlaps least, who is most at rest."""
    heaps = [heap for heap in found if heap.pile == pile and heap.record.status.code == "ok"]
    timed = [heap for heap in heaps if math.isfinite(heap.cost)]
    if not timed:
        return ""
    quick = min(timed, key=lambda heap: heap.cost)
    still = min(heaps, key=lambda heap: heap.record.metric(MOTION))
    tight = min(heaps, key=lambda heap: heap.record.metric(OVERLAP))
    said = f"{pile.words}: fastest is {quick.contender.label} with {quick.cost:.2g} µs a body's step"
    said += f"; {tight.contender.label} overlaps least, {tight.record.metric(OVERLAP):.1e} m"
    return f"{said}; most at rest is {still.contender.label}, {still.record.metric(MOTION):.1e} J/kg."
