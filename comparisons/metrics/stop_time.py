"""Relative error of the time at which a bouncing body comes to rest."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject, _flight

UNIT = "1"
TITLE = "error of the stop time"

AT_REST = 1e-6
"""A body with less than this part of its energy is at rest; in closed form it is so for the last 1e-3 of the time."""


LATER = 4.0
"""Of two flights that tell how rebounds shorten, the earlier has at least so many times the energy of the later."""


def measure(subject: Subject) -> float:
    """|stop / known - 1|; `Refused` where the scene knows none.

    Under any constant restitution the speeds of impacts fall linearly in the times of impacts, to 0 at the stop. So two
    flights, of the last sample in motion and of an earlier one, tell the stop, whatever the samples. Of an engine that
    cuts rebounds short it is known to less than a sample interval, as the sample after the last in motion is at rest.
    What loses no energy stops at the end.
    """
    known, flight, times = _flight.known(subject, "stop_time"), _flight.of(subject), subject.trajectory.times
    last = int(np.flatnonzero(flight.energies >= AT_REST * flight.energies[0])[-1])
    before = np.flatnonzero(flight.energies >= LATER * flight.energies[last])
    ends = range(last, min(last + 2, len(times)))
    taus, speeds = np.transpose([flight.to_impact(sample) for sample in ends])
    slope = 0.0
    if len(before):
        tau, speed = flight.to_impact(int(before[-1]))
        slope = (times[last] + taus[0] - times[before[-1]] - tau) / (speed - speeds[0])
    elif len(ends) == 1:
        return abs(float(times[-1]) / known - 1.0)
    return abs(float(np.min(times[ends] + taus + slope * speeds)) / known - 1.0)
