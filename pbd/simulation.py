"""The simulation: everything bound once, then a whole duration inside one kernel call."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import indices, number, real_array
from pbd.errors import InvalidInput
from pbd.external import Gravity
from pbd.fields import Rule
from pbd.integrators.euler import Euler
from pbd.jit import device, kernel
from pbd.settings import Settings
from pbd.solvers.gauss_seidel import GaussSeidel
from pbd.stages import not_finite, record, step
from pbd.state import Particles, State
from pbd.vector import from_store

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
            for _ in range(plan.substeps):
                step(integrator, solver, scene, plan.h)
            unchecked += 1
        if unchecked == plan.check_every or n == plan.steps:
            unchecked = 0
            broken = first_broken(scene.state)
            if broken > 0:
                return n, recorded, broken
        if recorded < plan.samples.shape[0] and plan.samples[recorded] == n:
            record(scene.state.particles, recordings[0], recorded)
            record(scene.state.bodies, recordings[1], recorded)
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
    projections : constraint projections done, counted in the kernel
    scene : the final state and the bound batches, e.g. for ``scene.batches[0].law.multiplier``
    recordings : the raw recordings of all groups
    """

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    quantity: str
    steps: int
    projections: int
    scene: Scene
    recordings: tuple

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
        self.settings = settings or Settings()
        self._solver = GaussSeidel(int(self.settings.iterations))
        fields = list(external)
        if gravity is not None:
            fields.insert(0, Gravity(_gravity(gravity, particles)))
        damping = self.settings.damping.bind() if self.settings.damping else None
        state = State(particles, bodies, np.zeros(1, dtype=np.int64))
        self._scene = Scene(state, _bind(constraints, self.settings.iterations), tuple(fields), damping)

    def run(self, steps: int, samples: Any = None) -> Outcome:
        """Do ``steps`` steps from the initial state and record after the step numbers in ``samples``.

        samples : ascending step numbers in [0, steps]; default all
        """
        if not Rule("whole", low=0, high=MAX_STEPS).holds(steps):
            raise InvalidInput("steps", steps, f"a whole number >= 0 and <= {MAX_STEPS:.0e}")
        steps = int(steps)  # numpy's own kinds of whole numbers would compile anew
        at = _sample_steps(steps, samples)
        scene = _copy(self._scene)  # so that an outcome keeps its state and multipliers whatever runs next
        state = scene.state
        recordings = tuple(g.new_recording(len(at)) if g is not None else None for g in state[:2])
        settings = self.settings
        plan = Plan(settings.h, int(settings.substeps), steps, at, max(1, steps // CHECKS_PER_RUN))
        done, recorded, broken = simulation(Euler(), self._solver, scene, plan, recordings)
        x, v = recordings[0] or ((np.zeros((len(at), 0)),) * 2,) * 2
        return Outcome(
            times=at[:recorded] * settings.dt,
            positions=from_store(x)[:recorded],
            velocities=from_store(v)[:recorded],
            quantity=QUANTITIES[broken],
            steps=done,
            projections=int(state.work[0]),
            scene=scene,
            recordings=recordings,
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


def _gravity(gravity: Any, particles: Particles | None) -> tuple[float, ...]:
    vector = real_array("gravity", gravity)
    if vector.ndim != 1 or (particles is not None and len(vector) != len(particles.x)):
        raise InvalidInput("gravity", gravity, "one component for each dimension of the positions")
    return tuple(float(component) for component in vector)


def _bind(constraints: Sequence[Any], iterations: int) -> tuple:
    """The kernel's batches: laws bound to the number of constraints and iterations, empty batches dropped."""
    bound = []
    for batch in constraints:
        if hasattr(getattr(batch, "law", None), "bind"):
            if batch.size() == 0:
                continue
            batch = batch._replace(law=batch.law.bind(batch.size(), iterations))
        bound.append(batch)
    return tuple(bound)


def _sample_steps(steps: int, samples: Any) -> np.ndarray:
    at = np.arange(steps + 1) if samples is None else indices("samples", samples, steps + 1)
    if at.ndim != 1 or np.any(np.diff(at) <= 0):
        raise InvalidInput("samples", samples, f"ascending step numbers in [0, {steps}]")
    return at


def _copy(value: Any) -> Any:
    """A deep copy of nested tuples of arrays."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        parts = [_copy(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value
