"""Largest change of the angular momentum of bodies on which nothing acts from outside."""

from __future__ import annotations

import numpy as np

from comparisons.bodies import rotations
from comparisons.metrics import Refused, Subject

UNIT = "1"
TITLE = "angular momentum drift"


def measure(subject: Subject) -> float:
    """max |L(t) - L(0)| / |L(0)|, about the origin of the world; `Refused` under outer forces, or where L(0) = 0."""
    scene = subject.scene
    if scene.gravity.any() or scene.planes is not None or subject.bodies.fixed:
        raise Refused("angular momentum of a scene on which forces act from outside", "ask for other metrics")
    total = momenta(subject)
    size = float(np.linalg.norm(total[0]))
    if size == 0.0:
        raise Refused("relative drift of an angular momentum of 0", "ask for other metrics")
    return float(np.linalg.norm(total - total[0], axis=1).max() / size)


def momenta(subject: Subject) -> np.ndarray:
    """(s, 1) in 2D, (s, 3) in 3D: of all bodies about the origin [kg m^2/s]."""
    x, v, d = subject.trajectory.positions, subject.trajectory.velocities, len(subject.scene.gravity)
    if d == 2:
        orbital = (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0])[..., None]
        return np.einsum("sni,n->si", orbital, subject.moving_masses) + subject.body_momenta.sum(axis=1)
    own = np.einsum("snij,snj->si", rotations(subject.orientations, d), subject.body_momenta)
    return np.einsum("sni,n->si", np.cross(x, v), subject.moving_masses) + own
