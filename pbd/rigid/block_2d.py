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
    if q[0] >= 0.0 and (points == 1 or q[1] >= 0.0):
        return 0.0, 0.0, 0.0
    if points == 2:
        fits, a, b, t = both(q, k, inverse, spent, mu)
        if fits:
            return a, b, t
    a, t = single(q[0], q[2], (k.aa, k.at, k.tt), spent, mu)
    if points == 1 or q[1] + k.ab * a + k.bt * t >= 0.0:
        return a, 0.0, t
    b, t = single(q[1], q[2], (k.bb, k.bt, k.tt), spent, mu)
    if q[0] + k.ab * b + k.at * t >= 0.0:
        return 0.0, b, t
    return one_after_the_other(q, k, spent, mu)


@device
def both(q, k, v, spent, mu):
    """Both points push: (whether that is so, a, b, t)."""
    a = -(v.aa * q[0] + v.ab * q[1] + v.at * q[2])
    b = -(v.ab * q[0] + v.bb * q[1] + v.bt * q[2])
    t = -(v.at * q[0] + v.bt * q[1] + v.tt * q[2])
    total = t + spent[1]
    limit = mu * (a + b + spent[0])
    if abs(total) > limit or a < 0.0 or b < 0.0:
        slope = mu if total > 0.0 else -mu
        shift = slope * spent[0] - spent[1]
        aa, ab = k.aa + slope * k.at, k.ab + slope * k.at
        ba, bb = k.ab + slope * k.bt, k.bb + slope * k.bt
        qa, qb = q[0] + k.at * shift, q[1] + k.bt * shift
        inverse = 1.0 / (aa * bb - ab * ba)
        a = (ab * qb - bb * qa) * inverse
        b = (ba * qa - aa * qb) * inverse
        t = slope * (a + b) + shift
    return a >= 0.0 and b >= 0.0, a, b, t


@device
def single(qn, qt, k, spent, mu):
    """One point pushes, k = (nn, nt, tt): (n, t), n at least 0."""
    nn, nt, tt = k
    inverse = 1.0 / (nn * tt - nt * nt)
    n = (nt * qt - tt * qn) * inverse
    t = (nt * qn - nn * qt) * inverse
    total = t + spent[1]
    if n < 0.0 or abs(total) > mu * (n + spent[0]):
        slope = mu if total > 0.0 else -mu
        shift = slope * spent[0] - spent[1]
        n = max(-(qn + nt * shift) / max(nn + slope * nt, 1e-3 * nn), 0.0)
        t = slope * n + shift if n > 0.0 else 0.0
    return n, t


@device
def one_after_the_other(q, k, spent, mu):
    """Two normals without friction, then friction within their budget."""
    determinant = k.aa * k.bb - k.ab * k.ab
    a = (k.ab * q[1] - k.bb * q[0]) / determinant
    b = (k.ab * q[0] - k.aa * q[1]) / determinant
    if a < 0.0 or b < 0.0:
        a = max(-q[0] / k.aa, 0.0)
        b = 0.0
        if q[1] + k.ab * a < 0.0:
            a, b = 0.0, max(-q[1] / k.bb, 0.0)
    limit = mu * (a + b + spent[0])
    t = -(q[2] + k.at * a + k.bt * b) / k.tt
    return a, b, max(-limit, min(limit, t + spent[1])) - spent[1]
