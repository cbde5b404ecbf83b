"""Error of the time of the first impact."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject, _flight

UNIT = "s"
TITLE = "error of the impact time"


def measure(subject: Subject) -> float:
    """|t1 - known|, t1 by the parabola through the last sample before it; `Refused` where the scene knows none."""
    known, flight = _flight.known(subject, "impact_time"), _flight.of(subject)
    before = np.flatnonzero((subject.trajectory.times < known) & (flight.heights > 0.0))
    if len(before) == 0:
        raise Refused("the impact time of a body that never flies", "ask for other metrics")
    return abs(float(subject.trajectory.times[before[-1]]) + flight.to_impact(int(before[-1]))[0] - known)
