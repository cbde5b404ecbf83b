"""The simulation: everything bound once, then a whole duration inside one kernel call."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd.arrangement import Problem, check_groups, renumbered
from pbd.arrays import indices, number, real_array
from pbd.errors import InvalidInput
from pbd.external import Gravity
from pbd.fields import Rule
from pbd.jit import device, kernel
from pbd.settings import Settings
from pbd.stages import detect, not_finite, observe, step
from pbd.state import LACKING, PAIRS_TESTED, SIGNALS, WORK, Particles, State
from pbd.team import helpers, with_teams
from pbd.vector import aligned, from_store

MAX_STEPS = 10**12
CHECKS_PER_RUN = 100
"""A run is tested for finite values at least this often, so that a blow-up ends it within 1 %."""

QUANTITIES = ("", "position", "velocity")


class Scene(NamedTuple):
    """The state and what acts on it in each step; its type decides what is compiled."""

    state: State
    batches: tuple
    external: tuple
    damping: Any


class Plan(NamedTuple):
    """When to step, sample and check: ``samples`` (s,) step numbers, ascending, to be recorded."""

    h: float
    substeps: int
    steps: int
    samples: np.ndarray
    check_every: int


@kernel
def simulation(integrator, solver, scene, plan, recordings):
    """Line (4): the loop. Returns (steps done, samples recorded, 0 or the index of what diverged)."""
    recorded = 0
    unchecked = 0
    for n in range(plan.steps + 1):
        if n > 0:
            for s in range(plan.substeps):
                detect(scene.batches, scene.state, plan.h, plan.substeps - s)
                step(integrator, solver, scene, plan.h)
            unchecked += 1
        if scene.state.work[LACKING] > 0:
            return n, recorded, 0
        if unchecked == plan.check_every or n == plan.steps:
            unchecked = 0
            broken = first_broken(scene.state)
            if broken > 0:
                return n, recorded, broken
        if recorded < plan.samples.shape[0] and plan.samples[recorded] == n:
            observe(integrator, solver, scene, recordings, recorded)
            recorded += 1
    return plan.steps, recorded, 0


@device
def first_broken(state):
    """Index in QUANTITIES of the first quantity that is not finite; 0 for none."""
    broken = not_finite(state.particles)
    return broken if broken > 0 else not_finite(state.bodies)


@dataclass(frozen=True)
class Outcome:
    """What came out of a run.

    Attributes
    ----------
    times : (s,) [s] of the samples reached
    positions, velocities : (s, n, d) [m], [m/s] of the particles
    quantity : what was found not finite; empty when all is
    steps : steps done
    projections : constraint projections done, counted in the kernel; a direct solve counts as one of each link
    pairs : pairs of bodies that were tested for contact
    unconverged : solves that ended without the residual they are to reach
    scene : the final state and the bound batches, e.g. for ``scene.batches[0].law.multiplier``
    recordings : the raw recordings of all groups
    solver : the kernel's solver after the run, e.g. for ``solver.counts`` of `pbd.Implicit`
    """

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    quantity: str
    steps: int
    projections: int
    unconverged: int
    pairs: int
    scene: Scene
    recordings: tuple
    solver: Any

    @property
    def bodies(self) -> Any:
        """The samples of the bodies, from their own ``from_recording``: of `pbd.bodies` a `BodyMotion`."""
        return self.scene.state.bodies.from_recording(self.recordings[1], len(self.times))

    @property
    def status(self) -> str:
        """ "ok", or "diverged"."""
        return "diverged" if self.quantity else "ok"

    @property
    def step(self) -> int:
        """The step at which the run ended: the last one, or where ``quantity`` was found not finite."""
        return self.steps


class Simulation:
    """Particles, constraints and settings, bound once; `run` may be called any number of times.

    Parameters
    ----------
    particles : from `pbd.particles`
    constraints : batches, e.g. from `pbd.distance`; empty ones are dropped
    gravity : (d,) [m/s^2], or None for none
    external : further fields with an accelerate() method, e.g. from `pbd.point_forces`
    settings : `Settings`
    bodies : a second state group, any NamedTuple with the group stages of `pbd.stages`

    Raises
    ------
    InvalidInput : gravity of another dimension than the particles, or not finite
    """

    def __init__(
        self,
        particles: Particles | None,
        constraints: Sequence[Any] = (),
        *,
        gravity: Any = None,
        external: Sequence[Any] = (),
        settings: Settings | None = None,
        bodies: Any = None,
    ) -> None:
        self.settings = settings = settings or Settings()
        problem = Problem(particles, tuple(constraints), settings, bodies)
        check_groups(problem)
        self._integrator = settings.integrator.bind(problem)
        arranged = settings.solver.arrange(problem)
        self._slot = arranged.slot
        fields = tuple(external)
        if arranged.slot is not None:
            fields = tuple(renumbered(field, arranged.slot, "coloured") for field in fields)
        if gravity is not None:
            fields = (Gravity(_gravity(gravity, particles or bodies)), *fields)
        damping = settings.damping.bind() if settings.damping else None
        state = State(arranged.particles, bodies, np.zeros(WORK, dtype=np.int64), np.zeros(SIGNALS))
        self._solver = arranged.solver
        batches = with_teams(arranged.batches, int(settings.threads))
        self._scene = _in_precision(Scene(state, batches, fields, damping), settings.dtype)

    def run(self, steps: int, samples: Any = None) -> Outcome:
        """Do ``steps`` steps from the initial state and record after the step numbers in ``samples``.

        samples : ascending step numbers in [0, steps]; default all
        """
        if not Rule("whole", low=0, high=MAX_STEPS).holds(steps):
            raise InvalidInput("steps", steps, f"a whole number >= 0 and <= {MAX_STEPS:.0e}")
        steps = int(steps)  # numpy's own kinds of whole numbers would compile anew
        at = _sample_steps(steps, samples)
        # copies, so that an outcome keeps its state and multipliers whatever runs next
        scene, solver, integrator = _copy(self._scene), _copy(self._solver), _copy(self._integrator)
        state = scene.state
        recordings = tuple(g.new_recording(len(at)) if g is not None else None for g in state[:2])
        settings = self.settings
        plan = Plan(settings.dtype.type(settings.h), int(settings.substeps), steps, at, max(1, steps // CHECKS_PER_RUN))
        with helpers(scene.batches, state):
            done, recorded, broken = simulation(integrator, solver, scene, plan, recordings)
        if state.work[LACKING] > 0:
            self._scene = self._scene._replace(batches=_grown(self._scene.batches, 2 * int(state.work[LACKING])))
            return self.run(steps, at)
        x, v = recordings[0] or ((np.zeros((len(at), 0)),) * 2,) * 2
        seen = slice(None) if self._slot is None else self._slot
        return Outcome(
            times=at[:recorded] * settings.dt,
            positions=from_store(x)[:recorded, seen],
            velocities=from_store(v)[:recorded, seen],
            quantity=QUANTITIES[broken],
            steps=done,
            projections=int(state.work[0]),
            unconverged=int(state.work[1]),
            pairs=int(state.work[PAIRS_TESTED]),
            scene=scene,
            recordings=recordings,
            solver=solver,
        )


def simulate(
    particles: Particles,
    constraints: Sequence[Any] = (),
    *,
    duration: float,
    samples: int = 100,
    settings: Settings | None = None,
    **scene: Any,
) -> Outcome:
    """Simulate ``duration`` seconds and record the start and ``samples`` equally spaced times.

    Further arguments as in `Simulation`. Raises `InvalidInput` where the samples do not lie on steps.
    """
    settings = settings or Settings()
    steps = steps_in(duration, settings.dt)
    if not Rule("whole", low=1).holds(samples) or steps % samples:
        raise InvalidInput("samples", samples, f"a divisor of the number of steps, {steps}")
    at = np.arange(samples + 1) * (steps // samples)
    return Simulation(particles, constraints, settings=settings, **scene).run(steps, at)


def steps_in(duration: float, dt: float) -> int:
    """The whole number of steps dt in ``duration``; refused where there is none, or too many."""
    ratio = number("duration", duration, 5e-324, math.inf, "finite and > 0 s") / dt
    if ratio > MAX_STEPS:
        raise InvalidInput(
            "dt", dt, f"so large that {duration:g} s take at most {MAX_STEPS:.0e} steps", f"{ratio:.1e} steps asked"
        )
    steps = round(ratio)
    if steps < 1 or abs(ratio - steps) > 1e-9 * max(ratio, 1.0):
        raise InvalidInput("dt", dt, f"a whole fraction of the duration, {duration:g} s")
    return steps


def _gravity(gravity: Any, group: Any) -> tuple[float, ...]:
    vector = real_array("gravity", gravity)
    if vector.ndim != 1 or len(vector) != len(group.x):
        raise InvalidInput("gravity", gravity, "one component for each dimension of the positions")
    return tuple(float(component) for component in vector)


def _sample_steps(steps: int, samples: Any) -> np.ndarray:
    at = np.arange(steps + 1) if samples is None else indices("samples", samples, steps + 1)
    if at.ndim != 1 or np.any(np.diff(at) <= 0):
        raise InvalidInput("samples", samples, f"ascending step numbers in [0, {steps}]")
    return at


def _grown(batches: tuple, capacity: int) -> tuple:
    """The batches, those that seek pairs of bodies with room for so many."""
    return tuple(batch.grown(capacity) if hasattr(batch, "grown") else batch for batch in batches)


def _copy(value: Any) -> Any:
    """A deep copy of nested tuples of arrays."""
    return _mapped(value, aligned)


def _in_precision(value: Any, dtype: Any) -> Any:
    """Nested tuples with every array of reals, and every real number, in a precision."""
    if dtype == np.float64:
        return value

    def convert(array: np.ndarray) -> np.ndarray:
        return aligned(array, dtype if array.dtype == np.float64 else None)

    return _mapped(value, convert, dtype.type)


def _mapped(value: Any, arrays: Any, reals: Any = float) -> Any:
    if isinstance(value, np.ndarray):
        return arrays(value)
    if isinstance(value, tuple):
        parts = [_mapped(part, arrays, reals) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return reals(value) if type(value) is float else value
