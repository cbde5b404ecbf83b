"""The one way to run: `execute(spec) -> Record`, for studies, tests, reports and gates alike."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from comparisons import catalog, engine, isolation
from comparisons.metrics import Refused, Subject
from comparisons.record import Record, RunSpec, Status, Value
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory
from pbd import fields

MAX_ENERGY_RISE = 0.1
"""Of the scene's energy scale: a passive system that gained more is drifting."""

BLOW_UP_RISE = 1.0
"""Of the energy scale: gained more than this, it has blown up."""

VIOLATED = 1e-9
"""A rigid link further from its length than this [m] counts as violated."""

Runner = Callable[[RunSpec], Trajectory]


class Bound(msgspec.Struct, frozen=True):
    """A spec with its names resolved and its values validated."""

    spec: RunSpec
    scene: Any
    adapter: Any
    settings: Any

    def run(self, scene: Scene | None = None) -> Trajectory:
        """Build everything, then run and time the run alone; ``scene`` takes the place of the spec's."""
        runner = self.adapter.prepare(scene or self.scene, self.settings)
        start = time.perf_counter()
        trajectory = runner()
        return dataclasses.replace(trajectory, wall=time.perf_counter() - start)


def build_scene(name: str, parameters: dict[str, Any]) -> Scene:
    """The scene of that name; `InvalidInput` names the parameter that is wrong."""
    module = catalog.load("scenes", name)
    for key in parameters:
        fields.find("scene parameter", key, module.Parameters)
    return module.build(module.Parameters(**parameters))


def bind(spec: RunSpec) -> Bound:
    """Resolve and validate everything that can be before anything runs.

    Raises `InvalidInput` for an unknown name, a value out of range, a dt off the sample grid.
    """
    scene = build_scene(spec.scene, spec.parameters)
    adapter = engine.load(spec.engine)
    settings = engine.make_settings(spec.engine, spec.preset, spec.settings)
    if getattr(settings, "dt", None) is not None:
        scene.steps_per_sample(settings.dt)
    for name in spec.metrics or ():
        catalog.load("metrics", name)
    return Bound(spec, scene, adapter, settings)


def execute(spec: RunSpec, runner: Runner | None = None) -> Record:
    """Run ``spec`` and measure it.

    ``runner`` produces the trajectory; by default a foreign engine runs in a child process of its own
    and ours in this one. What goes wrong in an engine is a status, not an exception; bad input is
    `InvalidInput`.
    """
    bound = bind(spec)
    remedy = bound.adapter.missing()
    if remedy:
        return _record(
            bound, status=Status(code="unsupported", quantity=f"{spec.engine} is not installed", remedy=remedy)
        )
    reason = bound.adapter.unsupported(bound.scene, bound.settings)
    if reason:
        return _record(
            bound, status=Status(code="unsupported", quantity=reason, remedy="choose another engine or scene")
        )
    try:
        if runner is not None:
            trajectory = runner(spec)
        else:
            trajectory = isolation.run_apart(spec) if bound.adapter.FOREIGN else bound.run()
    except isolation.Lost as lost:
        return _record(bound, status=Status(code=lost.code, quantity=lost.what, remedy=lost.remedy))
    return _measure(bound, trajectory)


def _measure(bound: Bound, trajectory: Trajectory) -> Record:
    values: dict[str, Value] = {}
    try:
        status = classify(bound.scene, trajectory)
        if status.code == "ok":
            subject = Subject(trajectory, bound.scene)
            for name in bound.scene.metrics if bound.spec.metrics is None else bound.spec.metrics:
                module = catalog.load("metrics", name)
                values[name] = Value(float(module.measure(subject)), module.UNIT)
    except Refused as refused:
        status = Status(code="refused", quantity=str(refused), remedy=refused.remedy)
        values = {}
    return _record(
        bound, status=status, steps=trajectory.steps, work=trajectory.work, wall=trajectory.wall, metrics=values
    )


def classify(scene: Scene, trajectory: Trajectory) -> Status:
    """ok; diverged where something is not finite or energy rose by the scale; drifting where it rose by a tenth."""
    smaller = "use a smaller time step, or more iterations or sub-steps"
    if trajectory.diverged:
        return Status(code="diverged", step=trajectory.steps, quantity=trajectory.diverged, remedy=smaller)
    if len(trajectory.times) == 0 or (len(scene.masses.masses) == 0 and scene.bodies is None):
        return Status()
    subject = Subject(trajectory, scene)
    if subject.rods and np.abs(subject.extensions[0]).max() > VIOLATED:
        return Status()  # a rigid link that starts violated holds unbounded energy, so energy judges nothing
    rise = (subject.energy - subject.energy[0]) / subject.energy_scale
    for limit, code in ((BLOW_UP_RISE, "diverged"), (MAX_ENERGY_RISE, "drifting")):
        above = ~(rise <= limit)  # true for nan as well
        if above.any():
            sample = int(np.argmax(above))
            step = trajectory.steps * sample // max(len(trajectory.times) - 1, 1)
            return Status(code=code, step=step, quantity="energy", remedy=smaller)
    return Status()


def _record(bound: Bound, *, status: Status, steps: int = 0, **measured: Any) -> Record:
    spec, settings = bound.spec, dataclasses.asdict(bound.settings)
    return Record(
        key=spec.key(),
        scene=spec.scene,
        parameters=spec.parameters,
        engine=spec.engine,
        version="" if bound.adapter.missing() else bound.adapter.version(),
        method=settings.get("method", spec.engine),
        preset=spec.preset,
        settings=settings,
        dt=_step(bound.scene, settings, steps),
        steps=steps,
        seed=spec.seed,
        status=status,
        **measured,
    )


def _step(scene: Scene, settings: dict[str, Any], steps: int) -> float | None:
    """dt [s]; where an engine has chosen it, what it has come to."""
    own = "dt" in settings and settings["dt"] is None and steps > 0
    return scene.duration / steps if own else settings.get("dt")
