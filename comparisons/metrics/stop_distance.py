"""Relative error of the distance after which a sliding body stops."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject, _flight

UNIT = "1"
TITLE = "error of the stop distance"


def measure(subject: Subject) -> float:
    """|distance / known - 1|, of the first body's centre at the end from its start; `Refused` where it is not known."""
    known, x = _flight.known(subject, "stop_distance"), subject.trajectory.positions[:, 0]
    return abs(float(np.linalg.norm(x[-1] - x[0])) / known - 1.0)
