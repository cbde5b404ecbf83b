"""Largest compression: the densest particle of all samples."""

from __future__ import annotations

from comparisons.metrics import Subject

UNIT = "1"
TITLE = "largest compression"


def measure(subject: Subject) -> float:
    """max of rho/rho0 - 1, at least 0."""
    return float(max(subject.densities[1:].max() - 1.0, 0.0))
