"""The generic projection: what turns a constraint's evaluate() into a position correction.

With C, its gradients g_j and W = sum_j w_j |g_j|^2, each law gives a multiplier increment dl and every
particle moves by w_j dl g_j (convention dx = + W g dl, so dl = -C/W for a rigid constraint):

    Hard             dl = -C / W                                             PBD 2006 eq. 8-9, k = 1
    Scaled           dl = -k' C / W                                          PBD 2006 section 3.3
    Compliant        dl = (-C - a l) / (W + a),            a = alpha/h^2     XPBD 2016 eq. 18
    DampedCompliant  dl = (-C - a l - c g.(p - x)) / ((1 + c) W + a),  c = alpha beta / h   eq. 26

Where a constraint's W never changes - a distance - it is divided by once, when the law is bound:

    Weighted             dl = -f C,                 f = k'/W
    WeightedCompliant    dl = (-C - a l) f,         f = 1/(W + a)

An inequality is skipped where satisfied (Hard, Scaled, Weighted); with compliance its total multiplier is
clamped. A compliant law's multiplier l starts at 0 in each (sub-)step; l/h^2 is the constraint force.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from pbd.dispatch import stage
from pbd.intrinsics import prefer_wide_vectors
from pbd.jit import DEVICE_OPTIONS, device
from pbd.stages import evaluate, size
from pbd.vector import Constant, accumulate, at, dot, like, load, subtract

# ------------------------------------------------------------------ relations


@stage(required=True)
def violated(relation, value):
    """True when C = value does not satisfy the relation."""


@stage(required=True)
def clamp(relation, multiplier):
    """The nearest multiplier that the relation allows."""


class Equality(NamedTuple):
    """C = 0."""

    def violated(self, value):
        return True

    def clamp(self, multiplier):
        return multiplier


class AtLeast(NamedTuple):
    """C >= 0: only pushes."""

    def violated(self, value):
        return value < 0.0

    def clamp(self, multiplier):
        return max(multiplier, like(multiplier, 0.0))


class AtMost(NamedTuple):
    """C <= 0: only pulls."""

    def violated(self, value):
        return value > 0.0

    def clamp(self, multiplier):
        return min(multiplier, like(multiplier, 0.0))


# ------------------------------------------------------------------ laws


@stage(required=True)
def increment(law, c, row, particles, h):
    """Multiplier increment of constraint c, whose evaluation is ``row``."""


@stage(required=True)
def of_run(law, r):
    """The law within run r, from one that holds a number for each run: its numbers are then constants."""


@stage
def relax(law, c, change, share):
    """The share of an increment that a relaxed solver applies; a multiplier keeps no more of it."""
    return share * change


@stage
def reset(law):
    """Forget the multipliers of the last (sub-)step."""


class Hard(NamedTuple):
    """Rigid: k = 1."""

    relation: Equality | AtLeast | AtMost

    def increment(self, c, row, particles, h):
        if not violated(self.relation, row[1]):
            return 0.0
        return -row[1] * inverse_weight(particles.w, row, 1.0, 0.0)


class Scaled(NamedTuple):
    """PBD stiffness: ``k`` (m,) is the factor applied in each iteration."""

    relation: Equality | AtLeast | AtMost
    k: np.ndarray

    def increment(self, c, row, particles, h):
        if not violated(self.relation, row[1]):
            return 0.0
        return -row[1] * (self.k[c] * inverse_weight(particles.w, row, 1.0, 0.0))


class Compliant(NamedTuple):
    """XPBD: ``alpha`` (m,) compliance [m/N], ``multiplier`` (m,) [N s^2]."""

    relation: Equality | AtLeast | AtMost
    alpha: np.ndarray
    multiplier: np.ndarray

    def reset(self):
        self.multiplier[:] = 0.0

    def increment(self, c, row, particles, h):
        scaled = self.alpha[c] / (h * h)
        residual = -row[1] - scaled * self.multiplier[c]
        return advance(self, c, residual * inverse_weight(particles.w, row, 1.0, scaled))

    def relax(self, c, change, share):
        self.multiplier[c] -= (like(share, 1.0) - share) * change
        return share * change


class DampedCompliant(NamedTuple):
    """XPBD with damping stiffness ``beta`` (m,) [N s/m]."""

    relation: Equality | AtLeast | AtMost
    alpha: np.ndarray
    beta: np.ndarray
    multiplier: np.ndarray

    def reset(self):
        self.multiplier[:] = 0.0

    def increment(self, c, row, particles, h):
        scaled = self.alpha[c] / (h * h)
        damping = self.alpha[c] * self.beta[c] / h
        residual = -row[1] - scaled * self.multiplier[c] - damping * constraint_motion(row, particles)
        return advance(self, c, residual * inverse_weight(particles.w, row, 1.0 + damping, scaled))


class Weighted(NamedTuple):
    """PBD stiffness of constraints whose W is constant: ``factor`` (m,) is k'/W, 0 where nothing can move."""

    relation: Equality | AtLeast | AtMost
    factor: np.ndarray | Constant

    def of_run(self, r):
        return Weighted(self.relation, Constant(self.factor[r]))

    def increment(self, c, row, particles, h):
        change = -at(self.factor, c) * row[1]
        return change if violated(self.relation, row[1]) else like(change, 0.0)


class WeightedCompliant(NamedTuple):
    """XPBD of constraints whose W is constant, at one sub-step h.

    ``scaled`` (m,) is alpha/h^2 [1/kg], ``factor`` (m,) is 1/(W + alpha/h^2) [kg], 0 where nothing can move.
    """

    relation: Equality | AtLeast | AtMost
    scaled: np.ndarray | Constant
    factor: np.ndarray | Constant
    multiplier: np.ndarray

    def of_run(self, r):
        return WeightedCompliant(self.relation, Constant(self.scaled[r]), Constant(self.factor[r]), self.multiplier)

    def reset(self):
        self.multiplier[:] = 0.0

    def increment(self, c, row, particles, h):
        residual = -row[1] - at(self.scaled, c) * self.multiplier[c]
        return advance(self, c, residual * at(self.factor, c))


@device
def advance(law, c, change):
    """Add ``change`` to multiplier c, clamped to the relation; return what was really added."""
    old = law.multiplier[c]
    new = clamp(law.relation, old + change)
    law.multiplier[c] = new
    return new - old


@device
def inverse_weight(w, row, factor, compliance):
    """1 / (factor sum_j w_j |g_j|^2 + compliance); 0 where nothing can move."""
    indices, _, _, norms = row
    total = 0.0
    for j in range(len(indices)):
        total += w[indices[j]] * norms[j]
    return 1.0 / (factor * total + compliance) if total > 0.0 else 0.0


@device
def constraint_motion(row, particles):
    """sum_j g_j . (p_j - x_j): how far the constraint moved in this (sub-)step."""
    indices, _, gradients, _ = row
    total = 0.0
    for j in range(len(indices)):
        i = indices[j]
        total += dot(gradients[j], subtract(load(particles.p, i), load(particles.x, i)))
    return total


def scatter(particles: Any, indices: tuple[int, ...], gradients: tuple, change: float) -> None:
    """p_j <- p_j + w_j dl g_j for all j of a constraint (in kernels unrolled: 4 % of a chain's step)."""
    for i, gradient in zip(indices, gradients, strict=True):
        accumulate(particles.p, i, at(particles.w, i) * change, gradient)


@overload(scatter, strict=False, jit_options=DEVICE_OPTIONS)
def _scatter(particles: Any, indices: Any, gradients: Any, change: Any) -> Any:
    def last(particles, indices, gradients, change):
        accumulate(particles.p, indices[0], at(particles.w, indices[0]) * change, gradients[0])

    def first(particles, indices, gradients, change):
        accumulate(particles.p, indices[0], at(particles.w, indices[0]) * change, gradients[0])
        scatter(particles, indices[1:], gradients[1:], change)

    return last if len(indices) == 1 else first


# ------------------------------------------------------------------ the stages with defaults


@stage(needs="law")
def begin(batch, state, h):
    """Line 8: what a batch prepares once per (sub-)step - contacts, neighbours; by default its law's reset."""
    reset(batch.law)


@stage(needs="law")
def project(batch, state, h):
    """Line 10: one sweep over the batch in its natural order; by default from evaluate() and its law."""
    sweep(batch, range(size(batch)), state.particles, h)
    state.work[0] += size(batch)


@device
def sweep(batch, constraints, particles, h):
    """Project the constraints of a range, one after the other; whole vectors of them where they are independent."""
    prefer_wide_vectors()
    for c in constraints:
        row = evaluate(batch, c, particles.p)
        change = increment(batch.law, c, row, particles, h)
        indices, _, gradients, _ = row
        scatter(particles, indices, gradients, change)
