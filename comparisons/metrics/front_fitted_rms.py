"""Distance of the front from Martin and Moyce's table 2 after one shift in time: how wrong its speed is."""

from __future__ import annotations

from comparisons.metrics import Subject, _water
from comparisons.water import TABLE_2, experiment

UNIT = "a"
TITLE = "front, rms distance after a shift"


def measure(subject: Subject) -> float:
    """rms over the measured times that the run reaches, n^2 = 2."""
    times, values = _water.dimensionless(subject)
    measured = experiment(TABLE_2)
    return _water.fitted(times, values, measured)[1]
