"""How near XPBD, with and without re-synchronisation, and Newton's method come to implicit Euler's minimiser.

XPBD's corrections pull along gradients of passing iterates, so its fixed point is near the minimiser of
|x - x_hat|_M^2 / (2 h^2) + sum C^2 / (2 alpha), but not at it, however many sweeps are spent. The scene must be
compliant; its own stiffness and time steps are replaced by those of the study.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from comparisons.gather import Gatherer, through
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec, plain
from comparisons.run import bind
from comparisons.study import Panel, Series, Study, Table, duration, head
from pbd.errors import InvalidInput

ENGINE, METRIC = "pbd", "minimiser_distance"
STIFFNESSES = (1e4, 1e5)
TIME_STEPS = (1 / 60, 1 / 600)
STEPS = 10
"""After so many the cloth is in motion; of the last one the distance is measured."""

SWEEPS = (20, 100, 500)
PERIOD = 5
GOAL = 1e-8
HEADER = ["stiffness [N/m]", "dt [s]", "method", "distance from the minimiser", "re-synchronised", "time a step"]
NEWTON, RESYNCHRONISED = "Newton-CG", f"re-synchronised every {PERIOD} sweeps, guarded by Newton-CG"


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    stiffness: Sequence[float] = STIFFNESSES,
    dt: Sequence[float] = TIME_STEPS,
    steps: int = STEPS,
    rounds: int = 3,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure the distance of one step's end from its minimiser, and the time of a step.

    Parameters
    ----------
    scene_name : a scene with a compliance: "hanging_cloth"
    scene : parameters that differ; engines : only "pbd"; settings : none, the study sets them itself
    stiffness : 1 / compliance of all links [N/m]; dt : time steps [s]; steps : done before and with the measured one

    Raises
    ------
    InvalidInput : before anything runs
    """
    if settings or list(engines or [ENGINE]) != [ENGINE]:
        raise InvalidInput("engines and settings", engines or settings, "those of the study: pbd with its own")
    if steps < 1:
        raise InvalidInput("steps", steps, "a whole number >= 1")
    parameters = plain(scene or {})
    cases = [Case(scene_name, parameters, k, h, steps) for k in stiffness for h in dt]
    plan = [(case, name, spec) for case in cases for name, spec in case.specs()]
    for _, _, spec in plan:
        bind(spec)
    subject = bind(plan[0][2]).scene.title
    with Gatherer([ENGINE], f"implicit Euler, {subject}", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(ENGINE, through([spec])) for _, _, spec in plan])
        records = gatherer.times([group[0] for group in groups], rounds)
    rows = [(case, name, record) for (case, name, _), record in zip(plan, records, strict=True)]
    return Study(
        kind="implicit_euler",
        title=f"Implicit Euler's minimiser: {subject}",
        subject=subject,
        scene=scene_name,
        parameters=parameters,
        head=head(),
        panels=[Panel(name="sweeps", title="XPBD's stall", x="sweeps in a step", y="distance / correction")],
        series=[*(_stall(case, rows) for case in cases), *_worst(rows)],
        records=records,
        tables=[Table(title="Distance after one step", columns=HEADER, rows=[_row(*row, steps) for row in rows])],
        sentences=_sentences(rows),
    )


class Case:
    """One stiffness [N/m] and time step [s] of the scene."""

    def __init__(self, scene: str, parameters: dict[str, Any], stiffness: float, dt: float, steps: int) -> None:
        self.stiffness, self.dt = stiffness, dt
        changes = {"compliance": 1.0 / stiffness, "duration": steps * dt, "samples": steps}
        self._base = {"scene": scene, "engine": ENGINE, "parameters": {**parameters, **changes}, "metrics": (METRIC,)}

    @property
    def label(self) -> str:
        """The case in words."""
        return f"sweeps, {self.stiffness:g} N/m, 1/{1 / self.dt:.0f} s"

    def specs(self) -> Iterator[tuple[str, RunSpec]]:
        """(name, spec) of each method."""
        common = {"method": "xpbd", "dt": self.dt}
        for sweeps in SWEEPS:
            yield f"XPBD, {sweeps} sweeps", self._spec({**common, "iterations": sweeps, "order": "coloured"})
        yield RESYNCHRONISED, self._spec({**common, "solver": "implicit", "period": PERIOD})
        yield NEWTON, self._spec({**common, "solver": "implicit"})

    def _spec(self, settings: dict[str, Any]) -> RunSpec:
        return RunSpec(**self._base, settings=settings)  # type: ignore[arg-type]


Row = tuple[Case, str, Record]


def _row(case: Case, name: str, record: Record, steps: int) -> list[str]:
    """One line of the table."""
    if record.status.code == "ok":
        distance = f"{record.metric(METRIC):.1e}"
    else:
        distance = f"{record.status.code}: {record.status.quantity}"
    seconds = duration(record.seconds.min / steps) if record.seconds else "-"
    return [f"{case.stiffness:g}", f"1/{1 / case.dt:.0f}", name, distance, _accepted(record, steps), seconds]


def _accepted(record: Record, steps: int) -> str:
    """The share of steps that re-synchronised sweeps brought to the tolerance by themselves."""
    if not record.settings.get("period"):
        return "-"
    return f"{100 * record.work.get('re-synchronised solves', 0) / steps:.0f} % of steps"


def _stall(case: Case, rows: list[Row]) -> Series:
    """The distance over the number of plain sweeps."""
    mine = [record for other, name, record in rows if other is case and name.startswith("XPBD")]
    points = [(float(r.settings["iterations"]), r.metric(METRIC)) for r in mine if r.status.code == "ok"]
    x, y = [p[0] for p in points], [p[1] for p in points]
    return Series(panel="sweeps", label=case.label, engine=ENGINE, method="xpbd", x=x, y=y)


def _worst(rows: list[Row]) -> list[Series]:
    """The largest distance of the methods that need no number of sweeps, over the whole width."""
    found = []
    for method, label in ((RESYNCHRONISED, "re-synchronised, worst case"), (NEWTON, "Newton-CG, worst case")):
        if distances := _distances(rows, method):
            x, y = [float(SWEEPS[0]), float(SWEEPS[-1])], [max(distances)] * 2
            found.append(Series(panel="sweeps", label=label, engine=ENGINE, method="implicit", x=x, y=y))
    return found


def _sentences(rows: list[Row]) -> list[str]:
    """What the numbers say."""
    stalls = _distances(rows, f"XPBD, {SWEEPS[-1]} sweeps")
    said = []
    if stalls:
        low, high = 100 * min(stalls), 100 * max(stalls)
        said.append(f"Plain XPBD stays {low:.2g} to {high:.2g} % from the minimiser after {SWEEPS[-1]} sweeps.")
    for name, words in ((RESYNCHRONISED, f"XPBD {RESYNCHRONISED}"), (NEWTON, NEWTON)):
        if found := _distances(rows, name):
            within = sum(distance <= GOAL for distance in found)
            said.append(f"{words}: at most {max(found):.1e}; within {GOAL:g} in {within} of {len(found)} cases.")
    return said


def _distances(rows: list[Row], method: str) -> list[float]:
    return [record.metric(METRIC) for _, name, record in rows if name == method and record.status.code == "ok"]
