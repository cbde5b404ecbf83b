"""Trees of joints, solved at once: however many bodies hang together, and however unequal their masses.

Sought are impulses p with J M^-1 J^T p + soft p = -residual. From the leaves inwards, each joint between a body b and
its parent a, seen from a, is a measurement of how a moves:

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

from pbd.rigid.joint_rows import GRADIENT, INVERSE, JOINED, RESIDUAL, SOFT, STEP, invert, solve_alone
from pbd.routine import routine

GROUND = -1
"""In the place of a parent that nothing moves."""


JOINT, SIDE, PARENT = range(3)
"""Columns of `Forest.branch`: the joint; 0 or 1, which of its bodies is the child; place of the other, or GROUND."""

LEVER, GAIN, SCRATCH = range(3)
"""Places in `Forest.arm`: B_b J_b^T, W, and what becomes of them."""


class Forest(NamedTuple):
    """t joints from the leaves inwards. A body's place is that of the joint to its parent; roots stand behind.

    branch (t, 3)
    body (places,) : the body of each place
    loops : the joints that close one
    answer (places, N, N), change (places, N) : B and w; N = 3 or 6 velocities, of motion and spin
    arm (3, t, N, R)
    """

    branch: np.ndarray
    body: np.ndarray
    loops: np.ndarray
    answer: np.ndarray
    change: np.ndarray
    arm: np.ndarray


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
            roots += [root] if root != GROUND else []
            found += _branches(root, joints_at, ends, seen)
    found.reverse()
    t, places = len(found), len(found) + len(roots)
    place = {child: k for k, (_, child, _) in enumerate(found)} | {root: t + k for k, root in enumerate(roots)}
    place[GROUND] = GROUND
    branch = [(c, int(ends[c, 1] == child), place[parent]) for c, child, parent in found]
    return Forest(
        branch=np.array(branch, dtype=np.int64).reshape(t, 3),
        body=np.array([child for _, child, _ in found] + roots, dtype=np.int64),
        loops=np.setdiff1d(np.arange(len(pairs)), [c for c, _, _ in found]).astype(np.int64),
        answer=np.zeros((places, velocities, velocities)),
        change=np.zeros((places, velocities)),
        arm=np.zeros((3, t, velocities, rows)),
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
    """INVERSE, LEVER and GAIN of all joints, at the present pose and softness."""
    for k in range(forest.body.shape[0]):
        set_answer(forest.answer, k, motion, forest.body[k])
    for k in range(forest.branch.shape[0]):
        c, child = forest.branch[k, JOINT], forest.branch[k, SIDE]
        levered(forest.answer, k, rows.lever, c, child, forest.arm, LEVER, k)
        along(rows.lever, c, child, forest.arm, LEVER, k, rows.square, INVERSE)
        for r in range(rows.number.shape[2]):
            rows.square[INVERSE, c, r, r] += rows.number[SOFT, c, r]
        if forest.branch[k, PARENT] != GROUND:
            hang(forest, rows, k)
        invert(rows.square, INVERSE, c)


@routine
def hang(forest, rows, k):
    """What hangs on the joint at place k, of which INVERSE still holds S, becomes part of its parent's answer."""
    c, parent, arm, square = forest.branch[k, JOINT], forest.branch[k, PARENT], forest.arm, rows.square
    side = 1 - forest.branch[k, SIDE]
    levered(forest.answer, parent, rows.lever, c, side, arm, SCRATCH, k)
    along(rows.lever, c, side, arm, SCRATCH, k, square, JOINED)
    for r in range(square.shape[2]):
        for s in range(square.shape[2]):
            square[JOINED, c, r, s] += square[INVERSE, c, r, s]
    invert(square, JOINED, c)
    for n in range(arm.shape[2]):
        for r in range(arm.shape[3]):
            total = 0.0
            for s in range(arm.shape[3]):
                total += arm[SCRATCH, k, n, s] * square[JOINED, c, s, r]
            arm[GAIN, k, n, r] = total
        for m in range(n + 1):
            total = forest.answer[parent, n, m]
            for r in range(arm.shape[3]):
                total -= arm[GAIN, k, n, r] * arm[SCRATCH, k, m, r]
            forest.answer[parent, n, m] = forest.answer[parent, m, n] = total


@routine
def set_answer(answer, k, motion, i):
    """B = M^-1 of body i."""
    size = answer.shape[1]
    d = size // 3 + 1
    for n in range(size):
        for m in range(size):
            answer[k, n, m] = motion[i, size] if n == m and n < d else 0.0
    column = size + 1
    for n in range(d, size):
        for m in range(n, size):
            answer[k, n, m] = answer[k, m, n] = motion[i, column]
            column += 1


@routine
def levered(answer, place, lever, c, side, arm, which, k):
    """An arm <- B J^T."""
    for n in range(arm.shape[2]):
        for r in range(arm.shape[3]):
            total = 0.0
            for m in range(arm.shape[2]):
                total += answer[place, n, m] * lever[GRADIENT, c, side, r, m]
            arm[which, k, n, r] = total


@routine
def along(lever, c, side, arm, which, k, square, where):
    """A matrix of joint c <- J times an arm."""
    for r in range(square.shape[2]):
        for s in range(square.shape[2]):
            total = 0.0
            for n in range(arm.shape[2]):
                total += lever[GRADIENT, c, side, r, n] * arm[which, k, n, s]
            square[where, c, r, s] = total


@routine
def solve_forest(forest, rows):
    """STEP <- the impulses of all joints of the trees that make their residuals 0, to first order."""
    change, number, branch = forest.change, rows.number, forest.branch
    for k in range(change.shape[0]):
        for n in range(change.shape[1]):
            change[k, n] = 0.0
    for k in range(branch.shape[0]):
        c, child, parent = branch[k, JOINT], branch[k, SIDE], branch[k, PARENT]
        observe(number, RESIDUAL, c, rows.lever, child, change, k)
        if parent != GROUND:
            for r in range(number.shape[2]):
                number[STEP, c, r] = number[RESIDUAL, c, r]
            observe(number, STEP, c, rows.lever, 1 - child, change, parent)
            add_product(change, parent, -1.0, forest.arm, GAIN, k, number, c)
    for k in range(branch.shape[0] - 1, -1, -1):
        c, child, parent = branch[k, JOINT], branch[k, SIDE], branch[k, PARENT]
        if parent != GROUND:
            observe(number, RESIDUAL, c, rows.lever, 1 - child, change, parent)
        solve_alone(number, rows.square, c)
        add_product(change, k, 1.0, forest.arm, LEVER, k, number, c)


@routine
def observe(number, where, c, lever, side, change, k):
    """RESIDUAL or STEP <- itself + J w."""
    for r in range(number.shape[2]):
        total = number[where, c, r]
        for n in range(change.shape[1]):
            total += lever[GRADIENT, c, side, r, n] * change[k, n]
        number[where, c, r] = total


@routine
def add_product(change, place, sign, arm, which, k, number, c):
    """w <- w + sign times an arm times STEP."""
    for n in range(change.shape[1]):
        total = 0.0
        for r in range(number.shape[2]):
            total += arm[which, k, n, r] * number[STEP, c, r]
        change[place, n] += sign * total
