"""How studies run many specs: each engine in its own worker, errors first, then times, interleaved.

The error pass uses both cores, engine beside engine; the time pass runs alone, in rounds over all engines,
and keeps the minimum. Records come from the store where it has them; times never do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, TypeVar

import msgspec
import numpy as np

from comparisons import store
from comparisons.isolation import Lost, Workers
from comparisons.progress import Progress
from comparisons.record import Record, RunSpec, Seconds, plain
from comparisons.run import bind, build_scene, execute
from comparisons.study import Omission
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput, unknown

PARALLEL = 2
ROUNDS = 3
FLOOR_GAIN = 0.8
"""Two refinements in a row that left more than this share of the error have met a floor."""

MAX_LEVELS = 16

Result = TypeVar("Result")

Ladder = Callable[[list[Record]], RunSpec | None]
"""Gives the next spec from the records so far, or None at its end."""


def asked(
    scene: Mapping[str, Any] | None,
    engines: Sequence[str] | None,
    settings: Mapping[str, Mapping[str, Any]] | None,
    usual: Iterable[str],
) -> tuple[dict[str, Any], list[str], dict[str, dict[str, Any]]]:
    """What a study is asked for, as plain data: scene parameters, engines (default ``usual``), settings by engine.

    Raises `InvalidInput` for settings of an engine that is not in the study.
    """
    names = list(engines or usual)
    changes = {name: plain(each) for name, each in (settings or {}).items()}
    for name in changes:
        if name not in names:
            raise unknown("settings", name, names)
    return plain(scene or {}), names, changes


def check(specs: Iterable[RunSpec]) -> None:
    """Refuse bad input before anything runs."""
    for spec in specs:
        bind(spec)


def by_engine(title: str, jobs: Sequence[tuple[str, Callable[[], Result]]], *, quiet: bool) -> list[Result]:
    """What each job of an engine gives, in the given order; the engines run beside each other."""
    done: dict[int, Result] = {}
    with Progress(title, len(jobs), quiet=quiet) as progress:

        def work(name: str) -> None:
            for k, (owner, job) in enumerate(jobs):
                if owner == name:
                    done[k] = job()
                    progress.advance()

        with ThreadPoolExecutor(PARALLEL) as pool:
            list(pool.map(work, dict.fromkeys(owner for owner, _ in jobs)))
    return [done[k] for k in range(len(jobs))]


def with_motion(workers: Workers, spec: RunSpec, known: Trajectory | None = None) -> tuple[Record, Trajectory | None]:
    """A run's record and, where it has one, its motion; a ``known`` motion is measured only."""
    kept = [] if known is None else [known]

    def runner(asked: RunSpec) -> Trajectory:
        if not kept:
            kept.append(workers[asked.engine].run(asked))
        return kept[0]

    return execute(spec, runner), (kept[0] if kept else None)


class Gatherer:
    """Runs specs for a study, in the workers that it is given or, as a context manager, in its own."""

    def __init__(
        self, engines: Iterable[str], title: str, *, workers: Workers | None = None, quiet: bool = False
    ) -> None:
        self.engines = list(engines)
        self.omissions: list[Omission] = []
        self._title, self._quiet = title, quiet
        self._workers, self._owns = workers or Workers(), workers is None

    def __enter__(self) -> Gatherer:
        return self

    def __exit__(self, *error: object) -> None:
        if self._owns:
            self._workers.__exit__(*error)

    def groups(self, ladders: Sequence[tuple[str, Ladder]]) -> list[list[Record]]:
        """The records of each ladder of an engine, in the given order; the engines run beside each other."""
        jobs = [(owner, partial(self._climb, ladder)) for owner, ladder in ladders]
        done = by_engine(f"{self._title}, errors", jobs, quiet=self._quiet)
        self._note_omissions([record for group in done for record in group])
        return done

    def _climb(self, ladder: Ladder) -> list[Record]:
        found: list[Record] = []
        while (spec := ladder(found)) is not None:
            found.append(self._record(spec))
        return found

    def _record(self, spec: RunSpec) -> Record:
        record = store.load_record(spec)
        if record is None:
            record = execute(spec, self._workers[spec.engine].run)
            store.save_record(spec, record)
        return record

    def times(self, records: list[Record], rounds: int = ROUNDS) -> list[Record]:
        """The records with the run time of each that is ok: minimum over interleaved rounds."""
        timed = [record for record in records if record.status.code == "ok"]
        gross: dict[str, float] = {}
        overhead: dict[str, float] = {}
        with Progress(f"{self._title}, times", len(timed) * rounds, quiet=self._quiet) as progress:
            for _ in range(rounds):
                for record in timed:
                    self._time(record, gross, overhead)
                    progress.advance()
        return [_with_seconds(record, gross, overhead, rounds) for record in records]

    def times_by_length(self, records: list[Record], rounds: int, long: float, cap: float = np.inf) -> list[Record]:
        """As `times`, but once for what took longer than ``long``, and not for what took longer than ``cap`` [s]."""
        found = {record.key: record for record in records}
        short = [record for record in records if record.wall <= long]
        slow = [record for record in records if long < record.wall <= cap]
        for some, repeats in ((short, rounds), (slow, 1)):
            found |= {record.key: record for record in self.times(some, repeats)}
        return [found[record.key] for record in records]

    def _time(self, record: Record, gross: dict[str, float], overhead: dict[str, float]) -> None:
        worker, spec = self._workers[record.engine], spec_of(record)
        try:
            one, empty = worker.seconds(spec)
        except Lost:
            return
        gross[record.key] = min(one, gross.get(record.key, one))
        overhead[record.key] = min(empty, overhead.get(record.key, empty))

    def _note_omissions(self, records: list[Record]) -> None:
        for name in self.engines:
            mine = [record for record in records if record.engine == name]
            if mine and all(record.status.code in ("unsupported", "refused", "crashed", "timeout") for record in mine):
                status = mine[0].status
                self.omissions.append(Omission(name, status.quantity, status.remedy))


def _with_seconds(record: Record, gross: dict[str, float], overhead: dict[str, float], rounds: int) -> Record:
    if record.key not in gross:
        return record
    seconds = Seconds(min=gross[record.key], repeats=rounds, overhead=overhead[record.key])
    return msgspec.structs.replace(record, seconds=seconds)


def spec_of(record: Record) -> RunSpec:
    """The spec that gave a record; its settings are complete, so the preset changes nothing."""
    return RunSpec(
        scene=record.scene,
        engine=record.engine,
        parameters=record.parameters,
        preset=record.preset,
        settings=record.settings,
        seed=record.seed,
    )


def descend(base: RunSpec, dts: list[float] | None, cap: float) -> Ladder:
    """A ladder over time steps: the given ones, or halving from the sample interval down.

    Without a list it ends before a run would take longer than ``cap`` seconds, at a floor, or after
    MAX_LEVELS levels. Raises `InvalidInput` for a wrong time step or cap now, before anything runs.
    """
    scene = build_scene(base.scene, base.parameters)
    start = scene.duration / scene.samples
    if not cap > 0.0:
        raise InvalidInput("cap", cap, "a number > 0 s")
    if dts is not None and not dts:
        raise InvalidInput("dt", dts, "at least one number")
    for dt in dts or [start]:
        bind(msgspec.structs.replace(base, settings={**base.settings, "dt": dt}))

    def following(found: list[Record]) -> RunSpec | None:
        k = len(found)
        given = dts[k : k + 1] if dts is not None else [start / 2**k] if _goes_on(found, cap) else []
        dt = given[0] if given else None
        return None if dt is None else msgspec.structs.replace(base, settings={**base.settings, "dt": dt})

    return following


def _goes_on(found: list[Record], cap: float) -> bool:
    if not found:
        return True
    if len(found) == MAX_LEVELS or found[-1].status.code not in ("ok", "drifting", "diverged"):
        return False
    errors = [record.metric("position_error") for record in found[-3:]]
    at_floor = len(errors) == 3 and errors[2] > FLOOR_GAIN * errors[1] and errors[1] > FLOOR_GAIN * errors[0]
    return not at_floor and _next_wall(found) <= cap


def _next_wall(found: list[Record]) -> float:
    """What half the time step would take [s], by the last two runs, so that one hiccup of the machine ends nothing."""
    return min(2.0 * found[-1].wall, 4.0 * found[-2].wall if len(found) > 1 else np.inf)


def through(specs: Sequence[RunSpec], cap: float = np.inf) -> Ladder:
    """The ladder of given specs, from cheap to dear; it ends after two that took longer than ``cap`` seconds."""

    def following(found: list[Record]) -> RunSpec | None:
        dear = bool(found) and min(record.wall for record in found[-2:]) > cap
        return None if dear or len(found) == len(specs) else specs[len(found)]

    return following
