"""How deep bodies overlap each other and the planes: exact geometry of boxes and balls, vectorised over pairs.

The overlap of two convex bodies is the shortest translation that parts them. Of two boxes it is the least over the axes
of the separating-axis theorem: the faces' normals and, in 3D, the cross products of edges (Gottschalk, Lin, Manocha,
OBBTree, 1996). Negative where bodies are apart; then it is a bound, not the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from comparisons.bodies import Ball, Bodies, Box, Planes, rotations

PARALLEL = 1e-6
"""Edges whose cross product is shorter name no axis of their own: the faces' normals part such boxes as well."""

CHUNK = 256
"""Pairs of boxes whose edges are tried at once."""


@dataclass(frozen=True)
class Placed:
    """Bodies at one time: centres (n, d), rotations (n, d, d), and of their shapes half edges and radii."""

    centres: np.ndarray
    turns: np.ndarray
    halves: np.ndarray
    """(n, d) half edges [m]; 0 of balls"""
    radii: np.ndarray
    """(n,) [m]; 0 of boxes"""

    @property
    def bounds(self) -> np.ndarray:
        """(n,) radii of the spheres around the bodies [m]."""
        return np.linalg.norm(self.halves, axis=1) + self.radii


def placed(bodies: Bodies, centres: np.ndarray, orientations: np.ndarray) -> Placed:
    """The bodies with those centres (n, d) and orientations (n,) or (n, 4)."""
    d = centres.shape[1]
    halves = [np.array(shape.size) / 2.0 if isinstance(shape, Box) else np.zeros(d) for shape in bodies.shapes]
    radii = [shape.radius if isinstance(shape, Ball) else 0.0 for shape in bodies.shapes]
    return Placed(centres, rotations(orientations, d), np.array(halves).reshape(-1, d), np.array(radii))


def heights(at: Placed, planes: Planes) -> np.ndarray:
    """(n, m) of the lowest points above the planes [m]; negative below."""
    return at.centres @ planes.normals.T - planes.offsets - reaches(at, planes.normals)


def reaches(at: Placed, normals: np.ndarray) -> np.ndarray:
    """(n, m): how far the bodies extend from their centres along the normals (m, d) [m]."""
    along = np.abs(np.einsum("nij,mi->nmj", at.turns, normals))
    return np.einsum("nmj,nj->nm", along, at.halves) + at.radii[:, None]


def neighbours(at: Placed, free: np.ndarray) -> np.ndarray:
    """(p, 2) pairs, at least one of them free, whose surrounding spheres touch."""
    bounds = at.bounds
    pairs = cKDTree(at.centres).query_pairs(2.0 * bounds.max(initial=0.0), output_type="ndarray")
    i, j = pairs.T
    near = np.sum((at.centres[i] - at.centres[j]) ** 2, axis=1) < (bounds[i] + bounds[j]) ** 2
    return pairs[near & (free[i] | free[j])]


def deepest_pair(at: Placed, free: np.ndarray, deepest: float = 0.0) -> float:
    """The deepest overlap of two bodies, or ``deepest`` if that is more [m]; the more that is, the less is computed."""
    pairs = neighbours(at, free)
    i, j = np.where((at.radii[pairs[:, 0]] > 0.0)[:, None], pairs[:, ::-1], pairs).T  # boxes come first
    first_ball, second_ball = at.radii[i] > 0.0, at.radii[j] > 0.0
    for kind, overlap in ((first_ball & second_ball, balls), (~first_ball & second_ball, box_and_ball)):
        deepest = max(deepest, float(overlap(at, i[kind], j[kind]).max(initial=0.0)))
    boxes = ~first_ball & ~second_ball
    return _deepest_boxes(at, i[boxes], j[boxes], deepest)


def balls(at: Placed, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(p,) overlaps of pairs of balls [m]."""
    return at.radii[i] + at.radii[j] - np.linalg.norm(at.centres[i] - at.centres[j], axis=1)


def box_and_ball(at: Placed, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(p,) overlaps of boxes i with balls j [m]; of a centre inside the box, out of the nearest face."""
    local = np.abs(np.einsum("pij,pi->pj", at.turns[i], at.centres[j] - at.centres[i]))
    outside = local - at.halves[i]
    distance = np.linalg.norm(np.maximum(outside, 0.0), axis=1)
    return at.radii[j] - np.where(distance > 0.0, distance, outside.max(axis=1))


def boxes_faces(at: Placed, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(p,) least overlaps along the faces' normals of pairs of boxes [m]: in 2D the overlap, in 3D at least that."""
    apart, mixed = _frame(at, i, j)
    size, other = at.halves[i], at.halves[j]
    absolute = np.abs(mixed)
    first = size + np.einsum("pij,pj->pi", absolute, other) - np.abs(apart)
    second = other + np.einsum("pij,pi->pj", absolute, size) - np.abs(np.einsum("pij,pi->pj", mixed, apart))
    return np.minimum(first.min(axis=1), second.min(axis=1))


def boxes_edges(at: Placed, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(p,) least overlaps along the cross products of edges of pairs of boxes in 3D [m]; inf where all are parallel."""
    apart, mixed = _frame(at, i, j)
    edges = np.swapaxes(mixed, 1, 2)
    crosses = np.cross(np.eye(3)[None, :, None], edges[:, None])  # (p, edge of i, edge of j, 3)
    lengths = np.linalg.norm(crosses, axis=3)
    reach = np.einsum("pabk,pk->pab", np.abs(crosses), at.halves[i])
    reach += np.einsum("pabl,pl->pab", np.abs(np.einsum("pabk,pkl->pabl", crosses, mixed)), at.halves[j])
    depth = reach - np.abs(np.einsum("pabk,pk->pab", crosses, apart))
    return np.where(lengths > PARALLEL, depth / np.maximum(lengths, PARALLEL), np.inf).min(axis=(1, 2), initial=np.inf)


def _frame(at: Placed, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From centre to centre (p, d), and the axes of boxes j as columns (p, d, d), both in the frames of boxes i."""
    turned = np.swapaxes(at.turns[i], 1, 2)
    return (turned @ (at.centres[j] - at.centres[i])[..., None])[..., 0], turned @ at.turns[j]


def _deepest_boxes(at: Placed, i: np.ndarray, j: np.ndarray, deepest: float) -> float:
    """The deepest overlap of the pairs of boxes, or ``deepest`` if that is more [m].

    The faces bound the overlap, so the edges of a pair matter only where that bound exceeds what was found.
    """
    bounds = boxes_faces(at, i, j)
    if at.centres.shape[1] == 2:
        return max(deepest, float(bounds.max(initial=0.0)))
    order = np.argsort(-bounds)
    for start in range(0, len(order), CHUNK):
        some = order[start : start + CHUNK]
        some = some[bounds[some] > deepest]
        if len(some) == 0:
            break
        overlap = np.minimum(bounds[some], boxes_edges(at, i[some], j[some]))
        deepest = max(deepest, float(overlap.max()))
    return deepest
