"""Where position based fluids blow up: a map over time step, relaxation and iterations.

A dam break runs to T = 1.5 at each point. A cross is a run that is not finite, or whose energy rose by a tenth of what
the column can fall; a dot is a run that held.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from comparisons.gather import Gatherer, check, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec
from comparisons.studies import _fluids
from comparisons.studies._fluids import OURS
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

SCENE, METRICS = "dam_break", ("energy_rise", "density_error")
PLACE = {"across": 10, "duration": 1.5, "samples": 15}
COURANT = (0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28)
OMEGA = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
ITERATIONS = (1, 2, 4, 10)
X, Y = "c = dt √(a g)/dx", "relaxation ω"


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    courant: Sequence[float] = COURANT,
    omega: Sequence[float] = OMEGA,
    iterations: Sequence[int] = ITERATIONS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Map what holds.

    Parameters
    ----------
    engines : "pbf" or none
    settings : of "pbf" beside those that are swept, e.g. its method
    courant, omega, iterations : the points of the map, which has a panel for each number of iterations

    Raises
    ------
    InvalidInput : before anything runs
    """
    if list(engines or [OURS]) != [OURS] or set(settings or {}) - {OURS}:
        raise InvalidInput("engines", [*(engines or []), *(settings or {})], OURS, "the map is of its settings")
    _fluids.counts("iterations", iterations)
    base = dict((settings or {}).get(OURS, {}))
    points = [(n, c, w) for n in iterations for c in courant for w in omega]
    if not points:
        raise InvalidInput("courant, omega", [list(courant), list(omega)], "at least one number each")
    specs = [_spec({**base, "iterations": n, "courant": c, "omega": w}) for n, c, w in points]
    check(specs)
    with Gatherer([OURS], "blow-up", workers=workers, quiet=quiet) as gatherer:
        records = gatherer.groups([(OURS, through(specs))])[0]
    return Study(
        kind="blow_up",
        title="Where position based fluids hold (dots) and blow up (crosses)",
        subject="blow-up",
        scene=SCENE,
        parameters=PLACE,
        head=head(),
        panels=[Panel(name=str(n), title=_iterations(n), x=X, y=Y) for n in iterations],
        series=[s for n in iterations for s in _series(n, records)],
        records=records,
        sentences=[_sentence(n, records) for n in iterations],
        tables=[_table(n, records, courant, omega) for n in iterations],
    )


def _spec(settings: dict[str, Any]) -> RunSpec:
    return RunSpec(scene=SCENE, engine=OURS, parameters=PLACE, settings=settings, metrics=METRICS)


def _iterations(n: int) -> str:
    return f"{n} iteration" + "s" * (n > 1)


def _of(n: int, records: Sequence[Record]) -> list[Record]:
    return [record for record in records if record.settings["iterations"] == n]


def _series(n: int, records: Sequence[Record]) -> list[Series]:
    """The points that hold, and those that do not."""
    found = []
    for label, kind, holds in (("holds", "held", True), ("blows up", "failed", False)):
        some = [r.settings for r in _of(n, records) if (r.status.code == "ok") is holds]
        xs, ys = [s["courant"] for s in some], [s["omega"] for s in some]
        found.append(Series(panel=str(n), label=label, engine=OURS, x=xs, y=ys, kind=kind))
    return [series for series in found if series.x]


def _table(n: int, records: Sequence[Record], courant: Sequence[float], omega: Sequence[float]) -> Table:
    """Rise of the energy at each point, or how it ended."""
    cells = {(r.settings["courant"], r.settings["omega"]): _cell(r) for r in _of(n, records)}
    rows = [[f"{w:g}", *(cells[c, w] for c in courant)] for w in omega]
    columns = ["omega", *(f"c = {c:g}" for c in courant)]
    return Table(
        title=f"{_iterations(n)}: largest rise of the energy [m g L], or how it ended", columns=columns, rows=rows
    )


def _cell(record: Record) -> str:
    return f"{record.metric('energy_rise'):.0e}" if record.status.code == "ok" else record.status.code


def _sentence(n: int, records: Sequence[Record]) -> str:
    """Up to which relaxation every step holds."""
    some = _of(n, records)
    bad = [record.settings["omega"] for record in some if record.status.code != "ok"]
    if not bad:
        return f"{_iterations(n)}: all {len(some)} points hold."
    safe = [record.settings["omega"] for record in some if record.settings["omega"] < min(bad)]
    held = f"every step tried holds up to omega = {max(safe):g}" if safe else "no relaxation holds at every step tried"
    return f"{_iterations(n)}: {held}; {len(bad)} of {len(some)} points blow up."
