"""The part of its volume that the fluid has lost at the end, as packed grains do."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject

UNIT = "1"
TITLE = "volume loss"


def measure(subject: Subject) -> float:
    """1 - rho0/rho of the median particle at the end, at least 0: half of the fluid is denser than that."""
    return float(max(1.0 - 1.0 / np.median(subject.densities[-1]), 0.0))
