"""How far from its start a body has ever been that should have stayed."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject

UNIT = "m"
TITLE = "drift"


def measure(subject: Subject) -> float:
    """Largest over samples and bodies of |x(t) - x(0)|."""
    return float(displacements(subject).max(initial=0.0))


def displacements(subject: Subject) -> np.ndarray:
    """(s, n) distances of the centres that can move from their start [m]."""
    x = subject.trajectory.positions[:, subject.bodies.free]
    return np.linalg.norm(x - x[0], axis=2)
