"""Largest over the samples of the rms over what is free of the distance to the reference or closed form."""

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
    if scene.exact is not None:
        free = scene.masses.free if scene.bodies is None else scene.bodies.free
        return _rms(subject.trajectory.positions - scene.exact(subject.trajectory.times).positions, free)
    if scene.bodies is not None:
        raise Refused("position error of a scene without a closed form", "ask for other metrics")
    try:
        reference, limit = store.reference(scene)
    except NoReference as reason:
        raise Refused(f"position error without a reference: {reason}", "ask for other metrics") from None
    if scene.duration > limit:
        raise Refused(
            f"position error past the predictability horizon of {limit:g} s",
            f"set scene.duration to at most {limit:g}, or ask for other metrics",
        )
    return _rms(subject.trajectory.positions - reference, scene.masses.free)


def _rms(difference: np.ndarray, free: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(difference[:, free] ** 2, axis=2), axis=1)).max())
