"""Two point masses on one link that nothing holds, spinning about their centre of mass while it moves.

Question: do the forces of an engine's link cancel? Then momentum changes by gravity alone, and the centre of mass moves
on a parabola, whatever else the engine gets wrong. A rigid pair turns at a constant rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import PointMasses, Rods, Scene, Springs
from pbd import fields

QUESTION = "Does an engine keep the linear momentum of two masses that only act on each other?"


@dataclass(frozen=True)
class Parameters:
    """Unequal masses, so that an error in their weights shows."""

    length: float = fields.real(1.0, "m", 1e-9, 1e6, "rest length of the link")
    mass: float = fields.real(1.0, "kg", 0.0, 1e12, "of the first", above=True)
    other_mass: float = fields.real(3.0, "kg", 0.0, 1e12, "of the second", above=True)
    speed: float = fields.real(1.0, "m/s", 0.0, 1e6, "of the centre of mass, along the link at the start")
    spin: float = fields.real(2.0, "rad/s", -1e6, 1e6, "rate of the link at the start")
    compliance: float = fields.real(0.0, "m/N", 0.0, 1e6, "of the link; 0 is rigid")
    gravity: float = fields.real(0.0, "m/s^2", 0.0, 1e3, "downward acceleration")
    duration: float = fields.real(1.0, "s", 0.0, 1e5, "simulated time", above=True)
    samples: int = fields.whole(100, 1, 1_000_000, "equally spaced sample times after the start")

    def __post_init__(self) -> None:
        fields.check(self, "scene")


def build(parameters: Parameters) -> Scene:
    """The pair along x, at its rest length, its centre of mass at the origin."""
    masses = np.array([parameters.mass, parameters.other_mass])
    offsets = parameters.length / masses.sum() * np.array([-masses[1], masses[0]])
    zeros = np.zeros(2)
    positions = np.column_stack([offsets, zeros])
    velocities = np.column_stack([zeros + parameters.speed, parameters.spin * offsets])
    pairs, lengths = np.array([[0, 1]]), np.array([parameters.length])
    rigid = parameters.compliance == 0.0
    return Scene(
        name="free_pair",
        title=f"a free {'rigid' if rigid else 'compliant'} pair, {parameters.duration:g} s",
        masses=PointMasses(positions, velocities, masses),
        links=(Rods(pairs, lengths) if rigid else Springs(pairs, lengths, np.array([parameters.compliance])),),
        gravity=np.array([0.0, -parameters.gravity]),
        duration=parameters.duration,
        samples=parameters.samples,
        metrics=("position_error", "energy_drift", "momentum_drift"),
    )
