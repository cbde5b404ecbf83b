"""A disc of water, in space a ball, thrown into free fall: no part of it moves against another.

Question: does the fluid solver leave alone what needs no correction? Every particle's path is a parabola.
"""

from __future__ import annotations

from dataclasses import dataclass

from comparisons.scene import Scene
from comparisons.scenes import _fluid, _rigid
from pbd import fields

QUESTION = "Does a fluid in free fall follow its parabola?"


@dataclass(frozen=True)
class Parameters(_fluid.Common):
    """Thrown along x and y with ``speed`` each."""

    across: int = _fluid.across(10)
    width: float = _fluid.extent()
    speed: float = fields.real(1.0, "m/s", 0.0, 1e6, "along x, and along y")
    duration: float = _rigid.seconds(1.0)
    samples: int = _rigid.sampling(20)


def build(parameters: Parameters) -> Scene:
    """The disc about the origin."""
    p, spacing = parameters, parameters.width / parameters.across
    return _fluid.thrown(
        p,
        _fluid.disc(p.across, spacing, p.dimension),
        spacing,
        name="falling_blob",
        title=f"a blob in free fall, {p.across} particles across, {p.dimension}D, {p.duration:g} s",
        metrics=("position_error", "momentum_drift", "density_peak", "energy_drift"),
    )
