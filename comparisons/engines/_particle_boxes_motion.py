"""Boxes as particles, and back: where the particles of a box are, and how the box moves when they do.

The corners and the centre of a solid box, of m/24 and 2m/3 in 3D and m/12 and 2m/3 in 2D, have its mass and its tensor
of inertia: along an axis of edge a the second moment is that of all corners, 8 (m/24) (a/2)^2 = 4 (m/12) (a/2)^2
= m a^2 / 12, as the solid's, and mixed moments are 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Bodies, Box, rotations
from pbd.constraints.polar import nearest_quaternions

CENTER_SHARE = 2.0 / 3.0
"""Of a box's mass."""


@dataclass(frozen=True)
class Particles:
    """Of n boxes with P = 2^d + 1 particles each, the corners numbered by bits, then the centre.

    rest : (n, P, d) places about the centre, unturned [m]
    masses : (n, P) [kg]
    """

    rest: np.ndarray
    masses: np.ndarray

    @property
    def moments(self) -> np.ndarray:
        """(n, d, d): sum m r r^T at rest [kg m^2]."""
        return np.einsum("np,npi,npj->nij", self.masses, self.rest, self.rest)


def particles_of(bodies: Bodies) -> Particles:
    """The particles of bodies that are all boxes."""
    d = bodies.positions.shape[1]
    bits = np.arange(2**d)[:, None] >> np.arange(d) & 1
    sides = np.vstack([2.0 * bits - 1.0, np.zeros(d)])
    sizes = np.array([shape.size for shape in bodies.shapes if isinstance(shape, Box)]).reshape(-1, d)
    shares = np.append(np.full(2**d, (1.0 - CENTER_SHARE) / 2**d), CENTER_SHARE)
    return Particles(0.5 * sizes[:, None] * sides, bodies.masses[:, None] * shares)


def placed(bodies: Bodies, particles: Particles) -> tuple[np.ndarray, np.ndarray]:
    """(n, P, d) positions and velocities of the particles of boxes that move as ``bodies`` say; 0 of the fixed."""
    d = bodies.positions.shape[1]
    arms = np.einsum("nij,npj->npi", rotations(bodies.orientations, d), particles.rest)
    velocities = bodies.velocities[:, None] + _cross(bodies.spins[:, None], arms)
    return bodies.positions[:, None] + arms, np.where(bodies.free[:, None, None], velocities, 0.0)


@dataclass(frozen=True)
class Motion:
    """Of n boxes at s times: centres and velocities (s, n, d), orientations and spins as in a trajectory."""

    centres: np.ndarray
    velocities: np.ndarray
    orientations: np.ndarray
    spins: np.ndarray


def motion(particles: Particles, times: np.ndarray, x: np.ndarray, v: np.ndarray) -> Motion:
    """Of boxes whose particles are at x and move with v, (s, n, P, d) each.

    The centre of mass and its velocity; the rotation of the polar decomposition of sum m (p - c) r^T; the spin I^-1 L,
    with the inertia of the particles where they are. A 2D angle goes on from the one before by about its spin.
    """
    share = particles.masses / particles.masses.sum(axis=1, keepdims=True)
    centres, velocities = (np.einsum("np,snpi->sni", share, values) for values in (x, v))
    arms, relative = x - centres[:, :, None], v - velocities[:, :, None]
    moments = np.einsum("np,snpi,npj->snij", particles.masses, arms, particles.rest)
    spins = _spins(particles.masses, arms, relative)
    if x.shape[-1] == 3:
        return Motion(centres, velocities, nearest_quaternions(moments), spins)
    angles = np.arctan2(moments[..., 1, 0] - moments[..., 0, 1], moments[..., 0, 0] + moments[..., 1, 1])
    return Motion(centres, velocities, _continued(times, angles, spins), spins)


def _spins(masses: np.ndarray, arms: np.ndarray, relative: np.ndarray) -> np.ndarray:
    """I^-1 L about the centres of mass."""
    if arms.shape[-1] == 2:
        turning = arms[..., 0] * relative[..., 1] - arms[..., 1] * relative[..., 0]
        return np.einsum("np,snp->sn", masses, turning) / np.einsum("np,snpi->sn", masses, arms**2)
    momenta = np.einsum("np,snpi->sni", masses, np.cross(arms, relative))
    squares = np.einsum("np,snpi,snpj->snij", masses, arms, arms)
    inertia = np.trace(squares, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - squares
    return np.linalg.solve(inertia, momenta[..., None])[..., 0]


def _continued(times: np.ndarray, angles: np.ndarray, spins: np.ndarray) -> np.ndarray:
    """Angles (s, n) [rad] by whole turns nearest to where the mean spin of each interval leads."""
    turns = 0.5 * (spins[1:] + spins[:-1]) * np.diff(times)[:, None]
    steps = np.diff(angles, axis=0)
    steps += 2.0 * np.pi * np.round((turns - steps) / (2.0 * np.pi))
    return np.vstack([angles[:1], angles[:1] + np.cumsum(steps, axis=0)])


def _cross(spins: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """omega x r, of spins (n, 1) or (n, 1, 3) and arms (n, P, d)."""
    if arms.shape[-1] == 3:
        return np.cross(spins, arms)
    return np.stack([-spins * arms[..., 1], spins * arms[..., 0]], axis=-1)
