"""Total extension of all links at the end; meaningful for a scene that has come to rest."""

from __future__ import annotations

from comparisons.metrics import Subject

UNIT = "m"
TITLE = "static stretch"


def measure(subject: Subject) -> float:
    """sum of (length - rest) over the links in the last sample."""
    return float(subject.extensions[-1].sum())
