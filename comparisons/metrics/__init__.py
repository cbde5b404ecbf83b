"""One file a metric: UNIT, TITLE and measure(subject); sees the trajectory and the scene, no engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory


class Refused(ValueError):
    """A metric that would mislead; carries its remedy."""

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(reason)
        self.remedy = remedy


@dataclass(frozen=True)
class Subject:
    """A trajectory and its scene, with what several metrics need computed once."""

    trajectory: Trajectory
    scene: Scene

    @cached_property
    def extensions(self) -> np.ndarray:
        """(s, m) length minus rest length of all links [m]."""
        x = self.trajectory.positions
        columns = [
            np.linalg.norm(x[:, link.pairs[:, 0]] - x[:, link.pairs[:, 1]], axis=2) - link.lengths
            for link in self.scene.links
        ]
        return np.hstack(columns) if columns else np.zeros((len(x), 0))

    @cached_property
    def energy(self) -> np.ndarray:
        """(s,) kinetic + potential + elastic energy of what can move [J]."""
        scene, masses = self.scene, self.scene.masses
        m = np.where(masses.free, masses.masses, 0.0)
        x, v = self.trajectory.positions, self.trajectory.velocities
        total = 0.5 * np.sum(v**2, axis=2) @ m - (x @ scene.gravity) @ m
        for spring in scene.of(Springs):
            length = np.linalg.norm(x[:, spring.pairs[:, 0]] - x[:, spring.pairs[:, 1]], axis=2)
            total = total + 0.5 * np.sum((length - spring.lengths) ** 2 / spring.compliances, axis=1)
        return total

    @cached_property
    def energy_scale(self) -> float:
        """What an energy error is measured in [J]: m g L of all that can fall, or the energy at the start."""
        scene, masses = self.scene, self.scene.masses
        reach = sum(float(np.sum(link.lengths)) for link in scene.links)
        fall = float(np.sum(masses.masses[masses.free])) * float(np.linalg.norm(scene.gravity)) * reach
        return max(fall, abs(float(self.energy[0]))) or 1.0

    @property
    def rods(self) -> list[Rods]:
        """The rigid links."""
        return self.scene.of(Rods)
