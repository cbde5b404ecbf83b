"""What a contact in the plane does between and in its projections: bring its rows to the pose, foresee, turn over."""

from __future__ import annotations

import math

from pbd.jit import device
from pbd.rigid.block_2d import Block, solve_block
from pbd.rigid.closing import after, closing, opening


@device
def arm(bodies, i, x, y):
    c, s = bodies.frame[i, 0], bodies.frame[i, 1]
    return c * x - s * y, s * x + c * y


@device
def refresh(hot, cold, bodies, a, b):
    """Bring arms, gaps and K to the present pose; friction acts where the normal forces a and b do.

    Both bodies are pushed at one place, or a contact that slides would make angular momentum: at the point of the one
    that touches a face of the other, the normal's owner.
    """
    i, j = hot["i"], hot["j"]
    owner = i if cold["owner"] == 0 else j
    nx, ny = arm(bodies, owner, cold["local_nx"], cold["local_ny"])
    hot["nx"], hot["ny"] = nx, ny
    dx, dy = bodies.x[0][j] - bodies.x[0][i], bodies.x[1][j] - bodies.x[1][i]
    ix, iy = anchor(bodies, i, cold["iax"], cold["iay"], nx, ny)
    jx, jy = anchor(bodies, j, cold["jax"], cold["jay"], -nx, -ny)
    cold["gap_a"] = (dx + jx - ix) * nx + (dy + jy - iy) * ny
    ix, iy, jx, jy = at_one_place(cold, dx, dy, (ix, iy, jx, jy))
    hot["ai"], hot["aj"] = ix * ny - iy * nx, jx * ny - jy * nx
    tx, ty = -ny, nx
    if hot["points"] == 2:
        kx, ky = arm(bodies, i, cold["ibx"], cold["iby"])
        lx, ly = arm(bodies, j, cold["jbx"], cold["jby"])
        cold["gap_b"] = (dx + lx - kx) * nx + (dy + ly - ky) * ny
        kx, ky, lx, ly = at_one_place(cold, dx, dy, (kx, ky, lx, ly))
        hot["bi"], hot["bj"] = kx * ny - ky * nx, lx * ny - ly * nx
        u, v = shares(a, b, cold["gap_a"], cold["gap_b"])
        cold["share"] = v
        ix, iy, jx, jy = u * ix + v * kx, u * iy + v * ky, u * jx + v * lx, u * jy + v * ly
    hot["ti"], hot["tj"] = ix * ty - iy * tx, jx * ty - jy * tx
    stiffen(hot, bodies)


@device
def at_one_place(cold, dx, dy, arms):
    """Arms of a contact point, from the point on the body that does not own the normal."""
    ix, iy, jx, jy = arms
    if cold["owner"] == 0:
        return dx + jx, dy + jy, jx, jy
    return ix, iy, ix - dx, iy - dy


@device
def shares(a, b, gap_a, gap_b):
    """How much of the contact is at each of its points: by their forces, or all where the gap is less."""
    if a + b > 0.0:
        return a / (a + b), b / (a + b)
    if gap_a == gap_b:
        return 0.5, 0.5
    return (1.0, 0.0) if gap_a < gap_b else (0.0, 1.0)


@device
def anchor(bodies, i, x, y, nx, ny):
    """The arm of a contact point: fixed in a box; of a ball always the point that faces the other body."""
    if bodies.kind[i] == 1:
        return bodies.half[0][i] * nx, bodies.half[0][i] * ny
    return arm(bodies, i, x, y)


@device
def stiffen(hot, bodies):
    """K = J M^-1 J^T and its inverse."""
    i, j = hot["i"], hot["j"]
    mass = bodies.motion[i, 3] + bodies.motion[j, 3]
    wi, wj = bodies.motion[i, 4], bodies.motion[j, 4]
    ai, aj, bi, bj, ti, tj = hot["ai"], hot["aj"], hot["bi"], hot["bj"], hot["ti"], hot["tj"]
    aa = mass + ai * ai * wi + aj * aj * wj
    at = ai * ti * wi + aj * tj * wj
    tt = mass + ti * ti * wi + tj * tj * wj
    hot["aa"], hot["at"], hot["tt"] = aa, at, tt
    if hot["points"] == 1:
        inverse = 1.0 / (aa * tt - at * at)
        hot["iaa"], hot["iat"], hot["itt"] = tt * inverse, -at * inverse, aa * inverse
        hot["iab"] = hot["ibb"] = hot["ibt"] = hot["ab"] = hot["bb"] = hot["bt"] = hot["wb"] = 0.0
        return
    ab = mass + ai * bi * wi + aj * bj * wj
    bb = mass + bi * bi * wi + bj * bj * wj
    bt = bi * ti * wi + bj * tj * wj
    hot["ab"], hot["bb"], hot["bt"] = ab, bb, bt
    caa, cab, cat = bb * tt - bt * bt, at * bt - ab * tt, ab * bt - at * bb
    determinant = aa * caa + ab * cab + at * cat
    inverse = 1.0 / determinant
    hot["iaa"], hot["iab"], hot["iat"] = caa * inverse, cab * inverse, cat * inverse
    hot["ibb"] = (aa * tt - at * at) * inverse
    hot["ibt"] = (ab * at - aa * bt) * inverse
    hot["itt"] = (aa * bb - ab * ab) * inverse


@device
def speeds(hot, motion):
    """Velocities of the rows a, b, t: J v."""
    i, j = hot["i"], hot["j"]
    nx, ny = hot["nx"], hot["ny"]
    dx, dy = motion[j, 0] - motion[i, 0], motion[j, 1] - motion[i, 1]
    wi, wj = motion[i, 2], motion[j, 2]
    normal, tangent = dx * nx + dy * ny, dy * nx - dx * ny
    return (
        normal + hot["aj"] * wj - hot["ai"] * wi,
        normal + hot["bj"] * wj - hot["bi"] * wi,
        tangent + hot["tj"] * wj - hot["ti"] * wi,
    )


@device
def push(hot, motion, a, b, t):
    """v <- v + M^-1 J^T (a, b, t)."""
    i, j = hot["i"], hot["j"]
    nx, ny = hot["nx"], hot["ny"]
    n = a + b
    px, py = n * nx - t * ny, n * ny + t * nx
    mi, mj = motion[i, 3], motion[j, 3]
    motion[i, 0] -= mi * px
    motion[i, 1] -= mi * py
    motion[i, 2] -= motion[i, 4] * (hot["ai"] * a + hot["bi"] * b + hot["ti"] * t)
    motion[j, 0] += mj * px
    motion[j, 1] += mj * py
    motion[j, 2] += motion[j, 4] * (hot["aj"] * a + hot["bj"] * b + hot["tj"] * t)


@device
def project_contact(hot, motion, mu):
    """One projection: solve the contact exactly for the present velocities of all else.

    Most stick, or do not touch; only for the others the cases are gone through. Returns the squares of the change and
    of the impulses in the norm of K: that of the change d is -d.w where the contact sticks.
    """
    ua, ub, ut = speeds(hot, motion)
    ua, ub, ut = ua + hot["wa"], ub + hot["wb"], ut + hot["wt"]
    a, b, t = hot["a"], hot["b"], hot["t"]
    nothing = a == hot["low_a"] == 0.0 and b == hot["low_b"] == 0.0 and t == 0.0
    if nothing and ua >= 0.0 and (ub >= 0.0 or hot["points"] == 1):
        hot["da"] = hot["db"] = hot["dt"] = 0.0
        return 0.0, 0.0
    da = -(hot["iaa"] * ua + hot["iab"] * ub + hot["iat"] * ut)
    db = -(hot["iab"] * ua + hot["ibb"] * ub + hot["ibt"] * ut)
    dt = -(hot["iat"] * ua + hot["ibt"] * ub + hot["itt"] * ut)
    limit = mu * (a + da + b + db + hot["spent_n"])
    sticks = a + da >= hot["low_a"] and b + db >= hot["low_b"] and abs(t + dt + hot["spent_t"]) <= limit
    changed = -(da * ua + db * ub + dt * ut)
    if not sticks:
        da, db, dt = change_by_cases(hot, mu, ua, ub, ut)
        changed = hot["aa"] * da * da + hot["bb"] * db * db + hot["tt"] * dt * dt
        changed += 2.0 * (hot["ab"] * da * db + hot["at"] * da * dt + hot["bt"] * db * dt)
    a, b, t = a + da, b + db, t + dt
    hot["a"], hot["b"], hot["t"], hot["da"], hot["db"], hot["dt"] = a, b, t, da, db, dt
    push(hot, motion, da, db, dt)
    return changed, (a + b) * (a + b) * hot["aa"]


@device
def change_by_cases(hot, mu, ua, ub, ut):
    """The change of a contact's impulses, of whatever kind."""
    a, b, t, low_a, low_b = hot["a"], hot["b"], hot["t"], hot["low_a"], hot["low_b"]
    k = Block(hot["aa"], hot["ab"], hot["bb"], hot["at"], hot["bt"], hot["tt"])
    inverse = Block(hot["iaa"], hot["iab"], hot["ibb"], hot["iat"], hot["ibt"], hot["itt"])
    da, db = low_a - a, low_b - b
    q = (
        ua + k.aa * da + k.ab * db - k.at * t,
        ub + k.ab * da + k.bb * db - k.bt * t,
        ut + k.at * da + k.bt * db - k.tt * t,
    )
    spent = (hot["spent_n"] + low_a + low_b, hot["spent_t"])
    new_a, new_b, new_t = solve_block(q, k, inverse, spent, mu, hot["points"])
    return new_a + da, new_b + db, new_t - t


@device
def foresee(hot, cold, bodies, h, limits):
    """Set the bias of a position pass; returns when within h the contact closes in an impact, or inf; and its gap."""
    most_push, rest, rate = limits
    ua, ub, _ = speeds(hot, bodies.motion)
    i, j = hot["i"], hot["j"]
    ra, rb, rt = curvature(hot, cold, bodies, i, j, h)
    inverse = 1.0 / h
    hot["low_a"] = hot["low_b"] = hot["spent_n"] = hot["spent_t"] = 0.0
    gap_a, gap_b = cold["gap_a"], cold["gap_b"]
    hot["wt"] = cold["slip"] * rate + rt * inverse
    when, cold["impact_a"] = closing(gap_a, cold["rest_a"], ua + ra * inverse, h, rest)
    hot["wa"] = opening(gap_a, ra, inverse, rate, most_push)
    if hot["points"] == 2:
        when_b, cold["impact_b"] = closing(gap_b, cold["rest_b"], ub + rb * inverse, h, rest)
        hot["wb"] = opening(gap_b, rb, inverse, rate, most_push)
        return min(when, when_b), min(gap_a, gap_b)
    return when, gap_a


@device
def relieve(hot, cold, motion, depth):
    """After a position pass: take back what it pushed if the contact overlapped by more than ``depth``."""
    if cold["gap_a"] < -depth or (hot["points"] == 2 and cold["gap_b"] < -depth):
        push(hot, motion, -hot["a"], -hot["b"], -hot["t"])
        hot["a"] = hot["b"] = hot["t"] = 0.0


@device
def curvature(hot, cold, bodies, i, j, h):
    """How far gaps and slip end from h J v because arms turn: n . (turned arm - arm - h w x arm), of j less i."""
    ti, tj = h * bodies.motion[i, 2], h * bodies.motion[j, 2]
    if ti == 0.0 and tj == 0.0:
        return 0.0, 0.0, 0.0
    nx, ny = hot["nx"], hot["ny"]
    ci, si = turned(bodies, i, ti)
    cj, sj = turned(bodies, j, tj)
    ix, iy = arm(bodies, i, cold["iax"], cold["iay"])
    jx, jy = arm(bodies, j, cold["jax"], cold["jay"])
    ax, ay = cj * jx - sj * jy - ci * ix + si * iy, sj * jx + cj * jy - si * ix - ci * iy
    if hot["points"] == 1:
        return ax * nx + ay * ny, 0.0, ay * nx - ax * ny
    kx, ky = arm(bodies, i, cold["ibx"], cold["iby"])
    lx, ly = arm(bodies, j, cold["jbx"], cold["jby"])
    bx, by = cj * lx - sj * ly - ci * kx + si * ky, sj * lx + cj * ly - si * kx - ci * ky
    v = cold["share"]
    tx, ty = ax + v * (bx - ax), ay + v * (by - ay)
    return ax * nx + ay * ny, bx * nx + by * ny, ty * nx - tx * ny


@device
def turned(bodies, i, angle):
    """(cos - 1, sin - angle) of a turn; 0 for a ball, whose contact point does not turn with it."""
    if bodies.kind[i] == 1:
        return 0.0, 0.0
    if abs(angle) > 0.5:
        return math.cos(angle) - 1.0, math.sin(angle) - angle
    square = angle * angle
    return (
        square * (-1.0 / 2.0 + square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0))),
        angle * square * (-1.0 / 6.0 + square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0))),
    )


@device
def turn_over(hot, cold, bodies, h, mu, restitution):
    """From the position pass to the velocity pass: what was spent, the new arms, the targets.

    With ``restitution`` below 0 impacts come after this pass, in one of their own, see `strike`.
    """
    a, b, t = hot["a"], hot["b"], hot["t"]
    _, _, ut = speeds(hot, bodies.motion)
    sticks = a + b > 0.0 and abs(t) < mu * (a + b)
    cold["slip"] = h * (ut + hot["wt"]) if sticks else 0.0
    refresh(hot, cold, bodies, a, b)
    hot["low_a"] = -a
    hot["low_b"] = -b
    hot["spent_n"], hot["spent_t"] = a + b, t
    hot["wa"] = after(cold["gap_a"], a, cold["impact_a"], restitution)
    hot["wb"] = after(cold["gap_b"], b, cold["impact_b"], restitution)
    hot["wt"] = hot["a"] = hot["b"] = hot["t"] = 0.0


@device
def strike(hot, cold, bodies, restitution):
    """From the velocity pass before an impact to that of the impact: it has a budget of friction of its own."""
    ua, ub, _ = speeds(hot, bodies.motion)
    hot["low_a"] = hot["low_b"] = hot["spent_n"] = hot["spent_t"] = 0.0
    if cold["impact_a"] != 0.0:
        hot["wa"] = restitution * min(ua, 0.0)
    if cold["impact_b"] != 0.0:
        hot["wb"] = restitution * min(ub, 0.0)
    hot["a"] = hot["b"] = hot["t"] = 0.0
