"""One chain's tridiagonal system: made and eliminated in one pass; its corrections; its prediction. See `direct`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pbd.intrinsics import multiply_add
from pbd.jit import device, device_sum
from pbd.vector import Store, dot, load, subtract, zeros

HISTORY = 3
"""Steps from which SHAKE's multipliers are predicted."""


class Chain(NamedTuple):
    """Work arrays of one chain of m links, with a link of length 0 before the first and after the last.

    link : store (m + 2,) of e, the links as they pull
    coupling, multiplier (m + 2,) : what elimination leaves, then l of this solve
    total (m,) : SHAKE's l of this step;  past (stages, HISTORY, m) : of the last steps, in turn
    turn (3,) : the sub-step, the place in ``past`` to write next, and how many steps are known
    """

    link: Store
    coupling: np.ndarray
    multiplier: np.ndarray
    total: np.ndarray
    past: np.ndarray
    turn: np.ndarray


def workspace(links: int, dimension: int, stages: int) -> Chain:
    link, (coupling, multiplier) = zeros(links + 2, dimension), zeros(links + 2, 2)
    past, turn = np.zeros((stages, HISTORY, links)), np.zeros(3, dtype=np.int64)
    return Chain(link, coupling, multiplier, np.zeros(links), past, turn)


@device
def copy_links(batch, x, links):
    """e_c <- x_c - x_(c+1)."""
    first = batch.pairs.first
    for k in range(len(x)):
        for c in range(batch.rest.shape[0]):
            i = first + np.uint64(c)
            links[k][c + 1] = x[k][i] - x[k][i + np.uint64(1)]


# ------------------------------------------------------------------ elimination


@device
def matrix_row(batch, chain, c, link, w):
    """(lower, diagonal, upper) of row c of T, for d = ``link``; 0 beyond the ends, where e is 0."""
    i = batch.pairs.first + np.uint64(c)
    one, other = w[i], w[i + np.uint64(1)]
    lower = -one * dot(link, load(chain.link, c))
    diagonal = (one + other) * dot(link, load(chain.link, c + 1))
    return lower, diagonal, -other * dot(link, load(chain.link, c + 2))


@device
def link_at(batch, c, x):
    """x_c - x_(c+1)."""
    i = batch.pairs.first + np.uint64(c)
    return subtract(load(x, i), load(x, i + np.uint64(1)))


@device
def excess(batch, c, link):
    """-C = (L^2 - |d|^2)/2."""
    return 0.5 * multiply_add(batch.rest[c], batch.rest[c], -dot(link, link))


@device
def eliminate(batch, chain, p, w):
    """Solve T l = -C(p); the solution stands in chain.multiplier, shifted by one."""
    last = batch.rest.shape[0] - 1
    middle = last // 2
    low = high = low_right = high_right = 0.0
    for k in range(last - middle):
        c = last - k
        link = link_at(batch, c, p)
        lower, diagonal, upper = matrix_row(batch, chain, c, link, w)
        high, high_right = eliminated(chain, c, lower, diagonal, upper, excess(batch, c, link), high, high_right)
        if k < middle:
            link = link_at(batch, k, p)
            lower, diagonal, upper = matrix_row(batch, chain, k, link, w)
            low, low_right = eliminated(chain, k, upper, diagonal, lower, excess(batch, k, link), low, low_right)
    link = link_at(batch, middle, p)
    lower, diagonal, upper = matrix_row(batch, chain, middle, link, w)
    right = excess(batch, middle, link) - lower * low_right - upper * high_right
    substitute(chain, middle, last, right / (diagonal - lower * low - upper * high))


@device
def eliminate_rates(batch, chain, x, v, w):
    """Solve T l = -e . (v_c - v_(c+1)), with T at x."""
    last = batch.rest.shape[0] - 1
    low = low_right = 0.0
    for c in range(last):
        link = link_at(batch, c, x)
        lower, diagonal, upper = matrix_row(batch, chain, c, link, w)
        low, low_right = eliminated(chain, c, upper, diagonal, lower, -dot(link, link_at(batch, c, v)), low, low_right)
    link = link_at(batch, last, x)
    lower, diagonal, _ = matrix_row(batch, chain, last, link, w)
    right = -dot(link, link_at(batch, last, v)) - lower * low_right
    substitute(chain, last, last, right / (diagonal - lower * low))


@device
def eliminated(chain, c, onward, diagonal, behind, right, coupling, solved):
    """Row c without the neighbour ``behind``, whose solution is  solved - coupling l_c:  the same for row c."""
    inverse = 1.0 / multiply_add(-behind, coupling, diagonal)
    onward, right = onward * inverse, multiply_add(-behind, solved, right) * inverse
    chain.coupling[c + 1], chain.multiplier[c + 1] = onward, right
    return onward, right


@device
def substitute(chain, middle, last, solution):
    """From l of the middle row to both ends."""
    multiplier, coupling = chain.multiplier, chain.coupling
    multiplier[middle + 1] = solution
    up = down = solution
    for k in range(1, max(last - middle, middle) + 1):
        if middle + k <= last:
            up = multiply_add(-coupling[middle + 1 + k], up, multiplier[middle + 1 + k])
            multiplier[middle + 1 + k] = up
        if k <= middle:
            down = multiply_add(-coupling[middle + 1 - k], down, multiplier[middle + 1 - k])
            multiplier[middle + 1 - k] = down


# ------------------------------------------------------------------ correction


@device
def pull(batch, chain, y, w, factor):
    """y_c <- y_c + factor w_c (e_c l_c - e_(c-1) l_(c-1)), for positions or velocities y."""
    first, multiplier = batch.pairs.first, chain.multiplier
    for k in range(len(y)):
        e = chain.link[k]
        for c in range(batch.rest.shape[0] + 1):
            i = first + np.uint64(c)
            y[k][i] += factor * w[i] * (e[c + 1] * multiplier[c + 1] - e[c] * multiplier[c])


@device
def pull_both(batch, chain, p, v, w, inverse_h):
    """The same for p, and over h for v."""
    first, multiplier = batch.pairs.first, chain.multiplier
    for k in range(len(p)):
        e = chain.link[k]
        for c in range(batch.rest.shape[0] + 1):
            i = first + np.uint64(c)
            change = w[i] * (e[c + 1] * multiplier[c + 1] - e[c] * multiplier[c])
            p[k][i] += change
            v[k][i] = multiply_add(inverse_h, change, v[k][i])


@device_sum
def left(batch, chain, w):
    """The residual that a correction leaves: the root of sum_c (|D_c|^2 / (2 L_c^2))^2, D being the change of d."""
    first, multiplier = batch.pairs.first, chain.multiplier
    total = 0.0
    for c in range(batch.rest.shape[0]):
        i = first + np.uint64(c)
        square = 0.0
        for k in range(len(chain.link)):
            e = chain.link[k]
            middle = e[c + 1] * multiplier[c + 1]
            one, other = middle - e[c] * multiplier[c], e[c + 2] * multiplier[c + 2] - middle
            change = w[i] * one - w[i + np.uint64(1)] * other
            square += change * change
        relative = square / (batch.rest[c] * batch.rest[c])
        total += relative * relative
    return 0.5 * math.sqrt(total)


# ------------------------------------------------------------------ prediction


@device
def extrapolate(chain):
    """l <- 3 l_1 - 3 l_2 + l_3, or what fewer known steps allow; of the same sub-step in each step."""
    past, newest, known = chain.past[chain.turn[0]], chain.turn[1] + HISTORY - 1, chain.turn[2]
    a = float(known)
    b = 0.0 if known < 2 else (-1.0 if known == 2 else -3.0)
    d = 1.0 if known > 2 else 0.0
    one, two, three = past[newest % HISTORY], past[(newest - 1) % HISTORY], past[(newest - 2) % HISTORY]
    for c in range(chain.total.shape[0]):
        predicted = a * one[c] + b * two[c] + d * three[c]
        chain.total[c] = predicted
        chain.multiplier[c + 1] = predicted


@device
def remember(chain):
    """Keep this sub-step's multipliers, and go on to the next sub-step."""
    past = chain.past[chain.turn[0]]
    newest = past[chain.turn[1]]
    for c in range(chain.total.shape[0]):
        newest[c] = chain.total[c]
    chain.turn[0] += 1
    if chain.turn[0] == chain.past.shape[0]:
        chain.turn[0] = 0
        chain.turn[1] = (chain.turn[1] + 1) % HISTORY
        chain.turn[2] = min(chain.turn[2] + 1, HISTORY)
