"""What comes out of an engine: the motion at the scene's sample times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Trajectory:
    """Samples of all particles or bodies, in the scene's order.

    Attributes
    ----------
    times : (s,) [s]
    positions, velocities : (s, n, d) [m], [m/s]; of bodies' centres; velocities at the same times as the positions
    steps : steps the engine did
    work : counters of what ran, e.g. ``{"projections": 1000}``
    wall : seconds that the run took, compilation included where it was the first of its kind
    diverged : the quantity that stopped being finite, at step ``steps``; empty when all is finite
    orientations : of bodies: (s, n) angles [rad] in 2D, (s, n, 4) unit quaternions (w, x, y, z) in 3D
    spins : of bodies: (s, n) [rad/s] in 2D, (s, n, 3) in the world frame in 3D
    contact_forces : (s,) magnitude of the sum of all planes' forces on the bodies [N], mean over the last step; where
        an engine tells
    residue : largest departure from the plane of a planar scene in an engine of three dimensions [m]
    """

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    steps: int
    work: dict[str, int] = field(default_factory=dict)
    diverged: str = ""
    wall: float = 0.0
    orientations: np.ndarray | None = None
    spins: np.ndarray | None = None
    contact_forces: np.ndarray | None = None
    residue: float = 0.0


def from_samples(
    times: np.ndarray, positions: np.ndarray, velocities: np.ndarray, steps: int, **of_bodies: Any
) -> Trajectory:
    """A trajectory from preallocated samples, cut at the first that is not finite; ``of_bodies``: its other fields."""
    finite = np.isfinite(positions).all(axis=(1, 2)) & np.isfinite(velocities).all(axis=(1, 2))
    if finite.all():
        return Trajectory(times, positions, velocities, steps, **of_bodies)
    end = int(np.argmin(finite))
    quantity = "velocity" if np.isfinite(positions[end]).all() else "position"
    done = steps * end // max(len(times) - 1, 1)
    cut: Any = {key: value[:end] if isinstance(value, np.ndarray) else value for key, value in of_bodies.items()}
    return Trajectory(times[:end], positions[:end], velocities[:end], done, diverged=quantity, **cut)
