"""Which bodies are near each other, and what their contacts remember from one step to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbd.jit import device
from pbd.vector import Store, add, dot, load, scale, store, subtract, zero

SAME = 0.2
"""A point is the one of the last step that was within this part of the smaller body's bounding radius."""


class Memory(NamedTuple):
    """The points that touched in the last step: ``held`` (m,) of each pair, where they were, and their tangential
    displacements, in stores of arrays (m p,), p points a pair."""

    held: np.ndarray
    point: Store
    slip: Store


class Neighbours(NamedTuple):
    """Verlet's list: pairs whose bounding balls were nearer than ``skin`` when the centres were ``seen``, ascending.

    They are first[:listed[0]] and second[:listed[0]]; their memory follows that of bodies and planes. The spare arrays
    are scratch.
    """

    first: np.ndarray
    second: np.ndarray
    listed: np.ndarray
    seen: Store
    skin: float
    spare_first: np.ndarray
    spare_second: np.ndarray
    spare: Memory


@device
def recall(world, m, a, b, normal, active):
    """Tangential displacements of the active points: of the nearest point of the last step, turned into the plane."""
    patch, memory, room = world.patch, world.memory, world.patch.depth.shape[0]
    near = SAME * world.shapes.bound[a]
    if b >= 0:
        near = min(near, SAME * world.shapes.bound[b])
    for c in range(active):
        nearest, slip = near * near, zero(patch.slip)
        for old in range(m * room, m * room + memory.held[m]):
            way = subtract(load(memory.point, old), load(patch.point, c))
            if dot(way, way) < nearest:
                nearest, slip = dot(way, way), load(memory.slip, old)
        store(patch.slip, c, subtract(slip, scale(dot(slip, normal), normal)))


@device
def remember(world, m, active):
    memory, room = world.memory, world.patch.depth.shape[0]
    memory.held[m] = active
    for c in range(active):
        store(memory.point, m * room + c, load(world.patch.point, c))
        store(memory.slip, m * room + c, load(world.patch.slip, c))


@device
def have_moved(world, h):
    """Whether any centre will, in half a step, be farther than half the skin from where it was seen."""
    limit = 0.25 * world.neighbours.skin * world.neighbours.skin
    for i in range(world.state.w.shape[0]):
        soon = add(load(world.state.x, i), scale(0.5 * h, load(world.state.v, i)))
        way = subtract(soon, load(world.neighbours.seen, i))
        if dot(way, way) > limit:
            return True
    return False


@device
def list_pairs(world):
    """List the neighbours anew, with the memory of those that stay; False where there is no room."""
    state, found, bound = world.state, world.neighbours, world.shapes.bound
    n, kept, old = state.w.shape[0], 0, 0
    for a in range(n):
        store(found.seen, a, load(state.x, a))
        for b in range(a + 1, n):
            between = subtract(load(state.x, a), load(state.x, b))
            reach = bound[a] + bound[b] + found.skin
            if dot(between, between) < reach * reach and state.w[a] + state.w[b] > 0.0:
                if kept == found.first.shape[0]:
                    return False
                while old < found.listed[0] and (found.first[old], found.second[old]) < (a, b):
                    old += 1
                found.spare_first[kept], found.spare_second[kept] = a, b
                found.spare.held[kept] = 0
                if old < found.listed[0] and found.first[old] == a and found.second[old] == b:
                    copy_memory(world, world.memory, behind(world) + old, found.spare, kept)
                kept += 1
    found.listed[0] = kept
    for p in range(kept):
        found.first[p], found.second[p] = found.spare_first[p], found.spare_second[p]
        copy_memory(world, found.spare, p, world.memory, behind(world) + p)
    return True


@device
def behind(world):
    """Where the memory of pairs of bodies begins."""
    return world.planes.offset.shape[0] * world.state.w.shape[0]


@device
def copy_memory(world, source, i, target, j):
    room = world.patch.depth.shape[0]
    target.held[j] = source.held[i]
    for c in range(source.held[i]):
        store(target.point, j * room + c, load(source.point, i * room + c))
        store(target.slip, j * room + c, load(source.slip, i * room + c))
