"""K^-1 of a contact in space, for the impulses that make it stick at all its points.

K has seven rows, of which rigid bodies can tell six apart: with four points a pattern of normal impulses does nothing.
A slightly larger diagonal makes K regular and chooses the impulses of least norm, which shares a symmetric load
symmetrically; sweeps remove what that leaves of the residual, a factor REGULAR at a time.
"""

from __future__ import annotations

import math

from pbd.jit import device
from pbd.rigid import block_3d as at

REGULAR = 1e-4
"""Over the normals' diagonal. With 1e-9 errors of rounding in how load is shared move a stack of 20 by a millimetre."""

SAME = 1e-4
"""K is that of the stored K^-1 while its probes have changed by less than this share."""

ROWS = 7

FIRST = (0.71, -0.43, 0.37, -0.59, 0.83, -0.31, 0.47)
SECOND = (-0.29, -0.67, 0.53, 0.41, 0.23, 0.79, -0.61)
"""Vectors z without a symmetry of a contact: z.K z tells when K changes, and when points or directions swap."""


@device
def has_changed(row, c, points, mass):
    """Whether K has changed so much that K^-1 no longer serves; then the new probes are stored.

    A slightly old K^-1 costs sweeps, not accuracy, since speeds are those of the present pose. One of other points, or
    that has aged little by little, would make sweeps diverge.
    """
    first, second = probe(row, c, points, mass, FIRST), probe(row, c, points, mass, SECOND)
    old_first, old_second = row[c, at.PROBES], row[c, at.PROBES + 1]
    if abs(first - old_first) <= SAME * old_first and abs(second - old_second) <= SAME * old_second:
        return False
    row[c, at.PROBES], row[c, at.PROBES + 1] = first, second
    return True


@device
def probe(row, c, points, mass, z):
    """z.K z, the rows of points that are not there left out."""
    push = 0.0
    for k in range(points):
        push += z[k]
    total = mass * (push * push + z[4] * z[4] + z[5] * z[5])
    for axis in range(6):
        moment, turn = 0.0, 0.0
        for r in range(ROWS):
            if r < points or r >= at.POINTS:
                moment += z[r] * row[c, moments(r) + axis]
                turn += z[r] * row[c, moments(r) + 6 + axis]
        total += moment * turn
    return total


@device
def set_inverse(rows, c, bodies, points):
    """Store K^-1 of contact c, 0 in the rows of points it lacks."""
    k = rows.square
    fill(rows.row, c, bodies.motion[rows.pair[c, 0], 6] + bodies.motion[rows.pair[c, 1], 6], points, k)
    factor(k)
    invert(k)
    for r in range(ROWS):
        for s in range(r + 1):
            absent = points <= r < at.POINTS or points <= s < at.POINTS
            rows.row[c, at.WHOLE + r * (r + 1) // 2 + s] = 0.0 if absent else k[r, s]


@device
def moments(r):
    """Where the moments of row r begin."""
    return at.ARMS + 12 * r


@device
def fill(row, c, mass, points, k):
    """The lower half of K; the unit matrix in the rows of points that are not there."""
    for r in range(ROWS):
        for s in range(r + 1):
            if points <= r < at.POINTS or points <= s < at.POINTS:
                k[r, s] = 1.0 if r == s else 0.0
                continue
            same = (r < at.POINTS and s < at.POINTS) or (r == s and r < ROWS - 1)
            total = mass if same else 0.0
            a, b = moments(r), moments(s) + 6
            for axis in range(6):
                total += row[c, a + axis] * row[c, b + axis]
            k[r, s] = total
        if r < at.POINTS:
            k[r, r] *= 1.0 + REGULAR


@device
def factor(k):
    """K = L L^T, in place (Cholesky)."""
    for r in range(ROWS):
        for s in range(r + 1):
            total = k[r, s]
            for m in range(s):
                total -= k[r, m] * k[s, m]
            k[r, s] = math.sqrt(max(total, 1e-300)) if r == s else total / k[s, s]


@device
def invert(k):
    """(L L^T)^-1 into the lower half: first L^-1, then its product with its transpose."""
    for s in range(ROWS):
        k[s, s] = 1.0 / k[s, s]
        for r in range(s + 1, ROWS):
            total = 0.0
            for m in range(s, r):
                total -= k[r, m] * k[m, s]
            k[r, s] = total / k[r, r]
    for r in range(ROWS):
        for s in range(r + 1):
            total = 0.0
            for m in range(r, ROWS):
                total += k[m, r] * k[m, s]
            k[r, s] = total
