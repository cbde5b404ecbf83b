"""How deep boxes made of particles lie, in closed form: by unfinished iterations of shape matching, and as trusses."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from comparisons.engines._particle_boxes_motion import Particles, particles_of
from comparisons.run import build_scene

GRAVITY = 9.81


def sunk(k: float, n: int, h: float, raw: bool = False) -> float:
    """5/6 g h^2 q^(n-1) / (1 - q^n), q = 1 - k'/6 [m]: what n iterations of shape matching leave; ``raw``: k for k'."""
    q = 1.0 - (k if raw else 1.0 - (1.0 - k) ** (1.0 / n)) / 6.0
    return float(5.0 / 6.0 * GRAVITY * h**2 * q ** (n - 1) / (1.0 - q**n))


def truss(compliance: float, ratios: Sequence[float], sticks: bool) -> list[float]:
    """How far the centres of mass of boxes of ``ratios`` kg, each on the one before, sink [m]: particles are nodes.

    Boxes share the corners between them; the lowest corners lie on the plane and slide, unless they stick. Small
    displacements u: K u = f, with K = sum n n^T / compliance over all distances.
    """
    box = _particles()
    size = len(box.rest[0])
    nodes = [[i if i < 2 else i + 3 * level for i in range(size)] for level in range(len(ratios))]
    for below, above in itertools.pairwise(nodes):
        above[0], above[1] = below[2], below[3]
    count = nodes[-1][-1] + 1
    stiffness, force = np.zeros((count, 2, count, 2)), np.zeros((count, 2))
    for mine, ratio in zip(nodes, ratios, strict=True):
        force[mine, 1] -= GRAVITY * ratio * box.masses[0]
        for i, j in itertools.combinations(range(size), 2):
            along = box.rest[0, i] - box.rest[0, j]
            ends = np.zeros((count, 2))
            ends[mine[i]], ends[mine[j]] = along / np.linalg.norm(along), -along / np.linalg.norm(along)
            stiffness += np.multiply.outer(ends, ends) / compliance
    free = np.ones((count, 2), dtype=bool)
    free[:2, 0 if sticks else 1 :] = False
    moves = free.ravel()
    matrix = stiffness.reshape(2 * count, 2 * count)[np.ix_(moves, moves)]
    u = np.zeros(2 * count)
    u[moves] = np.linalg.lstsq(matrix, force.ravel()[moves], rcond=None)[0]
    share = box.masses[0] / box.masses[0].sum()
    return [float(-share @ u.reshape(count, 2)[mine, 1]) for mine in nodes]


def _particles() -> Particles:
    """Of the box of 1 kg and 1 m that the scenes have."""
    bodies = build_scene("stack", {"count": 1, "jitter": 0.0}).bodies
    assert bodies is not None
    return particles_of(bodies)
