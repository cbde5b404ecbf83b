"""One file a metric: UNIT, TITLE and measure(subject); sees the trajectory and the scene, no engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

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
        columns = [self._lengths(link) - link.lengths for link in self.scene.links]
        return np.hstack(columns) if columns else np.zeros((len(self.trajectory.times), 0))

    def _lengths(self, link: Rods | Springs) -> np.ndarray:
        """(s, m) lengths [m]; sample by sample, because the differences of a large cloth's would fill the memory."""
        i, j = link.pairs.T
        rows = [np.linalg.norm(x[i] - x[j], axis=1) for x in self.trajectory.positions]
        return np.array(rows).reshape(-1, len(link.lengths))

    @cached_property
    def energy(self) -> np.ndarray:
        """(s,) kinetic + potential + elastic energy of what can move [J]."""
        scene, masses = self.scene, self.scene.masses
        m = np.where(masses.free, masses.masses, 0.0)
        x, v = self.trajectory.positions, self.trajectory.velocities
        total = 0.5 * np.sum(v**2, axis=2) @ m - (x @ scene.gravity) @ m
        for spring in scene.of(Springs):
            total = total + 0.5 * np.sum((self._lengths(spring) - spring.lengths) ** 2 / spring.compliances, axis=1)
        return total

    @cached_property
    def energy_scale(self) -> float:
        """What an energy error is measured in [J]: m g L of all that can fall, or the energy at the start."""
        scene, masses = self.scene, self.scene.masses
        fall = float(np.sum(masses.masses[masses.free])) * float(np.linalg.norm(scene.gravity)) * reach(scene)
        return max(fall, abs(float(self.energy[0]))) or 1.0

    @property
    def rods(self) -> list[Rods]:
        """The rigid links."""
        return self.scene.of(Rods)


def reach(scene: Scene) -> float:
    """L [m]: how far along links at rest length the farthest particle is from what is pinned, or from the first."""
    if not scene.links:
        return 0.0
    n = len(scene.masses.masses)
    i, j = np.concatenate([link.pairs for link in scene.links]).T
    graph = csr_array((np.concatenate([link.lengths for link in scene.links]), (i, j)), shape=(n, n))
    held = list(scene.masses.pinned) or [0]
    far = dijkstra(graph, directed=False, indices=held, min_only=True)
    return float(far[np.isfinite(far)].max())
