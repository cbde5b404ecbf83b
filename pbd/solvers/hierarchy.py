"""The levels of Hierarchical PBD in flat arrays, and what a kernel does on them; see `pbd.solvers.multilevel`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pbd.jit import device
from pbd.solvers.coarsening import TAUT, Graph, Level, Sparse, coarse_levels, starts
from pbd.state import Particles
from pbd.vector import Store, accumulate, add, dot, from_store, load, scale, store, subtract, zero, zeros

NOTHING = -1.0
"""The rest length of a coarse link that says nothing in this cycle."""


class Hierarchy(NamedTuple):
    """All levels in flat arrays, finest first, for the kernel.

    first (levels + 2,) : where the links of each level begin; i, j (m,) : what they join
    rest (m,) [m], upper (m,), taut (m,) [m] : see `Graph`; taut is set for all coarse links
    share_i, share_j (m,) : of a correction, by the particles' inverse masses; 0 for a pinned particle
    paths, vector : rows of coarse links, from the end of level 0 on; the links' vectors as store of (m,), work
    child_first (levels + 1,), child, parents : the same for the particles that became fine
    depth (n,) : the coarsest level of each particle; before : their positions before a cycle, work
    """

    first: np.ndarray
    i: np.ndarray
    j: np.ndarray
    rest: np.ndarray
    upper: np.ndarray
    taut: np.ndarray
    share_i: np.ndarray
    share_j: np.ndarray
    paths: Sparse
    vector: Store
    child_first: np.ndarray
    child: np.ndarray
    parents: Sparse
    depth: np.ndarray
    before: Store


def build(particles: Particles, finest: Graph, most: int, straight: bool, unilateral: bool) -> Hierarchy:
    """At most ``most`` coarse levels above ``finest``.

    straight : coarse rest lengths are the distances of ``particles`` as they stand, not sums along paths
    unilateral : coarse links are upper limits, whatever the finest are
    """
    levels, x = coarse_levels(particles, finest, most), from_store(particles.x)
    links = [len(level.graph.pairs) for level in levels]
    pairs, rest, upper, taut = (
        np.concatenate(column) for column in zip(*(level.graph for level in levels), strict=True)
    )
    coarse = np.arange(len(pairs)) >= links[0]
    if straight:
        rest = np.where(coarse, np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1), rest)
    # braced paths bend too, where a cloth folds; what they are when straight is seen at the start alone
    taut = np.where(taut > 0.0, taut, TAUT * np.linalg.norm(np.concatenate(list(carried(levels, x))), axis=1))
    shares = np.concatenate([_shares(level) for level in levels])
    depth = np.zeros(len(x), dtype=np.int64)
    for number, level in enumerate(levels):
        depth[level.graph.pairs.ravel()] = number
    return Hierarchy(
        first=starts(links),
        i=pairs[:, 0].astype(np.uint64),
        j=pairs[:, 1].astype(np.uint64),
        rest=rest,
        upper=upper | (coarse & unilateral),
        taut=taut,
        share_i=shares[:, 0].copy(),
        share_j=shares[:, 1].copy(),
        paths=_stacked([level.paths for level in levels[1:]], links),
        vector=zeros(len(pairs), x.shape[1]),
        child_first=starts([len(level.child) for level in levels[1:]]),
        child=np.concatenate([level.child for level in levels]),
        parents=_stacked([level.parents for level in levels[1:]], [0] * len(links)),
        depth=depth,
        before=zeros(len(x), x.shape[1]),
    )


@device
def carry(levels, state):
    """Coarse rest lengths, from the finest links at rest length in their present directions.

    Counted as one projection of every link, which it costs.
    """
    p, finest = state.particles.p, levels.first[1]
    for c in range(finest):
        link = subtract(load(p, levels.i[c]), load(p, levels.j[c]))
        length = math.sqrt(dot(link, link))
        is_met = length == 0.0 or (levels.upper[c] and length < levels.rest[c])
        store(levels.vector, c, scale(1.0 if is_met else levels.rest[c] / length, link))
    for c in range(finest, levels.rest.shape[0]):
        vector = zero(p)
        row = c - finest
        for s in range(levels.paths.start[row], levels.paths.start[row + 1]):
            vector = add(vector, scale(levels.paths.value[s], load(levels.vector, levels.paths.column[s])))
        store(levels.vector, c, vector)
        length = math.sqrt(dot(vector, vector))
        levels.rest[c] = length if length >= levels.taut[c] else NOTHING
    state.work[0] += levels.rest.shape[0]


@device
def project_level(levels, level, is_backward, state):
    """One sweep over the coarse distances of a level: p_i <- p_i -+ share (|d| - rest) d/|d|."""
    p, begin, end = state.particles.p, levels.first[level], levels.first[level + 1]
    for a in range(end - begin):
        c = end - 1 - a if is_backward else begin + a
        i, j = levels.i[c], levels.j[c]
        link = subtract(load(p, i), load(p, j))
        length = math.sqrt(dot(link, link))
        value = length - levels.rest[c]
        if length > 0.0 and levels.rest[c] > NOTHING and (value > 0.0 or not levels.upper[c]):
            accumulate(p, i, -levels.share_i[c] * value / length, link)
            accumulate(p, j, levels.share_j[c] * value / length, link)
    state.work[0] += end - begin


@device
def pass_on(levels, level, p):
    """p_i <- p_i + sum_j w_ij (p_j - q_j) for the particles that join on the next finer level."""
    start, parent, weight = levels.parents
    for a in range(levels.child_first[level - 1], levels.child_first[level]):
        i = levels.child[a]
        for s in range(start[a], start[a + 1]):
            j = parent[s]
            accumulate(p, i, weight[s], subtract(load(p, j), load(levels.before, j)))


def _stacked(parts: list[Sparse], columns: list[int]) -> Sparse:
    """Matrices under each other; the columns of part a move on by the ``columns`` of those before it."""
    shift, begin = starts(columns), starts([len(part.value) for part in parts])
    start = [part.start[:-1] + offset for part, offset in zip(parts, begin, strict=False)]
    column = [part.column + offset for part, offset in zip(parts, shift, strict=False)]
    value = np.concatenate([np.zeros(0), *(part.value for part in parts)])
    return Sparse(np.concatenate([*start, begin[-1:]]), np.concatenate([np.zeros(0, dtype=np.int64), *column]), value)


def carried(levels: list[Level], x: np.ndarray) -> Iterator[np.ndarray]:
    """The links' vectors (m, d) of each level at positions x: as `carry` makes them."""
    graph = levels[0].graph
    link = x[graph.pairs[:, 0]] - x[graph.pairs[:, 1]]
    size = np.linalg.norm(link, axis=1, keepdims=True)
    vector = link * np.divide(graph.length[:, None], size, out=np.ones_like(size), where=size > 0.0)
    yield vector
    for level in levels[1:]:
        start, column, value = level.paths
        rows, finer = np.repeat(np.arange(len(start) - 1), np.diff(start)), vector
        vector = np.zeros((len(start) - 1, x.shape[1]))
        np.add.at(vector, rows, value[:, None] * finer[column])
        yield vector


def _shares(level: Level) -> np.ndarray:
    """(m, 2) which part of a link's correction each end takes."""
    w = np.divide(1.0, level.mass, out=np.zeros_like(level.mass), where=level.mass > 0.0)[level.graph.pairs]
    return w / w.sum(axis=1, keepdims=True)
