"""What the studies of fluids share: who takes part, and their runs with the motion kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from comparisons import catalog, engine
from comparisons.gather import with_motion
from comparisons.isolation import Workers
from comparisons.metrics import Subject
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.study import Omission
from pbd.errors import InvalidInput

OURS = "pbf"
"""The subject: this project's position based fluids."""

USUAL_STEP = 1.0 / 240.0
"""[s] pybullet's own, and what is usual with pymunk."""

Seen = TypeVar("Seen")


@dataclass(frozen=True)
class Contender:
    """An engine with settings; ``step`` is its longest time step [s] where the engine does not choose one."""

    label: str
    engine: str
    preset: str = "default"
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    step: float | None = None

    def spec(self, scene: str, parameters: Mapping[str, Any], metrics: Sequence[str]) -> RunSpec:
        """A run; the step, if it is not the engine's choice, a whole fraction of the sample interval."""
        given = dict(self.settings)
        if self.step is not None:
            given["dt"] = build_scene(scene, dict(parameters)).longest_step(self.step)
        return RunSpec(
            scene=scene,
            engine=self.engine,
            preset=self.preset,
            parameters=dict(parameters),
            settings=given,
            metrics=tuple(metrics),
        )


# PBF and XPBD are as published; "from rest" takes the density at the start for that of rest, see `pbd.fluid.rest`;
# with more relaxation XPBD diverges, see `pbd.fluid.density`
PBF = Contender("PBF", OURS)
FAST = Contender("PBF from rest, fast", OURS, "fast")
REST = Contender("PBF from rest", OURS, settings={"rest": "start"})
XPBD = Contender("XPBD fluid", OURS, settings={"method": "xpbd", "omega": 0.7})
ACCURATE = Contender("PBF from rest, accurate", OURS, "accurate")
WCSPH = Contender("WCSPH", "symplectic_euler", settings={"dt": None})
GRAINS = (
    Contender("pymunk discs (granular)", "pymunk", "matched", settings={"dt": None}),
    Contender("pymunk discs, default", "pymunk", step=USUAL_STEP),
    Contender("pybullet balls (granular)", "pybullet", "matched", settings={"dt": None}),
    Contender("pybullet balls, default", "pybullet", step=USUAL_STEP),
)
CONTENDERS = (PBF, FAST, XPBD, ACCURATE, WCSPH, *GRAINS)
ENGINES = tuple(dict.fromkeys(one.engine for one in CONTENDERS))


def chosen(
    names: Sequence[str] | None, settings: Mapping[str, Any] | None, of: Sequence[Contender] = CONTENDERS
) -> list[Contender]:
    """Who takes part of those given, all by default; such a study sets their settings itself."""
    possible = list(dict.fromkeys(one.engine for one in of))
    if settings:
        raise InvalidInput("settings", sorted(settings), "absent: this study sets them itself", "use run")
    for name in names or ():
        engine.load(name)
        if name not in possible:
            raise InvalidInput("engines", name, "of " + ", ".join(possible), "others have no place in this study")
    return [one for one in of if one.engine in (names or possible)]


def counts(name: str, values: Sequence[float]) -> None:
    """Refuse a list that is empty or holds what is not a whole number >= 1."""
    if not values or not all(float(value).is_integer() and value >= 1 for value in values):
        raise InvalidInput(name, list(values), "at least one number, all whole and >= 1")


def measured(pool: Workers, spec: RunSpec, see: Callable[[Subject], Seen]) -> tuple[Record, Seen | None]:
    """A run's record, and what ``see`` finds in its motion, None where it has none."""
    record, trajectory = with_motion(pool, spec)
    if record.status.code != "ok" or trajectory is None:
        return record, None
    return record, see(Subject(trajectory, build_scene(spec.scene, spec.parameters)))


def others_left_out() -> list[Omission]:
    """The engines that move no fluids, in their adapters' words."""
    water, found = build_scene("lone_particle", {}), []
    for name in catalog.names("engines"):
        if name not in ENGINES:
            reason = engine.load(name).unsupported(water, engine.make_settings(name, "default", {}))
            found.append(Omission(name, reason or "has no place in this study", "choose another engine or scene"))
    return found


def lost(records: Iterable[Record]) -> list[Omission]:
    """Engines none of whose runs has a result."""
    mine: dict[str, list[Record]] = {}
    for record in records:
        mine.setdefault(record.engine, []).append(record)
    return [
        Omission(name, some[0].status.quantity or some[0].status.code, some[0].status.remedy)
        for name, some in mine.items()
        if all(record.status.code != "ok" for record in some)
    ]
