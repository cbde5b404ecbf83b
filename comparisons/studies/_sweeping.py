"""What the studies of constraint sweeps share: who takes part, scenes of a given size, runs of given steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from comparisons import catalog, engine
from comparisons.record import Record, RunSpec, plain
from comparisons.scene import Scene
from comparisons.study import Omission
from pbd import fields
from pbd.errors import InvalidInput

ENGINES = ("pbd", "pypbd")
"""Engines that project each constraint in turn, as often as they are told."""

PEER = "pypbd"
"""The C++ reference of the method, beside which our times are shown."""

DT = 1e-3
"""Seconds; without gravity and velocities at the start it changes nothing."""

START = {"stretch": 1.1, "gravity": 0.0, "angles": 45.0}
"""Every link 10 % too long, and no axis along which all is 0: squares of round-off there would be denormal numbers."""

ORDERS = {"natural": "natural order", "wavefront": "wavefront", "coloured": "coloured"}
PRECISIONS = {"float64": "", "float32": " (float32)"}
METHODS = ("pbd", "xpbd")
TITLES = {"pbd": "PBD (k = 1)", "xpbd": "XPBD (rigid)"}


@dataclass(frozen=True)
class Contender:
    """An engine with settings, apart from time step and iterations, and how its lines are named."""

    label: str
    engine: str
    preset: str = "default"
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def method(self) -> str:
        """One of METHODS."""
        return str(self.settings["method"])

    def spec(self, sized: Sized, steps: int, iterations: int, metrics: tuple[str, ...] = ()) -> RunSpec:
        """Some steps from the start of a scene, sampled at their end."""
        settings = {**self.settings, "dt": DT, "iterations": iterations}
        return RunSpec(
            scene=sized.scene,
            engine=self.engine,
            preset=self.preset,
            parameters={**sized.parameters, "duration": steps * DT, "samples": 1},
            settings=settings,
            metrics=metrics,
        )


@dataclass(frozen=True)
class Sized:
    """A scene, its parameters, and how many particles and links it has."""

    scene: str
    parameters: dict[str, Any]
    built: Scene

    @property
    def words(self) -> str:
        """For headings."""
        return f"{self.scene.replace('_', ' ')}, {self.particles} particles"

    @property
    def particles(self) -> int:
        """Their number, the pinned ones included."""
        return len(self.built.masses.masses)

    @property
    def links(self) -> int:
        """Their number; those that join two pinned particles are projected by nobody."""
        free = self.built.masses.free
        return sum(int((free[link.pairs[:, 0]] | free[link.pairs[:, 1]]).sum()) for link in self.built.links)


def contenders(
    method: str, orders: Sequence[str] = tuple(ORDERS), precisions: Sequence[str] = tuple(PRECISIONS)
) -> list[Contender]:
    """Our Gauss-Seidel solver in each order and precision, then the peer; PBD has k = 1, XPBD no compliance."""
    ours = [
        Contender(
            ORDERS[order] + PRECISIONS[precision],
            "pbd",
            settings={"method": method, "order": order, "precision": precision},
        )
        for order in orders
        for precision in precisions
    ]
    return [*ours, Contender("pyPBD", "pypbd", "matched", {"method": method})]


def step_pair(one: Contender, size: Sized, steps: int) -> list[RunSpec]:
    """Two runs with one sweep a step, the second three times as long; see `step_time`."""
    return [one.spec(size, steps, 1), one.spec(size, 3 * steps, 1)]


def step_time(pair: Sequence[Record], size: Sized, steps: int) -> float:
    """Time of a particle's step [ns], without what a run costs before its first; nan where it was not measured."""
    return difference(*pair) / (2 * steps * size.particles)


def difference(less: Record, more: Record) -> float:
    """By how much the run time of ``more`` exceeds that of ``less`` [ns]; nan where one has none."""
    return 1e9 * (more.seconds.min - less.seconds.min) if less.seconds and more.seconds else math.nan


def size_of(scene_name: str) -> str:
    """The scene's parameter that sets its size: links, or size, which is the side of a square."""
    known = fields.rules(catalog.load("scenes", scene_name).Parameters)
    for name in ("links", "size"):
        if name in known:
            return name
    raise InvalidInput("scene", scene_name, "a scene whose size can be set, by links or size")


def sized(scene_name: str, changes: Mapping[str, Any], count: int | None = None) -> Sized:
    """The scene at the start of these studies, with ``changes``, and with about ``count`` particles if given."""
    module, name = catalog.load("scenes", scene_name), size_of(scene_name)
    known = fields.rules(module.Parameters)
    parameters = {**{k: v for k, v in START.items() if k in known}, **plain(changes)}
    for key in parameters:
        fields.find("scene parameter", key, module.Parameters)
    if count is not None:
        parameters[name] = round(count**0.5) if name == "size" else count
    return Sized(scene_name, parameters, module.build(module.Parameters(**parameters)))


def in_range(scene_name: str, counts: Sequence[int]) -> list[int]:
    """Those numbers of particles, ascending, that the scene can have."""
    name = size_of(scene_name)
    rule = fields.rules(catalog.load("scenes", scene_name).Parameters)[name]
    power = 2 if name == "size" else 1
    return [count for count in sorted(set(counts)) if rule.low**power <= count <= rule.high**power]


def chosen(names: Sequence[str] | None, settings: Mapping[str, Any] | None, rounds: int) -> list[str]:
    """The engines of such a study, all of ENGINES by default; it sets their settings itself, and times ``rounds``."""
    if rounds < 1:
        raise InvalidInput("rounds", rounds, "a whole number >= 1")
    if settings:
        raise InvalidInput("settings", sorted(settings), "absent: this study sets them itself")
    for name in names or ():
        engine.load(name)
        if name not in ENGINES:
            raise InvalidInput("engines", name, "of " + ", ".join(ENGINES), "others project no constraints in sweeps")
    return list(names or ENGINES)


def others_left_out() -> list[Omission]:
    """The engines that no study of sweeps can show."""
    reason, remedy = "projects no constraints in sweeps that can be counted", "see run time against error"
    return [Omission(name, reason, remedy) for name in catalog.names("engines") if name not in ENGINES]


def left_out(found: Sequence[tuple[Contender, Sequence[Record]]]) -> list[Omission]:
    """Who is missing: engines that sweep over no constraints, and contenders of which no run was ok."""
    omissions = others_left_out()
    runs: dict[tuple[str, str], list[Record]] = {}
    for one, records in found:
        runs.setdefault((one.engine, f"{TITLES[one.method]}, {one.label}"), []).extend(records)
    failed: dict[tuple[str, str, str], list[str]] = {}
    for (name, title), records in runs.items():
        if all(record.status.code != "ok" for record in records):
            status = records[0].status
            failed.setdefault((name, status.quantity or status.code, status.remedy), []).append(title)
    for (name, what, how), titles in failed.items():
        is_absent = bool(engine.load(name).missing())
        omissions.append(Omission(name, what if is_absent else f"{'; '.join(titles)}: {what}", how))
    return omissions
