"""Largest departure of the linear momentum from what gravity alone makes of it."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "kg m/s"
TITLE = "momentum drift"


def measure(subject: Subject) -> float:
    """max |P(t) - P(0) - M g t|; needs a scene in which nothing is pinned."""
    masses = subject.scene.masses
    if masses.pinned:
        raise Refused("momentum of a scene that is held by pinned particles", "ask for other metrics")
    momentum = np.einsum("sid,i->sd", subject.trajectory.velocities, masses.masses)
    pushed = masses.masses.sum() * subject.trajectory.times[:, None] * subject.scene.gravity
    return float(np.linalg.norm(momentum - momentum[0] - pushed, axis=1).max())
