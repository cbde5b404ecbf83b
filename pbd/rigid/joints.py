"""Joints of rigid bodies: shared points, hinges and distances, rigid or springs of a compliance alpha.

With C the error of a joint, a sub-step of RATTLE (`pbd.integrators.rattle`) gives it the impulses p and p' such that

    theta C(x + h v) + (1 - theta) C(x) + (2 alpha/h) p = 0             in the position pass,
    J v + D (p' - p) = 0                                                in the velocity pass,

    D = w (c/z)^2,  z = h^2 w/alpha,  s = D/(w + D),  theta = 1 - s/2,  w the mean of J M^-1 J^T, c = `RESOLVED`.

A rigid joint has D = s = 0: C = 0 at the end, then J v = 0. A spring that the sub-step resolves has s near 1,
theta = 1/2 and p' = p: the trapezoidal rule, of second order. One that it does not resolve is damped, and tends to a
rigid joint. For linear motion its energy changes by -(theta - 1/2)/alpha |dC|^2 - |J v|^2/D and less, never upwards,
whatever is coupled to what; and at rest a load F is held at C = -alpha F for every sub-step. Deviation from XPBD
(Macklin et al. 2016; Mueller et al. 2020): that is of first order, and damps also what is resolved.

Joints that form trees are solved at once (`pbd.rigid.joint_tree`), not one by one. Limit: impulses act along the
gradients of their pose, so that the swinging of a body across a force F, of angular frequency sqrt(F r/I) at an arm r,
or sqrt(F/(m L)) at a distance L, must be resolved: h times it < 2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pbd.rigid.joint_kinds import change, locate
from pbd.rigid.joint_rows import (
    ALPHA,
    BIAS,
    DIRECTION,
    ERROR,
    FORCE,
    IMPULSE,
    INVERSE,
    MOBILITY,
    SOFT,
    STEP,
    WEIGHT,
    JointRows,
    complete,
    invert,
    push,
    softness,
    solve_alone,
    speeds,
    springiness,
    take_step,
    weigh,
)
from pbd.rigid.joint_tree import JOINT, Forest, factorise, solve_forest
from pbd.rigid.swing import swing
from pbd.routine import routine
from pbd.state import CHANGE, SIZE


class Joints(NamedTuple):
    """Joints of one kind, see `pbd.rigid.joint_kinds`, their rows, and how they hang together; number of bodies."""

    kind: Any
    rows: JointRows
    forest: Forest
    bodies: int

    def made_for(self) -> tuple[int, int]:
        """Number and dimension of the bodies (called by Python)."""
        return self.bodies, self.rows.lever.shape[-1] // 3 + 1

    def mark(self, state):
        mark_all(self, state)

    def warm_start(self, state, h):
        warm_start_all(self, state, h)

    def foresee(self, state, h, whole):
        foresee_all(self, state, h, whole)

    def project(self, state, h):
        project_all(self, state, h)

    def extrapolate(self, state, share):
        extrapolate_all(self, state, share)

    def turn_over(self, state, h, strikes):
        turn_over_all(self, state, h)

    def settle(self, state, h, steady):
        settle_all(self, state, h, steady)


@routine
def mark_all(joints, state):
    """No impulse yet; after the first sub-step the rows are at the present pose."""
    number = joints.rows.number
    for c in range(number.shape[1]):
        if number[MOBILITY, c, 0] == 0.0:
            locate(joints.kind, c, joints.rows, state.bodies)
            weigh(joints.rows, c, len(state.bodies.x))
        for r in range(number.shape[2]):
            number[IMPULSE, c, r] = 0.0


@routine
def warm_start_all(joints, state, h):
    """Rigid joints start from their last force; springs from none, or what a loop is not swept out of would grow."""
    number = joints.rows.number
    for c in range(number.shape[1]):
        for r in range(number.shape[2]):
            impulse = 0.5 * h * number[FORCE, c, r] if number[ALPHA, c, r] == 0.0 else 0.0
            number[STEP, c, r] = impulse - number[IMPULSE, c, r]
            number[IMPULSE, c, r] = impulse
        push(joints.rows, c, state.bodies.motion)


@routine
def foresee_all(joints, state, h, whole):
    """The law of the position pass over theta h; in a part of a sub-step a rigid error is undone at the rate of all."""
    number = joints.rows.number
    for c in range(number.shape[1]):
        for r in range(number.shape[2]):
            s = springiness(number, c, r, h)
            factor = (s + (1.0 - s) * h / whole) / (h * (1.0 - 0.5 * s))
            number[BIAS, c, r] = factor * number[ERROR, c, r]
            number[SOFT, c, r] = factor * 2.0 * number[ALPHA, c, r] / h
    prepare(joints.forest, joints.rows, state.bodies.motion)


@routine
def prepare(forest, rows, motion):
    """(K + soft)^-1 of what is swept, and the factors of what is not."""
    factorise(forest, rows, motion)
    for k in range(forest.loops.shape[0]):
        c = forest.loops[k]
        for r in range(rows.square.shape[2]):
            for s in range(rows.square.shape[2]):
                rows.square[INVERSE, c, r, s] = rows.square[WEIGHT, c, r, s]
            rows.square[INVERSE, c, r, r] += rows.number[SOFT, c, r]
        invert(rows.square, INVERSE, c)


@routine
def project_all(joints, state, h):
    rows, branch, loops, motion = joints.rows, joints.forest.branch, joints.forest.loops, state.bodies.motion
    change, size = 0.0, 0.0
    for k in range(branch.shape[0]):
        set_residual(joints, branch[k, JOINT], state.bodies, h)
    solve_forest(joints.forest, rows)
    for k in range(branch.shape[0] + loops.shape[0]):
        c = branch[k, JOINT] if k < branch.shape[0] else loops[k - branch.shape[0]]
        if k >= branch.shape[0]:
            set_residual(joints, c, state.bodies, h)
            solve_alone(rows.number, rows.square, c)
        changed, sized = take_step(rows, c, motion)
        change, size = change + changed, size + sized
    state.signals[CHANGE] += change
    state.signals[SIZE] += size
    state.work[0] += rows.pair.shape[0]


@routine
def set_residual(joints, c, bodies, h):
    """Of joint c in the pass at hand; h is 0 for velocities."""
    rows = joints.rows
    if h > 0.0:
        turns = swing(bodies, rows.pair[c, 0], h), swing(bodies, rows.pair[c, 1], h)
        change(joints.kind, c, rows, bodies, turns, h)
    else:
        speeds(rows, c, bodies.motion)
    complete(rows.number, c)


@routine
def extrapolate_all(joints, state, share):
    number = joints.rows.number
    for c in range(number.shape[1]):
        for r in range(number.shape[2]):
            step = share * number[DIRECTION, c, r]
            number[DIRECTION, c, r] = step + number[STEP, c, r]
            number[IMPULSE, c, r] += step
            number[STEP, c, r] = step
        if share != 0.0:
            push(joints.rows, c, state.bodies.motion)


@routine
def turn_over_all(joints, state, h):
    rows, number = joints.rows, joints.rows.number
    for c in range(number.shape[1]):
        locate(joints.kind, c, rows, state.bodies)
        weigh(rows, c, len(state.bodies.x))
        for r in range(number.shape[2]):
            number[SOFT, c, r] = softness(number, c, r, h)
            number[BIAS, c, r] = -number[SOFT, c, r] * number[IMPULSE, c, r]
            number[IMPULSE, c, r] = 0.0
    prepare(joints.forest, rows, state.bodies.motion)


@routine
def settle_all(joints, state, h, steady):
    number = joints.rows.number
    if steady:
        for c in range(number.shape[1]):
            for r in range(number.shape[2]):
                number[FORCE, c, r] = 2.0 / h * number[IMPULSE, c, r]
