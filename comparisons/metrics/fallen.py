"""What part of the bodies that should have stayed has not."""

from __future__ import annotations

import numpy as np

from comparisons.bodies import Box
from comparisons.metrics import Subject
from comparisons.metrics.drift import displacements

UNIT = "1"
TITLE = "fallen"

FALLEN = 0.1
"""Displaced by more than this part of its shortest edge, or of its diameter, a body has fallen."""


def measure(subject: Subject) -> float:
    """Their number at the end over that of all that can move; 0 where none can."""
    shapes = np.array(subject.bodies.shapes, dtype=object)[subject.bodies.free]
    edges = np.array([min(shape.size) if isinstance(shape, Box) else 2.0 * shape.radius for shape in shapes])
    fallen = displacements(subject)[-1] > FALLEN * edges
    return float(fallen.mean()) if len(fallen) else 0.0
