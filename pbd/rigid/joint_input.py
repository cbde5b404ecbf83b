"""What a user calls for joints: its input is checked and brought into the frames of the bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd.arrays import broadcast, real_array
from pbd.errors import InvalidInput
from pbd.rigid.bodies import Bodies
from pbd.rigid.joint_kinds import Hinge, Length, SharedPoint
from pbd.rigid.joint_rows import new_joint_rows
from pbd.rigid.joint_tree import plant
from pbd.rigid.joints import Joints
from pbd.vector import from_store

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


def ball_joint(bodies: Bodies, pairs: Any, anchors: Any, compliance: Any = 0.0) -> Joints:
    """Two bodies share a point: in 2D a hinge, in 3D a ball in its socket. A compliant one is a spring of length 0.

    Parameters
    ----------
    pairs : (m, 2) indices of bodies; -1 or None is the world
    anchors : (m, d) the points in the world [m], with the bodies where they are now
    compliance : (m,) or one number alpha [m/N], >= 0; 0 is rigid

    Raises
    ------
    InvalidInput : an index that does not exist, a pair that nothing can move, a shape that does not fit, alpha < 0
    """
    rows, d = checked_pairs(bodies, pairs), len(bodies.x)
    points = checked_points("anchors", anchors, len(rows), d)
    alpha = checked_compliance(compliance, len(rows), d)
    return _joined(bodies, SharedPoint(_arms(bodies, rows, points, points)), rows, alpha)


def hinge(bodies: Bodies, pairs: Any, anchors: Any, axes: Any, compliance: Any = 0.0) -> Joints:
    """Two bodies in 3D share a point, and turn against each other about one axis only.

    Parameters
    ----------
    pairs, anchors : as in `ball_joint`
    axes : (m, 3) in the world, of any length > 0
    compliance : (m,) or one number alpha [m/N] of the point, >= 0; the axis is held rigidly

    Raises
    ------
    InvalidInput : as in `ball_joint`; bodies in 2D, an axis of length 0
    """
    if len(bodies.x) != 3:
        raise InvalidInput("bodies", "in 2D", "in 3D for a hinge", "in 2D a ball_joint is one")
    rows = checked_pairs(bodies, pairs)
    m = len(rows)
    points, given = checked_points("anchors", anchors, m, 3), checked_points("axes", axes, m, 3)
    lengths = np.linalg.norm(given, axis=1)
    if m and not lengths.min() > 0.0:
        raise InvalidInput("axes", given[int(np.argmin(lengths))].tolist(), "of length > 0")
    axis = given / lengths[:, None]
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    alpha = np.hstack([checked_compliance(compliance, m, 3), np.zeros((m, 2))])
    sides = (0, axis), (1, first), (1, np.cross(axis, first))
    directions = [in_frames(bodies, rows[:, side], vectors) for side, vectors in sides]
    return _joined(bodies, Hinge(np.hstack([_arms(bodies, rows, points, points), *directions])), rows, alpha)


def distance_joint(
    bodies: Bodies, pairs: Any, anchors_a: Any, anchors_b: Any, lengths: Any = None, compliance: Any = 0.0
) -> Joints:
    """A point of one body keeps its distance from a point of another: a rod, or a spring.

    Parameters
    ----------
    pairs : as in `ball_joint`
    anchors_a, anchors_b : (m, d) points of the first and second bodies in the world [m], apart
    lengths : (m,) or one number [m], > 0; default the distances now
    compliance : (m,) or one number alpha [m/N], >= 0; 0 is rigid

    Raises
    ------
    InvalidInput : as in `ball_joint`; points that coincide, a length that is not > 0
    """
    rows, d = checked_pairs(bodies, pairs), len(bodies.x)
    m = len(rows)
    a, b = checked_points("anchors_a", anchors_a, m, d), checked_points("anchors_b", anchors_b, m, d)
    now = np.linalg.norm(b - a, axis=1)
    wanted = now if lengths is None else broadcast("lengths", lengths, (m,))
    for field, values in (("the distance of anchors_a and anchors_b", now), ("lengths", wanted)):
        if m and not values.min() > 0.0:
            raise InvalidInput(field, float(values.min()), "> 0 m", "use ball_joint")
    local = np.hstack([_arms(bodies, rows, a, b), wanted[:, None]])
    return _joined(bodies, Length(local), rows, checked_compliance(compliance, m, 1))


def _arms(bodies: Bodies, rows: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(m, 2 d) points of the first and second bodies in their frames."""
    x = from_store(bodies.x)
    return np.hstack([in_frames(bodies, rows[:, k], points - x[rows[:, k]]) for k, points in enumerate((a, b))])


def _joined(bodies: Bodies, kind: Any, rows: np.ndarray, alpha: np.ndarray) -> Joints:
    velocities = 3 * (len(bodies.x) - 1)
    forest = plant(rows, bodies.motion[:, velocities] == 0.0, alpha.shape[1], velocities)
    return Joints(kind, new_joint_rows(rows, alpha, velocities), forest, len(bodies.radius) - 1)
