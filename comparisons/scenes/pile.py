"""Boxes of random sizes and angles that fall into a container and come to rest as a heap.

Question: what does an engine pay for many contacts at once? There is no closed form, and no two engines' heaps agree;
but bodies must not overlap, energy must never rise, and in the end nothing should move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Planes
from comparisons.scene import Scene
from comparisons.scenes import _heap, _rigid

QUESTION = "How deep do the bodies of a heap overlap, and does it come to rest?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """``size`` and ``mass`` are those of the mean box; edges vary by a fifth."""

    count: int = _rigid.amount(100)
    size: float = _rigid.edge(0.25, "mean edge of a box")
    friction: float = _rigid.coulomb()
    restitution: float = _rigid.newton(0.0)
    gravity: float = _rigid.downward()
    seed: int = _rigid.randomness()
    duration: float = _rigid.seconds(3.0)
    samples: int = _rigid.sampling(60)


def build(parameters: Parameters) -> Scene:
    """A grid of boxes about as high as wide, between walls at its sides; in 3D four of them."""
    n, d = parameters.count, parameters.dimension
    heap = _heap.Heap(n, d, parameters.size, parameters.mass, _heap.columns(n, d))
    return _rigid.described_by(
        parameters,
        heap.bodies(parameters.seed),
        name="pile",
        title=f"{n} boxes falling into a container, {parameters.place}",
        planes=_container(d, heap.width),
        metrics=("penetration", "settled_penetration", "residual_kinetic_energy", "energy_rise"),
    )


def _container(dimension: int, width: float) -> Planes:
    """The floor y = 0 and walls at a distance of ``width`` [m]."""
    sides = [sign * _rigid.axis(along, dimension) for along in (0, 2)[: dimension - 1] for sign in (1.0, -1.0)]
    normals = np.array([_rigid.axis(1, dimension), *sides])
    return Planes(normals, np.array([0.0] + [-width / 2.0] * len(sides)))
