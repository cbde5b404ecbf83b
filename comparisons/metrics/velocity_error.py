"""Largest error of a body's velocity at the end."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "m/s"
TITLE = "velocity error"


def measure(subject: Subject) -> float:
    """Largest over the bodies of |v - exact| in the last sample; `Refused` where there is no closed form."""
    scene, run = subject.scene, subject.trajectory
    if scene.exact is None:
        raise Refused("velocity error without a closed form", "ask for other metrics")
    difference = run.velocities[-1] - scene.exact(run.times[-1:]).velocities[0]
    return float(np.linalg.norm(difference[subject.bodies.free], axis=1).max(initial=0.0))
