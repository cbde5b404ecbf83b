"""How far ahead of Martin and Moyce's table 2 the front is, as one shift in time fits best."""

from __future__ import annotations

from comparisons.metrics import Subject, _water
from comparisons.water import TABLE_2, experiment

UNIT = "sqrt(a/(n^2 g))"
TITLE = "front, offset from experiment"


def measure(subject: Subject) -> float:
    """In units of T, positive where the run is ahead; n^2 = 2."""
    times, values = _water.dimensionless(subject)
    measured = experiment(TABLE_2)
    return _water.fitted(times, values, measured)[0]
