"""Largest over the samples of the rms over free particles of the distance to the reference."""

from __future__ import annotations

import numpy as np

from comparisons import store
from comparisons.metrics import Refused, Subject
from comparisons.reference import NoReference

UNIT = "m"
TITLE = "position error"


def measure(subject: Subject) -> float:
    """Raises `Refused` where the scene has no reference, or is longer than its predictability horizon."""
    scene = subject.scene
    try:
        reference, limit = store.reference(scene)
    except NoReference as reason:
        raise Refused(f"position error without a reference: {reason}", "ask for other metrics") from None
    if scene.duration > limit:
        raise Refused(
            f"position error past the predictability horizon of {limit:g} s",
            f"set scene.duration to at most {limit:g}, or ask for other metrics",
        )
    difference = (subject.trajectory.positions - reference)[:, scene.masses.free]
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=2), axis=1)).max())
