"""Largest angle between a body's attitude and that in closed form."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "rad"
TITLE = "attitude error"


def measure(subject: Subject) -> float:
    """Largest over samples and bodies of the angle of the rotation from one to the other; at most pi.

    `Refused` where there is no closed form.
    """
    scene = subject.scene
    if scene.exact is None:
        raise Refused("attitude error without a closed form", "ask for other metrics")
    ours, exact = subject.orientations, scene.exact(subject.trajectory.times).orientations
    assert exact is not None
    between = quaternion_angles(ours, exact) if ours.ndim == 3 else plane_angles(ours, exact)
    return float(between[:, subject.bodies.free].max(initial=0.0))


def plane_angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(...) differences of angles [rad], whatever whole turns are between them."""
    return np.abs(np.arctan2(np.sin(p - q), np.cos(p - q)))


def quaternion_angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(...) angles between quaternions (..., 4) [rad].

    Of unit quaternions at an angle the chord is 2 sin(angle / 4), which unlike the dot product tells small ones to
    round-off.
    """
    p, q = (a / np.linalg.norm(a, axis=-1, keepdims=True) for a in (p, q))
    chords = np.minimum(np.linalg.norm(p - q, axis=-1), np.linalg.norm(p + q, axis=-1))
    return 4.0 * np.arcsin(chords / 2.0)
