"""H D = -g by conjugate gradients (Hestenes & Stiefel 1952), preconditioned by the d x d blocks of the particles.

What is pinned has block 0, so that its D stays 0 whatever reaction its residual holds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pbd.routine import routine, routine_sum
from pbd.solvers.elastic_energy import multiply
from pbd.solvers.incidence import spread
from pbd.vector import Store

MOST_PRODUCTS = 20_000


class ConjugateGradients(NamedTuple):
    """Stores (n,): the solution D, residual r, search direction q, its product H q, and the d*d entries of blocks."""

    solution: Store
    residual: Store
    direction: Store
    product: Store
    block: Store


@routine
def solve_linear(energy, work, goal, count):
    """Solve for D until its error in |.|_H is below the part goal[0] of it, or below goal[1].

    Returns (|D|_H, estimate of the error), (-1, 0) at negative curvature: the direction is left in ``direction``.
    """
    linear = work.linear
    begin(linear, work.gradient)
    rz, square, left = apply(linear.block, linear.residual, linear.product), 0.0, 0.0
    turn(linear.direction, linear.product, 0.0)
    for n in range(MOST_PRODUCTS):
        if rz == 0.0:
            break
        multiply(energy, work.springs, linear.direction, linear.product)
        count[-1] += 1
        curvature = product(linear.direction, linear.product)
        if not curvature > 0.0:
            return -1.0, 0.0
        go(linear, rz / curvature)
        gain = rz * rz / curvature
        square += gain
        left = (n + 1) * gain
        if left <= max(goal[0] * goal[0] * square, goal[1] * goal[1]):
            break
        before = rz
        rz = apply(linear.block, linear.residual, linear.product)
        turn(linear.direction, linear.product, rz / before)
    return math.sqrt(square), math.sqrt(left)


@routine
def begin(linear, gradient):
    """D <- 0, r <- -g, q <- 0."""
    for k in range(len(gradient)):
        for i in range(gradient[k].shape[0]):
            linear.solution[k][i] = 0.0
            linear.residual[k][i] = -gradient[k][i]
            linear.direction[k][i] = 0.0


@routine
def go(linear, a):
    """D <- D + a q, r <- r - a H q."""
    for k in range(len(linear.solution)):
        combine(linear.solution[k], linear.solution[k], a, linear.direction[k])
        combine(linear.residual[k], linear.residual[k], -a, linear.product[k])


@routine
def turn(q, z, b):
    """q <- z + b q."""
    for k in range(len(q)):
        combine(q[k], z[k], b, q[k])


@routine
def combine(out, one, factor, other):
    """out <- one + factor other, one axis."""
    for i in range(out.shape[0]):
        out[i] = one[i] + factor * other[i]


@routine_sum
def product(a, b):
    """a . b."""
    total = 0.0
    for k in range(len(a)):
        for i in range(a[k].shape[0]):
            total += a[k][i] * b[k][i]
    return total


@routine_sum
def apply(block, r, z):
    """z <- B^-1 r; returns r . z."""
    d = len(r)
    total = 0.0
    for k in range(d):
        for i in range(r[k].shape[0]):
            entry = 0.0
            for other in range(d):
                entry += block[k * d + other][i] * r[other][i]
            z[k][i] = entry
            total += entry * r[k][i]
    return total


@routine
def precondition(energy, springs, block):
    """block <- the inverse diagonal blocks of H; returns whether all are positive definite."""
    d = len(springs.normal)
    for entry in range(d * d):
        for i in range(energy.mass.shape[0]):
            block[entry][i] = energy.mass[i] if entry % (d + 1) == 0 else 0.0
    for r in range(energy.links.is_run.shape[0]):
        begin, count = energy.links.start[r], energy.links.start[r + 1] - energy.links.start[r]
        for k in range(d):
            for other in range(k + 1):
                unit = 1.0 if k == other else 0.0
                fill(springs, begin, count, (springs.normal[k], springs.normal[other]), unit)
                spread(energy.links, r, springs.size, 1.0, block[k * d + other])
    for k in range(d):
        for other in range(k):
            for i in range(energy.mass.shape[0]):
                block[other * d + k][i] = block[k * d + other][i]
    return invert(block, energy.mass, d)


@routine
def fill(springs, begin, count, normals, unit):
    """size <- an entry of (k - b) n n^T + b I for the springs of a chunk; ``unit`` is that of I."""
    one, other = normals
    for c in range(count):
        springs.size[c] = (
            springs.along[begin + c] * one[begin + c] * other[begin + c] + unit * springs.across[begin + c]
        )


@routine
def invert(block, mass, d):
    """All blocks at once in place, by Gauss and Jordan without pivoting; 0 for what is pinned."""
    definite = True
    for k in range(d):
        pivot = block[k * d + k]
        for i in range(mass.shape[0]):
            definite = definite and (pivot[i] > 0.0 or mass[i] == 0.0)
            pivot[i] = 1.0 / pivot[i] if mass[i] > 0.0 else 0.0
        for column in range(d):
            if column != k:
                scale(block[k * d + column], pivot, 1.0)
        for row in range(d):
            if row != k:
                eliminate(block, d, row, k)
    return definite


@routine
def eliminate(block, d, row, k):
    """Take pivot row k out of a row."""
    factor = block[row * d + k]
    for column in range(d):
        if column != k:
            take(block[row * d + column], factor, block[k * d + column])
    scale(factor, block[k * d + k], -1.0)


@routine
def scale(entries, factor, sign):
    """entries <- sign factor entries, one by one."""
    for i in range(entries.shape[0]):
        entries[i] *= sign * factor[i]


@routine
def take(entries, factor, others):
    """entries <- entries - factor others, one by one."""
    for i in range(entries.shape[0]):
        entries[i] -= factor[i] * others[i]
