"""Stiffness k' against raw k, over the number of iterations, beside XPBD's compliance and a Newtonian spring.

Three subjects, each with its closed form where there is one:

one link      stretched, one step without gravity: residual 1-k with k', (1-k)^n with raw k
a chain       the same with all links stretched: k' is not independent of n, raw k falls to 0
a hung mass   at rest: stretch g dt^2 (1-k)/k with k', m g alpha with XPBD and with a spring

The last is drawn at two time steps: k' is proportional to dt^2, compliance is independent of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons import catalog, engine
from comparisons.gather import Gatherer, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec, plain
from comparisons.run import bind
from comparisons.study import Omission, Panel, Series, Study, head
from pbd.errors import InvalidInput

ITERATIONS = (1, 2, 3, 5, 10, 20, 30, 50, 100)
STIFFNESS = 0.4
"""At 0.5 the Newtonian spring of equal compliance happens to leave exactly nothing after its one step."""

DT = 1.0 / 60.0
STRETCH = 1.1
CHAIN = 10
MASS, GRAVITY = 1.0, 9.81
SETTLE = 600
"""Steps after which a hung mass rests: its motion has shrunk by (1-k)^(SETTLE/2)."""

KNOWN = ("pbd", "symplectic_euler")
ROUND_OFF = 1e-15
"""Values below are round-off and are not drawn."""

N = "iterations n"
PANELS = (
    Panel(name="link", title="one link, one step", x=N, y="residual / initial error", lowest=1e-3),
    Panel(name="chain", title=f"chain of {CHAIN}, one step", x=N, y="largest residual / initial error"),
    Panel(name="mass", title="hung mass at rest, time step dt", x=N, y="stretch [m]", lowest=1e-5),
    Panel(name="mass, dt/2", title="hung mass at rest, time step dt/2", x=N, y="stretch [m]", lowest=1e-5),
)


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    iterations: Sequence[int] | None = None,
    k: float = STIFFNESS,
    dt: float = DT,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure what k does.

    Parameters
    ----------
    scene_name : a scene with links, stretch, angles and compliance: "pendulum_chain"
    scene : parameters that differ, for the chain subject: links, stretch
    engines : of "pbd" and "symplectic_euler"; default both
    iterations : numbers of iterations n
    k : stiffness in (0, 1); dt : time step [s]

    Raises
    ------
    InvalidInput : before anything runs
    """
    if not 0.0 < k < 1.0:
        raise InvalidInput("k", k, "a number > 0 and < 1", "k = 1 is rigid for every n, k = 0 is nothing")
    if settings:
        raise InvalidInput(
            "settings", sorted(settings), "absent: this study sets them itself", "use k, dt and iterations"
        )
    names = list(engines or KNOWN)
    for name in names:
        engine.load(name)
    engine.make_settings("pbd", "default", {"dt": dt})
    counts = list(iterations or ITERATIONS)
    chain = plain(scene or {})
    plan = [line for line in _lines(scene_name, chain, k, dt, counts) if line.engine in names]
    for line in plan:
        for spec in line.specs:
            bind(spec)
    with Gatherer(names, "stiffness", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(line.engine, through(line.specs)) for line in plan])
    series = [_series(line, found) for line, found in zip(plan, groups, strict=True)]
    return Study(
        kind="stiffness",
        title=f"What stiffness k = {k:g} does, at dt = {dt:.4g} s",
        subject="stiffness",
        scene=scene_name,
        parameters=chain,
        head=head(),
        panels=list(PANELS),
        series=series + _closed_forms(k, dt, counts),
        records=[record for found in groups for record in found],
        omissions=[_omission(name) for name in catalog.names("engines") if name not in KNOWN],
        sentences=_sentences(series, k),
    )


@dataclass(frozen=True)
class Line:
    """One line of the plot: specs over n, or a single one for what does not depend on n."""

    panel: str
    label: str
    engine: str
    method: str
    specs: list[RunSpec]


def _lines(scene_name: str, chain: dict[str, Any], k: float, dt: float, counts: list[int]) -> list[Line]:
    """All lines: per subject the two uses of k, XPBD's compliance of equal first projection, a Newtonian spring."""
    stretched = {"stretch": STRETCH, "gravity": 0.0, "duration": dt, "samples": 1}
    lines = []
    for panel, links, weight in (("link", 1, 1.0), ("chain", CHAIN, 2.0)):
        parameters = {"links": links, **stretched, **(chain if panel == "chain" else {})}
        case = Case(scene_name, panel, parameters, "link_residual", weight * dt**2 * (1.0 - k) / k / MASS)
        lines += _case_lines(case, k, dt, counts, 0.0)
    alpha = dt**2 * (1.0 - k) / k / MASS
    for panel, step in (("mass", dt), ("mass, dt/2", 0.5 * dt)):
        parameters = {"links": 1, "angles": 0.0, "duration": SETTLE * dt, "samples": 1}
        lines += _case_lines(Case(scene_name, panel, parameters, "static_stretch", alpha), k, step, counts, 0.25)
    return lines


@dataclass(frozen=True)
class Case:
    """A subject: its panel, scene parameters, metric, and the compliance [m/N] that stands beside k."""

    scene: str
    panel: str
    parameters: dict[str, Any]
    metric: str
    compliance: float

    def spec(self, name: str, *, springs: bool = False, **settings: Any) -> RunSpec:
        """One run of the subject, its links rigid or of the compliance."""
        parameters = {**self.parameters, **({"compliance": self.compliance} if springs else {})}
        return RunSpec(scene=self.scene, engine=name, parameters=parameters, settings=settings, metrics=(self.metric,))


def _case_lines(case: Case, k: float, dt: float, counts: list[int], damping: float) -> list[Line]:
    corrected = [case.spec("pbd", dt=dt, k=k, iterations=n) for n in counts]
    raw = [case.spec("pbd", dt=dt, k=k, raw=True, iterations=n) for n in counts]
    xpbd = [case.spec("pbd", springs=True, method="xpbd", dt=dt, iterations=n) for n in counts]
    spring = [case.spec("symplectic_euler", dt=dt, stiffness=1.0 / case.compliance, damping_ratio=damping)]
    return [
        Line(case.panel, "PBD, k'", "pbd", "pbd", corrected),
        Line(case.panel, "PBD, raw k", "pbd", "raw", raw),
        Line(case.panel, "XPBD compliance", "pbd", "xpbd", xpbd),
        Line(case.panel, "symplectic Euler spring", "symplectic_euler", "", spring),
    ]


def _series(line: Line, found: list[Record]) -> Series:
    metric = "static_stretch" if line.panel.startswith("mass") else "link_residual"
    ys = [record.metric(metric) for record in found]
    xs = [float(record.settings.get("iterations", 1)) for record in found]
    if len(found) == 1:  # does not depend on n: drawn over the whole width
        xs, ys = [float(ITERATIONS[0]), float(ITERATIONS[-1])], ys * 2
    points = [(x, y) for x, y in zip(xs, ys, strict=True) if np.isfinite(y) and y > ROUND_OFF]
    return Series(
        panel=line.panel,
        label=line.label,
        engine=line.engine,
        method=line.method,
        x=[x for x, _ in points],
        y=[y for _, y in points],
    )


def _closed_forms(k: float, dt: float, counts: list[int]) -> list[Series]:
    """1-k and (1-k)^n; at rest g dt^2 (1-k)/k and g dt^2 (1-k)^n / (1-(1-k)^n), for k' and raw k."""
    n = np.unique(np.round(np.geomspace(min(counts), max(counts), 40)))
    left = (1.0 - k) ** n
    curves = [("link", np.full_like(n, 1.0 - k)), ("link", left)]
    for panel, step in (("mass", dt), ("mass, dt/2", 0.5 * dt)):
        fall = GRAVITY * step**2
        curves += [(panel, np.full_like(n, fall * (1.0 - k) / k)), (panel, fall * left / (1.0 - left))]
    return [
        Series(panel=panel, label="closed form", engine="", x=n.tolist(), y=y.tolist(), kind="closed form")
        for panel, y in curves
    ]


def _omission(name: str) -> Omission:
    return Omission(
        name, "has no constraint stiffness k in [0, 1] to compare", "see the compliant chains for its springs"
    )


def _sentences(series: list[Series], k: float) -> list[str]:
    """What the measured lines show, in words made from their numbers."""
    by = {(s.panel, s.label): s.y for s in series if s.y}
    said = []
    if one := by.get(("link", "PBD, k'")):
        worst = max(abs(y - (1.0 - k)) for y in one)
        said.append(f"One link: k' leaves 1-k for every n, to {worst:.0e}; raw k leaves (1-k)^n.")
    if chain := by.get(("chain", "PBD, k'")):
        said.append(
            f"A chain: k' is not independent of n: the largest residual goes from {chain[0]:.3f} to {chain[-1]:.3f}."
        )
    whole, half = by.get(("mass", "PBD, k'")), by.get(("mass, dt/2", "PBD, k'"))
    if whole and half:
        said.append(
            f"A hung mass: with k' the stretch falls by {whole[0] / half[0]:.3f} when dt is halved: k' depends on dt."
        )
    whole, half = by.get(("mass", "XPBD compliance")), by.get(("mass, dt/2", "XPBD compliance"))
    if whole and half:
        said.append(f"XPBD's compliance gives the same stretch at both time steps: ratio {whole[0] / half[0]:.6f}.")
    return said
