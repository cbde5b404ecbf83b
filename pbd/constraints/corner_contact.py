"""Contacts of the corners of boxes made of particles with fixed planes: C(p) = n . p - offset >= 0.

What a contact does - push, friction, restitution - stands in `pbd.constraints.grip`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast, indices, unit_vectors
from pbd.collision.plane import Planes, height
from pbd.constraints.grip import Grip, new_grip, open_contact, press
from pbd.errors import InvalidInput
from pbd.state import Particles
from pbd.vector import from_store, load, to_store

MARGIN = 0.05
"""Of the smallest half edge: what is this near is watched, so that a push in the solve finds the contact there.

It is also how far a corner may stand out beside a face on which it lies flat, and still be held by it: not beside one
that is tilted, to whose plane it could be far.
"""


class CornerPlanes(NamedTuple):
    """Corners ``candidates`` (a,) over fixed planes; of the slots, one a corner and plane, ``filled[0]`` are in use."""

    planes: Planes
    candidates: np.ndarray
    margin: float
    filled: np.ndarray
    particle: np.ndarray
    plane: np.ndarray
    grip: Grip

    def begin(self, state, h):
        self.filled[0] = 0
        particles = state.particles
        for k in range(self.planes.offset.shape[0]):
            normal = load(self.planes.normal, k)
            for a in range(self.candidates.shape[0]):
                i = self.candidates[a]
                predicted = height(self.planes, k, load(particles.p, i))
                if predicted < self.margin:
                    c = self.filled[0]
                    self.filled[0] = c + 1
                    self.particle[c], self.plane[c] = i, k
                    gaps = (height(self.planes, k, load(particles.x, i)), predicted)
                    open_contact(self.grip, c, particles, (i,), (1.0,), gaps, normal, h)

    def project(self, state, h):
        particles = state.particles
        for c in range(self.filled[0]):
            i, k = self.particle[c], self.plane[c]
            gap = height(self.planes, k, load(particles.p, i))
            press(self.grip, c, particles, (i,), (1.0,), gap, load(self.planes.normal, k))
        state.work[0] += self.filled[0]


def corner_planes(
    particles: Particles,
    corners: Any,
    *,
    normal: Any,
    offset: Any = 0.0,
    friction: float = 0.0,
    restitution: float = 0.0,
    gravity: float = 9.81,
) -> CornerPlanes:
    """Contacts of boxes' corners with fixed planes n . y >= offset.

    Parameters
    ----------
    corners : (b, 2^d) particle indices, numbered by bits: bit k of a corner's number is its side along axis k
    normal : (d,) or (m, d), any length > 0
    offset : one number or (m,) [m], along the unit normal
    friction, restitution, gravity : as in `pbd.box_contacts`

    Raises
    ------
    InvalidInput : a value outside its range
    """
    d = len(particles.x)
    index = corners_of(particles, corners)
    normals = unit_vectors("normal", normal, (d,))
    candidates = index.ravel()[particles.w[index.ravel()] > 0.0]
    slots = len(candidates) * len(normals)
    return CornerPlanes(
        planes=Planes(to_store(normals), broadcast("offset", offset, (len(normals),))),
        candidates=candidates,
        margin=margin_of(particles, index),
        filled=np.zeros(1, dtype=np.int64),
        particle=np.zeros(slots, dtype=np.int64),
        plane=np.zeros(slots, dtype=np.int64),
        grip=new_grip(slots, d, friction, restitution, gravity),
    )


def corners_of(particles: Particles, corners: Any) -> np.ndarray:
    """(b, 2^d) checked indices of boxes' corners."""
    n, d = particles.w.shape[0], len(particles.x)
    if d not in (2, 3):
        raise InvalidInput("particles", d, "of dimension 2 or 3")
    index = indices("corners", corners, n)
    if index.size == 0:
        return np.zeros((0, 2**d), dtype=np.int64)
    if index.ndim != 2 or index.shape[1] != 2**d:
        raise InvalidInput("corners", index.shape, f"of shape (b, {2**d})")
    return index


def margin_of(particles: Particles, index: np.ndarray) -> float:
    """MARGIN of the smallest half edge [m]."""
    if len(index) == 0:
        return 0.0
    x, d = from_store(particles.x), len(particles.x)
    edges = [np.linalg.norm(x[index[:, 1 << k]] - x[index[:, 0]], axis=1) for k in range(d)]
    return MARGIN * 0.5 * float(np.min(edges))
