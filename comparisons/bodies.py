"""The vocabulary of rigid bodies: boxes and balls, and the half-spaces that they fall on.

All are solid and of uniform density. In 2D a ball is a disc and turns about one axis; its orientation is an angle
[rad], counter-clockwise. In 3D an orientation is a unit quaternion (w, x, y, z) that turns the body frame into the
world's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Box:
    """Edge lengths (d,) [m] along the axes of the body frame."""

    size: tuple[float, ...]

    def inertia(self, mass: float) -> np.ndarray:
        """About the centre [kg m^2]: (1,) in 2D, (3,) along the body axes in 3D."""
        squares = np.square(self.size)
        return mass / 12.0 * (squares.sum(keepdims=True) if len(self.size) == 2 else squares.sum() - squares)


@dataclass(frozen=True)
class Ball:
    """A disc in 2D, a sphere in 3D, of ``radius`` [m]."""

    radius: float
    dimension: int = 2

    def inertia(self, mass: float) -> np.ndarray:
        """About the centre [kg m^2]: (1,) in 2D, (3,) in 3D."""
        share, axes = (0.5, 1) if self.dimension == 2 else (0.4, 3)
        return np.full(axes, share * mass * self.radius**2)


@dataclass(frozen=True)
class Bodies:
    """n rigid bodies.

    shapes : n of `Box` or `Ball`
    masses : (n,) [kg]
    positions, velocities : (n, d) of the centres [m], [m/s]
    orientations : (n,) angles [rad] in 2D, (n, 4) unit quaternions (w, x, y, z) in 3D
    spins : (n,) [rad/s] in 2D, (n, 3) in the world frame in 3D
    fixed : indices of bodies that nothing moves
    """

    shapes: tuple[Box | Ball, ...]
    masses: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray
    velocities: np.ndarray
    spins: np.ndarray
    fixed: tuple[int, ...] = ()

    @property
    def free(self) -> np.ndarray:
        """(n,) mask of what can move."""
        mask = np.ones(len(self.masses), dtype=bool)
        mask[list(self.fixed)] = False
        return mask

    @property
    def inertias(self) -> np.ndarray:
        """(n, 1) in 2D, (n, 3) along the body axes in 3D [kg m^2]."""
        axes = 1 if self.positions.shape[1] == 2 else 3
        rows = [shape.inertia(mass) for shape, mass in zip(self.shapes, self.masses, strict=True)]
        return np.array(rows).reshape(-1, axes)


@dataclass(frozen=True)
class Planes:
    """Fixed half-spaces: unit normals (m, d) that point out of the solid, where n . y < offset (m,) [m]."""

    normals: np.ndarray
    offsets: np.ndarray


def at_rest(shapes: tuple[Box | Ball, ...], masses: np.ndarray, positions: np.ndarray, **changes: object) -> Bodies:
    """Bodies that are unturned and at rest but for ``changes``."""
    n, d = positions.shape
    turned = np.zeros(n) if d == 2 else np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    still: dict = {
        "orientations": turned,
        "velocities": np.zeros((n, d)),
        "spins": np.zeros(n) if d == 2 else np.zeros((n, 3)),
    }
    return Bodies(shapes, np.asarray(masses, dtype=float), positions, **{**still, **changes})


def rotations(orientations: np.ndarray, dimension: int) -> np.ndarray:
    """(..., d, d) matrices from body to world coordinates, from angles (...) or quaternions (..., 4)."""
    if dimension == 2:
        c, s = np.cos(orientations), np.sin(orientations)
        return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    w, x, y, z = np.moveaxis(orientations, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
