"""A light box, made of particles as the fluid is, in a tank of water.

Question: how deep does it float? By Archimedes the water that it displaces weighs as much as it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.scene import Scene
from comparisons.scenes import _fluid, _rigid
from pbd import fields

QUESTION = "Does a box float as deep as Archimedes says?"

DEEP = 0.5
"""Depth of the water over the tank's width."""


@dataclass(frozen=True)
class Parameters(_fluid.Common):
    """``box`` particles are along the box's edge; it starts with as much of it under water as belongs there."""

    across: int = _fluid.across(32)
    width: float = _fluid.extent(1.0, "of the tank; in 3D its depth too")
    box: int = fields.whole(8, 2, 1000, "particles along the edge of the box")
    relative_density: float = fields.real(0.5, "1", 0.05, 0.95, "of the box")
    lift: float = fields.real(0.0, "spacing", -10.0, 10.0, "of the box above its place at the start")
    duration: float = _rigid.seconds(4.0)
    samples: int = _rigid.sampling(80)


def build(parameters: Parameters) -> Scene:
    """Water around the box's place, and as high above its bottom as beside it."""
    p, d = parameters, parameters.dimension
    spacing = p.width / p.across
    rows, sunk = round(DEEP * p.across), p.relative_density * p.box
    water = _fluid.lattice([p.across, rows, p.across][:d], spacing)
    box = _fluid.lattice([p.box] * d, spacing, _corner(p, spacing * (rows - sunk)))
    low, high = box.min(axis=0) - spacing, box.max(axis=0) + spacing
    water = water[~np.all((water > low + 1e-9 * spacing) & (water < high - 1e-9 * spacing), axis=1)]
    box[:, _fluid.Y] += p.lift * spacing
    relative = np.repeat([1.0, p.relative_density], [len(water), len(box)])
    solid = np.arange(len(water), len(relative))
    return _fluid.described_by(
        p,
        _fluid.masses_of(np.concatenate([water, box]), spacing, relative=relative),
        spacing,
        rows * spacing,
        {"solids": (solid,)},
        name="floating_box",
        title=f"a floating box of relative density {p.relative_density:g}, {p.across} particles across, {d}D",
        planes=_fluid.tank(p.width, d, p.width),
        duration=p.duration,
        samples=p.samples,
        metrics=("floating_depth_error", "density_error", "density_peak", "energy_rise"),
        known={"edge": p.box * spacing, "submerged": sunk * spacing},
    )


def _corner(p: Parameters, bottom: float) -> np.ndarray:
    """The box's lower corner, in the tank's middle, on the lattice of the water along it."""
    spacing = p.width / p.across
    corner = np.full(p.dimension, (p.across - p.box) // 2 * spacing)
    corner[_fluid.Y] = bottom
    return corner
