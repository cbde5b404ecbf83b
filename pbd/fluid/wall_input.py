"""Walls and boxes as a user gives them, checked."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from pbd.arrays import broadcast, real_array, unit_vectors
from pbd.collision.plane import Planes
from pbd.errors import InvalidInput
from pbd.fluid.walls import Obstacles
from pbd.vector import to_store

TOUCHING = 1e-9
"""Of h: so near to a wall a face lies on it."""


def read_walls(normal: Any, offset: Any, obstacles: Any, h: float, d: int) -> tuple[Planes, Obstacles | None]:
    """The planes of walls, and boxes as obstacles if there are any.

    A box that touches a wall goes on behind it: the faces there are left out, or fluid would leave through them.
    """
    normals = np.zeros((0, d)) if normal is None else unit_vectors("normal", normal, (d,))
    offsets = np.zeros(0) if normal is None else broadcast("offset", offset, (len(normals),))
    planes = Planes(to_store(normals), offsets)
    boxes = () if obstacles is None else obstacles
    if not isinstance(boxes, list | tuple | np.ndarray):
        raise InvalidInput("obstacles", boxes, "a list of boxes (low, high)")
    if len(boxes) == 0:
        return planes, None
    found = [_faces(f"obstacles[{k}]", box, normals, offsets, h) for k, box in enumerate(boxes)]
    faces = Planes(to_store(np.concatenate([each for each, _ in found])), np.concatenate([at for _, at in found]))
    return planes, Obstacles(faces, np.cumsum([0, *(len(at) for _, at in found)]).astype(np.int64))


def _faces(field: str, box: Any, walls: np.ndarray, offsets: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """(normals (m, d), offsets (m,)) of the faces of a box that are not on or behind one wall."""
    low, high = _corners(field, box, walls.shape[1])
    d = len(low)
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    behind = corners @ walls.T <= offsets + TOUCHING * h
    if behind.all(axis=0).any():
        raise InvalidInput(field, [low.tolist(), high.tolist()], "a box before all walls, at least in part")
    normals, heights = [], []
    for axis in range(d):
        faces = [(-1.0, low[axis]), (1.0, high[axis])]
        free = [(side, at) for side, at in faces if not behind[corners[:, axis] == at].all(axis=0).any()]
        edge = float(high[axis] - low[axis])
        if len(free) == 2 and edge < (1.0 - TOUCHING) * h:
            reason = "make it thicker, or the particles smaller"
            raise InvalidInput(field, edge, f"of edges >= {h:g} m, the kernel's support", reason)
        normals += [side * np.eye(d)[axis] for side, _ in free]
        heights += [side * at for side, at in free]
    return np.array(normals), np.array(heights)


def _corners(field: str, box: Any, d: int) -> tuple[np.ndarray, np.ndarray]:
    ends = real_array(field, box)
    if ends.shape != (2, d):
        raise InvalidInput(field, ends.shape, f"two opposite corners (low, high) of {d} numbers [m]")
    if not np.all(ends[0] < ends[1]):
        raise InvalidInput(field, ends.tolist(), "(low, high) with low < high along each axis")
    return ends[0], ends[1]
