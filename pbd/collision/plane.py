"""Half-spaces: the solid side of planes n . y = offset; the free side is where n . y > offset."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbd.jit import device
from pbd.vector import Store, add, dot, load, scale, subtract


class Planes(NamedTuple):
    """Planes with unit normals ``normal`` (store of (m,) arrays) and offsets ``offset`` (m,) [m]."""

    normal: Store
    offset: np.ndarray


@device
def height(planes, k, point):
    """Signed distance of a point from plane k; negative inside the solid."""
    return dot(load(planes.normal, k), point) - planes.offset[k]


@device
def ray_cast(planes, k, start, stop):
    """(hits, q): whether the segment start -> stop enters the solid of plane k, and where.

    A start on the surface counts as outside, so that a resting particle is found.
    """
    above, below = height(planes, k, start), height(planes, k, stop)
    if above < 0.0 or below >= 0.0:
        return False, stop
    fraction = above / (above - below)
    return True, add(start, scale(fraction, subtract(stop, start)))


@device
def closest_point(planes, k, point):
    """The surface point of plane k that is closest to a point."""
    return subtract(point, scale(height(planes, k, point), load(planes.normal, k)))
