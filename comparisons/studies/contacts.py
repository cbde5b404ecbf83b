"""Errors of every engine on rigid bodies with a closed form: impacts, friction, rest and free rotation.

Where something happens at a time, an engine's luck depends on where in a step it happens: such a scene is run with its
events at several phases of the grid of steps, and the worst counts. A scheme of second order that starts with half a
kick is exact, by construction, on parabolas and between impacts of equal velocities; so those win nobody anything.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from comparisons import catalog
from comparisons.gather import Gatherer, check
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.studies import _rigid
from comparisons.studies._contest import Standing, sentences
from comparisons.studies._rigid import ACCURATE, EULER, FAST, PARTICLES, Contender, capped, chosen, phases_of
from comparisons.study import Panel, Series, Study, Table, head

RATES = (60.0, 240.0, 1000.0)
PHASES = 8
CAP = 4.0
"""Seconds that a run may take."""

LOWEST = 1e-16
CONTENDERS = (
    ACCURATE,
    FAST,
    PARTICLES,
    Contender("pybullet, best preset", "pybullet", ("matched", "matched_bounce", "default")),
    Contender("pybullet, default", "pybullet", ("default",)),
    Contender("pymunk, best preset", "pymunk", ("matched", "default")),
    Contender("pymunk, default", "pymunk", ("default",)),
    Contender("MuJoCo, best preset", "mujoco", ("matched", "default")),
    Contender("MuJoCo, default", "mujoco", ("default",)),
    EULER,
)


@dataclass(frozen=True, eq=False)
class Question:
    """A scene and what is asked of it.

    words : by metric
    has_events : whether it is run at several phases of the grid of steps
    by_construction : metrics in which schemes of second order have no error
    at_most : rates [Hz] beyond which it is not run
    """

    scene: str
    words: Mapping[str, str]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    has_events: bool = False
    by_construction: tuple[str, ...] = ()
    at_most: float = math.inf


QUESTIONS = (
    Question(
        "drop",
        {"impact_time": "drop, impact time", "position_error": "drop, position"},
        has_events=True,
        by_construction=("impact_time",),
    ),
    Question("rebound", {"rebound": "flat rebound, height"}, has_events=True),
    Question(
        "bouncing_ball", {"apexes": "bouncing ball, apexes", "stop_time": "bouncing ball, stop time"}, has_events=True
    ),
    Question("elastic_ball", {"energy_drift": "elastic ball, energy, 20 s"}, has_events=True),
    Question(
        "box_impact", {"velocity_error": "box hits box, velocity"}, has_events=True, by_construction=("velocity_error",)
    ),
    Question("slide", {"stop_distance": "slide, stop distance"}, has_events=True),
    Question("incline_slip", {"position_error": "incline, slip"}, by_construction=("position_error",)),
    Question("incline_stick", {"creep": "incline 20°, creep in 10 s"}),
    Question("incline_stick", {"creep": "incline 0.97 of limit, creep"}, {"ratio": 0.97}),
    Question("rolling", {"position_error": "rolling"}, by_construction=("position_error",)),
    Question("rocking", {"position_error": "rocking block"}, has_events=True),
    Question("top", {"attitude_error": "free top in 3D, attitude"}),
    Question("stack", {"drift": "stack of 20, drift"}, {"count": 20}, at_most=240.0),
    Question("mass_ratio", {"penetration": "mass ratio 1:1000, overlap"}),
)


@dataclass(frozen=True)
class Asked:
    """A question to a contender at one preset: at rising rates, each in its phases if there are events."""

    question: Question
    contender: Contender
    preset: str
    rates: Sequence[float]
    phases: int

    @property
    def count(self) -> int:
        """Runs at each rate."""
        return self.phases if self.question.has_events else 1

    @property
    def specs(self) -> list[RunSpec]:
        """All runs, from large steps to small."""
        q, metrics = self.question, tuple(self.question.words)
        steps = [self.contender.spec(q.scene, q.parameters, self.preset, 1.0 / rate, metrics) for rate in self.rates]
        return [spec for step in steps for spec in phases_of(step, self.count)]

    def by_rate(self, group: Sequence[Record]) -> dict[float, list[Record]]:
        """The records at each rate at which all phases were run."""
        parts = {rate: group[k * self.count : (k + 1) * self.count] for k, rate in enumerate(self.rates)}
        return {rate: list(part) for rate, part in parts.items() if len(part) == self.count}


@dataclass(frozen=True)
class Cell:
    """A metric of a question, asked of a contender at a rate [Hz], and the record that answers."""

    question: Question
    contender: Contender
    rate: float
    metric: str
    record: Record

    @property
    def error(self) -> float:
        """Nan where there is none."""
        return self.record.metric(self.metric)

    @property
    def row(self) -> str:
        """The question in words, with its unit."""
        unit = catalog.load("metrics", self.metric).UNIT
        return self.question.words[self.metric] + (f" [{unit}]" if unit not in ("1", "m g L") else " [rel.]")

    @property
    def counts(self) -> bool:
        """Whether an engine can win here."""
        return self.metric not in self.question.by_construction


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    rates: Sequence[float] = RATES,
    phases: int = PHASES,
    cap: float = CAP,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Ask every engine every question.

    Parameters
    ----------
    engines : names; default all that move rigid bodies
    settings : must be empty
    rates : steps per second [Hz]; the sample interval, 1/20 s, must be a whole number of steps
    phases : of the grid of steps, for scenes with events
    cap : seconds that a run may take; what would take longer is left out

    Raises
    ------
    InvalidInput : before anything runs
    """
    contenders = chosen(engines, settings, CONTENDERS)
    _rigid.positive(rates=rates, phases=[phases], cap=[cap])
    asked = [
        Asked(question, one, preset, sorted(rate for rate in set(rates) if rate <= question.at_most), phases)
        for one in contenders
        for question in QUESTIONS
        for preset in one.presets
    ]
    check(spec for part in asked for spec in part.specs)
    names = list(dict.fromkeys(one.engine for one in contenders))
    with Gatherer(names, "contacts", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(part.contender.engine, capped(part.specs, cap)) for part in asked])
    found: dict[tuple[Question, Contender, float], list[list[Record]]] = {}
    for part, group in zip(asked, groups, strict=True):
        for rate, records in part.by_rate(group).items():
            found.setdefault((part.question, part.contender, rate), []).append(records)
    cells = [Cell(*key, metric, _answer(runs, metric)) for key, runs in found.items() for metric in key[0].words]
    return _study(cells, contenders, phases, gatherer.omissions)


def _answer(runs: list[list[Record]], metric: str) -> Record:
    """Of each preset the worst phase, of these the best."""
    return _rigid.least([_rigid.worst(phases, metric) for phases in runs], metric)


# ------------------------------------------------------------------ what is shown


def _study(cells: list[Cell], contenders: list[Contender], phases: int, omissions: list[Any]) -> Study:
    rates = sorted({cell.rate for cell in cells})
    rows = list(dict.fromkeys(cell.row for q in QUESTIONS for cell in cells if cell.question is q))
    shown = {cell.row: cell.row if cell.counts else f"{cell.row} †" for cell in cells}
    standings = [Standing(c.row, c.contender.label, c.contender.engine, c.rate, c.error, c.counts) for c in cells]
    worst = f"worst of {_rigid.counted(phases, 'phase')} of the step grid"
    return Study(
        kind="contacts",
        title=f"Errors against closed forms, {worst} († exact by construction)",
        subject="contacts",
        scene="",
        parameters={"phases": phases},
        head=head(),
        panels=[
            Panel(
                name=_named(rate),
                title=_named(rate),
                x="error, in the unit of the row",
                y="",
                lowest=LOWEST,
                rows=[shown[row] for row in rows],
            )
            for rate in rates
        ],
        series=[_series(rate, one, cells, rows) for rate in rates for one in contenders],
        records=list({cell.record.key: cell.record for cell in cells}.values()),
        omissions=omissions + _rigid.others_left_out(),
        sentences=[
            said for rate in rates for said in sentences(_named(rate), [s for s in standings if s.rate == rate])
        ],
        tables=[_table(rate, rows, cells, contenders, phases) for rate in rates],
    )


def _named(rate: float) -> str:
    return f"{rate:g} Hz"


def _series(rate: float, one: Contender, cells: list[Cell], rows: list[str]) -> Series:
    mine = [cell for cell in cells if cell.rate == rate and cell.contender is one and math.isfinite(cell.error)]
    return Series(
        panel=_named(rate),
        label=one.label,
        engine=one.engine,
        preset=one.presets[0],
        x=[max(cell.error, LOWEST) for cell in mine],
        y=[float(rows.index(cell.row)) for cell in mine],
    )


def _table(rate: float, rows: list[str], cells: list[Cell], contenders: list[Contender], phases: int) -> Table:
    """A row for each question, a column for each contender; a star for the least error."""
    here = {(cell.row, cell.contender.label): cell for cell in cells if cell.rate == rate}
    body = []
    for row in rows:
        some = [here[row, one.label] for one in contenders if (row, one.label) in here]
        if not some:
            continue
        best = min((cell.error for cell in some if math.isfinite(cell.error)), default=math.nan)
        marks = [_text(here.get((row, one.label)), best) for one in contenders]
        body.append([row if some[0].counts else f"{row} (exact by construction, no win)", *marks])
    title = f"Errors at {_named(rate)}, the worst of {_rigid.counted(phases, 'phase')} where there are events"
    title += f"; ★ least; {_rigid.PENALTY}"
    return Table(title=title, columns=["scene, error", *(one.label for one in contenders)], rows=body)


def _text(cell: Cell | None, best: float) -> str:
    """An error, the preset that gave it if another than the first could, or why there is none."""
    if cell is None:
        return "- budget"
    if not math.isfinite(cell.error):
        return f"- {cell.record.status.code}"
    star = "★ " if cell.counts and cell.error <= max(best, _rigid.ROUND_OFF) else ""
    preset = f" ({cell.record.preset})" if cell.record.preset != cell.contender.presets[0] else ""
    return f"{star}{cell.error:.1e}{preset}"
