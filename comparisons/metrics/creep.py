"""How far from its start a body is at the end that should have stayed."""

from __future__ import annotations

from comparisons.metrics import Subject
from comparisons.metrics.drift import displacements

UNIT = "m"
TITLE = "creep"


def measure(subject: Subject) -> float:
    """Largest over the bodies of |x(end) - x(0)|."""
    return float(displacements(subject)[-1].max(initial=0.0))
