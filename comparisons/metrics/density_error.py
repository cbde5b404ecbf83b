"""Mean compression: how much denser than at rest the fluid is, over its particles and all samples after the start."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject

UNIT = "1"
TITLE = "mean compression"


def measure(subject: Subject) -> float:
    """mean of max(rho/rho0 - 1, 0), so that a surface with few neighbours makes up for nothing."""
    return float(np.maximum(subject.densities[1:] - 1.0, 0.0).mean())
