"""Run time against error: every setting a point, each engine's best a front.

The error is the first metric of a scene of rigid bodies, and else that of the position. Where something happens at a
time, each point is the worst of several phases of the grid of steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from comparisons import catalog, engine
from comparisons.gather import ROUNDS, Gatherer, Ladder, asked, descend, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.scene import Scene
from comparisons.studies._rigid import by_worst, worst_phase
from comparisons.study import Panel, Series, Study, Winner, duration, head, variant
from pbd import fields
from pbd.errors import InvalidInput

CAP = 0.5
"""Seconds that a run may take."""

POSITION, TIME = "position_error", "run time [s]"
TARGETS = (1e-2, 1e-4, 1e-6, 1e-8)
"""Errors at which the winner is named."""

LOWEST = 1e-16
"""Errors below are drawn there."""

YARDSTICK = 3.0
"""An engine that chooses its own steps may take this many times the cap, so that it shows on long chains too."""

OURS = ("pbd", "shake")
"""This project's engines; the first is the subject, PBD as published."""

OUR_BODIES = ("particle_boxes", "rattle")
"""The same of rigid bodies."""

ANALYST = "dop853"
"""Drawn as a yardstick, but no competitor: it needs equations made for the scene and takes no contacts."""


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    dt: Sequence[float] | None = None,
    cap: float = CAP,
    rounds: int = ROUNDS,
    phases: int = 1,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure error and run time of every engine over its settings and time steps.

    Parameters
    ----------
    scene_name, scene, engines, settings : as in the convergence study; settings given for an engine replace
        those that the study would try
    dt : time steps [s]; default halvings while a run takes less than ``cap`` seconds
    rounds : interleaved timings of each run, of which the minimum counts
    phases : of the grid of steps, for a scene of rigid bodies in which something happens at a time

    Raises
    ------
    InvalidInput : before anything runs
    """
    parameters, names, changes = asked(scene, engines, settings, catalog.names("engines"))
    if rounds < 1 or phases < 1:
        raise InvalidInput("rounds" if rounds < 1 else "phases", min(rounds, phases), "a whole number >= 1")
    built = build_scene(scene_name, parameters)
    metric, has_bodies = error_of(built), built.bodies is not None
    steps = None if dt is None else list(dt)
    ladders: list[tuple[str, Ladder]] = []
    counts: list[int] = []
    for name in names:
        specs = tried(scene_name, parameters, name, changes.get(name, {}))
        stepping = "dt" in fields.rules(engine.load(name).Settings)
        tries = [descend(s, steps, cap) for s in specs] if stepping else [through(specs, YARDSTICK * cap)]
        count = phases if stepping else 1
        ladders += [(name, worst_phase(ladder, count, metric)) for ladder in tries]
        counts += [count] * len(tries)
    with Gatherer(names, f"work-precision, {built.title}", workers=workers, quiet=quiet) as gatherer:
        groups = [by_worst(g, n, metric) for g, n in zip(gatherer.groups(ladders), counts, strict=True)]
        records = gatherer.times([record for group in groups for record in group], rounds)
        omissions = gatherer.omissions
    winners = [winner(records, target, metric) for target in TARGETS]
    x = axis(metric)
    return Study(
        kind="work_precision",
        title=f"Run time against error: {built.title}" + (f", worst of {phases} phases" if phases > 1 else ""),
        subject=built.title,
        scene=scene_name,
        parameters=parameters,
        head=head(),
        panels=[
            Panel(name="gross", title="as called from Python", x=x, y=TIME),
            Panel(name="net", title="less the engine's empty-world time", x=x, y=TIME),
        ],
        series=[s for name in names for s in _series([r for r in records if r.engine == name], metric)],
        records=records,
        omissions=omissions,
        sentences=[sentence(won, OUR_BODIES if has_bodies else OURS) for won in winners],
        winners=winners,
    )


def error_of(scene: Scene) -> str:
    """The metric that is a scene's error."""
    return POSITION if scene.bodies is None else scene.metrics[0]


def axis(metric: str) -> str:
    """A metric and its unit, for an axis."""
    module = catalog.load("metrics", metric)
    return f"{module.TITLE} [{module.UNIT}]" if module.UNIT != "1" else f"{module.TITLE}, relative"


def tried(scene_name: str, parameters: dict[str, Any], name: str, changes: dict[str, Any]) -> list[RunSpec]:
    """The specs that are tried of an engine, before the time step varies: its default, and its sweep, matched."""
    adapter = engine.load(name)
    preset = "matched" if "matched" in adapter.PRESETS else "default"
    metrics = tuple(dict.fromkeys((error_of(build_scene(scene_name, parameters)), POSITION, "energy_drift")))
    base = RunSpec(scene=scene_name, engine=name, parameters=parameters, metrics=metrics)
    if changes:
        presets = dict.fromkeys(("default", preset))
        return [msgspec.structs.replace(base, preset=p, settings=changes) for p in presets]
    built = build_scene(scene_name, parameters)
    swept = [dict(chosen) for chosen in adapter.sweep(built)]
    if built.bodies is not None:  # whose sweeps are what is tried beside the preset itself
        usual = engine.make_settings(name, preset, {})
        swept = [{}] + [chosen for chosen in swept if engine.make_settings(name, preset, chosen) != usual]
    found = [base] if preset == "matched" else []
    return found + [msgspec.structs.replace(base, preset=preset, settings=chosen) for chosen in swept]


def front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The (error, seconds) points that no other beats in both, by falling error."""
    kept: list[tuple[float, float]] = []
    for error, seconds in sorted(points):
        if not kept or seconds < kept[-1][1]:
            kept.append((error, seconds))
    return kept[::-1]


def time_to_error(records: Sequence[Record], target: float, metric: str = POSITION) -> dict[str, tuple[float, Record]]:
    """engine -> (seconds, record) of its fastest measured run with an error of at most ``target``; no extrapolation."""
    best: dict[str, tuple[float, Record]] = {}
    for record in records:
        if record.seconds is None or not record.metric(metric) <= target:
            continue
        if record.engine not in best or record.seconds.min < best[record.engine][0]:
            best[record.engine] = (record.seconds.min, record)
    return best


def winner(records: Sequence[Record], target: float, metric: str = POSITION) -> Winner:
    """Who reaches ``target`` first; the analyst's tool is timed but does not compete."""
    best = time_to_error(records, target, metric)
    rivals = sorted((seconds, name) for name, (seconds, _) in best.items() if name != ANALYST)
    first = rivals[0][1] if rivals else ""
    setting = variant(best[first][1]) if first else ""
    seconds, unit = {name: best[name][0] for name in best}, catalog.load("metrics", metric).UNIT
    return Winner(target=target, engine=first, setting=setting, seconds=seconds, unit=unit)


def sentence(won: Winner, ours: Sequence[str] = OURS) -> str:
    """Who reaches an error first, by how much, and where this project's best and PBD itself stand, ``ours[0]``."""
    yard = f"; {_titled(ANALYST)} takes {duration(won.seconds[ANALYST])}" if ANALYST in won.seconds else ""
    goal = f"To {won.target:g} {won.unit}".removesuffix(" 1")
    if not won.engine:
        return f"{goal}: no engine gets there within the budget{yard}."
    seconds = won.seconds[won.engine]
    text = f"{goal}: {_titled(won.engine)} ({won.setting}) wins with {duration(seconds)}"
    later = sorted((s, n) for n, s in won.seconds.items() if n not in (won.engine, ANALYST))
    text += f", {later[0][0] / seconds:.1f} times faster than {_titled(later[0][1])}" if later else ", alone"
    named = {won.engine, *(name for _, name in later[:1])}
    return text + "".join(_standing(name, won, ours) for name in _to_tell(won, ours) if name not in named) + yard + "."


def _to_tell(won: Winner, ours: Sequence[str]) -> list[str]:
    """Whose place must be told: that of PBD, and before it the project's best where another engine wins."""
    found = sorted((won.seconds[name], name) for name in ours if name in won.seconds)
    best = [found[0][1]] if found and won.engine not in ours else []
    return list(dict.fromkeys([*best, ours[0]]))


def _standing(name: str, won: Winner, ours: Sequence[str]) -> str:
    taken = won.seconds.get(name)
    if taken is None:
        return f"; {_titled(name)} does not get there in the budget"
    title = _titled(name) if name == ours[0] else f"this project's best, {_titled(name)},"
    return f"; {title} needs {taken / won.seconds[won.engine]:.0f} times as long"


def by_setting(study: Study, name: str) -> Study:
    """A study of one engine drawn from the records of ``study``: a line for each of its settings."""
    lines: dict[str, list[tuple[float, float]]] = {}
    for record in study.records:
        if record.engine == name and record.seconds and record.metric(POSITION) > 0.0:
            lines.setdefault(variant(record), []).append((record.metric(POSITION), record.seconds.min))
    series = [
        Series(panel="settings", label=label, engine=name, x=[p[0] for p in points], y=[p[1] for p in points])
        for label, points in lines.items()
    ]
    panel = Panel(name="settings", title=_titled(name), x=axis(POSITION), y=TIME)
    title = f"Settings of {_titled(name)}: {study.subject}"
    changes = {"kind": "settings", "title": title, "subject": _titled(name), "panels": [panel], "series": series}
    kept = [record for record in study.records if record.engine == name]
    return msgspec.structs.replace(study, **changes, records=kept, sentences=[], winners=[], omissions=[])


def _series(records: list[Record], metric: str) -> list[Series]:
    """All points of one engine and its front, gross and net."""
    timed = [(max(r.metric(metric), LOWEST), r.seconds) for r in records if r.seconds and r.metric(metric) >= 0.0]
    if not timed:
        return []
    found, name = [], records[0].engine
    for panel in ("gross", "net"):
        points = [(error, s.min if panel == "gross" else s.net) for error, s in timed]
        points = [(error, seconds) for error, seconds in points if seconds > 0.0]
        for kind, kept in (("points", points), ("front", front(points))):
            label, (xs, ys) = engine.load(name).TITLE, ([p[0] for p in kept], [p[1] for p in kept])
            found.append(Series(panel=panel, label=label, engine=name, x=xs, y=ys, kind=kind))
    return found


def _titled(name: str) -> str:
    return str(engine.load(name).TITLE)
