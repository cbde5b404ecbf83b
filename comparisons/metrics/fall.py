"""How far what is free has moved along gravity at the end."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "m"
TITLE = "fall"


def measure(subject: Subject) -> float:
    """Mean over what is free of (x(end) - x(0)) . g / |g|."""
    pull = float(np.linalg.norm(subject.scene.gravity))
    if pull == 0.0:
        raise Refused("fall of a scene without gravity", "ask for other metrics")
    free = subject.scene.masses.free if subject.scene.bodies is None else subject.scene.bodies.free
    x = subject.trajectory.positions[:, free]
    return float(np.mean((x[-1] - x[0]) @ subject.scene.gravity) / pull)
