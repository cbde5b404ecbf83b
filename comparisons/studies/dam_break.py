"""The dam break: fronts and heights over the experiments' points, and run time against the front's error.

A column of water, n^2 = 2, collapses until T = 3. Methods for fluids are compared with the numerical reference and
with Martin and Moyce's measurements; discs and balls, which engines of rigid bodies have instead of water, are grains
and shown for what they are. A measured front comes later than any inviscid one: by one shift in time, which a wall that
does not vanish at once and a wet floor explain. So the raw distance is told first, then the shift and what it leaves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from comparisons.film import Film, film
from comparisons.gather import ROUNDS, Gatherer, by_engine, check
from comparisons.isolation import Workers, lent
from comparisons.metrics import Subject, _water
from comparisons.record import Record
from comparisons.studies import _dam_break_words as words
from comparisons.studies import _fluids
from comparisons.studies._fluids import FAST, GRAINS, OURS, WCSPH, Contender
from comparisons.studies.work_precision import front, sentence, winner
from comparisons.study import Panel, Series, Study, head
from comparisons.water import FRONTS, HEIGHTS, experiment, front_reference, ritter

SCENE, ERROR = "dam_break", "front_error"
ACROSS, SHOWN = (10, 20, 40), 20
FRAMES = 20
"""In a unit of T, where a film is made; else half of them."""

LAST, BOUNDED = 3.2, 1.6
"""T of the last measurement that is drawn, and of the last point of Ritter's bound."""

VIEW = (-0.1, 4.7, -0.1, 2.3)
"""What the film shows: x from and to, y from and to [a]."""

LONG = 1.0
"""Seconds: a run that takes longer is timed once."""

CAP = 30.0
GROWTH = 8.0
"""How much longer a run takes with twice as many particles across, at least with steps that shrink with them."""

TARGETS = (1e-2,)
FILMED = (FAST, WCSPH, GRAINS[0], GRAINS[2])
METRICS = (
    ERROR, "front", "density_error", "density_peak", "volume_loss", "front_rms", "front_offset", "front_fitted_rms",
    "energy_rise",
)  # fmt: skip
PANELS = (
    Panel(name="front", title="front", x="T = t √(2g/a)", y="front [a]", linear=True),
    Panel(name="height", title="height at the wall", x="t √(g/a)", y="height [2a]", linear=True),
    Panel(name="race", title="run time against error", x="front error at T = 1, 2", y="run time [s]"),
)


@dataclass(frozen=True)
class Curves:
    """What is kept of a motion: T, front, its 99.5th percentile [a], height at the wall [2a]; at one resolution more.

    ``shot`` is its film.
    """

    times: np.ndarray
    fronts: np.ndarray
    percentiles: np.ndarray
    heights: np.ndarray
    shot: Film | None


@dataclass(frozen=True)
class Break:
    """A contender's dam break at a resolution."""

    contender: Contender
    across: int
    record: Record
    curves: Curves | None


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    across: Sequence[int] = ACROSS,
    shown: int = SHOWN,
    cap: float = CAP,
    rounds: int = ROUNDS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Let the column collapse in every engine.

    Parameters
    ----------
    engines : names; default all that move fluids, or grains
    settings : must be empty
    across : particles along the column's width, from coarse to fine
    shown : of them, the resolution of curves and film
    cap : seconds; a run that would take longer, by the coarser one, is left out
    rounds : interleaved timings of each short run, of which the minimum counts

    Raises
    ------
    InvalidInput : before anything runs
    """
    contenders = _fluids.chosen(engines, settings)
    _fluids.counts("across", across)
    _fluids.counts("rounds, shown", [rounds, shown])
    sizes = sorted({*across, shown})
    check(_spec(one, n, shown) for one in contenders for n in sizes)
    with lent(workers) as pool:
        jobs = [(one.engine, partial(_climb, pool, one, sizes, shown, cap)) for one in contenders]
        found = [each for some in by_engine("dam break", jobs, quiet=quiet) for each in some]
        gatherer = Gatherer([one.engine for one in contenders], "dam break", workers=pool, quiet=quiet)
        timed = gatherer.times_by_length([b.record for b in found], rounds, LONG)
    records = {record.key: record for record in timed}
    found = [Break(b.contender, b.across, records[b.record.key], b.curves) for b in found]
    exact = [records[b.record.key] for b in found if b.contender not in GRAINS]
    winners = [winner(exact, target, ERROR) for target in TARGETS]
    at = [b for b in found if b.across == shown and b.curves is not None]
    return Study(
        kind="dam_break",
        title=f"Dam break, curves at {shown} particles across",
        subject="dam break",
        scene=SCENE,
        parameters={},
        head=head(),
        panels=list(PANELS),
        series=[*_measurements(), *(s for b in at for s in _lines(b)), *_races(found)],
        records=list(records.values()),
        omissions=_fluids.lost(records.values()) + _fluids.others_left_out(),
        sentences=[*(sentence(won, (OURS,)) for won in winners), *words.sentences(found, shown)],
        winners=winners,
        tables=[words.accuracy(found), words.experiments(at)],
        films=[b.curves.shot for b in at if b.curves is not None and b.curves.shot is not None],
    )


def _spec(one: Contender, across: int, shown: int) -> Any:
    filmed = across == shown and one in FILMED
    samples = {"samples": 3 * (FRAMES if filmed else FRAMES // 2)}
    return one.spec(SCENE, {"across": across, **samples}, METRICS)


def _climb(pool: Workers, one: Contender, sizes: Sequence[int], shown: int, cap: float) -> list[Break]:
    """A contender's runs from coarse to fine."""
    found: list[Break] = []
    for n in sizes:
        if found and found[-1].record.wall * GROWTH ** math.log2(n / found[-1].across) > cap:
            break
        see = partial(_curves, one=one, filmed=n == shown and one in FILMED)
        record, curves = _fluids.measured(pool, _spec(one, n, shown), see)
        found.append(Break(one, n, record, curves))
        if record.status.code in ("unsupported", "crashed", "timeout"):
            break
    return found


def _curves(subject: Subject, one: Contender, filmed: bool) -> Curves:
    times, fronts = _water.dimensionless(subject)
    known = subject.scene.known
    shot = _shot(subject, one, times) if filmed else None
    percentiles = _water.fronts(subject, 99.5) / known["width"]
    heights = _water.heights(subject) / (known["ratio"] * known["width"])
    return Curves(times, fronts, percentiles, heights, shot)


def _shot(subject: Subject, one: Contender, times: np.ndarray) -> Film:
    """The film, its clock in T, and stills at T = 0, 1, 2, 3."""
    a = subject.scene.known["width"]
    return film(
        subject.scene,
        subject.trajectory,
        engine=one.engine,
        label=one.label.partition(" (")[0],
        note="",
        times=np.round(times, 6).tolist(),
        clock="T = {:.1f}",
        view=[share * a for share in VIEW],
        moments=[int(k) for k in np.searchsorted(times, np.arange(4.0) - 1e-9)],
    )


# ------------------------------------------------------------------ what is shown


def _measurements() -> list[Series]:
    """Experiments, the reference, and Ritter's bound."""
    reference = front_reference()
    found = [
        Series(panel=panel, label=label, engine="", x=xs.tolist(), y=ys.tolist(), kind="experiment")
        for panel, files in (("front", FRONTS), ("height", HEIGHTS))
        for label, file in files.items()
        for xs, ys in [experiment(file)[experiment(file)[:, 0] <= LAST].T]
    ]
    bound = np.linspace(0.0, BOUNDED, 4)
    return found + [
        Series(panel="front", label=label, engine="", x=xs.tolist(), y=ys.tolist(), kind=kind)
        for label, kind, xs, ys in (
            ("numerical reference", "closed form", reference.times, reference.values),
            ("Ritter, upper bound", "bound", bound, ritter(bound)),
        )
    ]


def _lines(b: Break) -> list[Series]:
    """Front and height over time."""
    assert b.curves is not None
    one, curves = b.contender, b.curves
    named: Any = {"label": one.label, "engine": one.engine, "preset": one.preset}
    t = curves.times
    return [
        Series(panel="front", x=t.tolist(), y=curves.fronts.tolist(), kind="curve", **named),
        Series(panel="height", x=(t / math.sqrt(2.0)).tolist(), y=curves.heights.tolist(), kind="curve", **named),
    ]


def _races(found: Sequence[Break]) -> list[Series]:
    """Every contender's resolutions, by rising cost."""
    series = []
    for one in dict.fromkeys(b.contender for b in found):
        mine = [b.record for b in found if b.contender is one and b.record.seconds]
        points = front([(r.metric(ERROR), r.seconds.min) for r in mine if r.seconds and r.metric(ERROR) > 0.0])
        if points:
            xs, ys = [x for x, _ in points], [y for _, y in points]
            named: Any = {"label": one.label, "engine": one.engine, "preset": one.preset}
            series.append(Series(panel="race", x=xs, y=ys, kind="front", **named))
    return series
