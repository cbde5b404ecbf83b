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

from pbd.rigid.joint_rows import invert, solve_alone
from pbd.routine import routine

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


@routine
def factorise(forest, rows, motion):
    """S^-1 (into ``rows.inverse``), lever and gain of all joints, at the present pose and softness."""
    for k in range(forest.body.shape[0]):
        set_answer(forest.answer, k, motion, forest.body[k])
    for k in range(forest.order.shape[0]):
        c, child = forest.order[k], forest.side[k]
        levered(forest.answer, k, rows.gradient, c, child, forest.lever, k)
        along(rows.gradient, c, child, forest.lever, k, rows.inverse, c)
        for r in range(rows.soft.shape[1]):
            rows.inverse[c, r, r] += rows.soft[c, r]
        if forest.parent[k] != GROUND:
            hang(forest, rows, k)
        invert(rows.inverse, c)


@routine
def hang(forest, rows, k):
    """What hangs on the joint at place k, whose ``rows.inverse`` still holds S, becomes part of its parent's answer."""
    c, parent, lever, inner, gain = forest.order[k], forest.parent[k], forest.scratch, forest.inner, forest.gain
    count, size = inner.shape[1], lever.shape[1]
    levered(forest.answer, parent, rows.gradient, c, 1 - forest.side[k], lever, 0)
    along(rows.gradient, c, 1 - forest.side[k], lever, 0, inner, 0)
    for r in range(count):
        for s in range(count):
            inner[0, r, s] += rows.inverse[c, r, s]
    invert(inner, 0)
    for n in range(size):
        for r in range(count):
            total = 0.0
            for s in range(count):
                total += lever[0, n, s] * inner[0, s, r]
            gain[k, n, r] = total
        for m in range(n + 1):
            total = forest.answer[parent, n, m]
            for r in range(count):
                total -= gain[k, n, r] * lever[0, m, r]
            forest.answer[parent, n, m] = forest.answer[parent, m, n] = total


@routine
def set_answer(answer, k, motion, i):
    """B = M^-1 of body i."""
    size = answer.shape[1]
    d = size // 3 + 1
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


@routine
def levered(answer, k, gradient, c, side, out, place):
    """out <- B J^T."""
    for n in range(out.shape[1]):
        for r in range(out.shape[2]):
            total = 0.0
            for m in range(out.shape[1]):
                total += answer[k, n, m] * gradient[c, side, r, m]
            out[place, n, r] = total


@routine
def along(gradient, c, side, lever, place, out, k):
    """out <- J lever."""
    for r in range(out.shape[1]):
        for s in range(out.shape[2]):
            total = 0.0
            for n in range(lever.shape[1]):
                total += gradient[c, side, r, n] * lever[place, n, s]
            out[k, r, s] = total


@routine
def solve_forest(forest, rows):
    """step <- the impulses of all joints of the trees that make their residuals 0, to first order."""
    change, step = forest.change, rows.step
    for k in range(change.shape[0]):
        for n in range(change.shape[1]):
            change[k, n] = 0.0
    for k in range(forest.order.shape[0]):
        c, parent = forest.order[k], forest.parent[k]
        observe(rows, c, forest.side[k], change, k)
        if parent != GROUND:
            for r in range(step.shape[1]):
                step[c, r] = rows.residual[c, r]
            observe(rows, c, 1 - forest.side[k], change, parent)
            for r in range(step.shape[1]):
                step[c, r], rows.residual[c, r] = -rows.residual[c, r], step[c, r]
            add_product(change, parent, forest.gain, k, step, c)
    for k in range(forest.order.shape[0] - 1, -1, -1):
        c, parent = forest.order[k], forest.parent[k]
        if parent != GROUND:
            observe(rows, c, 1 - forest.side[k], change, parent)
        solve_alone(rows, c)
        add_product(change, k, forest.lever, k, step, c)


@routine
def observe(rows, c, side, change, k):
    """residual <- residual + J w."""
    for r in range(rows.residual.shape[1]):
        total = rows.residual[c, r]
        for n in range(change.shape[1]):
            total += rows.gradient[c, side, r, n] * change[k, n]
        rows.residual[c, r] = total


@routine
def add_product(change, place, matrix, k, p, c):
    """w <- w + matrix p."""
    for n in range(change.shape[1]):
        total = change[place, n]
        for r in range(p.shape[1]):
            total += matrix[k, n, r] * p[c, r]
        change[place, n] = total
