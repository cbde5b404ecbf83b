"""What every engine makes of problems with a known answer: free fall, a pendulum, a free pair, and its own traps.

The same scenes and closed forms for all, each engine at its defaults and, where that differs, matched:

free fall     g t^2 / 2; kick then move (symplectic Euler) must give g t (t + h) / 2, move then kick g t (t - h) / 2
a pendulum    the fitted order of its position error, and what becomes of its energy
a free pair   two masses on a rod: their linear momentum must not change

What only one engine can show comes from its adapter's ``calibrate``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons import catalog, engine
from comparisons.fit import fit_order
from comparisons.gather import Gatherer, through
from comparisons.isolation import Lost, Workers, lent
from comparisons.record import Finding, Record, RunSpec
from comparisons.study import Omission, Study, Table, head
from pbd import fields
from pbd.errors import InvalidInput

FALL_STEP, FALL_TIME, GRAVITY = 0.01, 1.0, 9.81
ORDER_STEPS = tuple(0.01 / 2**k for k in range(6))
STEP = 1e-3
"""Seconds, for energy and momentum."""

SWINGS = 10.0
"""Seconds that the pendulum's energy is watched."""

SPEED = 4.0
"""kg m/s that the free pair has: 4 kg at 1 m/s."""

AGREES = 1e-6
"""Metres within which a fall agrees with a closed form; what (x - x_old) / h loses to round-off is far below."""

KEPT = 1e-8
"""kg m/s: momentum below is round-off, which (x - x_old) / h magnifies."""

PRESETS = ("default", "matched", "accurate")
COLUMNS = ["engine", "settings", "question", "must be", "found", "verdict"]
OWN_COLUMNS = ["engine", "question", "must be", "found", "verdict"]


@dataclass(frozen=True)
class Question:
    """A scene that is run at some time steps, and the metric that answers."""

    words: str
    scene: str
    parameters: Mapping[str, Any]
    steps: tuple[float, ...]
    metric: str

    def specs(self, name: str, preset: str) -> list[RunSpec]:
        """The runs that answer for one engine and preset."""
        return [
            RunSpec(
                scene=self.scene,
                engine=name,
                preset=preset,
                parameters=dict(self.parameters),
                settings={"dt": dt},
                metrics=(self.metric,),
            )
            for dt in self.steps
        ]


QUESTIONS = (
    Question(f"free fall for {FALL_TIME:g} s, dt {FALL_STEP:g} s [m]", "free_fall", {}, (FALL_STEP,), "fall"),
    Question("pendulum, order of the position error", "pendulum_chain", {}, ORDER_STEPS, "position_error"),
    Question(
        f"pendulum, energy after {SWINGS:g} s, dt {STEP:g} s [m g L]",
        "pendulum_chain",
        {"duration": SWINGS},
        (STEP,),
        "energy_change",
    ),
    Question(
        f"free rigid pair, change of {SPEED:g} kg m/s within 1 s, dt {STEP:g} s",
        "free_pair",
        {},
        (STEP, 0.5 * STEP),
        "momentum_drift",
    ),
)


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Ask every engine every question.

    Parameters
    ----------
    engines : names; default all that have a time step
    settings : must be empty: engines are shown as their presets have them
    workers : where to run; default in workers of this study's own

    Raises
    ------
    InvalidInput : before anything runs
    """
    if settings:
        raise InvalidInput("settings", sorted(settings), "absent: this study shows the presets", "use convergence")
    names = list(engines or filter(_steps, catalog.names("engines")))
    for name in names:
        if not _steps(name):
            raise InvalidInput("engines", name, "engines with a fixed time step")
    remedies = {name: engine.load(name).missing() for name in names}
    present = [name for name in names if not remedies[name]]
    asked = [(question, name, preset) for name in present for preset in _presets(name) for question in QUESTIONS]
    with lent(workers) as pool:
        gatherer = Gatherer(present, "calibration", workers=pool, quiet=quiet)
        groups = gatherer.groups([(name, through(question.specs(name, preset))) for question, name, preset in asked])
        own = [(name, finding) for name in present for finding in _findings(pool, name)]
    answers = list(zip(asked, groups, strict=True))
    answering = {which[1] for which, found in answers if found[-1].status.code != "unsupported"}
    rows = [_row(*which, found) for which, found in answers if which[1] in answering]
    return Study(
        kind="calibration",
        title="Every engine on problems with a known answer",
        subject="calibration",
        scene="",
        parameters={},
        head=head(),
        panels=[],
        series=[],
        records=[record for found in groups for record in found],
        omissions=[
            *(Omission(name, f"{name} is not installed", remedies[name]) for name in names if remedies[name]),
            *(Omission(name, "it has no particles", "") for name in present if name not in answering),
        ],
        tables=[
            Table(title="The same questions to every engine", columns=COLUMNS, rows=rows),
            Table(title="What only one engine shows", columns=OWN_COLUMNS, rows=[_own(*one) for one in own]),
        ],
    )


def _steps(name: str) -> bool:
    return "dt" in fields.rules(engine.load(name).Settings)


def _presets(name: str) -> list[str]:
    return [preset for preset in PRESETS if preset in engine.load(name).PRESETS]


def _findings(pool: Workers, name: str) -> list[Finding]:
    """What the engine's own calibration finds; a lost child is a finding too."""
    try:
        return pool[name].findings(name)
    except Lost as lost:
        return [Finding(what="its own calibration", expected=0.0, found=math.nan, unit="", verdict=f"lost: {lost}")]


def _own(name: str, finding: Finding) -> list[str]:
    values = [f"{value:.7g} {finding.unit}".removesuffix(" 1") for value in (finding.expected, finding.found)]
    return [engine.load(name).TITLE, finding.what, *values, finding.verdict]


# ------------------------------------------------------------------ verdicts


def _row(question: Question, name: str, preset: str, found: list[Record]) -> list[str]:
    answer = _refusal(found) or ANSWERS[question.metric](found)
    return [engine.load(name).TITLE, preset, question.words, *answer]


def _refusal(found: list[Record]) -> tuple[str, str, str] | None:
    """Where the last, finest run has no result: why."""
    status = found[-1].status
    if status.code == "ok":
        return None
    return "", "-", f"{status.code}: {status.quantity}"


def _fall(found: list[Record]) -> tuple[str, str, str]:
    fall = found[-1].metric("fall")
    h = FALL_STEP / int(found[-1].settings.get("substeps", 1))
    forms = {
        "exact: half a kick at the start, or a higher order": GRAVITY * FALL_TIME**2 / 2.0,
        f"kicks, then moves, h = {h:g} s: g t (t + h) / 2": GRAVITY * FALL_TIME * (FALL_TIME + h) / 2.0,
        f"moves, then kicks, h = {h:g} s: g t (t - h) / 2": GRAVITY * FALL_TIME * (FALL_TIME - h) / 2.0,
    }
    words = [word for word, value in forms.items() if abs(fall - value) < AGREES]
    other = "trap: none of the three schemes; damped" if fall < min(forms.values()) else "wrong: falls too fast"
    return f"{GRAVITY * FALL_TIME**2 / 2.0:.6f}", f"{fall:.6f}", words[0] if words else other


def _order(found: list[Record]) -> tuple[str, str, str]:
    fit = fit_order(list(ORDER_STEPS), [record.metric("position_error") for record in found])
    error = found[-1].metric("position_error")
    at = f"error {error:.1e} m at dt {ORDER_STEPS[-1]:.3g} s"
    if fit.order is not None:
        return "a whole number", f"{fit.order:.2f}", f"order {round(fit.order)}; {at}"
    words = "no order on these steps" if fit.floor is None else f"stops at a floor of {fit.floor:.1e} m"
    return "a whole number", "-", f"{words}; {at}"


def _energy(found: list[Record]) -> tuple[str, str, str]:
    change = found[-1].metric("energy_change")
    if abs(change) < 1e-4:
        return "0", f"{change:+.1e}", "kept"
    return "0", f"{change:+.4f}", f"{'gains' if change > 0.0 else 'loses'} {abs(change):.2%} of m g L"


def _momentum(found: list[Record]) -> tuple[str, str, str]:
    drift, finer = (record.metric("momentum_drift") for record in found)
    words = "kept" if drift < KEPT else f"not kept: {drift / SPEED:.2%} of it, at half the step {finer / SPEED:.2%}"
    return "0", f"{drift:.1e}", words


ANSWERS = {"fall": _fall, "position_error": _order, "energy_change": _energy, "momentum_drift": _momentum}
