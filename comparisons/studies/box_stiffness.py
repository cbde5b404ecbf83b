"""How far a box made of particles is compressed, over iterations, time step and load, by what holds it together.

A box lies on a plane under its own weight; measured is how far its centre of mass ends below its place. What holds its
particles is shape matching, or distances between all of them, with PBD's k', raw k or k = 1, or XPBD's compliance.

shape matching   5/6 g h^2 q^(n-1) / (1 - q^n), q = 1 - k'/6: the lower corners, which lie on the plane, are a sixth of
                 the mass, and each of n iterations leaves the share q of what parts them from the rest
compliance       load x compliance: the small displacements of the truss of all distances, for any dt and n

Then a heavier box lies on it, and the upper one's place is measured: what a thousandfold load takes.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from comparisons.gather import Gatherer, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.run import bind
from comparisons.studies._box_depth import sunk, truss
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

ENGINE, METRIC = "particle_boxes", "drift"
ITERATIONS = (1, 2, 3, 5, 10, 20, 30, 50, 100)
STIFFNESS = 0.4
COMPLIANCE = 1e-3
"""[m/N] of each distance: a box of 1 kg sinks by 3.6 mm."""

DT = 1.0 / 60.0
SETTLE = 10.0
"""Seconds after which a box lies still."""

RATIOS = (1.0, 10.0, 100.0, 1000.0)
LOADED_DT, LOADED_SECONDS, LOADED_ITERATIONS = 1.0 / 960.0, 1.0, (10, 100)
LOADED_COMPLIANCE = 1e-6
"""Of the second question: a box any softer would be crushed by the heaviest load."""

ALONE: dict[str, Any] = {"count": 1, "jitter": 0.0, "friction": 0.0, "samples": 1}
BELOW: dict[str, Any] = {"offset": 0.0, "friction": 0.5, "samples": 1}

N, Y = "iterations n", "box below its place [m]"
PANELS = {
    (method, part): Panel(
        name=f"{method}, {part}" if part > 1 else method,
        title=f"{method.replace('_', ' ')}, {f'dt/{part}' if part > 1 else 'dt'}",
        x=N,
        y=Y,
        lowest=1e-6,
    )
    for method in ("shape_matching", "distance")
    for part in (1, 2)
}
LOAD = Panel(
    name="load", title="under a heavier box", x="mass of the upper box / of the lower", y="upper box too low [m]"
)
CLOSED_FORM, LOAD_X_COMPLIANCE = "closed form", "load x compliance"


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    iterations: Sequence[int] = ITERATIONS,
    ratios: Sequence[float] = RATIOS,
    k: float = STIFFNESS,
    compliance: float = COMPLIANCE,
    dt: float = DT,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure how far boxes are compressed.

    Parameters
    ----------
    engines : only "particle_boxes"; settings : none, the study sets them itself
    iterations : numbers n; k in (0, 1); compliance > 0 of each distance [m/N]; dt : time step [s]
    ratios : masses of the upper box over the lower one's

    Raises
    ------
    InvalidInput : before anything runs
    """
    if settings or list(engines or [ENGINE]) != [ENGINE]:
        raise InvalidInput("engines and settings", engines or settings, f"those of the study: {ENGINE} with its own")
    for name, value, high in (("k", k, 1.0), ("compliance", compliance, np.inf), ("dt", dt, np.inf)):
        if not 0.0 < value < high:
            raise InvalidInput(name, value, f"a number > 0{'' if high == np.inf else f' and < {high:g}'}")
    if not iterations or not ratios:
        raise InvalidInput("iterations and ratios", [list(iterations), list(ratios)], "at least one number each")
    lines = [*_lines(sorted(iterations), k, compliance, dt), *_loads(sorted(ratios))]
    for spec in (spec for line in lines for spec in line.specs):
        bind(spec)
    with Gatherer([ENGINE], "box stiffness", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(ENGINE, through(line.specs)) for line in lines])
    measured = [_series(line, found) for line, found in zip(lines, groups, strict=True)]
    closed = [*_closed_forms(sorted(iterations), k, compliance, dt), _closed_load(sorted(ratios))]
    return Study(
        kind="box_stiffness",
        title=f"How stiff a box made of particles is: k = {k:g}, {compliance:g} m/N, dt = {dt:.4g} s",
        subject="box stiffness",
        scene="stack",
        parameters={},
        head=head(),
        panels=[*PANELS.values(), LOAD],
        series=measured + closed,
        records=[record for found in groups for record in found],
        sentences=_sentences(measured, closed, compliance),
        tables=[_table(measured, closed)],
    )


@dataclass(frozen=True)
class Line:
    """One line of the plot: its panel, its name, and its runs over what the panel has as x."""

    panel: Panel
    label: str
    xs: list[float]
    specs: list[RunSpec] = field(default_factory=list)


def _lines(counts: list[int], k: float, compliance: float, dt: float) -> list[Line]:
    """The box by itself: each way to hold it, at two time steps, over the number of iterations."""
    stiffnesses: dict[str, dict[str, Any]] = {"k'": {"k": k}, "raw k": {"k": k, "raw": True}, "k = 1": {}}
    lines = []
    for (method, part), panel in PANELS.items():
        soft = {"XPBD compliance": {"compliance": compliance}} if method == "distance" else {}
        for label, changes in {**stiffnesses, **soft}.items():
            step = dt / part
            duration = step * max(1, round(SETTLE / step))
            made = {"method": method, "dt": step, **changes}
            specs = [_spec("stack", {**ALONE, "duration": duration}, iterations=n, **made) for n in counts]
            lines.append(Line(panel, label, [float(n) for n in counts], specs))
    return lines


def _loads(ratios: list[float]) -> list[Line]:
    """The box under a heavier one, rigid and soft, with few iterations and many."""
    soft = {"method": "distance", "compliance": LOADED_COMPLIANCE}
    methods: dict[str, dict[str, Any]] = {"shapes, k = 1": {}, "distances, XPBD": soft}
    lines = []
    for (label, changes), n in itertools.product(methods.items(), LOADED_ITERATIONS):
        made = {**changes, "dt": LOADED_DT, "iterations": n}
        specs = [_spec("mass_ratio", {**BELOW, "ratio": r, "duration": LOADED_SECONDS}, **made) for r in ratios]
        lines.append(Line(LOAD, f"{label}, n = {n}", ratios, specs))
    return lines


def _spec(scene: str, parameters: dict[str, Any], **settings: Any) -> RunSpec:
    return RunSpec(scene=scene, engine=ENGINE, parameters=parameters, settings=settings, metrics=(METRIC,))


def _series(line: Line, found: list[Record]) -> Series:
    points = [(x, r.metric(METRIC)) for x, r in zip(line.xs, found, strict=True) if r.metric(METRIC) > 0.0]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return Series(panel=line.panel.name, label=line.label, engine=ENGINE, method=line.label, x=xs, y=ys)


# ------------------------------------------------------------------ closed forms


def _closed_forms(counts: list[int], k: float, compliance: float, dt: float) -> list[Series]:
    n = [int(count) for count in np.unique(np.round(np.geomspace(counts[0], counts[-1], 30)))]
    found = []
    for (method, part), panel in PANELS.items():
        h = dt / part
        if method == "distance":
            (level,) = truss(compliance, [1.0], sticks=False)
            found.append(_grey(panel, LOAD_X_COMPLIANCE, n, [level] * len(n)))
        else:
            for stiffness, raw in ((k, False), (k, True), (1.0, False)):
                found.append(_grey(panel, CLOSED_FORM, n, [sunk(stiffness, count, h, raw) for count in n]))
    return found


def _closed_load(ratios: list[float]) -> Series:
    depths = [truss(LOADED_COMPLIANCE, [1.0, ratio], sticks=True)[1] for ratio in ratios]
    return _grey(LOAD, LOAD_X_COMPLIANCE, ratios, depths)


def _grey(panel: Panel, label: str, xs: Sequence[float], ys: list[float]) -> Series:
    kept = [(float(x), y) for x, y in zip(xs, ys, strict=True) if y > panel.lowest]
    xs, ys = [x for x, _ in kept], [y for _, y in kept]
    return Series(panel=panel.name, label=label, engine="", x=list(xs), y=ys, kind="closed form")


# ------------------------------------------------------------------ in words


def _table(measured: list[Series], closed: list[Series]) -> Table:
    """A row for each line: the box's depth at the first, a middle and the last x."""
    titles = {panel.name: panel.title for panel in [*PANELS.values(), LOAD]}
    rows = []
    for one in [*measured, *(form for form in closed if form.label == LOAD_X_COMPLIANCE)]:
        if one.x:
            chosen = sorted({0, len(one.x) // 2, len(one.x) - 1})
            rows.append([titles[one.panel], one.label, "; ".join(f"{one.x[i]:g}: {one.y[i]:.3g}" for i in chosen)])
    return Table(
        title="How far boxes are below their place", columns=["where", "held by", "at x: depth [m]"], rows=rows
    )


def _sentences(measured: list[Series], closed: list[Series], compliance: float) -> list[str]:
    """What the lines show, in words made from their numbers."""
    by = {(one.panel, one.label): one for one in measured if one.x}
    said = []
    for method in ("shape_matching", "distance"):
        words, half = method.replace("_", " "), f"{method}, 2"
        soft, rigid = by.get((method, "k'")), by.get((method, "k = 1"))
        if rigid:
            said.append(f"{words}, k = 1: {_span(rigid)}: not softness, but what the iterations have not finished.")
        if raw := by.get((method, "raw k")):
            said.append(f"{words}, raw k: {_span(raw)}: the number of iterations decides how stiff the box is.")
        if soft:
            said.append(f"{words}, k': {_span(soft)}: a factor of {soft.y[0] / soft.y[-1]:.3g} between them.")
        if soft and (halved := by.get((half, "k'"))):
            ratio = soft.y[-1] / halved.y[-1]
            said.append(
                f"{words}, k': half the time step divides the depth by {ratio:.3g}: k' is no stiffness of a material."
            )
    level = next((form.y[0] for form in closed if form.panel == "distance" and form.y), None)
    for part, words in (("distance", "dt"), ("distance, 2", "dt/2")):
        if level and (xpbd := by.get((part, "XPBD compliance"))):
            near = f"{xpbd.y[-1] / level - 1.0:+.2%} from load x compliance"
            said.append(f"XPBD, {compliance:g} m/N, {words}: {_span(xpbd)}; the last is {near}.")
    return [*said, *_of_load(by, closed)]


def _of_load(by: Mapping[tuple[str, str], Series], closed: list[Series]) -> list[str]:
    form = next(one for one in closed if one.panel == LOAD.name)
    truth = dict(zip(form.x, form.y, strict=True))
    said = []
    for (panel, label), one in by.items():
        if panel == LOAD.name:
            words = f"Under {one.x[-1]:g} times its mass, {label}: the upper box is {one.y[-1]:.2g} m too low"
            if "XPBD" in label and one.x[-1] in truth:
                words += f", {one.y[-1] / truth[one.x[-1]]:.3g} times load x compliance"
            said.append(words + ".")
    return said


def _span(one: Series) -> str:
    first, last = (f"{one.y[i]:.3g} m with {one.x[i]:g} iteration{'s' if one.x[i] > 1 else ''}" for i in (0, -1))
    return f"{first}, {last}" if len(one.x) > 1 else first
