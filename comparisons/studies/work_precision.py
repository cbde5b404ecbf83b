"""Run time against error: every setting a point, each engine's best a front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from comparisons import catalog, engine
from comparisons.gather import ROUNDS, Gatherer, Ladder, asked, descend, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.study import Panel, Series, Study, Winner, duration, head, variant
from pbd import fields
from pbd.errors import InvalidInput

CAP = 0.5
"""Seconds that a run may take."""

ERROR, TIME = "position error [m]", "run time [s]"
TARGETS = (1e-2, 1e-4, 1e-6, 1e-8)
"""Errors [m] at which the winner is named."""

YARDSTICK = 3.0
"""An engine that chooses its own steps may take this many times the cap, so that it shows on long chains too."""

OURS = ("pbd", "shake")
"""This project's engines; the first is the subject, PBD as published."""

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

    Raises
    ------
    InvalidInput : before anything runs
    """
    parameters, names, changes = asked(scene, engines, settings, catalog.names("engines"))
    if rounds < 1:
        raise InvalidInput("rounds", rounds, "a whole number >= 1")
    subject = build_scene(scene_name, parameters).title
    steps = None if dt is None else list(dt)
    ladders: list[tuple[str, Ladder]] = []
    for name in names:
        specs = tried(scene_name, parameters, name, changes.get(name, {}))
        stepping = "dt" in fields.rules(engine.load(name).Settings)
        tries = [descend(s, steps, cap) for s in specs] if stepping else [through(specs, YARDSTICK * cap)]
        ladders += [(name, ladder) for ladder in tries]
    with Gatherer(names, f"work-precision, {subject}", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups(ladders)
        records = gatherer.times([record for group in groups for record in group], rounds)
        omissions = gatherer.omissions
    winners = [winner(records, target) for target in TARGETS]
    series = [s for name in names for s in _series([r for r in records if r.engine == name])]
    return Study(
        kind="work_precision",
        title=f"Run time against error: {subject}",
        subject=subject,
        scene=scene_name,
        parameters=parameters,
        head=head(),
        panels=[
            Panel(name="gross", title="as called from Python", x=ERROR, y=TIME),
            Panel(name="net", title="less the engine's empty-world time", x=ERROR, y=TIME),
        ],
        series=series,
        records=records,
        omissions=omissions,
        sentences=[sentence(won) for won in winners],
        winners=winners,
    )


def tried(scene_name: str, parameters: dict[str, Any], name: str, changes: dict[str, Any]) -> list[RunSpec]:
    """The specs that are tried of an engine, before the time step varies: its default, and its sweep, matched."""
    adapter = engine.load(name)
    preset = "matched" if "matched" in adapter.PRESETS else "default"
    metrics = ("position_error", "energy_drift")
    base = RunSpec(scene=scene_name, engine=name, parameters=parameters, metrics=metrics)
    if changes:
        presets = dict.fromkeys(("default", preset))
        return [msgspec.structs.replace(base, preset=p, settings=changes) for p in presets]
    chosen_settings = adapter.sweep(build_scene(scene_name, parameters))
    found = [base] if preset == "matched" else []
    return found + [msgspec.structs.replace(base, preset=preset, settings=dict(chosen)) for chosen in chosen_settings]


def front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The (error, seconds) points that no other beats in both, by falling error."""
    kept: list[tuple[float, float]] = []
    for error, seconds in sorted(points):
        if not kept or seconds < kept[-1][1]:
            kept.append((error, seconds))
    return kept[::-1]


def time_to_error(records: Sequence[Record], target: float) -> dict[str, tuple[float, Record]]:
    """engine -> (seconds, record) of its fastest measured run with an error of at most ``target``; no extrapolation."""
    best: dict[str, tuple[float, Record]] = {}
    for record in records:
        if record.seconds is None or not record.metric("position_error") <= target:
            continue
        if record.engine not in best or record.seconds.min < best[record.engine][0]:
            best[record.engine] = (record.seconds.min, record)
    return best


def winner(records: Sequence[Record], target: float) -> Winner:
    """Who reaches ``target`` first; the analyst's tool is timed but does not compete."""
    best = time_to_error(records, target)
    rivals = sorted((seconds, name) for name, (seconds, _) in best.items() if name != ANALYST)
    first = rivals[0][1] if rivals else ""
    setting = variant(best[first][1]) if first else ""
    return Winner(target=target, engine=first, setting=setting, seconds={n: best[n][0] for n in best})


def sentence(won: Winner) -> str:
    """Who reaches an error first, by how much, and where this project's best and PBD itself stand."""
    yard = f"; {_titled(ANALYST)} takes {duration(won.seconds[ANALYST])}" if ANALYST in won.seconds else ""
    if not won.engine:
        return f"To {won.target:g} m: no engine gets there within the budget{yard}."
    seconds = won.seconds[won.engine]
    text = f"To {won.target:g} m: {_titled(won.engine)} ({won.setting}) wins with {duration(seconds)}"
    later = sorted((s, n) for n, s in won.seconds.items() if n not in (won.engine, ANALYST))
    text += f", {later[0][0] / seconds:.1f} times faster than {_titled(later[0][1])}" if later else ", alone"
    named = {won.engine, *(name for _, name in later[:1])}
    return text + "".join(_standing(name, won) for name in _to_tell(won) if name not in named) + yard + "."


def _to_tell(won: Winner) -> list[str]:
    """Whose place must be told: that of PBD, and before it the project's best where another engine wins."""
    ours = sorted((won.seconds[name], name) for name in OURS if name in won.seconds)
    best = [ours[0][1]] if ours and won.engine not in OURS else []
    return list(dict.fromkeys([*best, OURS[0]]))


def _standing(name: str, won: Winner) -> str:
    ours = won.seconds.get(name)
    if ours is None:
        return f"; {_titled(name)} does not get there in the budget"
    title = _titled(name) if name == OURS[0] else f"this project's best, {_titled(name)},"
    return f"; {title} needs {ours / won.seconds[won.engine]:.0f} times as long"


def by_setting(study: Study, name: str) -> Study:
    """A study of one engine drawn from the records of ``study``: a line for each of its settings."""
    lines: dict[str, list[tuple[float, float]]] = {}
    for record in study.records:
        if record.engine == name and record.seconds and record.metric("position_error") > 0.0:
            lines.setdefault(variant(record), []).append((record.metric("position_error"), record.seconds.min))
    series = [
        Series(panel="settings", label=label, engine=name, x=[p[0] for p in points], y=[p[1] for p in points])
        for label, points in lines.items()
    ]
    panel = Panel(name="settings", title=_titled(name), x=ERROR, y=TIME)
    title = f"Settings of {_titled(name)}: {study.subject}"
    changes = {"kind": "settings", "title": title, "subject": _titled(name), "panels": [panel], "series": series}
    kept = [record for record in study.records if record.engine == name]
    return msgspec.structs.replace(study, **changes, records=kept, sentences=[], winners=[], omissions=[])


def _series(records: list[Record]) -> list[Series]:
    """All points of one engine and its front, gross and net."""
    timed = [(r.metric("position_error"), r.seconds) for r in records if r.seconds and r.metric("position_error") > 0.0]
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
