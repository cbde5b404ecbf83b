"""Newton's method, its linear systems solved by conjugate gradients: minimises an energy without forming a matrix.

    H(p) D = -g(p),      p <- p + t D,      t = 1, 1/2, 1/4, ... until F falls by 1e-4 t D.g (Armijo)

CG is preconditioned by the inverse d x d blocks of the particles and solves no more exactly than Newton's method can
use: its error is to be a part eta = 0.9 (|D|_H / |D_before|_H)^2 of D, at most 0.1 (Eisenstat & Walker 1996, choice
2). What CG's last iteration gained, times their number, stands for the square of its error (Nash & Sofer 1990); all
lengths are in the energy norm |D|_H, which is at least |D|_M where no spring is compressed.

Where CG meets negative curvature q.Hq <= 0, compressed springs buckle: p moves along q to where F is lowest, and
takes a step of the convex Hessian. So a solve leaves the saddles near which it comes, and ends only by steps of the
exact Hessian.

Limits: a local minimum, the one downhill of the start; a cloth of large h^2/(alpha m) that buckles has many. What is
exactly symmetric stays so, on a saddle too: CG sees no direction in which the gradient has no part.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pbd.routine import routine
from pbd.solvers.conjugate_gradients import ConjugateGradients, combine, precondition, product, solve_linear
from pbd.solvers.elastic_energy import Springs, inertia, linearise, make_convex, value
from pbd.vector import Store, copy

MOST_STEPS = 100
MOST_HALVINGS = 40
ARMIJO = 1e-4
FORCING = 0.1
"""The largest eta."""

PART = 0.3
"""Of the error that is allowed in the end: what CG may leave of it."""

ROUND_OFF = 1e-14
"""Of F: a smaller change is none."""

NEARBY = 1e-3
"""Of the distance moved: where the search along negative curvature begins."""

RESYNCHRONISED, NEWTON, STEPS, PRODUCTS = range(4)
"""Places in the counters: solves by re-synchronisation alone, solves by Newton's method, its steps, CG iterations."""


class Accuracy(NamedTuple):
    """``tolerance`` of |p - x*|_M over |p - x_hat|_M, and round-off: of |p - x*|_H and of |g|_(M^-1)."""

    tolerance: float
    floor: float
    floor_of_residual: float


class Workspace(NamedTuple):
    """The springs at p, the gradient (n,), ``start`` (n,) of a search, and what CG needs."""

    springs: Springs
    gradient: Store
    start: Store
    linear: ConjugateGradients


@routine
def newton(energy, work, p, accuracy, count):
    """Bring p to the minimum; returns whether it is met.

    After a whole step D of the exact Hessian the error is what CG left, and - convergence being faster than linear -
    at most |D|_H times the ratio of the last two |D|_H.
    """
    forcing, before = FORCING, math.inf
    for _ in range(MOST_STEPS):
        allowed = max(accuracy.tolerance * math.sqrt(inertia(energy, p)), accuracy.floor)
        exact, length, left = direction(energy, work, p, (forcing, PART * allowed), count)
        part = search(energy, work, p, length, accuracy.floor)
        count[STEPS] += 1
        if part == 0.0:
            return False
        whole = exact and part == 1.0
        ratio = min(length / before, 1.0) if before < math.inf else 1.0
        if whole and length * ratio + left <= allowed:
            return True
        forcing = min(FORCING, 0.9 * ratio * ratio)
        before = length if whole else math.inf
    return False


@routine
def direction(energy, work, p, goal, count):
    """The step D: (whether by the exact Hessian, |D|_H, error of that). Negative curvature moves p first."""
    springs, linear, gradient = work.springs, work.linear, work.gradient
    linearise(energy, p, springs, gradient)
    if precondition(energy, springs, linear.block):
        length, left = solve_linear(energy, work, goal, count)
        if length >= 0.0:
            return True, length, left
        buckle(energy, work, p)
        linearise(energy, p, springs, gradient)
    make_convex(energy, springs)
    precondition(energy, springs, linear.block)
    length, left = solve_linear(energy, work, goal, count)
    return False, length, left


@routine
def search(energy, work, p, length, floor):
    """Move p by the part of D that lowers F enough, or as far as round-off shows; returns it, 0 for none."""
    copy(work.start, p)
    before = value(energy, p, work.springs)
    slack = floor * math.sqrt(2.0 * before) + ROUND_OFF * before
    part = 1.0
    for _ in range(MOST_HALVINGS):
        advance(p, work.start, part, work.linear.solution)
        if value(energy, p, work.springs) <= before + slack - ARMIJO * part * length * length:
            return part
        part *= 0.5
    copy(p, work.start)
    return 0.0


@routine
def buckle(energy, work, p):
    """Move p along the direction q of negative curvature, downhill, by doubling the way while F falls."""
    q = work.linear.direction
    copy(work.start, p)
    part = NEARBY * math.sqrt(inertia(energy, p) / weight(energy.mass, q))
    if product(work.gradient, q) > 0.0:
        part = -part
    lowest, best = value(energy, p, work.springs), 0.0
    for _ in range(MOST_HALVINGS):
        advance(p, work.start, part, q)
        now = value(energy, p, work.springs)
        if now < lowest:
            lowest, best = now, part
            part *= 2.0
        elif best == 0.0:
            part *= 0.25
        else:
            break
    advance(p, work.start, best, q)


@routine
def weight(mass, q):
    """|q|_M^2."""
    total = 0.0
    for k in range(len(q)):
        for i in range(mass.shape[0]):
            total += mass[i] * q[k][i] * q[k][i]
    return total


@routine
def advance(p, start, part, step):
    """p <- start + part step."""
    for k in range(len(p)):
        combine(p[k], start[k], part, step[k])
