"""A box in free space that spins about nearly its middle axis, and so flips over and over (Euler's top).

Question: does an engine turn a body as Euler's equations say? Energy and angular momentum are no test: schemes that
keep both to round-off still have the attitude wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Box
from comparisons.scene import Scene
from comparisons.scenes import _rigid
from comparisons.scenes._top import Top
from comparisons.trajectory import Trajectory
from pbd import fields

QUESTION = "Which way does a freely spinning box face?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """Edges along x, y and z: ``size``, and fractions of the edge before."""

    dimension: int = fields.whole(3, 3, 3, "in space only")
    size: float = _rigid.edge(1.0, "longest edge")
    middle: float = fields.real(0.6, "1", 0.01, 0.99, "middle edge, over the longest")
    short: float = fields.real(0.5, "1", 0.01, 0.99, "shortest edge, over the middle one")
    spin: float = fields.real(3.0, "rad/s", 0.0, 1e4, "at the start", above=True)
    tilt: float = fields.real(3.0, "degrees", 0.5, 89.5, "of the spin from the middle axis, towards the short edge")
    lead: float = _rigid.head_start()
    duration: float = _rigid.seconds(10.0)
    samples: int = _rigid.sampling(200)

    @property
    def box(self) -> Box:
        """With three unequal edges."""
        middle = self.middle * self.size
        return Box((self.size, middle, self.short * middle))


def build(parameters: Parameters) -> Scene:
    """One box at the origin, in line with the axes at time 0 of its motion."""
    tilt, box = np.deg2rad(parameters.tilt), parameters.box
    top = Top(tuple(box.inertia(parameters.mass)), parameters.spin * np.cos(tilt), parameters.spin * np.sin(tilt))

    def motion(times: np.ndarray) -> Trajectory:
        orientations, spins = top.at(times)
        still = np.zeros((len(times), 1, 3))
        return Trajectory(times, still, still.copy(), 0, orientations=orientations[:, None], spins=spins[:, None])

    return _rigid.moving(
        parameters,
        [box],
        [parameters.mass],
        motion,
        name="top",
        title=f"a box that spins freely near its middle axis, {parameters.place}",
        metrics=("attitude_error", "angular_momentum_drift", "position_error", "energy_drift"),
    )
