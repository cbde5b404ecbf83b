"""A point mass, released or thrown, that nothing holds: x = x0 + v0 t + g t^2 / 2, exactly.

Question: what does an engine's scheme make of constant acceleration? Kick then move falls dt/2 too long, move then kick
too short; a half kick is exact; what differs from all three is damping, or an error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import PointMasses, Scene
from pbd import fields

QUESTION = "How far does a free mass fall, and what does that tell about the engine's scheme and its damping?"


@dataclass(frozen=True)
class Parameters:
    """The height above y = 0 only sets the scale of energies."""

    height: float = fields.real(10.0, "m", 0.0, 1e6, "height at the start", above=True)
    speed: float = fields.real(0.0, "m/s", 0.0, 1e6, "speed at the start")
    angle: float = fields.real(45.0, "degrees", -360.0, 360.0, "direction of the start, from horizontal")
    mass: float = fields.real(1.0, "kg", 0.0, 1e12, "its mass", above=True)
    gravity: float = fields.real(9.81, "m/s^2", 0.0, 1e3, "downward acceleration")
    duration: float = fields.real(1.0, "s", 0.0, 1e5, "simulated time", above=True)
    samples: int = fields.whole(100, 1, 1_000_000, "equally spaced sample times after the start")

    def __post_init__(self) -> None:
        fields.check(self, "scene")

    @property
    def velocity(self) -> np.ndarray:
        """(2,) at the start [m/s]."""
        direction = np.deg2rad(self.angle)
        return self.speed * np.array([np.cos(direction), np.sin(direction)])


def exact(parameters: Parameters, times: np.ndarray) -> np.ndarray:
    """(s, 2) positions [m] at the times [s]."""
    t, fall = times[:, None], np.array([0.0, -parameters.gravity])
    return np.array([0.0, parameters.height]) + parameters.velocity * t + 0.5 * fall * t**2


def build(parameters: Parameters) -> Scene:
    """One free point mass."""
    start, velocity = np.array([[0.0, parameters.height]]), parameters.velocity[None]
    return Scene(
        name="free_fall",
        title=f"a free mass, {parameters.duration:g} s",
        masses=PointMasses(start, velocity, np.array([parameters.mass])),
        links=(),
        gravity=np.array([0.0, -parameters.gravity]),
        duration=parameters.duration,
        samples=parameters.samples,
        metrics=("position_error", "energy_drift", "fall", "momentum_drift"),
    )
