"""The contact of two bodies in the plane: the closed form against its laws, all cases in turn, and sweeps."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pbd.jit import kernel
from pbd.rigid.block_2d import Block, solve_block

TOLERANCE = 1e-10
"""Of the residuals, over the speeds that are asked for."""


@kernel
def solve(q, k, inverse, spent, mu, points):
    return solve_block(q, k, inverse, spent, mu, points)


def block(k):
    return Block(*(float(k[r, c]) for r, c in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))))


def answer(q, k, spent, mu, points):
    """(3,) impulses of the closed form; rows and columns of a point that is absent are 0, as in a contact's memory."""
    inverse = np.zeros((3, 3))
    present = np.ix_(*[[0, 1, 2] if points == 2 else [0, 2]] * 2)
    inverse[present] = np.linalg.inv(k[present])
    return np.array(solve(tuple(map(float, q)), block(k), block(inverse), tuple(map(float, spent)), mu, points))


def residual(p, q, k, spent, mu, points):
    """How far impulses p are from the laws of contact, [m/s]."""
    w, scale = q + k @ p, np.diag(k)
    total, limit = p[2] + spent[1], mu * (p[0] + p[1] + spent[0])
    parts = [scale[2] * max(abs(total) - limit, 0.0)]
    parts.append(abs(total - np.clip(total - w[2] / scale[2], -limit, limit)) * scale[2])
    parts += [abs(min(scale[r] * p[r], w[r])) for r in range(points)]
    return max(parts) if points == 2 else max(*parts, abs(p[1]))


def solutions(q, k, spent, mu, points):
    """All that obey the laws: each case of what pushes and what slides is a linear system."""
    found = []
    for pushes in itertools.product((False, True), repeat=points):
        for slides in (0.0, 1.0, -1.0):
            rows, right = np.eye(3), np.zeros(3)
            for r, on in enumerate(pushes):
                if on:
                    rows[r], right[r] = k[r], -q[r]
            if slides == 0.0:
                rows[2], right[2] = k[2], -q[2]
            else:
                rows[2], right[2] = [-slides * mu, -slides * mu, 1.0], slides * mu * spent[0] - spent[1]
            p = np.linalg.solve(rows, right)
            if residual(p, q, k, spent, mu, points) <= TOLERANCE * np.abs(q).max():
                found.append(p)
    return found


def stiffness(arms, inverse_masses, inverse_inertias, points):
    """K of rows a, b, t of two bodies; arms (2, 2, 2): body, point, (along the tangent, along the normal)."""
    k = np.zeros((3, 3))
    for body in range(2):
        (xa, ya), (xb, _) = arms[body]
        moments = np.array([xa, xb, -ya])
        k += inverse_masses[body] * np.diag([1.0, 1.0, 1.0]) + inverse_inertias[body] * np.outer(moments, moments)
        k[0, 1] += inverse_masses[body]
        k[1, 0] += inverse_masses[body]
    if points == 1:
        k[1, :] = k[:, 1] = 0.0
    return k


real = st.floats(-1.0, 1.0)
positive = st.floats(0.05, 1.0)


@st.composite
def contacts(draw, friction=1.0):
    """(q, K, spent, mu, points) of two boxes of any size and mass that touch along a common line; one may be fixed."""
    points = draw(st.integers(1, 2))
    left, width = draw(real), draw(st.floats(0.1, 2.0))
    arms = np.empty((2, 2, 2))
    masses, inertias = np.empty(2), np.empty(2)
    for body, side in enumerate((1.0, -1.0)):
        half, height, shift = width + draw(positive), 0.1 + 2.0 * draw(positive), draw(real)
        arms[body] = [[left + shift, side * height], [left + width + shift, side * height]]
        masses[body] = draw(st.sampled_from([0.0, 1.0, 1e-3, 1e3])) if body else 1.0
        inertias[body] = 3.0 * masses[body] / (half**2 + height**2)
    k = stiffness(arms, masses, inertias, points)
    assume(points == 1 or np.linalg.cond(k) < 1e5)
    q = np.array([draw(real), draw(real) if points == 2 else 0.0, draw(real)])
    assume(np.abs(q).max() > 1e-3)
    mu = draw(st.floats(0.0, friction))
    before = draw(st.sampled_from([0.0, 1.0])) * draw(positive)
    return q, k, (before, mu * before * draw(real)), mu, points


def check(contact):
    q = contact[0]
    p = answer(*contact)
    assert residual(p, *contact) <= TOLERANCE * np.abs(q).max(), (p, solutions(*contact))
    return p


@settings(max_examples=400, deadline=None)
@given(contacts())
def test_the_laws_are_obeyed(contact):
    check(contact)


@settings(max_examples=200, deadline=None)
@given(contacts())
def test_it_is_one_of_the_cases(contact):
    """Where only one case fits it is that; with friction up to 1 there is always one."""
    found = solutions(*contact)
    assert found
    p = answer(*contact)
    nearest = min(found, key=lambda other: np.abs(other - p).max())
    np.testing.assert_allclose(p, nearest, atol=1e-8 * (1.0 + np.abs(nearest).max()))


@settings(max_examples=100, deadline=None)
@given(contacts(), st.integers(1, 2000))
def test_sweeps_over_its_rows_end_there(contact, seed):
    """Projected Gauss-Seidel over the rows a, b, t, from anywhere: where they rest is the closed form."""
    q, k, spent, mu, points = contact
    p = np.random.default_rng(seed).uniform(-1.0, 1.0, 3)
    rows = [0, 2] if points == 1 else [0, 1, 2]
    p[1] *= points - 1
    for _ in range(20_000):
        before = p.copy()
        for r in rows:
            p[r] -= (q[r] + k[r] @ p) / k[r, r]
            limit = mu * (max(p[0], 0.0) + max(p[1], 0.0) + spent[0])
            p[r] = max(p[r], 0.0) if r < 2 else np.clip(p[r] + spent[1], -limit, limit) - spent[1]
        if np.abs(p - before).max() <= 1e-15:
            break
    assume(residual(p, *contact) <= 1e-9 * np.abs(q).max())
    assume(len(solutions(*contact)) == 1)
    np.testing.assert_allclose(answer(*contact), p, atol=1e-7 * (1.0 + np.abs(p).max()))


@settings(max_examples=100, deadline=None)
@given(contacts(), st.floats(1e-3, 1e3))
def test_impulses_scale_with_the_speeds(contact, factor):
    q, k, spent, mu, points = contact
    p = answer(*contact)
    scaled = answer(factor * q, k, (factor * spent[0], factor * spent[1]), mu, points)
    assume(len(solutions(*contact)) == 1)
    np.testing.assert_allclose(scaled, factor * p, rtol=1e-7, atol=1e-9 * factor)


@settings(max_examples=100, deadline=None)
@given(contacts())
def test_a_mirrored_contact_has_mirrored_impulses(contact):
    """The tangent turned round, and the points exchanged."""
    q, k, spent, mu, points = contact
    assume(len(solutions(*contact)) == 1)
    p = answer(*contact)
    turn = np.diag([1.0, 1.0, -1.0])
    if points == 2:
        turn = turn[[1, 0, 2]]
    mirrored = answer(turn @ q, turn @ k @ turn.T, (spent[0], -spent[1]), mu, points)
    np.testing.assert_allclose(mirrored, turn @ p, atol=1e-8 * (1.0 + np.abs(p).max()))


# ------------------------------------------------------------------ known contacts

SQUARE = stiffness([[[-0.5, 0.5], [0.5, 0.5]], [[0.0, 0.0]] * 2], [1.0, 0.0], [6.0, 0.0], 2)
"""A unit square of 1 kg that lies on the ground."""

NONE = (0.0, 0.0)


@pytest.mark.parametrize(
    ("q", "mu", "impulses"),
    [
        ((1.0, 1.0, 5.0), 0.5, (0.0, 0.0, 0.0)),  # opens
        ((-1.0, -1.0, 0.0), 0.5, (0.5, 0.5, 0.0)),  # lands flat
        ((-1.0, -1.0, 0.1), 0.0, (0.5, 0.5, 0.0)),  # without friction
        ((-1.0, -1.0, 4.0), 0.25, (0.5, 0.5, -0.25)),  # slides: the tangent's moment tilts the load, see below
    ],
)
def test_a_square_on_the_ground(q, mu, impulses):
    p = answer(np.array(q), SQUARE, NONE, mu, 2)
    if mu == 0.25:
        total = p[0] + p[1]
        assert (total, p[2]) == pytest.approx((1.0, -0.25))
        assert abs(p[0] - p[1]) == pytest.approx(0.25)  # friction at the ground, half an edge below the centre
    else:
        np.testing.assert_allclose(p, impulses, atol=1e-14)


def test_what_was_spent_is_not_spent_again():
    """Sliding friction of a step of two passes is mu times all normal impulses, however the passes share them."""
    mu, q = 0.5, np.array([-1.0, 0.0, 4.0])
    k = stiffness([[[0.0, 0.0]] * 2, [[0.0, 0.0]] * 2], [1.0, 0.0], [0.0, 0.0], 1)
    whole = answer(q, k, NONE, mu, 1)
    np.testing.assert_allclose(whole, [1.0, 0.0, -0.5], atol=1e-15)
    half = answer(q * [0.5, 0.0, 1.0], k, NONE, mu, 1)
    rest = answer(q * [0.5, 0.0, 1.0] + [0.0, 0.0, half[2]], k, (half[0], half[2]), mu, 1)
    np.testing.assert_allclose(half + rest, whole, atol=1e-15)


def test_a_budget_that_is_left_may_be_spent_where_nothing_pushes():
    """A first pass has pushed by n0 without friction; the second finds no closing but a slip that n0 can stop."""
    k = stiffness([[[0.0, 0.0]] * 2, [[0.0, 0.0]] * 2], [1.0, 0.0], [0.0, 0.0], 1)
    p = answer(np.array([0.0, 0.0, 0.3]), k, (1.0, 0.0), 0.5, 1)
    np.testing.assert_allclose(p, [0.0, 0.0, -0.3], atol=1e-15)
    p = answer(np.array([0.0, 0.0, 3.0]), k, (1.0, 0.0), 0.5, 1)
    np.testing.assert_allclose(p, [0.0, 0.0, -0.5], atol=1e-15)
