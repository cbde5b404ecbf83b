"""What a user says of joints, checked and brought into the frames of their bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd.arrays import broadcast, real_array
from pbd.errors import InvalidInput
from pbd.rigid.bodies import Bodies

MOST_COMPLIANCE = 1e9
"""[m/N]"""

WORLD = -1
"""In the place of a body's index; None is the same."""


def checked_pairs(bodies: Bodies, pairs: Any) -> np.ndarray:
    """(m, 2) rows of `Bodies`, the world as its last; raises `InvalidInput` for what no joint can hold."""
    n, d = len(bodies.radius) - 1, len(bodies.x)
    try:
        array = np.asarray([[WORLD if body is None else body for body in pair] for pair in pairs])
    except (TypeError, ValueError):  # no rows, or rows of different lengths
        raise InvalidInput("pairs", pairs, "of shape (m, 2)") from None
    if array.size == 0:
        return np.zeros((0, 2), dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 2 or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInput("pairs", pairs, "whole numbers of shape (m, 2)")
    bad = array[(array < WORLD) | (array >= n)]
    if bad.size:
        raise InvalidInput("pairs", int(bad[0]), f"an index >= 0 and < {n}, or -1 or None for the world")
    rows = np.where(array == WORLD, n, array).astype(np.int64)
    stuck = np.all(bodies.motion[rows, 3 * (d - 1)] == 0.0, axis=1) | (rows[:, 0] == rows[:, 1])
    if stuck.any():
        raise InvalidInput("pairs", array[int(np.argmax(stuck))].tolist(), "two bodies, one of them movable")
    return rows


def checked_points(field: str, values: Any, count: int, dimension: int) -> np.ndarray:
    """(m, d) vectors; raises `InvalidInput` for another shape."""
    array = real_array(field, values)
    if array.size == 0 and count == 0:
        return np.zeros((0, dimension))
    if array.shape != (count, dimension):
        raise InvalidInput(field, array.shape, f"of shape ({count}, {dimension}), one for each pair")
    return array


def checked_compliance(values: Any, count: int, rows: int) -> np.ndarray:
    """(m, rows) [m/N]; raises `InvalidInput` for what is not in [0, MOST_COMPLIANCE]."""
    alpha = broadcast("compliance", values, (count,))
    bad = alpha[~((alpha >= 0.0) & (alpha <= MOST_COMPLIANCE))]
    if bad.size:
        raise InvalidInput("compliance", float(bad[0]), f">= 0 and <= {MOST_COMPLIANCE:g} m/N")
    return np.repeat(alpha[:, None], rows, axis=1)


def in_frames(bodies: Bodies, which: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (m, d) of the world in the frames of bodies ``which`` (m,)."""
    frames = bodies.frame[which]
    if len(bodies.x) == 2:
        c, s = frames.T
        rotations = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    else:
        rotations = frames.reshape(-1, 3, 3)
    return np.einsum("mij,mi->mj", rotations, vectors)
