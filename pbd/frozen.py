"""Constraints as SHAKE sees them: corrected along the gradients of the start of the step, and, on velocities.

Both wrap a batch, so that any solver that projects constraints projects these.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pbd.intrinsics import typed
from pbd.jit import device
from pbd.projection import scatter
from pbd.stages import evaluate, size
from pbd.vector import Store, accumulate, dot, like, load


class Frozen(NamedTuple):
    """C(p) = 0, corrected along the gradients g(x) at the ``start`` x of the step (Ryckaert et al. 1977).

        dl = -C(p) / sum_j w_j g_j(x) . g_j(p),    p_j <- p_j + w_j dl g_j(x),    v_j <- v_j + w_j dl g_j(x) / h

    the denominator being the derivative of C along the correction, as Newton's method wants it.
    """

    batch: Any
    start: Store

    def project(self, state, h):
        particles = state.particles
        for c in range(size(self.batch)):
            indices, value, now, _ = evaluate(self.batch, c, particles.p)
            _, _, gradients, _ = evaluate(self.batch, c, self.start)
            change = -value * inverse_product(particles.w, indices, gradients, now)
            scatter(particles, indices, gradients, change)
            for j in range(len(indices)):
                accumulate(particles.v, indices[j], particles.w[indices[j]] * change / h, gradients[j])
        state.work[0] += size(self.batch)


class Tangent(NamedTuple):
    """sum_j g_j(x) . v_j = 0 at positions ``at``: velocities along which C does not change (RATTLE, Andersen 1983)."""

    batch: Any
    at: Store

    def project(self, state, h):
        particles = state.particles
        for c in range(size(self.batch)):
            indices, _, gradients, _ = evaluate(self.batch, c, self.at)
            rate = like(particles.w[0], 0.0)
            for j in range(len(indices)):
                rate += dot(gradients[j], load(particles.v, indices[j]))
            change = -rate * inverse_product(particles.w, indices, gradients, gradients)
            for j in range(len(indices)):
                accumulate(particles.v, indices[j], particles.w[indices[j]] * change, gradients[j])
        state.work[0] += size(self.batch)


@device
def inverse_product(w, indices, a, b):
    """1 / sum_j w_j a_j . b_j; 0 where nothing can move."""
    total = 0.0
    for j in range(len(indices)):
        total += w[indices[j]] * dot(a[j], b[j])
    return 1.0 / total if total != 0.0 else 0.0


def frozen(batches: tuple, x: Store) -> tuple:
    """Every batch as `Frozen` at positions x."""
    return tuple(Frozen(batch, x) for batch in batches)


@typed(frozen)
def _frozen(batches: Any, x: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, x: ()
    return lambda batches, x: (Frozen(batches[0], x),) + frozen(batches[1:], x)


def tangent(batches: tuple, x: Store) -> tuple:
    """Every batch as `Tangent` at positions x."""
    return tuple(Tangent(batch, x) for batch in batches)


@typed(tangent)
def _tangent(batches: Any, x: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, x: ()
    return lambda batches, x: (Tangent(batches[0], x),) + tangent(batches[1:], x)
