"""How far the free particles have moved along gravity at the end."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "m"
TITLE = "fall"


def measure(subject: Subject) -> float:
    """Mean over free particles of (x(end) - x(0)) . g / |g|."""
    pull = float(np.linalg.norm(subject.scene.gravity))
    if pull == 0.0:
        raise Refused("fall of a scene without gravity", "ask for other metrics")
    x = subject.trajectory.positions[:, subject.scene.masses.free]
    return float(np.mean((x[-1] - x[0]) @ subject.scene.gravity) / pull)
