"""The first body's flight over a plane, as its centre tells it, whichever way the body has turned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.metrics import Refused, Subject, _overlap


@dataclass(frozen=True)
class Flight:
    """Heights of the centre above where it lies on the plane (s,) [m], velocities upwards (s,) [m/s], pull [m/s^2]."""

    heights: np.ndarray
    velocities: np.ndarray
    pull: float

    @property
    def energies(self) -> np.ndarray:
        """(s,) per mass [J/kg]; what is below the plane counts as on it."""
        return 0.5 * self.velocities**2 + self.pull * np.maximum(self.heights, 0.0)

    def to_impact(self, sample: int) -> tuple[float, float]:
        """Time to the impact that follows that sample [s], and its speed [m/s]."""
        velocity, height = self.velocities[sample], max(self.heights[sample], 0.0)
        speed = float(np.sqrt(velocity**2 + 2.0 * self.pull * height))
        return (float(velocity) + speed) / self.pull, speed


def of(subject: Subject) -> Flight:
    """`Refused` where there is no body over a level plane, or no gravity."""
    scene, trajectory = subject.scene, subject.trajectory
    pull = float(np.linalg.norm(scene.gravity))
    if scene.bodies is None or scene.planes is None or pull == 0.0:
        raise Refused("the flight of a body over a plane, in a scene without them", "ask for other metrics")
    floor = int(np.argmin(scene.planes.normals @ scene.gravity))
    start = _overlap.placed(scene.bodies, scene.bodies.positions, scene.bodies.orientations)
    reach = _overlap.reaches(start, scene.planes.normals)[0, floor]
    upward = trajectory.velocities[:, 0] @ scene.planes.normals[floor]
    return Flight(subject.above_floor[:, 0] - reach, upward, pull)


def known(subject: Subject, name: str) -> Any:
    """The closed-form value of that name; `Refused` where the scene knows none."""
    if name not in subject.scene.known:
        what = f"{name.replace('_', ' ')} of a scene in which it is not known, or does not happen"
        raise Refused(what, "set a longer scene.duration, or ask for other metrics")
    return subject.scene.known[name]


def apex_error(subject: Subject, apexes: np.ndarray) -> float:
    """Largest relative error of the heights of apexes, rows of time [s] and height [m].

    The sample nearest to an apex tells its height, y + v^2 / 2g, wherever in the flight it is.
    """
    flight = of(subject)
    samples = np.abs(subject.trajectory.times[:, None] - apexes[:, 0]).argmin(axis=0)
    return float(np.abs(flight.energies[samples] / flight.pull / apexes[:, 1] - 1.0).max())
