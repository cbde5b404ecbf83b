"""What the scenes of fluids share: parameters, blocks of particles, tanks.

Gravity is along -y, floors are y = 0, and in 3D a tank has walls along z too. Particles start on a square (cubic)
lattice whose outermost ones are half a spacing from the faces that enclose them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.bodies import Planes
from comparisons.scene import Fluid, PointMasses, Scene
from comparisons.scenes import _rigid
from comparisons.trajectory import Trajectory
from pbd import fields

DENSITY = 1000.0
"""[kg/m^d] Water's; nothing depends on it."""

Y = 1
"""The axis of gravity."""


def across(default: int) -> Any:
    """The field ``across``: the resolution."""
    return fields.whole(default, 1, 2000, "particles along the width")


def extent(default: float = 1.0, what: str = "of the fluid") -> Any:
    """The field ``width``."""
    return fields.real(default, "m", 1e-6, 1e6, what)


def lattice(counts: Sequence[int], spacing: float, low: Sequence[float] | np.ndarray = ()) -> np.ndarray:
    """(n, d) the middles of the cells of a block of ``counts`` cells from its corner ``low`` on; x varies slowest."""
    axes = [(np.arange(count) + 0.5) * spacing for count in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(counts))
    return points + (np.asarray(low) if len(low) else 0.0)


def disc(count: int, spacing: float, dimension: int) -> np.ndarray:
    """(n, d) the middles of the cells within a disc, in 3D a sphere, of ``count`` cells across, about the origin."""
    points = lattice([count] * dimension, spacing) - 0.5 * count * spacing
    return points[np.sum(points**2, axis=1) <= (0.5 * count * spacing) ** 2 * (1.0 + 1e-12)]


def tank(width: float, dimension: int, depth: float = 0.0) -> Planes:
    """A floor, walls at x = 0 and x = ``width`` [m] and, in 3D, at z = 0 and z = ``depth`` [m]."""
    walls = [(_rigid.axis(Y, dimension), 0.0)]
    for along, size in ((0, width), (2, depth))[: dimension - 1]:
        unit = _rigid.axis(along, dimension)
        walls += [(unit, 0.0), (-unit, -size)]
    return Planes(np.array([normal for normal, _ in walls]), np.array([offset for _, offset in walls]))


def masses_of(points: np.ndarray, spacing: float, velocities: Any = 0.0, relative: Any = 1.0) -> PointMasses:
    """Particles at rest density, or ``relative`` to it, with velocities (n, d) or one for all."""
    weights = np.broadcast_to(np.asarray(relative, dtype=float), len(points)) * DENSITY * spacing ** points.shape[1]
    return PointMasses(points, np.broadcast_to(velocities, points.shape).astype(float), weights)


@dataclass(frozen=True)
class Common:
    """What every scene of fluids has; scenes change the defaults."""

    dimension: int = fields.whole(2, 2, 3, "2, or 3 for the same scene in space")
    gravity: float = fields.real(9.81, "m/s^2", 0.0, 1e3, "downward acceleration")

    def __post_init__(self) -> None:
        fields.check(self, "scene")


def thrown(parameters: Any, points: np.ndarray, spacing: float, **described: Any) -> Scene:
    """The scene of particles that all fly on the same parabola, in closed form."""
    p, d = parameters, parameters.dimension
    velocity, gravity = p.speed * (np.arange(d) < 2), _rigid.down(p)

    def exact(times: np.ndarray) -> Trajectory:
        t = np.asarray(times)[:, None, None]
        x = points + velocity * t + 0.5 * gravity * t**2
        return Trajectory(times, x, np.broadcast_to(velocity + gravity * t, x.shape), 0)

    masses = masses_of(points, spacing, velocity)
    shared = {"duration": p.duration, "samples": p.samples, "exact": exact}
    return described_by(p, masses, spacing, p.width, **shared, **described)


def described_by(
    parameters: Any, points: PointMasses, spacing: float, length: float, fluid: dict | None = None, **described: Any
) -> Scene:
    """The scene of those particles as a fluid, with the gravity of its parameters.

    length : a typical one [m], that of a fall after which the fluid is as fast as it typically is
    fluid : more of `Fluid`
    """
    return Scene(
        masses=points,
        links=(),
        gravity=_rigid.down(parameters),
        fluid=Fluid(spacing, DENSITY, _speed(parameters, length), **(fluid or {})),
        **described,
    )


def _speed(parameters: Any, length: float) -> float:
    """Of a fall over ``length``, sqrt(g length); without gravity that of the start, or any."""
    falling = float(np.sqrt(parameters.gravity * length))
    return falling or getattr(parameters, "speed", 0.0) or 1.0
