"""What finding contacts costs: a pair of boxes in space, and a ball of the broad phase.

Run as ``python tests/benchmarks/collisions.py``. All cases are run in turn, a fraction of a millisecond each, and the
minimum of the repeats counts. Boxes are unit cubes, PAIRS of each kind so that no branch is learnt by heart, and loaded
from arrays as a solver would. The broad phase has the bounding balls of unit cubes on a jittered grid, in random order,
and finds about 3 pairs a ball in 2D and 9 in 3D.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from pbd.collision.box_box_3d import box_box
from pbd.collision.cells import find_pairs, new_cells
from pbd.jit import kernel
from pbd.vector import to_store

PAIRS, BALLS = 500, 10_000
MARGIN, GAP = 1e-3, 1e-4
"""[m] Contacts are sought up to the margin; boxes that touch are this far apart."""

GOALS = {"face on face": 600.0, "apart": 60.0, "apart, with hint": 60.0, "2D, n = 1000": 40.0, "2D, n = 10000": 40.0}
"""ns a pair, ns a ball."""


@kernel
def all_pairs(boxes, hints, remember, points, sweeps):
    """Contacts of all pairs (n, 30): centres, half extents, rotations of both."""
    found = 0
    for _ in range(sweeps):
        for k in range(boxes.shape[0]):
            p = boxes[k]
            a = (
                (p[0], p[1], p[2]),
                (p[6], p[7], p[8]),
                (p[12], p[13], p[14], p[15], p[16], p[17], p[18], p[19], p[20]),
            )
            b = (
                (p[3], p[4], p[5]),
                (p[9], p[10], p[11]),
                (p[21], p[22], p[23], p[24], p[25], p[26], p[27], p[28], p[29]),
            )
            count, _, hint = box_box(a, b, MARGIN, hints[k] if remember else -1, points)
            hints[k] = hint
            found += count
    return found


@kernel
def all_cells(cells, x, radius, margin, pairs, sweeps):
    """Pairs of the broad phase."""
    count = 0
    for _ in range(sweeps):
        count = find_pairs(cells, x, radius, margin, pairs)
    return count


def about(axis, angle):
    """Rotation matrix."""
    x, y, z = axis / np.linalg.norm(axis)
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * turn + (1.0 - np.cos(angle)) * turn @ turn


def pair(kind, rng):
    """(offset, rotation) of one cube from another."""
    up, flat = np.array([0.0, 0.0, 1.0 + GAP]), np.append(rng.uniform(-0.4, 0.4, 2), 0.0)
    if kind == "face on face":
        return up + flat, about(rng.normal(size=3), 1e-5)
    if kind == "turned":
        return up + 0.5 * flat, about(up, rng.uniform(0.2, 1.3))
    if kind == "edge on edge":
        lying = about(np.array([1.0, 0.0, 0.0]), np.pi / 4).T
        offset = np.append(0.5 * flat[:2], np.sqrt(2.0) + GAP)
        return lying @ offset, lying @ about(np.array([0.0, 1.0, 0.0]), np.pi / 4)
    towards = rng.normal(size=3)
    return 1.8 * towards / np.linalg.norm(towards), about(rng.normal(size=3), rng.uniform(0.0, np.pi))


def boxes(kind):
    """(PAIRS, 30), each pair turned at random."""
    rng, rows = np.random.default_rng(0), []
    for _ in range(PAIRS):
        (offset, turn), whole = pair(kind, rng), about(rng.normal(size=3), rng.uniform(0.0, np.pi))
        rows.append(
            np.concatenate([np.zeros(3), whole @ offset, np.full(6, 0.5), whole.ravel(), (whole @ turn).ravel()])
        )
    return np.array(rows)


def narrow(kind):
    """Function that runs all pairs some times: (ns a pair, points a pair)."""
    given, hints, points = boxes(kind.removesuffix(", with hint")), np.full(PAIRS, -1), np.zeros((8, 5))
    remember = kind.endswith("hint")
    all_pairs(given, hints, remember, points, 1)

    def run(sweeps=2):
        start = time.perf_counter()
        found = all_pairs(given, hints, remember, points, sweeps)
        seconds = time.perf_counter() - start
        return seconds / (sweeps * PAIRS) * 1e9, found / (sweeps * PAIRS)

    return run


def broad(d, n):
    """Function that finds all pairs some times: (ns a ball, pairs a ball)."""
    rng, side = np.random.default_rng(0), round(n ** (1.0 / d))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * d), axis=-1).reshape(-1, d)
    positions = rng.permutation(grid + rng.uniform(-0.05, 0.05, grid.shape))
    count = len(positions)
    radius = np.full(count, 0.5 * np.sqrt(d))
    cells, x, pairs = new_cells(radius, d), to_store(positions), np.zeros((20 * count, 2), dtype=np.int32)
    all_cells(cells, x, radius, 0.0, pairs, 1)

    sweeps = max(1, BALLS // count)

    def run():
        start = time.perf_counter()
        found = all_cells(cells, x, radius, 0.0, pairs, sweeps)
        return (time.perf_counter() - start) / (sweeps * count) * 1e9, found / count

    return run


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=300)
    chosen = parser.parse_args()
    kinds = ("face on face", "turned", "edge on edge", "apart", "apart, with hint")
    runs = {kind: narrow(kind) for kind in kinds}
    runs |= {f"{d}D, n = {n}": broad(d, n) for d in (2, 3) for n in (1000, 10_000)}
    found = {name: [] for name in runs}
    for _ in range(chosen.repeats):
        for name, run in runs.items():
            found[name].append(run())
    print(f"{'case':20s} {'ns':>8s} {'found':>8s}    ns a pair of boxes, points of it; ns a ball, pairs of it")
    for name, times in found.items():
        best = min(times)
        goal = GOALS.get(name)
        verdict = "" if goal is None else f"goal {goal:g}: {('missed', 'met')[best[0] <= goal]}"
        print(f"{name:20s} {best[0]:8.1f} {best[1]:8.2f}    {verdict}")


if __name__ == "__main__":
    main()
