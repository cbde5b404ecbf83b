"""Largest change of the total energy, as a fraction of m g L."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject

UNIT = "m g L"
TITLE = "energy drift"


def measure(subject: Subject) -> float:
    """max |E(t) - E(0)| / (m g L)."""
    return float(np.abs(subject.energy - subject.energy[0]).max() / subject.energy_scale)
