"""How fast falling passes along a row of dominoes."""

from __future__ import annotations

import numpy as np

from comparisons.bodies import rotations
from comparisons.metrics import Subject

UNIT = "m/s"
TITLE = "speed of the front"

FALLING = np.deg2rad(10.0)
"""Turned by more than this from its start [rad], a domino is falling."""


def measure(subject: Subject) -> float:
    """Slope of the bodies' x at the start against the times at which they begin to fall; 0 where fewer than two do."""
    times, places = falls(subject)
    if len(times) < 2 or np.ptp(times) == 0.0:
        return 0.0
    return float(np.polyfit(times, places, 1)[0])


def falls(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Of the bodies that fall: when, between samples linearly [s], and x at the start [m]."""
    d = len(subject.scene.gravity)
    turns = rotations(subject.orientations, d)[..., 1]  # the body's y axis, (s, n, d)
    chords = np.linalg.norm(turns - turns[0], axis=2)
    tilts = 2.0 * np.arcsin(np.minimum(chords / 2.0, 1.0))
    fallen = np.flatnonzero((tilts > FALLING).any(axis=0))
    after = (tilts[:, fallen] > FALLING).argmax(axis=0)
    low, high = tilts[after - 1, fallen], tilts[after, fallen]
    times = subject.trajectory.times
    began = times[after - 1] + (FALLING - low) / (high - low) * (times[after] - times[after - 1])
    return began, subject.trajectory.positions[0, fallen, 0]
