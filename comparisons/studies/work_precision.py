"""Run time against error: every setting a point, each engine's best a front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from comparisons import catalog, engine
from comparisons.gather import ROUNDS, Gatherer, Ladder, descend
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.study import Panel, Series, Study, head, variant
from pbd.errors import unknown

SUMMARY = "run time against error, every setting a point, fronts drawn"
CAP = 0.5
"""Seconds that a run may take."""

TARGETS = (1e-2, 1e-4, 1e-6, 1e-8)
"""Errors [m] at which the winner is named."""

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
    parameters, changes = dict(scene or {}), {k: dict(v) for k, v in (settings or {}).items()}
    names = list(engines or catalog.names("engines"))
    for name in changes:
        if name not in names:
            raise unknown("settings", name, names)
    title = build_scene(scene_name, parameters).title
    steps = None if dt is None else list(dt)
    ladders: dict[str, list[Ladder]] = {
        name: [descend(spec, steps, cap) for spec in tried(scene_name, parameters, name, changes.get(name, {}))]
        for name in names
    }
    with Gatherer(names, f"work-precision of {title}", quiet=quiet) as gatherer:
        groups = gatherer.groups(ladders)
        records = gatherer.times([r for found in groups.values() for group in found for r in group], rounds)
        omissions = gatherer.omissions
    series = [s for name in names for s in _series([r for r in records if r.engine == name])]
    return Study(
        kind="work_precision",
        title=f"Run time against error: {title}",
        scene=scene_name,
        parameters=parameters,
        head=head(),
        panels=[
            Panel(name="gross", title="as called from Python", x="position error [m]", y="run time [s]"),
            Panel(name="net", title="less the engine's empty-world time", x="position error [m]", y="run time [s]"),
        ],
        series=series,
        records=records,
        omissions=omissions,
        sentences=[who_wins(records, target) for target in TARGETS],
    )


def tried(scene_name: str, parameters: dict[str, Any], name: str, changes: dict[str, Any]) -> list[RunSpec]:
    """The specs that are tried of an engine, before the time step varies: its default, and its sweep as matched."""
    adapter = engine.load(name)
    preset = "matched" if "matched" in adapter.PRESETS else "default"
    base = {
        "scene": scene_name,
        "engine": name,
        "parameters": parameters,
        "metrics": ("position_error", "energy_drift"),
    }
    if changes:
        return [RunSpec(**base, preset=p, settings=changes) for p in dict.fromkeys(("default", preset))]
    found = [RunSpec(**base)] if preset == "matched" else []
    return found + [RunSpec(**base, preset=preset, settings=dict(chosen)) for chosen in adapter.SWEEP]


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


def who_wins(records: Sequence[Record], target: float) -> str:
    """One sentence on who reaches an error first, who comes second, and where our solver stands."""
    best = time_to_error(records, target)
    rivals = sorted((item for item in best.items() if item[0] != ANALYST), key=lambda item: item[1][0])
    yard = f"; DOP853 takes {_duration(best[ANALYST][0])}" if ANALYST in best else ""
    if not rivals:
        return f"To {target:g} m: no engine gets there within the budget{yard}."
    name, (seconds, record) = rivals[0]
    text = f"To {target:g} m: {_titled(name)} ({variant(record)}) wins with {_duration(seconds)}"
    if len(rivals) > 1:
        second, (later, _) = rivals[1]
        text += f", {later / seconds:.1f} times faster than {_titled(second)}"
    else:
        text += ", the only one to get there within the budget"
    if name != "pbd" and len(rivals) > 1 and rivals[1][0] != "pbd":
        text += (
            f"; PBD needs {best['pbd'][0] / seconds:.0f} times as long" if "pbd" in best else "; PBD does not get there"
        )
    return text + yard + "."


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


def _duration(seconds: float) -> str:
    """A time in its natural unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
