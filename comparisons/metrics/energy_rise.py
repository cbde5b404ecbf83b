"""Largest rise of the total energy, which friction and impacts only ever lower."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject

UNIT = "m g L"
TITLE = "energy rise"


def measure(subject: Subject) -> float:
    """max (E(t) - least E before t) / (m g L); of bodies L is the height above the floor, and motion counts too."""
    lowest = np.minimum.accumulate(subject.energy)
    return float((subject.energy - lowest).max() / subject.energy_scale)
