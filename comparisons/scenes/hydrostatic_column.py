"""A column of water at rest in a tank that it fills from wall to wall.

Question: how much is it compressed by its own weight? It is incompressible, so nothing should move, and the density at
the bottom should be that at the top.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.scene import Scene
from comparisons.scenes import _fluid, _rigid

QUESTION = "How much is water at rest compressed at its bottom, and does it rest?"


@dataclass(frozen=True)
class Parameters(_fluid.Common):
    """In 3D the tank is as deep as it is wide."""

    across: int = _fluid.across(20)
    width: float = _fluid.extent(1.0, "of the tank")
    height: float = _fluid.extent(1.0, "of the column")
    duration: float = _rigid.seconds(3.0)
    samples: int = _rigid.sampling(60)


def build(parameters: Parameters) -> Scene:
    """Particles on a lattice, half a spacing from the walls."""
    p, spacing = parameters, parameters.width / parameters.across
    rows = max(1, round(p.height / spacing))
    counts = [p.across, rows, p.across][: p.dimension]
    return _fluid.described_by(
        p,
        _fluid.masses_of(_fluid.lattice(counts, spacing), spacing),
        spacing,
        rows * spacing,
        name="hydrostatic_column",
        title=f"water at rest, {p.across} x {rows} particles, {p.dimension}D, {p.duration:g} s",
        planes=_fluid.tank(p.width, p.dimension, p.width),
        duration=p.duration,
        samples=p.samples,
        metrics=("bottom_density", "density_error", "density_peak", "residual_kinetic_energy", "energy_rise"),
    )
