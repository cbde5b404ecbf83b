"""A planar chain of point masses on massless links, released at rest.

Question: how far from the true motion is an engine after the chain has swung, and what does a smaller
error cost? With ``compliance`` 0 the links are rigid; else they are linear springs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.scene import PointMasses, Rods, Scene, Springs
from pbd import fields
from pbd.errors import InvalidInput

QUESTION = "How far from the true motion is a swinging chain, and what does a smaller error cost?"

MAX_LINKS = 1_000_000


@dataclass(frozen=True)
class Parameters:
    """Lengths, masses, angles and compliances are one number for all links, or one for each."""

    links: int = fields.whole(1, 1, MAX_LINKS, "number of links")
    lengths: Any = fields.reals(None, "m", 1e-9, 1e6, "rest length of a link; default 1/links", optional=True)
    masses: Any = fields.reals(1.0, "kg", 0.0, 1e12, "point mass at the end of a link", above=True)
    angles: Any = fields.reals(90.0, "degrees", -360.0, 360.0, "link direction, from straight down")
    compliance: Any = fields.reals(0.0, "m/N", 0.0, 1e6, "of a link; 0 is rigid")
    stretch: float = fields.real(1.0, "1", 0.1, 10.0, "initial over rest length of the links")
    gravity: float = fields.real(9.81, "m/s^2", 0.0, 1e3, "downward acceleration")
    duration: float = fields.real(1.0, "s", 0.0, 1e5, "simulated time", above=True)
    samples: int = fields.whole(100, 1, 1_000_000, "equally spaced sample times after the start")

    def __post_init__(self) -> None:
        if isinstance(self.links, int) and self.links > MAX_LINKS:
            memory = self.links * 13 * 8 / 1e9
            raise InvalidInput(
                "scene.links", self.links, f"a whole number >= 1 and <= {MAX_LINKS}", f"it needs {memory:.3g} GB a copy"
            )
        fields.check(self, "scene")

    def per_link(self, name: str) -> np.ndarray:
        """(links,) values of a field that may be one number."""
        value = getattr(self, name)
        value = 1.0 / self.links if value is None else value
        array = np.asarray(value, dtype=float)
        if array.shape not in ((), (self.links,)):
            raise InvalidInput(
                f"scene.{name}", f"{array.size} values", f"one number or {self.links}, one for each link"
            )
        return np.broadcast_to(array, (self.links,)).copy()


def build(parameters: Parameters) -> Scene:
    """The chain: particle 0 is the pinned anchor at the origin, particle i the end of link i."""
    lengths, angles = parameters.per_link("lengths"), np.deg2rad(parameters.per_link("angles"))
    compliances = parameters.per_link("compliance")
    if np.any(compliances > 0.0) and not np.all(compliances > 0.0):
        raise InvalidInput("scene.compliance", parameters.compliance, "0 for all links or > 0 for all")
    steps = parameters.stretch * lengths[:, None] * np.column_stack([np.sin(angles), -np.cos(angles)])
    positions = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    masses = np.concatenate([[1.0], parameters.per_link("masses")])
    pairs = np.column_stack([np.arange(parameters.links), np.arange(1, parameters.links + 1)])
    rigid = not np.any(compliances)
    count = f"{parameters.links} {'rigid' if rigid else 'compliant'} link{'s' * (parameters.links > 1)}"
    return Scene(
        name="pendulum_chain",
        title=f"{count}, {parameters.duration:g} s",
        masses=PointMasses(positions, np.zeros_like(positions), masses, pinned=(0,)),
        links=(Rods(pairs, lengths) if rigid else Springs(pairs, lengths, compliances),),
        gravity=np.array([0.0, -parameters.gravity]),
        duration=parameters.duration,
        samples=parameters.samples,
        metrics=("position_error", "energy_drift", "link_violation") if rigid else ("position_error", "energy_drift"),
    )
