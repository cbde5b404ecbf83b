"""Root mean square of the links' relative errors at the end."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "1"
TITLE = "rms link error"


def measure(subject: Subject) -> float:
    """rms over links of (length - rest) / rest in the last sample."""
    if not subject.scene.links:
        raise Refused("link errors of a scene without links", "ask for other metrics")
    rest = np.concatenate([link.lengths for link in subject.scene.links])
    return float(np.sqrt(np.mean((subject.extensions[-1] / rest) ** 2)))
