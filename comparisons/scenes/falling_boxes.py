"""Boxes and a few balls of mixed sizes that fall on a floor, where nothing holds the heap together but friction.

Question: what heap is left? No two engines' heaps agree, but bodies must not overlap, energy must never rise, the floor
must carry their weight, and in the end nothing should move.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.scene import Scene
from comparisons.scenes import _heap, _rigid
from pbd import fields

QUESTION = "What heap do falling boxes leave, how deep do they overlap, and do they come to rest?"


@dataclass(frozen=True)
class Parameters(_rigid.Common):
    """``size`` and ``mass`` are those of the mean box; edges and diameters vary by a fifth."""

    count: int = _rigid.amount(60)
    balls: float = fields.real(0.1, "1", 0.0, 1.0, "chance of a body to be a ball")
    size: float = _rigid.edge(0.25, "mean edge of a box")
    friction: float = _rigid.coulomb()
    restitution: float = _rigid.newton(0.0)
    gravity: float = _rigid.downward()
    seed: int = _rigid.randomness()
    duration: float = _rigid.seconds(3.0)
    samples: int = _rigid.sampling(60)


def build(parameters: Parameters) -> Scene:
    """A grid of bodies twice as high as wide, over the plane y = 0."""
    n, d = parameters.count, parameters.dimension
    heap = _heap.Heap(n, d, parameters.size, parameters.mass, _heap.columns(n, d, height=2.0), parameters.balls)
    return _rigid.described_by(
        parameters,
        heap.bodies(parameters.seed),
        name="falling_boxes",
        title=f"{n} boxes and balls falling on a heap, {parameters.place}",
        planes=_rigid.floor(d),
        metrics=("heap_height", "penetration", "residual_kinetic_energy", "energy_rise"),
    )
