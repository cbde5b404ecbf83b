"""How far the front has come at the end, in widths of the column."""

from __future__ import annotations

from comparisons.metrics import Subject, _water

UNIT = "a"
TITLE = "front"


def measure(subject: Subject) -> float:
    """Z of the farthest attached particle, and half a spacing."""
    return float(_water.dimensionless(subject)[1][-1])
