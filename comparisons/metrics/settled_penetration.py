"""The deepest overlap of two bodies, or of a body and a plane, at the end."""

from __future__ import annotations

from comparisons.metrics import Subject
from comparisons.metrics.penetration import deepest

UNIT = "m"
TITLE = "penetration at the end"


def measure(subject: Subject) -> float:
    """In the last sample; 0 where nothing overlaps. `Refused` for a scene without bodies."""
    last = len(subject.trajectory.times) - 1
    return deepest(subject, range(last, last + 1))
