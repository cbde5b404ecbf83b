"""Time to equal residual: how many sweeps each order needs to get as far as natural order, and how long they take.

One step from the stretched start without gravity, so that the solver alone is at work. Residual: rms of C / rest length
over the links. Orders differ in what a sweep leaves: half a correction on every link in natural order, in red-black
order a whole one on every second, whose rms is sqrt(2) times as large for the same mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons.gather import Gatherer, Ladder, check, through
from comparisons.record import Record, RunSpec
from comparisons.studies._sweeping import PEER, Contender, Sized, size_of, sized
from comparisons.study import Table, duration
from pbd.errors import InvalidInput

METRIC = "link_rms"
USUAL: dict[str, tuple[int, tuple[int, ...]]] = {"links": (100, (1000, 10_000)), "size": (64, (10, 100))}
"""By the parameter that sets the size: its value, and natural sweeps until residuals fall slowly, and at last fast."""

MOST = 64
"""Times the natural sweeps: an order that needs more does not arrive."""

PRECISION = 0.01
"""Of the number of sweeps, to which it is found."""

ROUND_OFF = 1e-6
"""Of the residual: in another order of operations, or in single precision, the same sweeps leave this much more."""

NATURAL = Contender("natural order", "pbd", settings={"method": "pbd", "order": "natural", "precision": "float64"})


@dataclass(frozen=True)
class Goal:
    """The scene, and the natural sweeps whose residuals are to be reached."""

    sized: Sized
    sweeps: tuple[int, ...]


@dataclass(frozen=True)
class Arrival:
    """The cheapest run of a contender that reaches the residual ``target`` of ``sweeps`` natural ones, if any does."""

    sweeps: int
    target: float
    one: Contender
    record: Record | None

    @property
    def seconds(self) -> float:
        """Its run time [s]; nan where there is none."""
        return self.record.seconds.min if self.record and self.record.seconds else math.nan


def prepare(scene_name: str, changes: Mapping[str, Any], sweeps: Sequence[int] | None) -> Goal:
    """What is to be reached; `InvalidInput` for numbers of sweeps that are none."""
    name = size_of(scene_name)
    size, usual = USUAL[name]
    if sweeps is not None and not sweeps:
        raise InvalidInput("sweeps", sweeps, "at least one number")
    goal = Goal(sized(scene_name, {name: size, **changes}), tuple(sweeps or usual))
    check([NATURAL.spec(goal.sized, 1, MOST * n, (METRIC,)) for n in goal.sweeps])
    return goal


def measure(gatherer: Gatherer, goal: Goal, contestants: Sequence[Contender], rounds: int) -> list[Arrival]:
    """For each number of natural sweeps the arrival of every contender, with its time."""
    specs = [NATURAL.spec(goal.sized, 1, n, (METRIC,)) for n in goal.sweeps]
    (natural,) = gatherer.groups([(NATURAL.engine, through(specs))])
    targets = [record.metric(METRIC) * (1.0 + ROUND_OFF) for record in natural]
    tasks = [(n, target, one) for n, target in zip(goal.sweeps, targets, strict=True) for one in contestants]
    ladders = [(one.engine, search(_of(one, goal), n, target)) for n, target, one in tasks]
    found = [cheapest(group, task[1]) for group, task in zip(gatherer.groups(ladders), tasks, strict=True)]
    timed = {r.key: r for r in gatherer.times([record for record in found if record], rounds)}
    return [Arrival(*task, timed[record.key] if record else None) for task, record in zip(tasks, found, strict=True)]


def _of(one: Contender, goal: Goal) -> Callable[[int], RunSpec]:
    return lambda n: one.spec(goal.sized, 1, n, (METRIC,))


def search(spec: Callable[[int], RunSpec], start: int, target: float) -> Ladder:
    """A ladder to the least number of iterations that reaches ``target``: doubling or halving, then bisection."""

    def following(found: list[Record]) -> RunSpec | None:
        if any(record.status.code != "ok" for record in found):
            return None
        counts = {int(r.settings["iterations"]): r.metric(METRIC) <= target for r in found}
        high = min((n for n, reached in counts.items() if reached), default=0)
        low = max((n for n, reached in counts.items() if not reached), default=0)
        if not high:
            following_count = 2 * low or start
            return spec(following_count) if following_count <= MOST * start else None
        if high - low <= max(1.0, PRECISION * high):
            return None
        return spec((low + high) // 2)

    return following


def cheapest(found: Sequence[Record], target: float) -> Record | None:
    """The record with the fewest iterations that reached ``target``."""
    reached = [record for record in found if record.metric(METRIC) <= target]
    return min(reached, key=lambda record: int(record.settings["iterations"]), default=None)


def records(arrivals: Sequence[Arrival]) -> list[Record]:
    """Their records, with times."""
    return [arrival.record for arrival in arrivals if arrival.record]


# ------------------------------------------------------------------ in words


def table(goal: Goal, arrivals: Sequence[Arrival]) -> Table:
    """A row for each arrival, grouped by what is reached."""
    rows = []
    for arrival in arrivals:
        peer = next((a.seconds for a in arrivals if a.one.engine == PEER and a.sweeps == arrival.sweeps), math.nan)
        time = duration(arrival.seconds) if arrival.seconds > 0.0 else "-"
        ratio = f"{peer / arrival.seconds:.3g}" if peer / arrival.seconds > 0.0 else "-"
        what = f"{arrival.sweeps} natural sweeps: {arrival.target:.3g}"
        rows.append([what, arrival.one.label, _count(arrival), time, ratio])
    columns = ["residual (rms C / rest) of", "order", "sweeps", "run time", "pyPBD's / this one's"]
    return Table(title=f"Time to equal residual, PBD (k = 1), {goal.sized.words}", columns=columns, rows=rows)


def sentences(goal: Goal, arrivals: Sequence[Arrival]) -> list[str]:
    """Who gets to each residual, the first first."""
    said = []
    for n in goal.sweeps:
        ranked = sorted((a for a in arrivals if a.sweeps == n and a.seconds > 0.0), key=lambda a: a.seconds)
        times = ", ".join(f"{a.one.label} {duration(a.seconds)} ({_count(a)} sweeps)" for a in ranked)
        if ranked:
            goal_words = f"To the residual of {n} natural sweeps, {ranked[0].target:.3g}"
            said.append(f"{goal_words}, {goal.sized.words}: {times}.")
    return said


def _count(arrival: Arrival) -> str:
    return str(arrival.record.settings["iterations"]) if arrival.record else "not reached"
