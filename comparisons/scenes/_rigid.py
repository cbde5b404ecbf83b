"""What the scenes of rigid bodies share: parameters, planes, and motions that are known.

All planar motions are in the x-y plane with gravity along -y. In 3D they are the same, about the z axis.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from comparisons.bodies import Ball, Bodies, Box, Planes
from comparisons.scene import Scene, no_masses
from comparisons.trajectory import Trajectory
from pbd import fields

Motion = Callable[[np.ndarray], Trajectory]


def seconds(default: float) -> Any:
    """The field of a scene's duration."""
    return fields.real(default, "s", 0.0, 1e5, "simulated time", above=True)


def sampling(default: int) -> Any:
    """The field of a scene's number of samples; a default makes the interval 1/20 s, which usual steps divide."""
    return fields.whole(default, 1, 1_000_000, "equally spaced sample times after the start")


def edge(default: float = 1.0, what: str = "edge of a box") -> Any:
    """The field ``size``."""
    return fields.real(default, "m", 1e-6, 1e6, what)


def ball_radius(default: float = 0.5) -> Any:
    """The field ``radius``."""
    return fields.real(default, "m", 1e-6, 1e6, "of the disc, in 3D of the sphere")


def drop_height(default: float = 1.0) -> Any:
    """The field ``height``."""
    return fields.real(default, "m", 0.0, 1e6, "of the lowest point above the plane at the start", above=True)


def downward() -> Any:
    """The field ``gravity``."""
    return fields.real(9.81, "m/s^2", 0.0, 1e3, "downward acceleration", above=True)


def coulomb(default: float = 0.5) -> Any:
    """The field ``friction``."""
    return fields.real(default, "1", 0.0, 100.0, "Coulomb's coefficient of every contact")


def newton(default: float) -> Any:
    """The field ``restitution``."""
    return fields.real(default, "1", 0.0, 1.0, "Newton's coefficient of every contact")


def head_start() -> Any:
    """The field ``lead``, by which studies shift events against the grid of steps."""
    return fields.real(0.0, "s", 0.0, 1e5, "the scene starts so far into its exact motion")


def randomness() -> Any:
    """The field ``seed``."""
    return fields.whole(0, 0, 2**32 - 1, "of what is random")


def amount(default: int) -> Any:
    """The field ``count``."""
    return fields.whole(default, 1, 1_000_000, "number of bodies")


@dataclass(frozen=True)
class Common:
    """What every scene of rigid bodies has; scenes change the defaults."""

    dimension: int = fields.whole(2, 2, 3, "2, or 3 for the same scene in space")
    mass: float = fields.real(1.0, "kg", 0.0, 1e12, "of a body", above=True)
    duration: float = seconds(1.0)
    samples: int = sampling(20)

    def __post_init__(self) -> None:
        fields.check(self, "scene")

    @property
    def place(self) -> str:
        """For titles."""
        return f"{self.dimension}D, {self.duration:g} s"


def down(parameters: Any) -> np.ndarray:
    """(d,) gravity [m/s^2] of parameters that have it."""
    return -parameters.gravity * axis(1, parameters.dimension)


def axis(index: int, dimension: int) -> np.ndarray:
    """(d,) unit vector."""
    return np.eye(dimension)[index]


def floor(dimension: int) -> Planes:
    """The half-space y < 0."""
    return Planes(axis(1, dimension)[None], np.zeros(1))


def cube(size: float, dimension: int) -> Box:
    """A box of equal edges, in 2D a square."""
    return Box((size,) * dimension)


def half(shape: Box | Ball) -> float:
    """How far an upright body's centre is above its lowest point [m]."""
    return shape.radius if isinstance(shape, Ball) else shape.size[1] / 2.0


def planar(
    dimension: int, times: np.ndarray, centres: np.ndarray, velocities: np.ndarray, turning: tuple = (0.0, 0.0)
) -> Trajectory:
    """A motion in the x-y plane: centres and velocities (s, n, 2), ``turning`` = angles and spins (s, n) about z."""
    shape = centres.shape[:2]
    angles, spins = (np.broadcast_to(np.asarray(turn, dtype=float), shape).copy() for turn in turning)
    if dimension == 2:
        return Trajectory(times, centres, velocities, 0, orientations=angles, spins=spins)
    zero = np.zeros(shape)
    return Trajectory(
        times,
        np.concatenate([centres, zero[..., None]], axis=2),
        np.concatenate([velocities, zero[..., None]], axis=2),
        0,
        orientations=np.stack([np.cos(angles / 2), zero, zero, np.sin(angles / 2)], axis=2),
        spins=np.stack([zero, zero, spins], axis=2),
    )


def along(
    origin: np.ndarray, direction: np.ndarray, way: np.ndarray, speed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Centres and velocities (s, 1, 2) of one body on a line: ``way`` [m] and ``speed`` [m/s] (s,) from its origin."""
    return origin + way[:, None, None] * direction, speed[:, None, None] * direction


def moving(
    parameters: Any, shapes: Iterable[Box | Ball], masses: Iterable[float], motion: Motion, **described: Any
) -> Scene:
    """The scene of a known motion: it starts in the state at ``lead`` and goes on from there."""
    lead = parameters.lead
    start = motion(np.array([lead]))
    assert start.orientations is not None
    assert start.spins is not None
    first = (start.positions[0], start.orientations[0], start.velocities[0], start.spins[0])
    bodies = Bodies(tuple(shapes), np.array(list(masses), dtype=float), *first)

    def exact(times: np.ndarray) -> Trajectory:
        return replace(motion(np.asarray(times) + lead), times=times)

    return described_by(parameters, bodies, exact=exact, **described)


def resting(parameters: Any, bodies: Bodies, **described: Any) -> Scene:
    """The scene of bodies that should stay as they start."""

    def exact(times: np.ndarray) -> Trajectory:
        def always(value: np.ndarray) -> np.ndarray:
            return np.broadcast_to(value, (len(times), *value.shape)).copy()

        x, v, q, w = (always(a) for a in (bodies.positions, bodies.velocities, bodies.orientations, bodies.spins))
        return Trajectory(times, x, v, 0, orientations=q, spins=w)

    return described_by(parameters, bodies, exact=exact, **described)


def described_by(parameters: Any, bodies: Bodies, **described: Any) -> Scene:
    """The scene of those bodies, with the gravity, friction, restitution and sampling of its parameters."""
    d = parameters.dimension
    return Scene(
        masses=no_masses(d),
        links=(),
        gravity=down(parameters) if hasattr(parameters, "gravity") else np.zeros(d),
        duration=parameters.duration,
        samples=parameters.samples,
        bodies=bodies,
        friction=getattr(parameters, "friction", 0.0),
        restitution=getattr(parameters, "restitution", 0.0),
        **described,
    )
