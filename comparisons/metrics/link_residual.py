"""What remains of the largest initial link error at the end."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "1"
TITLE = "link residual"


def measure(subject: Subject) -> float:
    """max |C(end)| / max |C(start)| over the links; needs a start that violates them."""
    start = float(np.abs(subject.extensions[0]).max(initial=0.0))
    if start <= 1e-12:
        raise Refused("link residual of links that start at rest length", "set scene.stretch to another value than 1")
    return float(np.abs(subject.extensions[-1]).max() / start)
