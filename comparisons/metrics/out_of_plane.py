"""How far an engine of three dimensions has left the plane of a planar scene."""

from __future__ import annotations

from comparisons.metrics import Refused, Subject

UNIT = "m"
TITLE = "departure from the plane"


def measure(subject: Subject) -> float:
    """The largest; 0 for an engine of two dimensions. `Refused` for a scene in space."""
    if len(subject.scene.gravity) != 2:
        raise Refused("departure from the plane of a scene in space", "set scene.dimension to 2")
    return float(subject.trajectory.residue)
