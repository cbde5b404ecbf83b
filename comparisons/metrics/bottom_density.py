"""How much denser than at rest the lowest row of a resting fluid is, with its sign."""

from __future__ import annotations

from comparisons.metrics import Subject, _water

UNIT = "1"
TITLE = "density at the bottom"


def measure(subject: Subject) -> float:
    """Mean of rho/rho0 - 1 over the particles within a spacing of the floor, over the second half of the samples."""
    spacing, chosen = _water.fluid_of(subject.scene).spacing, _water.liquid(subject.scene)
    half = len(subject.densities) // 2
    low = subject.trajectory.positions[half:, chosen, 1] < spacing
    return float(subject.densities[half:][low].mean() - 1.0)
