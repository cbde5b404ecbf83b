"""A row of dominoes, the first of which is pushed over.

Question: does an engine pass a fall from body to body, edge against face and sliding, without energy out of nothing?
There is no closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Box, at_rest
from comparisons.scene import Scene
from comparisons.scenes import _rigid
from pbd import fields
from pbd.errors import InvalidInput

QUESTION = "How fast does a row of dominoes fall, and what does it cost in overlap and energy?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """Lengths are fractions of ``size``, a domino's height."""

    count: int = _rigid.amount(10)
    size: float = _rigid.edge(1.0, "height of a domino")
    thickness: float = fields.real(0.2, "1", 0.01, 1.0, "of a domino, over its height")
    breadth: float = fields.real(0.5, "1", 0.01, 10.0, "of a domino in 3D, over its height")
    spacing: float = fields.real(0.6, "1", 0.02, 2.0, "from one domino to the next, over their height")
    spin: float = fields.real(2.0, "rad/s", 0.0, 1e3, "at which the first starts to fall", above=True)
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    duration: float = _rigid.seconds(3.0)
    samples: int = _rigid.sampling(60)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.spacing <= self.thickness:
            raise InvalidInput("scene.spacing", self.spacing, f"> {self.thickness:g}, the thickness")


def build(parameters: Parameters) -> Scene:
    """Upright along x on the plane y = 0; the first turns about its lower edge towards the others."""
    n, d = parameters.count, parameters.dimension
    edges = parameters.size * np.array([parameters.thickness, 1.0, parameters.breadth][:d])
    positions = np.zeros((n, d))
    positions[:, 0] = parameters.spacing * parameters.size * np.arange(n)
    positions[:, 1] = edges[1] / 2.0
    velocities, spins = np.zeros((n, d)), np.zeros((n, 3))
    velocities[0, :2] = parameters.spin / 2.0 * edges[[1, 0]]
    spins[0, 2] = -parameters.spin
    return _rigid.described_by(
        parameters,
        at_rest(
            (Box(tuple(edges.tolist())),) * n,
            np.full(n, parameters.mass),
            positions,
            velocities=velocities,
            spins=spins[:, 2] if d == 2 else spins,
        ),
        name="dominoes",
        title=f"{n} dominoes, {parameters.place}",
        planes=_rigid.floor(d),
        metrics=("front_speed", "penetration", "energy_rise"),
    )
