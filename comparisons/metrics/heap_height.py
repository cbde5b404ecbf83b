"""How high above the floor the highest point of a heap is at the end."""

from __future__ import annotations

from comparisons.metrics import Refused, Subject, _overlap

UNIT = "m"
TITLE = "height of the heap"


def measure(subject: Subject) -> float:
    """In the last sample, over the plane that is most level; `Refused` where there is none."""
    scene, bodies = subject.scene, subject.bodies
    if scene.planes is None or not scene.gravity.any():
        raise Refused("height of a heap without a floor", "ask for other metrics")
    floor = int((scene.planes.normals @ scene.gravity).argmin())
    at = _overlap.placed(bodies, subject.trajectory.positions[-1], subject.orientations[-1])
    tops = subject.above_floor[-1] + _overlap.reaches(at, scene.planes.normals)[:, floor]
    return float(tops[bodies.free].max())
