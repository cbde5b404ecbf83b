"""Trees of joints, solved at once: however many bodies hang together, and however unequal their masses.

Sought are impulses p with J M^-1 J^T p + soft p = -residual. From the leaves inwards, each joint between a body b and its
parent a, seen from a, is a measurement of how a moves:

    S = J_b B_b J_b^T + soft,    r = residual + J_b w_b,
    W = B_a J_a^T (S + J_a B_a J_a^T)^-1,    w_a <- w_a - W (r + J_a w_a),    B_a <- B_a - W J_a B_a,

where B, at first M^-1, is how a body with all that hangs on it answers to impulses, and w, at first 0, how its velocity
changes. Outwards then p = -S^-1 (r + J_a w_a), w_b <- w_b + B_b J_b^T p. Source: the articulated bodies of Featherstone
1983, of linear cost, in the form of Kalman's filter, in which joints may be rigid (soft = 0) and bodies light.

Joints that close a loop - the ground and all fixed bodies are one body here - are swept one by one after the trees:
they may be redundant.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from pbd.jit import device
from pbd.rigid.joint_rows import invert

GROUND = -1
"""In the place of a parent that nothing moves."""


class Forest(NamedTuple):
    """t joints from the leaves inwards. A body's place is that of the joint to its parent; roots stand behind.

    order (t,) : the joints
    side (t,) : 0 or 1, which of its bodies is the child
    parent (t,) : place of the other, or GROUND
    body (places,) : the body of each place
    loops : the joints that close one
    answer (places, N, N), change (places, N) : B and w; N = 3 or 6 velocities, of motion and spin
    lever, gain (t, N, R) : B_b J_b^T and W
    scratch (1, N, R), inner (1, R, R) : of one joint
    """

    order: np.ndarray
    side: np.ndarray
    parent: np.ndarray
    body: np.ndarray
    loops: np.ndarray
    answer: np.ndarray
    change: np.ndarray
    lever: np.ndarray
    gain: np.ndarray
    scratch: np.ndarray
    inner: np.ndarray


def plant(pairs: np.ndarray, fixed: np.ndarray, rows: int, velocities: int) -> Forest:
    """The forest of joints between ``pairs`` (m, 2), of so many rows; ``fixed`` (n + 1,) marks what nothing moves."""
    ends = np.where(fixed[pairs], GROUND, pairs)
    joints_at: dict[int, list[int]] = {}
    for c, both in enumerate(ends.tolist()):
        for body in both:
            joints_at.setdefault(body, []).append(c)
    found: list[tuple[int, int, int]] = []  # joint, child, parent
    roots, seen = [], set()
    for root in sorted(joints_at):  # the ground first
        if root not in seen:
            seen.add(root)
            roots.append(root)
            found += _branches(root, joints_at, ends, seen)
    found.reverse()
    place = {child: k for k, (_, child, _) in enumerate(found)}
    free = [root for root in roots if root != GROUND]
    place |= {GROUND: GROUND, **{root: len(found) + k for k, root in enumerate(free)}}
    order = np.array([c for c, _, _ in found], dtype=np.int64)
    t, places = len(found), len(found) + len(free)
    return Forest(
        order=order,
        side=np.array([int(ends[c, 1] == child) for c, child, _ in found], dtype=np.int64),
        parent=np.array([place[parent] for _, _, parent in found], dtype=np.int64),
        body=np.array([child for _, child, _ in found] + free, dtype=np.int64),
        loops=np.setdiff1d(np.arange(len(pairs)), order),
        answer=np.zeros((places, velocities, velocities)),
        change=np.zeros((places, velocities)),
        lever=np.zeros((t, velocities, rows)),
        gain=np.zeros((t, velocities, rows)),
        scratch=np.zeros((1, velocities, rows)),
        inner=np.zeros((1, rows, rows)),
    )


def _branches(root: int, joints_at: dict[int, list[int]], ends: np.ndarray, seen: set[int]) -> list:
    """(joint, child, parent) of the tree that grows from a root, breadth first."""
    found, waiting = [], deque([root])
    while waiting:
        parent = waiting.popleft()
        for c in joints_at[parent]:
            child = int(ends[c].sum()) - parent
            if child not in seen:
                seen.add(child)
                waiting.append(child)
                found.append((c, child, parent))
    return found


@device
def gradient(rows, c, r, side, k, d):
    """J of row r for velocity k of the joint's first (0) or second (1) body."""
    if k < d:
        return rows.row[c, r, k] if side == 1 else -rows.row[c, r, k]
    return rows.row[c, r, 2 * d - 3 + k] if side == 1 else -rows.row[c, r, k]


@device
def factorise(forest, rows, bodies):
    """S^-1 (into ``rows.inverse``), lever and gain of all joints, at the present pose and softness."""
    d = len(bodies.x)
    for k in range(forest.body.shape[0]):
        set_answer(forest.answer, k, bodies.motion, forest.body[k], d)
    for k in range(forest.order.shape[0]):
        c, child, parent = forest.order[k], forest.side[k], forest.parent[k]
        levered(forest.answer, k, rows, c, child, d, forest.lever, k)
        for r in range(rows.soft.shape[1]):
            for s in range(rows.soft.shape[1]):
                rows.inverse[c, r, s] = along(rows, c, r, child, forest.lever, k, s, d)
            rows.inverse[c, r, r] += rows.soft[c, r]
        if parent != GROUND:
            hang(forest, rows, k, d)
        invert(rows.inverse, c)


@device
def hang(forest, rows, k, d):
    """What hangs on the joint at place k, whose ``rows.inverse`` still holds S, becomes part of its parent's answer."""
    c, side, parent, scratch, inner = (
        forest.order[k],
        1 - forest.side[k],
        forest.parent[k],
        forest.scratch,
        forest.inner,
    )
    count, answer, gain = rows.soft.shape[1], forest.answer, forest.gain
    levered(answer, parent, rows, c, side, d, scratch, 0)
    for r in range(count):
        for s in range(count):
            inner[0, r, s] = rows.inverse[c, r, s] + along(rows, c, r, side, scratch, 0, s, d)
    invert(inner, 0)
    for n in range(3 * (d - 1)):
        for r in range(count):
            total = 0.0
            for s in range(count):
                total += scratch[0, n, s] * inner[0, s, r]
            gain[k, n, r] = total
    for n in range(3 * (d - 1)):
        for m in range(n + 1):
            total = 0.0
            for r in range(count):
                total += gain[k, n, r] * scratch[0, m, r]
            answer[parent, n, m] -= total
            answer[parent, m, n] = answer[parent, n, m]


@device
def set_answer(answer, k, motion, i, d):
    """B = M^-1 of body i."""
    size = 3 * (d - 1)
    for n in range(size):
        for m in range(size):
            answer[k, n, m] = 0.0
    for n in range(d):
        answer[k, n, n] = motion[i, size]
    column = size + 1
    for n in range(d, size):
        for m in range(n, size):
            answer[k, n, m] = answer[k, m, n] = motion[i, column]
            column += 1


@device
def levered(answer, k, rows, c, side, d, out, place):
    """out <- B J^T."""
    for n in range(3 * (d - 1)):
        for r in range(rows.soft.shape[1]):
            total = 0.0
            for m in range(3 * (d - 1)):
                total += answer[k, n, m] * gradient(rows, c, r, side, m, d)
            out[place, n, r] = total


@device
def along(rows, c, r, side, lever, place, s, d):
    """Entry (r, s) of J times a lever."""
    total = 0.0
    for n in range(3 * (d - 1)):
        total += gradient(rows, c, r, side, n, d) * lever[place, n, s]
    return total


@device
def seen_from(rows, c, r, side, change, k, d):
    """J w."""
    total = 0.0
    for n in range(3 * (d - 1)):
        total += gradient(rows, c, r, side, n, d) * change[k, n]
    return total


@device
def solve_forest(forest, rows, d):
    """``rows.step`` <- the impulses of all joints of the trees that make their ``rows.residual`` 0, to first order."""
    change, residual = forest.change, rows.residual
    for k in range(change.shape[0]):
        for n in range(change.shape[1]):
            change[k, n] = 0.0
    for k in range(forest.order.shape[0]):
        c, child, parent = forest.order[k], forest.side[k], forest.parent[k]
        for r in range(rows.soft.shape[1]):
            residual[c, r] += seen_from(rows, c, r, child, change, k, d)
        if parent != GROUND:
            for r in range(rows.soft.shape[1]):
                rows.step[c, r] = residual[c, r] + seen_from(rows, c, r, 1 - child, change, parent, d)
            add_product(change, parent, forest.gain, k, rows.step, c, -1.0)
    for k in range(forest.order.shape[0] - 1, -1, -1):
        c, child, parent = forest.order[k], forest.side[k], forest.parent[k]
        if parent != GROUND:
            for r in range(rows.soft.shape[1]):
                residual[c, r] += seen_from(rows, c, r, 1 - child, change, parent, d)
        for r in range(rows.soft.shape[1]):
            step = 0.0
            for s in range(rows.soft.shape[1]):
                step -= rows.inverse[c, r, s] * residual[c, s]
            rows.step[c, r] = step
        add_product(change, k, forest.lever, k, rows.step, c, 1.0)


@device
def add_product(change, place, matrix, k, p, c, sign):
    """w <- w + sign matrix p."""
    for n in range(change.shape[1]):
        total = 0.0
        for r in range(p.shape[1]):
            total += matrix[k, n, r] * p[c, r]
        change[place, n] += sign * total
