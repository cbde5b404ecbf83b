"""Boxes that rest exactly on each other, shifted at random by a hundredth of their edge.

Question: how high a stack does an engine keep standing, and how far does it sink and creep? Nothing should move. The
shifts matter: a stack in perfect line shows no drift even where any other would collapse.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import at_rest
from comparisons.scene import Scene
from comparisons.scenes import _rigid
from pbd import fields

QUESTION = "Does a stack of boxes stay as it is?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """``count`` boxes of equal edges. Any stack stands whose shifts are less than a quarter of them."""

    count: int = _rigid.amount(10)
    size: float = _rigid.edge()
    jitter: float = fields.real(0.01, "1", 0.0, 0.2, "largest shift of a box, over its edge")
    friction: float = _rigid.coulomb()
    gravity: float = _rigid.downward()
    seed: int = _rigid.randomness()
    duration: float = _rigid.seconds(3.0)
    samples: int = _rigid.sampling(60)


def build(parameters: Parameters) -> Scene:
    """The stack along y, on the plane y = 0."""
    n, d, size = parameters.count, parameters.dimension, parameters.size
    positions = np.random.default_rng(parameters.seed).uniform(-1.0, 1.0, (n, d)) * parameters.jitter * size
    positions[:, 1] = size * (np.arange(n) + 0.5)
    return _rigid.resting(
        parameters,
        at_rest((_rigid.cube(size, d),) * n, np.full(n, parameters.mass), positions),
        name="stack",
        title=f"a stack of {n} boxes, {parameters.place}",
        planes=_rigid.floor(d),
        metrics=("drift", "penetration", "fallen", "position_error", "energy_drift"),
    )
