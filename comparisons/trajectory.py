"""What comes out of an engine: positions and velocities at the scene's sample times."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Trajectory:
    """Samples of all particles, in the scene's order.

    Attributes
    ----------
    times : (s,) [s]
    positions, velocities : (s, n, d) [m], [m/s]; velocities at the same times as the positions
    steps : steps the engine did
    work : counters of what ran, e.g. ``{"projections": 1000}``
    wall : seconds that the run took, compilation included where it was the first of its kind
    diverged : the quantity that stopped being finite, at step ``steps``; empty when all is finite
    """

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    steps: int
    work: dict[str, int] = field(default_factory=dict)
    diverged: str = ""
    wall: float = 0.0


def from_samples(times: np.ndarray, positions: np.ndarray, velocities: np.ndarray, steps: int) -> Trajectory:
    """A trajectory from preallocated samples, cut at the first that is not finite."""
    finite = np.isfinite(positions).all(axis=(1, 2)) & np.isfinite(velocities).all(axis=(1, 2))
    if finite.all():
        return Trajectory(times, positions, velocities, steps)
    end = int(np.argmin(finite))
    quantity = "velocity" if np.isfinite(positions[end]).all() else "position"
    done = steps * end // max(len(times) - 1, 1)
    return Trajectory(times[:end], positions[:end], velocities[:end], done, diverged=quantity)
