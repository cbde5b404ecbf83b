"""A column of water behind a wall that is taken away at once: it collapses and runs along the floor.

Question: how far has the front come? Martin and Moyce (1952) measured it for columns of n^2 = 1 and 2, Z = front/a
over T = t sqrt(n^2 g/a) with the column's width a and height n^2 a; a film of water on the floor, friction, and the
time that a wall takes to vanish are not in the scene. Its fluid is inviscid and the scene is without a length: a = 1 m
stands for all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _fluid, _rigid
from comparisons.water import front_reference
from pbd import fields
from pbd.errors import InvalidInput

QUESTION = "How far has the front of a collapsing column come, and how much is the water compressed?"

TANK = 7.0
"""Length of the tank [widths of the column]; the front is at 4.1 when T = 3, and at 2 sqrt(2) T at most (Ritter)."""

OBSTACLE = (2.0, 0.5)
"""Of the obstacle [widths of the column]: where it begins, and the edge of its square."""


@dataclass(frozen=True)
class Parameters(_fluid.Common):
    """``duration`` is dimensionless, T; ``across`` particles fill the column's width."""

    across: int = _fluid.across(20)
    width: float = _fluid.extent(1.0, "a, of the column")
    ratio: int = fields.whole(2, 1, 4, "n^2, the column's height over its width")
    depth: float = fields.real(0.5, "a", 0.0, 100.0, "in 3D: of column and tank", above=True)
    obstacle: bool = fields.flag(False, "a box on the floor, in the way of the water")
    duration: float = fields.real(3.0, "sqrt(a/(n^2 g))", 0.0, 1e3, "simulated time", above=True)
    samples: int = _rigid.sampling(30)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gravity == 0.0:
            raise InvalidInput("scene.gravity", self.gravity, "> 0 m/s^2", "without it nothing collapses")

    @property
    def unit(self) -> float:
        """The time T = 1 [s]."""
        return float(np.sqrt(self.width / (self.ratio * self.gravity)))


def build(parameters: Parameters) -> Scene:
    """The column in a corner of its tank."""
    p, d = parameters, parameters.dimension
    spacing = p.width / p.across
    deep = [max(1, round(p.depth * p.across))] * (d - 2)
    points = _fluid.lattice([p.across, p.ratio * p.across, *deep], spacing)
    described = f"{p.across} across, {'obstacle, ' if p.obstacle else ''}{d}D, T = {p.duration:g}"
    known: dict = {"width": p.width, "ratio": p.ratio, "unit": p.unit}
    if d == 2 and p.ratio == 2 and not p.obstacle:
        known["front"] = front_reference()
    error = ("front_error",) if "front" in known else ()
    return _fluid.described_by(
        p,
        _fluid.masses_of(points, spacing),
        spacing,
        p.width,
        {"obstacles": _obstacles(p, sum(deep) * spacing)},
        name="dam_break",
        title=f"dam break, column 1 x {p.ratio}, {described}",
        planes=_fluid.tank(TANK * p.width, d, sum(deep) * spacing),
        duration=p.duration * p.unit,
        samples=p.samples,
        metrics=(*error, "front", "density_error", "density_peak", "volume_loss", "energy_rise"),
        known=known,
    )


def _obstacles(p: Parameters, deep: float) -> tuple:
    """A box over the whole depth of the tank, and beyond its walls."""
    if not p.obstacle:
        return ()
    begin, edge = (share * p.width for share in OBSTACLE)
    low, high = np.array([begin, -edge, -edge]), np.array([begin + edge, edge, deep + edge])
    return ((low[: p.dimension], high[: p.dimension]),)
