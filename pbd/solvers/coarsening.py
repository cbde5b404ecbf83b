"""Coarsening for Hierarchical PBD (Mueller 2008, section 4): which particles are coarse, and how they are linked.

Level 0 holds all particles, level l + 1 a part of level l:

restriction    A particle becomes fine when K of its neighbours are coarse and each fine neighbour keeps K; so every
               fine particle has at least K coarse neighbours, its parents. Pinned particles stay coarse.
weights        w_ij = 1 / (d_ij / max_j d_ij + EPSILON), normalised, d_ij the rest length between child and parent.
links          A fine particle collapses into the parent nearest to the mean of its parents, and takes its links
               along; those that then join the same two particles become one.

Deviations from the paper: a parent takes on its share of a child's mass, m_j <- m_j + sum_i w_ij m_i, so that coarse
corrections keep linear momentum when they are passed on; and each coarse link knows all finer paths that it stands
for, as a linear combination of finer link vectors, besides the length of the shortest one.

A path can bend at a hinge, a particle with fewer than 2 d neighbours (Maxwell 1864: too few to hold it in d
dimensions). A coarse link is a rod only while its paths are straight: a bent rope gets shorter by moving inwards.

Everything is built once, in O(links) a level: 64 x 64 particles with 24 000 links take 0.05 s.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.jit import kernel
from pbd.state import Particles
from pbd.vector import from_store

K = 2
"""Coarse neighbours of a fine particle at least; the paper's choice."""

EPSILON = 0.01
"""In the parents' weights: bounds the weight of a very near parent."""

SMALLEST = float(np.finfo(np.float64).tiny)

TAUT = 0.99
"""End to end over length of a path: straighter ones - an arc of less than 28 degrees - count as straight."""


class Graph(NamedTuple):
    """The links of one level.

    pairs (m, 2) : particles;  length (m,) [m] : at rest;  upper (m,) : whether it is an upper limit only
    taut (m,) [m] : a link with hinges on all its paths says nothing while these reach less far; 0 for others
    """

    pairs: np.ndarray
    length: np.ndarray
    upper: np.ndarray
    taut: np.ndarray


class Points(NamedTuple):
    """The particles of the finest level: positions ``x`` (n, d), ``pinned`` (n,), whether they are ``hinges`` (n,)."""

    x: np.ndarray
    pinned: np.ndarray
    hinges: np.ndarray


class Neighbours(NamedTuple):
    """Both ends of all links, sorted by particle: ``particle`` (2m,) is linked to ``other`` by ``link``."""

    particle: np.ndarray
    other: np.ndarray
    link: np.ndarray


class Sparse(NamedTuple):
    """Rows of a sparse matrix: row r has entries start[r] to start[r + 1], each a column and its value."""

    start: np.ndarray
    column: np.ndarray
    value: np.ndarray


class Level(NamedTuple):
    """What one coarsening gives.

    graph : of the coarser level;  mass (n,) [kg] : of its particles, 0 elsewhere and where pinned
    child (f,), parents : the particles that became fine, and row by row their parents and weights
    paths : row by row, the finer links whose vectors add up to a coarse link's
    """

    graph: Graph
    mass: np.ndarray
    child: np.ndarray
    parents: Sparse
    paths: Sparse


def coarsen(fine: Level, points: Points) -> Level | None:
    """The next coarser level; None when no more particle can become fine."""
    graph, count = fine.graph, len(points.pinned)
    near = _neighbours(graph.pairs)
    coarse = _restrict(near, points.pinned)
    if coarse.all():
        return None
    to_parent = ~coarse[near.particle] & coarse[near.other]
    family = Neighbours(*(values[to_parent] for values in near))
    weight = _weights(family, graph.length, count)
    mass = fine.mass.copy()
    np.add.at(mass, family.other, weight * fine.mass[family.particle])
    mass[~coarse | points.pinned] = 0.0
    collapsed, paths = _relink(graph, points, *_collapse(family, points.x))
    child, start = np.unique(family.particle, return_index=True)
    return Level(collapsed, mass, child, Sparse(np.append(start, len(weight)), family.other, weight), paths)


def coarse_levels(particles: Particles, finest: Graph, most: int) -> list[Level]:
    """The finest level, without children, and at most ``most`` coarser ones above it."""
    pinned = particles.w == 0.0
    mass = np.divide(1.0, particles.w, out=np.zeros(len(pinned)), where=~pinned)
    links = np.bincount(np.unique(np.sort(finest.pairs, axis=1), axis=0).ravel(), minlength=len(pinned))
    points = Points(from_store(particles.x), pinned, links < 2 * len(particles.x))
    nothing = Sparse(starts([]), np.zeros(0, dtype=np.int64), np.zeros(0))
    levels = [Level(finest, mass, np.zeros(0, dtype=np.int64), nothing, nothing)]
    while len(levels) <= most and (level := coarsen(levels[-1], points)) is not None:
        levels.append(level)
    return levels


@kernel
def mark_fine(start, other, order, coarse, coarse_neighbours):
    """The paper's restriction: from all coarse on, visit ``order`` and make fine what may be."""
    for a in range(order.shape[0]):
        i = order[a]
        can = coarse_neighbours[i] >= K
        for s in range(start[i], start[i + 1]):
            j = other[s]
            can = can and (coarse[j] or coarse_neighbours[j] > K)
        if can:
            coarse[i] = False
            for s in range(start[i], start[i + 1]):
                coarse_neighbours[other[s]] -= 1


def _restrict(near: Neighbours, pinned: np.ndarray) -> np.ndarray:
    """(n,) whether a particle is coarse."""
    count = np.bincount(near.particle, minlength=len(pinned))
    coarse = np.ones(len(pinned), dtype=np.bool_)
    mark_fine(starts(count), near.other, np.flatnonzero(~pinned & (count > 0)), coarse, count.copy())
    return coarse


def _neighbours(pairs: np.ndarray) -> Neighbours:
    particle, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    order = np.argsort(particle, kind="stable")
    return Neighbours(particle[order], other[order], np.tile(np.arange(len(pairs)), 2)[order])


def _weights(family: Neighbours, length: np.ndarray, count: int) -> np.ndarray:
    """The weights of the parents of each child, of sum 1."""
    distance, farthest = length[family.link], np.zeros(count)
    np.maximum.at(farthest, family.particle, distance)
    weight = 1.0 / (distance / farthest[family.particle] + EPSILON)
    return weight / np.bincount(family.particle, weight, minlength=count)[family.particle]


def _collapse(family: Neighbours, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) the particle into which each collapses - itself if coarse -, and (n,) the link to there or -1."""
    count = np.bincount(family.particle, minlength=len(x))
    mean = np.zeros_like(x)
    np.add.at(mean, family.particle, x[family.other])
    mean /= np.maximum(count, 1)[:, None]
    off = np.linalg.norm(x[family.other] - mean[family.particle], axis=1)
    # rounded, as two parents are always equally far from their mean: numbers decide then, not round-off
    order = np.lexsort((family.other, np.round(off / off.max(initial=SMALLEST), 9), family.particle))
    child, nearest = np.unique(family.particle[order], return_index=True)
    into, via = np.arange(len(x)), np.full(len(x), -1)
    into[child], via[child] = family.other[order][nearest], family.link[order][nearest]
    return into, via


def _relink(graph: Graph, points: Points, into: np.ndarray, via: np.ndarray) -> tuple[Graph, Sparse]:
    """The coarser links, and the finer paths that they stand for (parent of i, i, j, parent of j): their mean.

    A coarse link is as long at rest as its shortest path, an upper limit if any finer link on its paths is, and
    hinged if all of its paths are.
    """
    ends = into[graph.pairs]
    kept = np.flatnonzero((ends[:, 0] != ends[:, 1]) & ~points.pinned[ends].all(axis=1))
    ends, inner = ends[kept], graph.pairs[kept]
    steps = np.column_stack([via[inner[:, 0]], kept, via[inner[:, 1]]])
    used = steps >= 0
    joined, row = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    row = row.ravel()
    begins = np.column_stack([ends[:, 0], inner[:, 0], inner[:, 1]])
    sign = np.where(graph.pairs[steps, 0] == begins, 1.0, -1.0) * np.where(ends[:, :1] == joined[row, :1], 1.0, -1.0)
    value = sign / np.bincount(row)[row][:, None]
    entries = np.column_stack([np.broadcast_to(row[:, None], steps.shape)[used], steps[used]])
    length, braced = np.full(len(joined), np.inf), np.zeros(len(joined), dtype=np.bool_)
    np.minimum.at(length, row, np.where(used, graph.length[steps], 0.0).sum(axis=1))
    hinged = (points.hinges[inner] & used[:, ::2]).any(axis=1) | (used & (graph.taut[steps] > 0.0)).any(axis=1)
    braced[row[~hinged]] = True
    upper = np.zeros(len(joined), dtype=np.bool_)
    upper[row[(used & graph.upper[steps]).any(axis=1)]] = True
    return Graph(joined, length, upper, np.where(braced, 0.0, TAUT * length)), _summed(
        entries, value[used], len(joined)
    )


def _summed(entries: np.ndarray, value: np.ndarray, rows: int) -> Sparse:
    """A sparse matrix from (row, column) entries; equal ones are added up."""
    cell, where = np.unique(entries, axis=0, return_inverse=True)
    return Sparse(starts(np.bincount(cell[:, 0], minlength=rows)), cell[:, 1], np.bincount(where.ravel(), value))


def starts(sizes: Any) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
