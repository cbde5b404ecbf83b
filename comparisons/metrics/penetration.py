"""The deepest overlap of two bodies, or of a body and a plane, over the whole run."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Subject, _overlap

UNIT = "m"
TITLE = "penetration"


def measure(subject: Subject) -> float:
    """Largest over the samples; 0 where nothing overlaps. `Refused` for a scene without bodies."""
    return deepest(subject, range(len(subject.trajectory.times)))


def deepest(subject: Subject, samples: range) -> float:
    """The deepest overlap in those samples [m]."""
    bodies, orientations = subject.bodies, subject.orientations
    found, planes = 0.0, subject.scene.planes
    for sample in samples:
        at = _overlap.placed(bodies, subject.trajectory.positions[sample], orientations[sample])
        if planes is not None:
            found = max(found, -float(np.min(_overlap.heights(at, planes)[bodies.free], initial=0.0)))
        found = _overlap.deepest_pair(at, bodies.free, found)
    return found
