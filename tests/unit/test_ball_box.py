"""Contacts of balls with boxes and with balls, in the plane and in space."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pbd.collision.ball_box import ball_ball, ball_box
from pbd.jit import kernel


@kernel
def touch_box(centre, radius, box, margin):
    return ball_box(centre, radius, box, margin)


@kernel
def touch_ball(first, first_radius, second, second_radius, margin):
    return ball_ball(first, first_radius, second, second_radius, margin)


def vector(values):
    return tuple(map(float, np.ravel(values)))


def with_box(centre, radius, box, margin=0.0):
    """(hit, point, gap, normal) as arrays; box is (centre, half extents, matrix)."""
    hit, point, gap, normal = touch_box(vector(centre), radius, tuple(map(vector, box)), margin)
    return hit, np.array(point), gap, np.array(normal)


def with_ball(first, first_radius, second, second_radius, margin=0.0):
    hit, point, gap, normal = touch_ball(vector(first), first_radius, vector(second), second_radius, margin)
    return hit, np.array(point), gap, np.array(normal)


def rotation(rng, d):
    """A random one."""
    q = np.linalg.qr(rng.normal(size=(d, d)))[0]
    q[:, 0] *= np.sign(np.linalg.det(q))
    return q


def square(d):
    return np.zeros(d), np.ones(d), np.eye(d)


@pytest.mark.parametrize("d", [2, 3])
def test_on_a_face(d):
    centre = np.full(d, 0.25)
    centre[-1] = 1.5
    hit, point, gap, normal = with_box(centre, 0.5, square(d))
    assert hit
    assert gap == 0.0
    assert normal.tolist() == [0.0] * (d - 1) + [-1.0]
    assert point.tolist() == [0.25] * (d - 1) + [1.0]


@pytest.mark.parametrize("d", [2, 3])
def test_at_a_corner(d):
    centre = np.full(d, 1.5)
    hit, point, gap, normal = with_box(centre, 0.75, square(d))
    assert gap == pytest.approx(0.5 * np.sqrt(d) - 0.75, abs=1e-15)
    assert hit == (d == 2)
    np.testing.assert_allclose(normal, -1.0 / np.sqrt(d), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(point, 1.0 + 0.5 * gap / np.sqrt(d), rtol=0.0, atol=1e-15)


def test_at_an_edge():
    _, point, gap, normal = with_box([1.3, 0.2, -1.4], 0.5, square(3))
    assert gap == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(normal, [-0.6, 0.0, 0.8], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(point, [1.0, 0.2, -1.0], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("d", [2, 3])
def test_a_centre_inside_goes_out_through_the_nearest_face(d):
    centre = np.zeros(d)
    centre[0], centre[1] = 0.5, -0.75
    hit, point, gap, normal = with_box(centre, 0.5, square(d))
    assert hit
    assert gap == -0.75
    assert normal.tolist() == [0.0, 1.0, 0.0][:d]
    assert point.tolist() == [0.5, -1.0 + 0.375, 0.0][:d]
    hit, _, gap, normal = with_box(np.zeros(d), 0.5, square(d))
    assert hit
    assert gap == -1.5
    assert np.abs(normal).tolist() == [1.0, 0.0, 0.0][:d]


@pytest.mark.parametrize("d", [2, 3])
def test_gap_and_normal_do_not_jump_at_the_surface(d):
    found = []
    for height in (1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0 + 1e-200):
        centre = np.full(d, 0.3)
        centre[0] = height
        _, point, gap, normal = with_box(centre, 0.5, square(d))
        assert gap == pytest.approx(height - 1.5, abs=1e-15)
        found.append([*point, *normal])
    np.testing.assert_allclose(found, found[1:2] * 4, rtol=0.0, atol=1e-9)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from([2, 3]), st.integers(0, 2**32 - 1), st.sampled_from([0.2, 1.0, 3.0]))
def test_both_surfaces_are_half_a_gap_away(d, seed, spread):
    rng = np.random.default_rng(seed)
    half, turn, middle = rng.uniform(0.1, 1.0, d), rotation(rng, d), rng.normal(size=d)
    centre, radius = middle + spread * rng.normal(size=d), rng.uniform(0.05, 1.0)
    hit, point, gap, normal = with_box(centre, radius, (middle, half, turn), margin=0.1)
    assert hit == (gap <= 0.1)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(point - 0.5 * gap * normal, centre + radius * normal, rtol=0.0, atol=1e-13)
    surface = point + 0.5 * gap * normal
    outside = np.abs(turn.T @ (surface - middle)) - half
    assert outside.max() == pytest.approx(0.0, abs=1e-13), "on the box"
    local = turn.T @ (centre - middle)
    beyond = np.maximum(np.abs(local) - half, 0.0)
    distance = np.linalg.norm(beyond) if beyond.any() else (np.abs(local) - half).max()
    assert gap == pytest.approx(distance - radius, abs=1e-13), "and nowhere is it nearer"


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([2, 3]), st.integers(0, 2**32 - 1))
def test_two_balls(d, seed):
    rng = np.random.default_rng(seed)
    a, b, r, s = rng.normal(size=d), rng.normal(size=d), rng.uniform(0.1, 1.0), rng.uniform(0.1, 1.0)
    hit, point, gap, normal = with_ball(a, r, b, s, margin=0.1)
    assert gap == pytest.approx(np.linalg.norm(b - a) - r - s, abs=1e-14)
    assert hit == (gap <= 0.1)
    np.testing.assert_allclose(point - 0.5 * gap * normal, a + r * normal, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(point + 0.5 * gap * normal, b - s * normal, rtol=0.0, atol=1e-13)
    _, same, _, back = with_ball(b, s, a, r)
    np.testing.assert_allclose([*same, *back], [*point, *-normal], rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("d", [2, 3])
def test_balls_in_one_place_have_a_normal(d):
    hit, point, gap, normal = with_ball(np.ones(d), 1.0, np.ones(d), 0.5)
    assert hit
    assert gap == -1.5
    assert normal.tolist() == [0.0, 0.0, 1.0][-d:]
    assert point.tolist() == [1.0, 1.0, 1.25][-d:]


@pytest.mark.parametrize("d", [2, 3])
def test_bad_numbers_are_no_contact(d):
    bad = np.full(d, np.nan)
    assert not with_box(bad, 1.0, square(d))[0]
    assert not with_box(np.full(d, np.inf), 1.0, square(d))[0]
    assert not with_ball(bad, 1.0, np.zeros(d), 1.0)[0]


PROGRAM = """
import sys
import numba
sys.path.insert(0, sys.argv[1])
import test_ball_box as t
assert numba.config.DISABLE_JIT
for d in (2, 3):
    t.test_on_a_face(d)
    t.test_at_a_corner(d)
    t.test_a_centre_inside_goes_out_through_the_nearest_face(d)
    t.test_balls_in_one_place_have_a_normal(d)
t.test_both_surfaces_are_half_a_gap_away()
t.test_two_balls()
print("done")
"""


def test_plain_python_does_the_same():
    command = [sys.executable, "-c", PROGRAM, os.path.dirname(__file__)]
    done = subprocess.run(
        command, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "done\n", done.stderr
