"""XPBD whose positions are brought back in line with its multipliers, so that it converges to implicit Euler.

XPBD sums corrections along gradients of changing iterates. Where it stops changing, p - x_hat is no W J(p)^T l, for
any l: 1 % away on a cloth at large steps, after however many iterations. Every few sweeps the positions are therefore
made anew,

    p <- x_hat + W J(p)^T l,        and where that repeats itself, l = -C/s, the gradient g of the energy vanishes.

Limit: it converges only where springs are soft against m/h^2. The residual |g(p)|_(M^-1), which is at least
|p - x*|_M where no spring is compressed, is the guard: it must fall fast, or Newton's method is the faster one.
"""

from __future__ import annotations

import math
from typing import Any

from pbd.intrinsics import typed
from pbd.projection import project, scatter
from pbd.routine import routine
from pbd.solvers.elastic_energy import inertia, linearise
from pbd.stages import evaluate, size
from pbd.vector import copy

GUARD = 0.1
"""The residual must fall to this part of itself in every round of sweeps."""


@routine
def resynchronised(solver, batches, state, h):
    """Whether rounds of sweeps brought p = x_hat to the minimum; if not, p is the best of what they found.

    The first round begins with the multipliers of the springs at the start of the step.
    """
    work, particles = solver.work, state.particles
    balance(batches, particles.x)
    resynchronise(batches, solver, particles, particles.x)
    before = residual(solver.energy, work, particles)
    while not met(solver, particles, before):
        copy(work.start, particles.p)
        for _ in range(solver.period):
            project(batches, state, h)
        resynchronise(batches, solver, particles, particles.p)
        now = residual(solver.energy, work, particles)
        if not now <= GUARD * before and not met(solver, particles, now):
            if not now <= before:
                copy(particles.p, work.start)
            return False
        before = now
    return True


@routine
def met(solver, particles, now):
    """Whether a residual is small enough."""
    moved = math.sqrt(inertia(solver.energy, particles.p))
    return now <= max(solver.accuracy.tolerance * moved, solver.accuracy.floor_of_residual)


@routine
def residual(energy, work, particles):
    """|g(p)|_(M^-1), in the units of |p - x_hat|_M."""
    linearise(energy, particles.p, work.springs, work.gradient)
    total = 0.0
    for k in range(len(particles.p)):
        for i in range(particles.w.shape[0]):
            total += particles.w[i] * work.gradient[k][i] * work.gradient[k][i]
    return math.sqrt(total)


@routine
def resynchronise(batches, solver, particles, at):
    """p <- x_hat + W J(at)^T l; ``at`` may be p."""
    fixed = solver.work.gradient
    copy(fixed, at)
    copy(particles.p, solver.energy.predicted)
    pull(batches, particles, fixed)


def pull(batches: tuple, particles: Any, at: Any) -> None:
    """p <- p + W J(at)^T l, over all batches."""
    for batch in batches:
        pull_one(batch, particles, at)


@typed(pull)
def _pull(batches: Any, particles: Any, at: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, particles, at: None

    def first(batches, particles, at):
        pull_one(batches[0], particles, at)
        pull(batches[1:], particles, at)

    return first


@routine
def pull_one(batch, particles, at):
    """The same for one batch."""
    for c in range(size(batch)):
        indices, _, gradients, _ = evaluate(batch, c, at)
        scatter(particles, indices, gradients, batch.law.multiplier[c])


def balance(batches: tuple, x: Any) -> None:
    """l <- -C(x)/s, the multipliers of springs at x, in all batches."""
    for batch in batches:
        balance_one(batch, x)


@typed(balance)
def _balance(batches: Any, x: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, x: None

    def first(batches, x):
        balance_one(batches[0], x)
        balance(batches[1:], x)

    return first


@routine
def balance_one(batch, x):
    """The same for one batch."""
    for c in range(size(batch)):
        _, stretch, _, _ = evaluate(batch, c, x)
        batch.law.multiplier[c] = -stretch / batch.law.scaled[c]
