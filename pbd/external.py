"""Line 5: external forces and accelerations."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast
from pbd.stages import kick
from pbd.state import Particles
from pbd.vector import Store, Vector, to_store


class Gravity(NamedTuple):
    """One acceleration [m/s^2] for all that is not pinned."""

    acceleration: Vector

    def accelerate(self, state, h):
        kick(state.particles, self.acceleration, h)
        kick(state.bodies, self.acceleration, h)


class PointForces(NamedTuple):
    """A constant force [N] on each particle: v <- v + h w f."""

    force: Store

    def accelerate(self, state, h):
        for axis in range(len(self.force)):
            v, w, f = state.particles.v[axis], state.particles.w, self.force[axis]
            for i in range(f.shape[0]):
                v[i] += h * w[i] * f[i]

    def renumbered(self, slot: np.ndarray) -> PointForces:
        """The same for particles that now stand in ``slot``."""
        return PointForces(tuple(_spread(axis, slot) for axis in self.force))


def _spread(values: np.ndarray, slot: np.ndarray) -> np.ndarray:
    found = np.zeros(int(slot.max()) + 1 if len(slot) else 0)
    found[slot] = values
    return found


def point_forces(particles: Particles, forces: Any) -> PointForces:
    """`PointForces` from an (n, d) array [N]."""
    return PointForces(to_store(broadcast("forces", forces, (particles.w.shape[0], len(particles.x)))))
