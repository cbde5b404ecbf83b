"""Largest relative error of the dam break's front at T = 1 and 2, against the numerical reference."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject, _water

UNIT = "1"
TITLE = "front error"

JUDGED = (1.0, 2.0)
"""T at which the front counts; at 3 the reference itself is uncertain by a per cent."""


def measure(subject: Subject) -> float:
    """`Refused` for columns without a reference, and for runs that end before the first of `JUDGED`."""
    reference = subject.scene.known.get("front")
    if reference is None:
        raise Refused("front error of a column without a reference", "set scene.ratio to 2, or ask for other metrics")
    times, values = _water.dimensionless(subject)
    judged = [t for t in JUDGED if t <= times[-1] * (1.0 + 1e-9)]
    if not judged:
        raise Refused("front error of a run that ends before T = 1", "set a longer scene.duration")
    right = np.interp(judged, reference.times, reference.values)
    return float(np.abs(np.interp(judged, times, values) / right - 1.0).max())
