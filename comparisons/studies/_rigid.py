"""What the studies of rigid bodies share: who takes part, phases of the grid of steps, what counts of several runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons import catalog, engine
from comparisons.gather import Ladder
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.study import Omission
from pbd.errors import InvalidInput

OURS = "rattle"
"""The subject: this project's solver of rigid bodies."""

CONTACT_STEPS = 10
"""Steps that a penalty contact of symplectic Euler lasts: stiffer ones blow up in heaps, softer ones sink deeper."""

PENALTY = f"symplectic Euler's penalty contacts last {CONTACT_STEPS} steps"

ROUND_OFF = 1e-12
"""Errors below are round-off: none of two of them is better."""


@dataclass(frozen=True)
class Contender:
    """An engine at a preset; of several presets the one with the least error counts, question by question."""

    label: str
    engine: str
    presets: tuple[str, ...]

    def settings(self, dt: float) -> dict[str, float]:
        """What departs from a preset; a box's contact in the plane takes pi / sqrt(2 k) with symplectic Euler."""
        if self.engine != "symplectic_euler":
            return {"dt": dt}
        return {"dt": dt, "contact_stiffness": 0.5 * (math.pi / (CONTACT_STEPS * dt)) ** 2}

    def spec(
        self, scene: str, parameters: Mapping[str, Any], preset: str, dt: float, metrics: tuple[str, ...]
    ) -> RunSpec:
        """A run with steps of ``dt`` [s]."""
        return RunSpec(
            scene=scene,
            engine=self.engine,
            preset=preset,
            parameters=dict(parameters),
            settings=self.settings(dt),
            metrics=metrics,
        )


FAST = Contender("RATTLE contacts, fast", OURS, ("fast",))
ACCURATE = Contender("RATTLE contacts, accurate", OURS, ("accurate",))
PARTICLES = Contender("PBD particle boxes", "particle_boxes", ("accurate",))
EULER = Contender("symplectic Euler", "symplectic_euler", ("matched",))
AT_ONE_PRESET = (
    ACCURATE,
    FAST,
    PARTICLES,
    Contender("pybullet, matched", "pybullet", ("matched",)),
    Contender("pybullet, default", "pybullet", ("default",)),
    Contender("pymunk, matched", "pymunk", ("matched",)),
    Contender("pymunk, default", "pymunk", ("default",)),
    Contender("MuJoCo, matched", "mujoco", ("matched",)),
    Contender("MuJoCo, default", "mujoco", ("default",)),
    EULER,
)
"""For questions of rest, for which there is one matched preset."""

ENGINES = tuple(dict.fromkeys(one.engine for one in AT_ONE_PRESET))


def chosen(names: Sequence[str] | None, settings: Mapping[str, Any] | None, of: Iterable[Contender]) -> list[Contender]:
    """Who takes part, of all of ENGINES by default; such a study sets their settings itself."""
    if settings:
        raise InvalidInput("settings", sorted(settings), "absent: this study sets them itself", "use work_precision")
    for name in names or ():
        engine.load(name)
        if name not in ENGINES:
            raise InvalidInput("engines", name, "of " + ", ".join(ENGINES), "others move no rigid bodies")
    return [one for one in of if one.engine in (names or ENGINES)]


def positive(**numbers: Sequence[float]) -> None:
    """Refuse a list that is empty or holds what is not a finite number > 0."""
    for name, values in numbers.items():
        if not values or not all(math.isfinite(value) and value > 0.0 for value in values):
            raise InvalidInput(name, list(values), "at least one number, all > 0")


def counted(number: int, what: str) -> str:
    """For titles."""
    return f"{number} {what}" + "s" * (number > 1)


def others_left_out() -> list[Omission]:
    """The engines that move no rigid bodies, in their adapters' words."""
    body, remedy = build_scene("drop", {}), "choose another engine or scene"
    found = []
    for name in catalog.names("engines"):
        if name not in ENGINES:
            reason = engine.load(name).unsupported(body, engine.make_settings(name, "default", {}))
            found.append(Omission(name, reason or "has no place in this study yet", remedy))
    return found


def capped(specs: Sequence[RunSpec], cap: float) -> Ladder:
    """The given specs, of falling time steps; it ends before one that would take longer than ``cap`` seconds."""

    def following(found: list[Record]) -> RunSpec | None:
        if len(found) == len(specs):
            return None
        spec = specs[len(found)]
        if found and found[-1].wall * found[-1].settings["dt"] / spec.settings["dt"] > cap:
            return None
        return spec

    return following


# ------------------------------------------------------------------ one of several runs


def phases_of(spec: RunSpec, count: int) -> list[RunSpec]:
    """The run with its events shifted against the grid of steps by k / count of a step."""
    if count == 1:
        return [spec]
    dt = spec.settings["dt"]
    leads = [spec.parameters.get("lead", 0.0) + k * dt / count for k in range(count)]
    return [
        RunSpec(
            scene=spec.scene,
            engine=spec.engine,
            preset=spec.preset,
            parameters={**spec.parameters, "lead": lead} if lead else spec.parameters,
            settings=spec.settings,
            seed=spec.seed,
            metrics=spec.metrics,
        )
        for lead in leads
    ]


def worst(records: Sequence[Record], metric: str) -> Record:
    """One that has no result, or else that with the largest error."""
    lost = [record for record in records if not math.isfinite(record.metric(metric))]
    return lost[0] if lost else max(records, key=lambda record: record.metric(metric))


def least(records: Sequence[Record], metric: str) -> Record:
    """That with the smallest error, or else one that has none."""
    have = [record for record in records if math.isfinite(record.metric(metric))]
    return min(have, key=lambda record: record.metric(metric)) if have else records[0]


def worst_phase(ladder: Ladder, count: int, metric: str) -> Ladder:
    """A ladder that runs each spec of another in ``count`` phases; the other sees the worst of them."""
    pending: list[RunSpec] = []

    def following(found: list[Record]) -> RunSpec | None:
        if not pending:
            spec = ladder(by_worst(found, count, metric))
            if spec is None:
                return None
            pending.extend(phases_of(spec, count))
        return pending.pop(0)

    return following


def by_worst(found: Sequence[Record], count: int, metric: str) -> list[Record]:
    """Of each ``count`` records the worst."""
    return [worst(found[k : k + count], metric) for k in range(0, len(found), count)]
