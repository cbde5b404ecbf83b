"""A block that rocks from edge to edge on a floor, released tilted (Housner, BSSA 53, 1963).

Question: does an engine pass a body's weight from one edge to the other with the right loss? Between impacts the block
is an inverted pendulum; each impact leaves it 1 - 1.5 sin^2 alpha of its spin, alpha = atan(width / height).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Box
from comparisons.scene import Scene
from comparisons.scenes import _rigid
from comparisons.scenes._rocking import Rocking
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput

QUESTION = "How does a tilted block rock to rest?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """``size`` is the block's height; in 3D it is as deep as wide."""

    size: float = _rigid.edge(1.0, "height of the block")
    width: float = fields.real(0.25, "1", 0.01, 1.0, "of the block, over its height")
    tilt: float = fields.real(0.5, "1", 0.01, 0.95, "at the start, over the angle at which it would topple")
    friction: float = _rigid.coulomb(1.0)
    gravity: float = _rigid.downward()
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(2.0)
    samples: int = _rigid.sampling(40)

    def __post_init__(self) -> None:
        super().__post_init__()
        needed = self.motion.friction
        if self.friction <= needed:
            raise InvalidInput("scene.friction", self.friction, f"> {needed:.4g} for such a block", "else it slips")

    @property
    def motion(self) -> Rocking:
        """In closed form."""
        return Rocking(self.width * self.size / 2.0, self.size / 2.0, self.tilt, self.gravity)


def build(parameters: Parameters) -> Scene:
    """One block on the plane y = 0, tilted about its left edge, which is at -width/2."""
    rocking, d = parameters.motion, parameters.dimension
    edges = parameters.size * np.array([parameters.width, 1.0, parameters.width][:d])

    def motion(times: np.ndarray) -> Trajectory:
        centres, velocities, angles, spins = rocking.at(times)
        return _rigid.planar(d, times, centres[:, None], velocities[:, None], (angles[:, None], spins[:, None]))

    return _rigid.moving(
        parameters,
        [Box(tuple(edges.tolist()))],
        [parameters.mass],
        motion,
        name="rocking",
        title=f"a rocking block, {parameters.place}",
        planes=_rigid.floor(d),
        metrics=("position_error", "attitude_error", "energy_rise", "penetration"),
    )
