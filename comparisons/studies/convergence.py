"""Error against time step, sub-steps and iterations, with fitted orders."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from comparisons import catalog, engine
from comparisons.fit import Fit, fit_order
from comparisons.gather import Gatherer, Ladder, asked, descend, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.run import bind, build_scene
from comparisons.study import Omission, Panel, Series, Study, head, label
from pbd import fields
from pbd.errors import InvalidInput

CAP = 1.0
"""Seconds that a run may take where the time steps are not given."""

COUNTS = (1, 2, 4, 8, 16, 32, 64, 128)
AXES = {"dt": "time step [s]", "substeps": "sub-steps in each step", "iterations": "iterations in each step"}


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    dt: Sequence[float] | None = None,
    substeps: Sequence[int] | None = COUNTS,
    iterations: Sequence[int] | None = COUNTS,
    cap: float = CAP,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure position errors along each axis and fit orders.

    Parameters
    ----------
    scene_name : e.g. "pendulum_chain"
    scene : the scene's parameters that differ from its defaults
    engines : names; default all
    settings : engine -> settings that differ from its preset
    dt : time steps [s], each a whole fraction of the sample interval; default halvings while a run takes less
        than ``cap`` seconds
    workers : where to run; default in workers of this study's own
    substeps, iterations : counts, tried with the engines that have such a setting, at the time step of
        the settings or else the sample interval; None or empty skips the axis

    Raises
    ------
    InvalidInput : before anything runs
    """
    parameters, names, changes = asked(scene, engines, settings, filter(_steps, catalog.names("engines")))
    bases = [base for name in names for base in variants(scene_name, parameters, name, changes.get(name, {}))]
    _check(bases, dt)
    subject = build_scene(scene_name, parameters).title
    lines = [Line("dt", base, descend(base, None if dt is None else list(dt), cap)) for base in bases]
    for axis, values in (("substeps", substeps or ()), ("iterations", iterations or ())):
        lines += [
            Line(axis, base, _counts(base, axis, values)) for base in bases if values and _varies(base, axis, changes)
        ]
    with Gatherer(names, f"convergence, {subject}", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(line.base.engine, line.ladder) for line in lines])
        omissions = gatherer.omissions
    series = [s for s in map(_series, lines, groups) if s.x]
    return Study(
        kind="convergence",
        title=f"Convergence: {subject}",
        subject=subject,
        scene=scene_name,
        parameters=parameters,
        head=head(),
        panels=[
            Panel(name=axis, title=f"error against {axis}", x=words, y="position error [m]")
            for axis, words in AXES.items()
            if axis in {s.panel for s in series}
        ],
        series=series,
        records=[record for group in groups for record in group],
        omissions=omissions + _absent(series, {omission.engine for omission in omissions}),
        sentences=[f"{s.label}: {s.fit.text()} in {s.panel}." for s in series if s.fit],
    )


@dataclass(frozen=True)
class Line:
    """One line of the plot: what varies, the specs' common part, the ladder of specs along it."""

    axis: str
    base: RunSpec
    ladder: Ladder


def variants(scene_name: str, parameters: dict[str, Any], name: str, changes: dict[str, Any]) -> list[RunSpec]:
    """What is shown of an engine: its VARIANTS, or else its default and its matched preset."""
    adapter = engine.load(name)
    metrics = ("position_error", "energy_drift")
    base = RunSpec(scene=scene_name, engine=name, parameters=parameters, settings=changes, metrics=metrics)
    if hasattr(adapter, "VARIANTS") and not changes:
        return [msgspec.structs.replace(base, settings=dict(chosen)) for chosen in adapter.VARIANTS]
    presets = [preset for preset in ("default", "matched") if preset in adapter.PRESETS]
    return [msgspec.structs.replace(base, preset=preset) for preset in presets]


def _check(bases: list[RunSpec], dts: Sequence[float] | None) -> None:
    """Refuse bad input before anything runs."""
    for base in bases:
        if not _steps(base.engine):
            raise InvalidInput("engines", base.engine, "engines with a fixed time step")
    if dts is not None and len(set(dts)) != len(dts):
        raise InvalidInput("dt", list(dts), "different time steps")


def _absent(series: list[Series], known: set[str]) -> list[Omission]:
    """Engines that are missing from a panel because they have nothing that varies along its axis."""
    found = []
    for name in sorted(set(catalog.names("engines")) - known):
        panels = {s.panel for s in series if s.engine == name}
        if not _steps(name):
            found.append(Omission(name, "chooses its own time steps", "see run time against error"))
        elif panels:
            lacking = [AXES[axis] for axis in dict.fromkeys(s.panel for s in series) if axis not in panels]
            found += [Omission(name, f"has no {words}", "see its error against time step") for words in lacking]
    return found


def _steps(name: str) -> bool:
    return "dt" in fields.rules(engine.load(name).Settings)


def _varies(base: RunSpec, axis: str, changes: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether an engine has the setting, its method and solver take other counts than 1, and the user left it open."""
    if axis not in fields.rules(engine.load(base.engine).Settings) or axis in changes.get(base.engine, {}):
        return False
    try:
        two = engine.make_settings(base.engine, base.preset, {**base.settings, axis: 2})
        one = engine.make_settings(base.engine, base.preset, {**base.settings, axis: 1})
    except InvalidInput:
        return False
    why_not, scene = engine.load(base.engine).unsupported, build_scene(base.scene, base.parameters)
    return not why_not(scene, two) or bool(why_not(scene, one))  # what runs with neither says so in its records


def _counts(base: RunSpec, axis: str, values: Sequence[int]) -> Ladder:
    scene = build_scene(base.scene, base.parameters)
    dt = base.settings.get("dt", scene.duration / scene.samples)
    specs = [msgspec.structs.replace(base, settings={**base.settings, "dt": dt, axis: value}) for value in values]
    for spec in specs:
        bind(spec)  # refuses a wrong value before anything runs
    return through(specs)


def _series(line: Line, found: list[Record]) -> Series:
    """A line's points and fit; iterations and sub-steps are fitted over 1/n."""
    axis, base = line.axis, line.base
    points = [
        (float(record.settings[axis]), record.metric("position_error"))
        for record in found
        if math.isfinite(record.metric("position_error"))
    ]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    fit: Fit = fit_order(xs if axis == "dt" else [1.0 / x for x in xs], ys)
    usual = dataclasses.asdict(engine.make_settings(base.engine, base.preset, {}))
    shown = msgspec.structs.replace(found[0], settings={**found[0].settings, "dt": usual["dt"], axis: usual[axis]})
    return Series(
        panel=axis,
        label=label(shown),
        engine=base.engine,
        method=str(base.settings.get("method", base.engine)),
        preset=base.preset,
        x=xs,
        y=ys,
        fit=fit,
    )
