"""Largest departure of the linear momentum from what gravity alone makes of it."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "kg m/s"
TITLE = "momentum drift"


def measure(subject: Subject) -> float:
    """max |P(t) - P(0) - M g t|; needs a scene in which nothing is pinned or fixed, and no planes."""
    scene, bodies = subject.scene, subject.scene.bodies
    if scene.masses.pinned or scene.planes is not None or (bodies is not None and bodies.fixed):
        raise Refused("momentum of a scene that is held from outside", "ask for other metrics")
    masses = scene.masses.masses if bodies is None else bodies.masses
    momentum = np.einsum("sid,i->sd", subject.trajectory.velocities, masses)
    pushed = masses.sum() * subject.trajectory.times[:, None] * scene.gravity
    return float(np.linalg.norm(momentum - momentum[0] - pushed, axis=1).max())
