"""What stiffness does to a fluid: k', raw k and compliance against how much water at rest is compressed.

A column stands in its tank, slightly viscous, so that it comes to rest. With XPBD a compliance alpha [1/J] lets a
particle of mass m under z of water be denser by alpha m g z, whatever the time step: alpha m g H/2 on average.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from comparisons.gather import Gatherer, check, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.studies import _fluids
from comparisons.studies._fluids import OURS
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

SCENE, METRIC, PEAK = "hydrostatic_column", "density_error", "density_peak"
ITERATIONS = (1, 2, 4, 8, 16, 32)
STIFFNESS, COMPLIANCE = (0.2, 0.5), (1e-3, 1e-2)
CALM = {"viscosity": 0.1, "omega": 0.5}
"""One iteration of more relaxation injects energy, as the blow-up map shows."""

N = "iterations n"
PANELS = (
    Panel(name=METRIC, title="mean compression", x=N, y="rho/rho0 - 1"),
    Panel(name=PEAK, title="largest compression", x=N, y="rho/rho0 - 1"),
)


@dataclass(frozen=True)
class Law:
    """A line of the plot; ``expected`` is its mean compression in closed form, where there is one."""

    label: str
    settings: Mapping[str, Any] = field(hash=False)
    expected: float | None = None


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    across: int = 20,
    iterations: Sequence[int] = ITERATIONS,
    k: Sequence[float] = STIFFNESS,
    compliance: Sequence[float] = COMPLIANCE,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure compression.

    Parameters
    ----------
    engines : "pbf" or none
    settings : must be empty
    across : particles along the column's width
    iterations : numbers of iterations n
    k : stiffnesses in (0, 1]; compliance : [1/J], > 0

    Raises
    ------
    InvalidInput : before anything runs
    """
    if list(engines or [OURS]) != [OURS] or settings:
        raise InvalidInput("engines, settings", [engines, settings], f"{OURS}, none", "use k and compliance")
    _fluids.counts("iterations", iterations)
    laws = [Law("k = 1", {})]
    laws += [
        Law(f"{name} = {each:g}", {"k": each, "raw": raw}) for each in k for name, raw in (("k'", False), ("k", True))
    ]
    laws += [
        Law(f"alpha = {a:g} /J (XPBD)", {"method": "xpbd", "compliance": a}, expected(a, across) if a else None)
        for a in (0.0, *compliance)
    ]
    plan = {law: [_spec(law, across, n) for n in iterations] for law in laws}
    check(spec for specs in plan.values() for spec in specs)
    with Gatherer([OURS], "density stiffness", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(OURS, through(specs)) for specs in plan.values()])
    found = dict(zip(plan, groups, strict=True))
    return Study(
        kind="density_stiffness",
        title=f"What stiffness does to water at rest, {across} particles across",
        subject="density stiffness",
        scene=SCENE,
        parameters={"across": across},
        head=head(),
        panels=list(PANELS),
        series=[s for law, records in found.items() for s in _series(law, records)] + _closed_forms(laws, iterations),
        records=[record for records in found.values() for record in records],
        sentences=_sentences(found),
        tables=[_table(found, iterations)],
    )


def _spec(law: Law, across: int, n: int) -> RunSpec:
    chosen = {**CALM, **law.settings, "iterations": n}
    return RunSpec(scene=SCENE, engine=OURS, parameters={"across": across}, settings=chosen, metrics=(METRIC, PEAK))


def _series(law: Law, records: Sequence[Record]) -> list[Series]:
    kept = [record for record in records if record.status.code == "ok"]
    xs = [float(record.settings["iterations"]) for record in kept]
    return [
        Series(panel=name, label=law.label, engine=OURS, x=xs, y=[record.metric(name) for record in kept])
        for name in (METRIC, PEAK)
        if kept
    ]


def expected(alpha: float, across: int) -> float:
    """alpha m g H/2."""
    scene = build_scene(SCENE, {"across": across})
    depth = scene.masses.positions[:, 1].max() + scene.masses.positions[:, 1].min()
    return 0.5 * alpha * float(scene.masses.masses[0]) * -float(scene.gravity[1]) * float(depth)


def _closed_forms(laws: Sequence[Law], iterations: Sequence[int]) -> list[Series]:
    ends = [float(min(iterations)), float(max(iterations))]
    return [
        Series(
            panel=METRIC,
            label="alpha m g H/2",
            engine="",
            x=ends,
            y=[law.expected] * 2,
            kind="closed form",
        )
        for law in laws
        if law.expected is not None
    ]


def _table(found: Mapping[Law, Sequence[Record]], iterations: Sequence[int]) -> Table:
    rows = []
    for law, records in found.items():
        cells = [
            f"{record.metric(METRIC):.2e}" if record.status.code == "ok" else record.status.code for record in records
        ]
        rows.append([law.label, *cells, f"{law.expected:.2e}" if law.expected else ""])
    columns = ["law", *(f"n = {n}" for n in iterations), "alpha m g H/2"]
    return Table(title="Mean compression of water at rest", columns=columns, rows=rows)


def _sentences(found: Mapping[Law, Sequence[Record]]) -> list[str]:
    """How each law depends on the number of iterations."""
    said = []
    for law, records in found.items():
        kept = [record.metric(METRIC) for record in records if record.status.code == "ok"]
        if len(kept) > 1:
            tail = f", alpha m g H/2 is {law.expected:.2e}" if law.expected else ""
            said.append(
                f"{law.label}: mean compression from {kept[0]:.1e} to {kept[-1]:.1e} over the iterations{tail}."
            )
    return said
