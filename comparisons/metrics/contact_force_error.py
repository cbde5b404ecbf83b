"""How far the planes' forces on a scene at rest are from its weight."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject

UNIT = "1"
TITLE = "error of the contact force"

LAST = 0.25
"""Part of the samples that counts, by the end of which a scene should be at rest."""


def measure(subject: Subject) -> float:
    """Mean of | |sum of forces| - weight | / weight; `Refused` without weight, or where the engine tells no forces."""
    forces = subject.trajectory.contact_forces
    weight = float(subject.moving_masses.sum() * np.linalg.norm(subject.scene.gravity))
    if forces is None:
        raise Refused("contact forces, which the engine does not tell", "choose another engine, or other metrics")
    if weight == 0.0:
        raise Refused("contact forces of a scene without weight", "ask for other metrics")
    last = forces[-max(1, round(LAST * (len(forces) - 1))) :]
    return float(np.mean(np.abs(last - weight)) / weight)
