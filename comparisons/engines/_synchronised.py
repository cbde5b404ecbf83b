"""Rates of bodies at a step, for engines whose rates stand half a step apart."""

from __future__ import annotations

import numpy as np

IMPACT = 10.0
"""A body whose velocity a step changes by more than this many times gravity's share was hit."""


def synchronised(before: np.ndarray, after: np.ndarray, kick: np.ndarray) -> np.ndarray:
    """Rates (n, r) at a step, from those half a step before and after it, and from gravity's share of a step (d,).

    The first d are velocities, the others spins. They are the mean; of a body that was hit the rates after, less half a
    kick, as the mean would be nearly at rest.
    """
    d = len(kick)
    whole = np.zeros(before.shape[1])
    whole[:d] = kick
    hit = np.linalg.norm((after - before)[:, :d], axis=1) > IMPACT * np.linalg.norm(kick)
    return np.where(hit[:, None], after - 0.5 * whole, 0.5 * (before + after))
