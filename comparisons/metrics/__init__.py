"""One file a metric: UNIT, TITLE and measure(subject); sees the trajectory and the scene, no engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from comparisons.bodies import Bodies, rotations
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
        scene = self.scene
        total = self.kinetic - (self.trajectory.positions @ scene.gravity) @ self.moving_masses
        for spring in scene.of(Springs):
            total = total + 0.5 * np.sum((self._lengths(spring) - spring.lengths) ** 2 / spring.compliances, axis=1)
        return total

    @property
    def bodies(self) -> Bodies:
        """The scene's rigid bodies; `Refused` where it has none."""
        if self.scene.bodies is None:
            raise Refused("a metric of rigid bodies in a scene of point masses", "ask for other metrics")
        return self.scene.bodies

    @property
    def orientations(self) -> np.ndarray:
        """Of the trajectory's bodies: (s, n) angles [rad] or (s, n, 4) quaternions; `Refused` where it has none."""
        return _told(self.trajectory.orientations, "orientations")

    @property
    def spins(self) -> np.ndarray:
        """Of the trajectory's bodies: (s, n) or (s, n, 3) [rad/s]; `Refused` where it has none."""
        return _told(self.trajectory.spins, "spins")

    @cached_property
    def moving_masses(self) -> np.ndarray:
        """(n,) masses of the bodies or point masses [kg], 0 for the fixed."""
        held = self.scene.masses if self.scene.bodies is None else self.scene.bodies
        return np.where(held.free, held.masses, 0.0)

    @cached_property
    def kinetic(self) -> np.ndarray:
        """(s,) kinetic energy of all that can move [J]."""
        linear = 0.5 * np.sum(self.trajectory.velocities**2, axis=2) @ self.moving_masses
        if self.scene.bodies is None:
            return linear
        return linear + 0.5 * np.sum(self.body_spins * self.body_momenta, axis=(1, 2))

    @cached_property
    def body_spins(self) -> np.ndarray:
        """(s, n, 1) in 2D, (s, n, 3) along the body axes in 3D [rad/s]."""
        d = len(self.scene.gravity)
        if d == 2:
            return self.spins[..., None]
        return np.einsum("snij,sni->snj", rotations(self.orientations, d), self.spins)

    @cached_property
    def body_momenta(self) -> np.ndarray:
        """(s, n, 1 or 3) angular momenta about the centres, along the body axes [kg m^2/s]; 0 for the fixed."""
        return self.body_spins * np.where(self.bodies.free[:, None], self.bodies.inertias, 0.0)

    @cached_property
    def energy_scale(self) -> float:
        """What an energy error is measured in [J]: m g L of all that can fall, or the energy at the start.

        Of bodies: kinetic energy at the start and m g times the distance of each centre from the floor.
        """
        scene, masses = self.scene, self.scene.masses
        if scene.bodies is not None:
            weights = self.moving_masses * float(np.linalg.norm(scene.gravity))
            return float(self.kinetic[0] + weights @ np.abs(self.above_floor[0])) or 1.0
        fall = float(np.sum(masses.masses[masses.free])) * float(np.linalg.norm(scene.gravity)) * reach(scene)
        return max(fall, abs(float(self.energy[0]))) or 1.0

    @cached_property
    def above_floor(self) -> np.ndarray:
        """(s, n) distances of the bodies' centres from the plane that is most level [m]; 0 where there is none."""
        scene, x = self.scene, self.trajectory.positions
        if scene.planes is None or len(scene.planes.offsets) == 0:
            return np.zeros(x.shape[:2])
        floor = int(np.argmin(scene.planes.normals @ scene.gravity))
        return x @ scene.planes.normals[floor] - scene.planes.offsets[floor]

    @cached_property
    def densities(self) -> np.ndarray:
        """(s, n) rho/rho0 of the fluid's particles; `Refused` where there is no fluid."""
        from comparisons.metrics import _water

        return _water.densities(self)

    @cached_property
    def attached(self) -> list[np.ndarray]:
        """(m, d) at each sample: positions of the fluid's particles that hang together [m]; `Refused` as above."""
        from comparisons.metrics import _water

        return _water.attached(self)

    @property
    def rods(self) -> list[Rods]:
        """The rigid links."""
        return self.scene.of(Rods)


def _told(values: np.ndarray | None, what: str) -> np.ndarray:
    if values is None:
        raise Refused(f"a metric that needs {what}, which the run does not tell", "ask for other metrics")
    return values


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
