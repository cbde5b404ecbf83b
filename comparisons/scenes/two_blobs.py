"""Two discs of water, in space balls, that meet in the middle, off-centre, without gravity.

Question: is momentum kept? Nothing acts from outside, so the sum of all momenta stays, whatever the collision does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _fluid, _rigid
from pbd import fields

QUESTION = "Do colliding fluids keep their momentum, and how much energy do they lose?"


@dataclass(frozen=True)
class Parameters(_fluid.Common):
    """The second is at rest; ``offset`` is how far past its centre the first one aims."""

    across: int = _fluid.across(10)
    width: float = _fluid.extent(1.0, "of each")
    speed: float = fields.real(1.0, "m/s", 0.0, 1e6, "of the first", above=True)
    offset: float = fields.real(0.3, "width", 0.0, 1.0, "of the line of impact from the centre")
    gravity: float = fields.real(0.0, "m/s^2", 0.0, 1e3, "downward acceleration")
    duration: float = _rigid.seconds(2.0)
    samples: int = _rigid.sampling(40)


def build(parameters: Parameters) -> Scene:
    """A quarter of a width between them."""
    p, spacing = parameters, parameters.width / parameters.across
    one = _fluid.disc(p.across, spacing, p.dimension)
    shift = np.zeros(p.dimension)
    shift[:2] = 1.25 * p.width, p.offset * p.width
    points = np.concatenate([one - shift, one])
    velocities = np.zeros_like(points)
    velocities[: len(one), 0] = p.speed
    return _fluid.described_by(
        p,
        _fluid.masses_of(points, spacing, velocities),
        spacing,
        p.width,
        name="two_blobs",
        title=f"two blobs that collide, {p.across} particles across each, {p.dimension}D, {p.duration:g} s",
        duration=p.duration,
        samples=p.samples,
        metrics=("momentum_drift", "density_error", "density_peak", "energy_drift", "energy_rise"),
    )
