"""The contact of two bodies in the plane, solved exactly: two normals and the tangent they share.

Impulses p = (a, b, t) at a contact's two points change its velocities by K p. Sought is, with w = q + K p,

    a >= 0, w_a >= 0, a w_a = 0, and so for b;     |t + t0| <= mu (a + b + n0), and where that is not sharp w_t = 0,

the complementarity problem of a contact with Coulomb friction (Stewart and Trinkle 1996), where n0 and t0 are impulses
spent before in the same step: one budget. In the plane it has few cases - which points push, whether they stick or
slide, and which way - and each is a linear system in closed form. Swept one by one, the points would share their load,
and with it the friction, wrongly. Where no case fits, which takes friction large enough to jam a slender body, the
points are taken one after the other.
"""

from __future__ import annotations

from typing import NamedTuple

from pbd.jit import device


class Block(NamedTuple):
    """K and its inverse, both symmetric, of the rows a, b, t."""

    aa: float
    ab: float
    bb: float
    at: float
    bt: float
    tt: float


@device
def solve_block(q, k, inverse, spent, mu, points):
    """The impulses (a, b, t): q (3,), k and inverse `Block`, spent = (n0, t0), points 1 or 2."""
    t = held(q[2], k.tt, spent, mu)
    if q[0] + k.at * t >= 0.0 and (points == 1 or q[1] + k.bt * t >= 0.0):
        return 0.0, 0.0, t
    if points == 2:
        fits, a, b, t = both(q, k, inverse, spent, mu)
        if fits:
            return a, b, t
    fits, a, t = single(q[0], q[2], (k.aa, k.at, k.tt), spent, mu)
    if fits and (points == 1 or q[1] + k.ab * a + k.bt * t >= 0.0):
        return a, 0.0, t
    if points == 2:
        fits, b, t = single(q[1], q[2], (k.bb, k.bt, k.tt), spent, mu)
        if fits and q[0] + k.ab * b + k.at * t >= 0.0:
            return 0.0, b, t
    return one_after_the_other(q, k, spent, mu, points)


@device
def held(qt, tt, spent, mu):
    """The friction of a contact that does not push, within what its budget has left; 0 where nothing was spent."""
    limit = mu * spent[0]
    return max(-limit, min(limit, spent[1] - qt / tt)) - spent[1]


@device
def both(q, k, v, spent, mu):
    """Both points push: (whether they do, a, b, t)."""
    a = -(v.aa * q[0] + v.ab * q[1] + v.at * q[2])
    b = -(v.ab * q[0] + v.bb * q[1] + v.bt * q[2])
    t = -(v.at * q[0] + v.bt * q[1] + v.tt * q[2])
    total = t + spent[1]
    if a >= 0.0 and b >= 0.0 and abs(total) <= mu * (a + b + spent[0]):
        return True, a, b, t
    for turn in range(2):
        slope = mu if (total > 0.0) == (turn == 0) else -mu
        shift = slope * spent[0] - spent[1]
        aa, ab = k.aa + slope * k.at, k.ab + slope * k.at
        ba, bb = k.ab + slope * k.bt, k.bb + slope * k.bt
        qa, qb = q[0] + k.at * shift, q[1] + k.bt * shift
        inverse = 1.0 / (aa * bb - ab * ba)
        a = (ab * qb - bb * qa) * inverse
        b = (ba * qa - aa * qb) * inverse
        t = slope * (a + b) + shift
        if a >= 0.0 and b >= 0.0 and slope * (q[2] + k.at * a + k.bt * b + k.tt * t) <= 0.0:
            return True, a, b, t
    return False, 0.0, 0.0, 0.0


@device
def single(qn, qt, k, spent, mu):
    """One point pushes, k = (nn, nt, tt): (whether it does, n, t)."""
    nn, nt, tt = k
    inverse = 1.0 / (nn * tt - nt * nt)
    n = (nt * qt - tt * qn) * inverse
    t = (nt * qn - nn * qt) * inverse
    total = t + spent[1]
    if n >= 0.0 and abs(total) <= mu * (n + spent[0]):
        return True, n, t
    for turn in range(2):
        slope = mu if (total > 0.0) == (turn == 0) else -mu
        shift = slope * spent[0] - spent[1]
        n = -(qn + nt * shift) / (nn + slope * nt)
        t = slope * n + shift
        if n >= 0.0 and slope * (qt + nt * n + tt * t) <= 0.0:
            return True, n, t
    return False, 0.0, 0.0


@device
def one_after_the_other(q, k, spent, mu, points):
    """Two normals without friction, then friction within their budget."""
    a, b = max(-q[0] / k.aa, 0.0), 0.0
    if points == 2 and q[1] + k.ab * a < 0.0:
        determinant = k.aa * k.bb - k.ab * k.ab
        a, b = (k.ab * q[1] - k.bb * q[0]) / determinant, (k.ab * q[0] - k.aa * q[1]) / determinant
        if a < 0.0 or b < 0.0:
            a, b = 0.0, max(-q[1] / k.bb, 0.0)
    limit = mu * (a + b + spent[0])
    t = -(q[2] + k.at * a + k.bt * b) / k.tt
    return a, b, max(-limit, min(limit, t + spent[1])) - spent[1]
