"""A box that hits another one at rest, face to face, without gravity.

Question: do impacts between bodies exchange the right momentum? With masses m1 and m2 and restitution e the velocities
after it are v (m1 - e m2) / (m1 + m2) and v m1 (1 + e) / (m1 + m2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _rigid
from comparisons.trajectory import Trajectory
from pbd import fields

QUESTION = "How fast are two boxes after one has hit the other?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """Boxes of equal edges."""

    size: float = _rigid.edge()
    other_mass: float = fields.real(2.0, "kg", 0.0, 1e12, "of the box at rest", above=True)
    speed: float = fields.real(1.0, "m/s", 0.0, 1e6, "of the first box", above=True)
    gap: float = fields.real(0.5, "m", 0.0, 1e6, "between the boxes at the start")
    restitution: float = _rigid.newton(0.5)
    friction: float = _rigid.coulomb()
    lead: float = _rigid.head_start()

    @property
    def after(self) -> np.ndarray:
        """(2,) velocities after the impact [m/s]."""
        m1, m2, e = self.mass, self.other_mass, self.restitution
        return self.speed / (m1 + m2) * np.array([m1 - e * m2, m1 * (1.0 + e)])


def build(parameters: Parameters) -> Scene:
    """The boxes along x, the impact at x = 0."""
    faces = parameters.size / 2.0 * np.array([-1.0, 1.0])
    before, impact = np.array([parameters.speed, 0.0]), parameters.gap / parameters.speed

    def motion(times: np.ndarray) -> Trajectory:
        since = times[:, None] - impact
        speeds = np.where(since < 0.0, before, parameters.after)
        centres, velocities = (np.stack([x, 0.0 * x], axis=2) for x in (faces + speeds * since, speeds))
        return _rigid.planar(parameters.dimension, times, centres, velocities)

    return _rigid.moving(
        parameters,
        [_rigid.cube(parameters.size, parameters.dimension)] * 2,
        [parameters.mass, parameters.other_mass],
        motion,
        name="box_impact",
        title=f"a box hitting another with e = {parameters.restitution:g}, {parameters.place}",
        metrics=("velocity_error", "position_error", "momentum_drift", "energy_rise", "penetration"),
    )
