"""The vocabulary in which scenes are written and which engine adapters translate.

A scene is data: bodies, what connects them, gravity, how long, when to sample. It knows no engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from comparisons.bodies import Bodies, Planes
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput

STEP = 5e-8
"""Seconds that the cheapest step of the fastest engine takes."""

MAX_STEPS = 10**10
"""About ten minutes of the cheapest steps."""


@dataclass(frozen=True)
class PointMasses:
    """Point masses: positions (n, d) [m], velocities (n, d) [m/s], masses (n,) [kg], indices of the pinned."""

    positions: np.ndarray
    velocities: np.ndarray
    masses: np.ndarray
    pinned: tuple[int, ...] = ()

    @property
    def free(self) -> np.ndarray:
        """(n,) mask of what can move."""
        mask = np.ones(len(self.masses), dtype=bool)
        mask[list(self.pinned)] = False
        return mask


@dataclass(frozen=True)
class Rods:
    """Rigid massless links between point masses: pairs (m, 2), lengths (m,) [m]."""

    pairs: np.ndarray
    lengths: np.ndarray


@dataclass(frozen=True)
class Springs:
    """Linear, undamped, massless links: pairs (m, 2), rest lengths (m,) [m], compliances (m,) [m/N], all > 0."""

    pairs: np.ndarray
    lengths: np.ndarray
    compliances: np.ndarray


@dataclass(frozen=True)
class Fluid:
    """That a scene's point masses, which stand for equal volumes, are an incompressible fluid, or float in it.

    spacing : of the point masses in a square or cubic lattice at rest density [m]
    density : rho0 [kg/m^d]; a point mass of fluid has rho0 spacing^d
    speed : what the fluid typically reaches [m/s], by which engines choose their steps and the speed of sound
    solids : groups of indices of point masses, each group one rigid body
    obstacles : opposite corners, low and high (d,) [m], of boxes that nothing enters
    """

    spacing: float
    density: float
    speed: float
    solids: tuple[np.ndarray, ...] = ()
    obstacles: tuple[tuple[np.ndarray, np.ndarray], ...] = ()

    @property
    def solid(self) -> np.ndarray:
        """Indices of all point masses that are part of a solid."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *self.solids])


@dataclass(frozen=True)
class Scene:
    """A complete description.

    title : the scene in a few words, for headings
    gravity : (d,) [m/s^2]
    links : of kind `Rods` or `Springs`
    duration [s], samples : recorded at 0 and at ``samples`` equally spaced times up to ``duration``
    metrics : names of the metrics that make sense, the default of a run
    bodies, planes : rigid bodies and the half-spaces they fall on; a scene has either point masses or bodies
    friction, restitution : Coulomb's and Newton's coefficient of every contact
    exact : the motion in closed form at given times [s], where there is one
    known : name -> closed-form value that a metric of the same name compares with
    fluid : what makes a fluid of the point masses; ``planes`` are its walls
    """

    name: str
    title: str
    masses: PointMasses
    links: tuple[Rods | Springs, ...]
    gravity: np.ndarray
    duration: float
    samples: int
    metrics: tuple[str, ...]
    bodies: Bodies | None = None
    planes: Planes | None = None
    friction: float = 0.0
    restitution: float = 0.0
    exact: Callable[[np.ndarray], Trajectory] | None = None
    known: Mapping[str, Any] = field(default_factory=dict)
    fluid: Fluid | None = None

    @property
    def times(self) -> np.ndarray:
        """(samples + 1,) sample times [s]."""
        return np.linspace(0.0, self.duration, self.samples + 1)

    def of(self, kind: type) -> list:
        """The links of one kind."""
        return [link for link in self.links if isinstance(link, kind)]

    def longest_step(self, limit: float) -> float:
        """The longest time step [s] up to ``limit`` that divides the sample interval."""
        interval = self.duration / self.samples
        return interval / max(1, math.ceil(interval / limit - 1e-9))

    def steps_per_sample(self, dt: float) -> int:
        """The whole number of steps dt between two samples; refused where there is none."""
        interval = self.duration / self.samples
        if not (math.isfinite(dt) and dt > 0.0):
            raise InvalidInput("dt", dt, "a finite number > 0 s")
        steps = max(1, round(interval / dt))
        count = steps * self.samples
        if count > MAX_STEPS:
            asked = f"{count:.1e} steps asked, at least {count * STEP / 3600:.1g} h"
            raise InvalidInput("dt", dt, f"so large that the scene takes at most {MAX_STEPS:.0e} steps", asked)
        if abs(interval / dt - steps) > 1e-9 * steps:
            near = interval / steps
            raise InvalidInput(
                "dt", dt, f"a whole fraction of the sample interval, {interval:g} s", f"the nearest is {near:.10g}"
            )
        return steps


def no_masses(dimension: int) -> PointMasses:
    """The point masses of a scene that has none."""
    return PointMasses(np.zeros((0, dimension)), np.zeros((0, dimension)), np.zeros(0))


def empty(scene: Scene) -> Scene:
    """The same scene without anything in it: what remains of a run is the engine's call overhead."""
    nothing = no_masses(len(scene.gravity))
    return Scene("empty", "empty world", nothing, (), scene.gravity, scene.duration, scene.samples, ())
