"""Iterations against sub-steps at equal cost, on a chain that hangs straight down (Macklin et al. 2019, "Small Steps").

n projections of every link a frame are spent as n iterations of one step, or on n sub-steps with one iteration each.
Error: how far the bottom hangs below its place, the sum of all links' extensions, after FRAMES frames from rest at
rest length. The links are rigid, so all of it is error. Two chains: equal masses, and a heavy last one.

At rest every sub-step h = dt / n has to lift each particle by g h^2. In natural order, from the top, a link is exact
when it is projected, and then its lower particle i is pulled down by the link below, which carries the mass M_i that
hangs below i. What is left of an error is therefore

    sub-steps:  sum over i of  g h^2 M_i / m_i,   proportional to 1 / n^2
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons import engine
from comparisons.fit import fit_order
from comparisons.gather import ROUNDS, Gatherer, check, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec, plain
from comparisons.run import build_scene
from comparisons.studies._sweeping import chosen, others_left_out
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

COUNTS = (1, 2, 5, 10, 20, 50, 100)
DT = 1.0 / 60.0
FRAMES = 1000
CHAIN = {"links": 19, "lengths": 0.01, "masses": 1.0, "angles": 0.0}
"""The paper's: 20 particles of 1 kg, 1 cm apart."""

HEAVY = 1e5
"""Mass of the heavy last particle [kg]; the others have 1 kg."""

METRIC = "static_stretch"
WAYS = {"iterations": "n iterations", "substeps": "n sub-steps"}
AT_REST = "sub-steps at rest, exact"
AT_REST_FROM = 0.95
"""A chain whose error is this part of the one at rest is at rest."""

X, Y = "n iterations, or n sub-steps, a frame", "bottom below its place [m]"
PANELS = {
    "light": Panel(name="light", title="equal masses", x=X, y=Y),
    "heavy": Panel(name="heavy", title="last mass 100 000 times as heavy", x=X, y=Y),
}


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    counts: Sequence[int] = COUNTS,
    dt: float = DT,
    rounds: int = ROUNDS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure what n iterations and n sub-steps leave.

    Parameters
    ----------
    scene_name : a scene with links, lengths, masses and angles: "pendulum_chain"
    scene : parameters that differ from the paper's chain
    engines : of "pbd" and "pypbd"; default both
    settings : must be empty
    counts : numbers n; dt : of a frame [s]
    rounds : timings of the largest n, of which the minimum counts

    Raises
    ------
    InvalidInput : before anything runs
    """
    names = chosen(engines, settings, rounds)
    if not counts:
        raise InvalidInput("counts", list(counts), "at least one number")
    for name in names:
        engine.make_settings(name, "default", {"dt": dt})
    chain = {**CHAIN, **plain(scene or {}), "duration": FRAMES * dt, "samples": 1}
    lines = [Line(panel, name, way) for panel in PANELS for name in names for way in WAYS]
    ladders = [[line.spec(scene_name, chain, n, dt) for n in sorted(counts)] for line in lines]
    check([spec for specs in ladders for spec in specs])
    with Gatherer(names, "small steps", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(line.engine, through(specs)) for line, specs in zip(lines, ladders, strict=True)])
        last = gatherer.times([found[-1] for found in groups], rounds)
        omissions = gatherer.omissions
    found = {line: [*group[:-1], timed] for line, group, timed in zip(lines, groups, last, strict=True)}
    closed = [_closed_form(panel, scene_name, chain, sorted(counts), dt) for panel in PANELS]
    series = [_series(line, records) for line, records in found.items()]
    return Study(
        kind="small_steps",
        title="Iterations or sub-steps, at equal cost",
        subject="small steps",
        scene=scene_name,
        parameters=plain(scene or {}),
        head=head(),
        panels=list(PANELS.values()),
        series=[one for one in series if one.x] + closed,
        records=[record for records in found.values() for record in records],
        omissions=omissions + others_left_out(),
        sentences=_sentences(found, closed),
        tables=[_table(found, sorted(counts))],
    )


@dataclass(frozen=True)
class Line:
    """One line of the plot: a chain, an engine, and what n counts."""

    panel: str
    engine: str
    way: str

    def spec(self, scene_name: str, chain: Mapping[str, Any], n: int, dt: float) -> RunSpec:
        """Its run with n of them a frame."""
        method = "small_steps" if self.engine == "pbd" and self.way == "substeps" else "xpbd"
        return RunSpec(
            scene=scene_name,
            engine=self.engine,
            preset="default" if self.engine == "pbd" else "matched",
            parameters=_with_masses(self.panel, chain),
            settings={"method": method, "dt": dt, self.way: n},
            metrics=(METRIC,),
        )


def _with_masses(panel: str, chain: Mapping[str, Any]) -> dict[str, Any]:
    return {**chain, "masses": [1.0] * (chain["links"] - 1) + [HEAVY]} if panel == "heavy" else dict(chain)


def _errors(found: Mapping[Line, list[Record]], line: Line) -> dict[int, float]:
    """n -> error [m] of a line, where there is one."""
    records = found.get(line, [])
    return {r.settings[line.way]: r.metric(METRIC) for r in records if r.metric(METRIC) > 0.0}


def _series(line: Line, records: list[Record]) -> Series:
    errors = _errors({line: records}, line)
    xs, ys = [float(n) for n in errors], list(errors.values())
    return Series(
        panel=line.panel,
        label=f"{engine.load(line.engine).TITLE}, {WAYS[line.way]}",
        engine=line.engine,
        method=line.way,
        x=xs,
        y=ys,
        fit=fit_order([1.0 / x for x in xs], ys),
    )


def _closed_form(panel: str, scene_name: str, chain: Mapping[str, Any], counts: list[int], dt: float) -> Series:
    """What sub-steps in natural order leave at rest: see above."""
    scene = build_scene(scene_name, _with_masses(panel, chain))
    masses = scene.masses.masses[scene.masses.free]
    below = masses.sum() - np.cumsum(masses)
    pull = float(np.linalg.norm(scene.gravity)) * float(np.sum(below / masses))
    ys = [pull * (dt / n) ** 2 for n in counts]
    return Series(panel=panel, label=AT_REST, engine="", x=[float(n) for n in counts], y=ys, kind="closed form")


# ------------------------------------------------------------------ in words


def _table(found: Mapping[Line, list[Record]], counts: list[int]) -> Table:
    """A row for each chain, engine and n."""
    rows = []
    for panel in PANELS:
        for name in dict.fromkeys(line.engine for line in found):
            iterations, substeps = (_errors(found, Line(panel, name, way)) for way in WAYS)
            for n in counts:
                one, other = iterations.get(n, math.nan), substeps.get(n, math.nan)
                numbers = [_number(one), _number(other), _number(one / other), _number(other * n**2)]
                rows.append([PANELS[panel].title, engine.load(name).TITLE, str(n), *numbers])
    columns = ["chain", "engine", "n", "n iterations [m]", "n sub-steps [m]", "ratio", "n sub-steps x n^2 [m]"]
    return Table(title=f"How far the bottom hangs below its place after {FRAMES} frames", columns=columns, rows=rows)


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _sentences(found: Mapping[Line, list[Record]], closed: list[Series]) -> list[str]:
    said = []
    for name in dict.fromkeys(line.engine for line in found):
        said += [sentence for panel in PANELS if (sentence := _compared(found, name, panel))]
    for form in closed:
        errors = _errors(found, Line(form.panel, "pbd", "substeps"))
        ratios = [errors[int(n)] / y for n, y in zip(form.x, form.y, strict=True) if int(n) in errors]
        if ratios:
            state = "at rest" if min(ratios) > AT_REST_FROM and max(ratios) < 1.0 / AT_REST_FROM else "still moving"
            span = f"{min(ratios):.3g} to {max(ratios):.3g} times what they leave at rest"
            title = PANELS[form.panel].title
            said.append(f"{title}: after {FRAMES} frames the chain is {state}; PBD's sub-steps leave {span}.")
    return said


def _compared(found: Mapping[Line, list[Record]], name: str, panel: str) -> str:
    """Gain of sub-steps over iterations at the largest n, what it costs, and how both depend on n."""
    lines = [Line(panel, name, way) for way in WAYS]
    iterations, substeps = (_errors(found, line) for line in lines)
    both = sorted(set(iterations) & set(substeps))
    if not both:
        return ""
    n = both[-1]
    said = f"{engine.load(name).TITLE}, {PANELS[panel].title}: {n} sub-steps leave 1/{iterations[n] / substeps[n]:.3g}"
    said += f" of the error of {n} iterations"
    seconds = [found[line][-1].seconds for line in lines]
    if seconds[0] and seconds[1]:
        said += f" in {seconds[1].min / seconds[0].min:.2f} of their time"
    fits = [_series(line, found[line]).fit for line in lines]
    orders = [
        f"{way} of order {fit.order:.2f}" for way, fit in zip(WAYS.values(), fits, strict=True) if fit and fit.order
    ]
    squares = [substeps[m] * m**2 for m in both]
    said += "; " + ", ".join(orders) if orders else "; the errors have no order in n"
    return f"{said}; error of sub-steps x n^2 from {min(squares):.3g} to {max(squares):.3g} m."
