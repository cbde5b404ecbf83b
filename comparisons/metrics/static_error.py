"""How far a scene of springs is, at the end, from the state in which it would come to rest."""

from __future__ import annotations

import numpy as np

from comparisons import store
from comparisons.metrics import Refused, Subject
from comparisons.reference import NoReference

UNIT = "m"
TITLE = "static error"


def measure(subject: Subject) -> float:
    """rms over free particles of the distance to the static state; `Refused` where there is not exactly one."""
    try:
        rest = store.static_state(subject.scene)
    except NoReference as reason:
        raise Refused(f"static error without a static state: {reason}", "ask for other metrics") from None
    difference = (subject.trajectory.positions[-1] - rest)[subject.scene.masses.free]
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=1))))
