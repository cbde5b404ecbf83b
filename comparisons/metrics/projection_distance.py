"""How far the end is from the exact projection of the start: the nearest state in which every link has its length."""

from __future__ import annotations

from comparisons import store
from comparisons.exact_projection import distance
from comparisons.metrics import Refused, Subject
from comparisons.reference import NoReference

UNIT = "m"
TITLE = "distance from the exact projection"


def measure(subject: Subject) -> float:
    """Mass-weighted rms over free particles; `Refused` where the links cannot be met, or not regularly.

    Meaningful after one step without gravity and velocities, which leaves the solver's work alone.
    """
    scene = subject.scene
    if not scene.links:
        raise Refused("distance from an exact projection in a scene without links", "ask for other metrics")
    try:
        exact = store.projection(scene)
    except NoReference as reason:
        raise Refused(f"distance from an exact projection: {reason}", "ask for other metrics") from None
    return distance(scene.masses, subject.trajectory.positions[-1], exact)
