"""Change of the total energy at the end, with its sign, as a fraction of m g L."""

from __future__ import annotations

from comparisons.metrics import Subject

UNIT = "m g L"
TITLE = "energy change"


def measure(subject: Subject) -> float:
    """(E(end) - E(0)) / (m g L): below 0 where the engine dissipates."""
    return float((subject.energy[-1] - subject.energy[0]) / subject.energy_scale)
