"""Kinetic energy that is left at the end, of what should have come to rest."""

from __future__ import annotations

from comparisons.metrics import Subject

UNIT = "J/kg"
TITLE = "residual kinetic energy"


def measure(subject: Subject) -> float:
    """Over the mass of all that can move, in the last sample; 0 where nothing can."""
    mass = float(subject.moving_masses.sum())
    return float(subject.kinetic[-1]) / mass if mass > 0.0 else 0.0
