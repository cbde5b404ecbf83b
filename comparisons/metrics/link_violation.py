"""Largest relative error of a rigid link's length."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "1"
TITLE = "link violation"


def measure(subject: Subject) -> float:
    """max |length - rest| / rest over samples and links."""
    if not subject.rods:
        raise Refused("link violation of a scene without rigid links", "ask for other metrics")
    rest = np.concatenate([link.lengths for link in subject.scene.links])
    return float((np.abs(subject.extensions) / rest).max())
