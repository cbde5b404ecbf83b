"""Contacts of boxes in the plane: known ones, and random ones against the corners and axes themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pbd.collision.box_box_2d import PREFERENCE, box_box
from pbd.jit import kernel

MARGIN = 0.05


@kernel
def touch(a, b, margin, points):
    return box_box(a, b, margin, points)


def box(x, y, angle=0.0, width=1.0, height=1.0):
    return x, y, np.cos(angle), np.sin(angle), 0.5 * width, 0.5 * height


def contact(a, b, margin=MARGIN):
    """(normal (2,), rows (count, 4), owner)."""
    points = np.full((2, 4), np.nan)
    count, nx, ny, owner = touch(tuple(map(float, a)), tuple(map(float, b)), margin, points)
    return np.array([nx, ny]), points[:count].copy(), owner


def frame(a):
    """(centre, axes as rows, half extents)."""
    return np.array(a[:2]), np.array([[a[2], a[3]], [-a[3], a[2]]]), np.array(a[4:])


def corners(a):
    """(4, 2)."""
    centre, axes, half = frame(a)
    return centre + (np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half) @ axes


def separations(a, b):
    """(8, 2 + 1): the outward normals of the faces of a, turned round those of b, and how far they separate."""
    rows = []
    for one, other, sign in ((a, b, 1.0), (b, a, -1.0)):
        centre, axes, half = frame(one)
        for axis in range(2):
            for side in (1.0, -1.0):
                normal = side * axes[axis]
                gap = ((corners(other) - centre) @ normal).min() - half[axis]
                rows.append([*(sign * normal), gap])
    return np.array(rows)


def outside(a, x):
    """(n,) by how much points are outside of the box, in the larger of its two directions; < 0 inside."""
    centre, axes, half = frame(a)
    return (np.abs((np.atleast_2d(x) - centre) @ axes.T) - half).max(axis=1)


def moved(a, angle, shift):
    c, s = np.cos(angle), np.sin(angle)
    x, y = np.array([[c, -s], [s, c]]) @ a[:2] + shift
    return x, y, c * a[2] - s * a[3], s * a[2] + c * a[3], a[4], a[5]


def by_feature(rows):
    return rows[np.argsort(rows[:, 3])]


# ------------------------------------------------------------------ known


@pytest.mark.parametrize("gap", [0.02, 0.0, -0.02])
def test_flat_on_a_wider_box(gap):
    """Two points, at the ends of the upper box's lower face, halfway between the surfaces."""
    normal, rows, owner = contact(box(0, 0, width=4), box(0.3, 1 + gap, width=2))
    np.testing.assert_allclose(normal, [0.0, 1.0], atol=1e-15)
    assert owner == 0
    rows = rows[np.argsort(rows[:, 0])]
    np.testing.assert_allclose(rows[:, :3], [[-0.7, 0.5 + gap / 2, gap], [1.3, 0.5 + gap / 2, gap]], atol=1e-15)
    assert rows[0, 3] != rows[1, 3]


@pytest.mark.parametrize("shift", [0.3, -0.6])
def test_an_overhang_is_cut(shift):
    """Of two equal boxes only the part touches where both are."""
    _, rows, _ = contact(box(0, 0), box(shift, 1.01))
    np.testing.assert_allclose(np.sort(rows[:, 0]), np.sort([np.sign(shift) * 0.5, shift - np.sign(shift) * 0.5]))
    np.testing.assert_allclose(rows[:, 2], 0.01)


@pytest.mark.parametrize(
    ("place", "normal"), [((1.02, 0), (1, 0)), ((-1.02, 0), (-1, 0)), ((0, 1.02), (0, 1)), ((0, -1.02), (0, -1))]
)
def test_on_each_side(place, normal):
    found, rows, _ = contact(box(0, 0), box(*place))
    np.testing.assert_allclose(found, normal, atol=1e-15)
    np.testing.assert_allclose(rows[:, 2], [0.02, 0.02])


@pytest.mark.parametrize("exchanged", [False, True])
def test_a_corner_on_a_face(exchanged):
    """A square on its tip: the tip touches, and the owner of the normal is the box whose face it is."""
    half = np.sqrt(0.5)
    below, above = box(0, 0, width=4), box(0.2, 0.5 + half + 0.01, np.pi / 4)
    normal, rows, owner = contact(above, below) if exchanged else contact(below, above)
    np.testing.assert_allclose(normal, [0.0, -1.0 if exchanged else 1.0], atol=1e-15)
    assert (len(rows), owner) == (1, 1 if exchanged else 0)
    np.testing.assert_allclose(rows[0, :3], [0.2, 0.505, 0.01], atol=1e-14)


def test_a_slight_tilt_shows_in_the_gaps():
    """A unit square on its left edge, tilted by 0.01: the right corner is sin 0.01 above."""
    tilt = 0.01
    y = 0.5 + 0.5 * (np.sin(tilt) + np.cos(tilt))
    normal, rows, _ = contact(box(0, 0, width=4), box(0, y, tilt))
    np.testing.assert_allclose(normal, [0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(np.sort(rows[:, 2]), [0.0, np.sin(tilt)], atol=1e-15)


def test_only_what_is_within_the_margin():
    tilt = 0.2
    y = 0.5 + 0.5 * (np.sin(tilt) + np.cos(tilt))
    assert len(contact(box(0, 0, width=4), box(0, y, tilt), 0.1)[1]) == 1
    assert len(contact(box(0, 0, width=4), box(0, y, tilt), 0.2)[1]) == 2
    assert len(contact(box(0, 0), box(0, 1.1), 0.0999)[1]) == 0
    assert len(contact(box(0, 0), box(0, 1.1), 0.1001)[1]) == 2
    assert len(contact(box(0, 0), box(3, 0))[1]) == 0


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_any_size(size):
    normal, rows, _ = contact(box(0, 0, 0, size, size), box(0.1 * size, 1.01 * size, 0, size, size), 0.05 * size)
    np.testing.assert_allclose(normal, [0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(rows[:, 2], 0.01 * size, rtol=1e-9)


def test_bodies_that_coincide_have_a_contact():
    normal, rows, _ = contact(box(0, 0), box(0, 0))
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    np.testing.assert_allclose(rows[:, 2], [-1.0, -1.0])


# ------------------------------------------------------------------ random, against the corners and axes themselves

length = st.floats(0.2, 2.0)
angle = st.floats(-np.pi, np.pi)


@st.composite
def near_pairs(draw):
    """Boxes of which one axis separates best by a random gap, within the margin or overlapping."""
    a = box(0.0, 0.0, draw(angle), draw(length), draw(length))
    turn, b = draw(angle), (draw(angle), draw(length), draw(length))
    direction = np.array([np.cos(turn), np.sin(turn)])
    low, high = 0.0, 10.0
    target = draw(st.floats(-0.1, MARGIN))
    for _ in range(40):  # how far along the direction the gap is as asked; it grows with the distance
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if separations(a, box(*(middle * direction), *b))[:, 2].max() < target else (low, middle)
        )
    return a, box(*(high * direction), *b)


@settings(max_examples=150, deadline=None)
@given(near_pairs())
def test_the_normal_is_the_axis_that_separates_best(pair):
    """Up to the preference for the first box's faces; it points from a to b and is a face's of its owner."""
    a, b = pair
    normal, rows, owner = contact(a, b)
    assume(len(rows))
    found = separations(a, b)
    mine = np.abs(found[:, :2] - normal).max(axis=1) <= 1e-12
    assert mine[4 * owner : 4 * owner + 4].any()
    room = PREFERENCE * (a[4] + a[5]) if owner == 0 else 0.0
    assert found[mine, 2].max() >= found[:, 2].max() - room - 1e-12


@settings(max_examples=150, deadline=None)
@given(near_pairs())
def test_points_are_between_the_surfaces(pair):
    """Half a gap along the normal from each point are points on both surfaces, and one of them is a corner."""
    a, b = pair
    normal, rows, owner = contact(a, b)
    for x, gap in zip(rows[:, :2], rows[:, 2], strict=True):
        on_a, on_b = x - 0.5 * gap * normal, x + 0.5 * gap * normal
        assert abs(outside(a, on_a)[0]) <= 1e-12
        assert abs(outside(b, on_b)[0]) <= 1e-12
        reference, incident = (on_a, on_b) if owner == 0 else (on_b, on_a)
        tips = np.abs(corners(b if owner == 0 else a) - incident).max(axis=1).min()
        ends = np.abs(corners(a if owner == 0 else b) - reference).max(axis=1).min()
        assert min(tips, ends) <= 1e-12


@settings(max_examples=150, deadline=None)
@given(near_pairs())
def test_no_corner_is_forgotten(pair):
    """Every corner of the incident box that is beyond the reference face, over its width, is a point of the contact."""
    a, b = pair
    normal, rows, owner = contact(a, b)
    assume(len(rows))
    reference, incident = (a, b) if owner == 0 else (b, a)
    outward = normal if owner == 0 else -normal
    centre, axes, half = frame(reference)
    along = int(np.argmax(np.abs(axes @ outward)))
    for corner in corners(incident):
        gap = (corner - centre) @ outward - half[along]
        across = abs((corner - centre) @ axes[1 - along])
        if gap <= -1e-9 and across <= half[1 - along] - 1e-9:
            assert np.abs(rows[:, :2] - (corner - 0.5 * gap * outward)).max(axis=1).min() <= 1e-9


@settings(max_examples=150, deadline=None)
@given(near_pairs())
def test_what_overlaps_touches(pair):
    a, b = pair
    assume(separations(a, b)[:, 2].max() < -1e-9)
    normal, rows, _ = contact(a, b, 0.0)
    assert len(rows) >= 1
    assert rows[:, 2].min() < 0.0
    # moved out along the normal by the deepest gap, they no longer overlap
    depth = -rows[:, 2].min() + 1e-9
    apart = (b[0] + depth * normal[0], b[1] + depth * normal[1], *b[2:])
    assert separations(a, apart)[:, 2].max() >= -PREFERENCE * (a[4] + a[5])


@settings(max_examples=150, deadline=None)
@given(near_pairs(), angle, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_rigid_motion_moves_the_contact(pair, turn, x, y):
    normal, rows, owner = contact(*pair)
    gaps = np.sort(separations(*pair)[:, 2])
    assume(gaps[-1] - gaps[-2] > 1e-9)
    shift = np.array([x, y])
    also, other, same = contact(*(moved(a, turn, shift) for a in pair))
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    if abs(gaps[-1] - gaps[-2] - PREFERENCE * (pair[0][4] + pair[0][5])) < 1e-9:
        return
    assert same == owner
    assert len(other) == len(rows) or np.abs(rows[:, 2] - MARGIN).min(initial=1.0) < 1e-9
    assume(len(other) == len(rows))
    np.testing.assert_allclose(also, rotation @ normal, atol=1e-12)
    np.testing.assert_allclose(other[:, :2], rows[:, :2] @ rotation.T + shift, atol=1e-11)
    np.testing.assert_allclose(other[:, 2], rows[:, 2], atol=1e-11)
    np.testing.assert_array_equal(other[:, 3], rows[:, 3])


@settings(max_examples=150, deadline=None)
@given(near_pairs())
def test_exchanged_boxes_have_the_same_contact(pair):
    """Where a face is better by more than the preference; the normal turns round."""
    a, b = pair
    found = separations(a, b)
    best, other = found[:4, 2].max(), found[4:, 2].max()
    assume(abs(best - other) > 1.01 * PREFERENCE * (a[4] + a[5] + b[4] + b[5]))
    normal, rows, owner = contact(a, b)
    turned, back, its = contact(b, a)
    assert len(back) == len(rows)
    assume(len(rows))
    assert its == 1 - owner
    np.testing.assert_allclose(turned, -normal, atol=1e-15)
    np.testing.assert_allclose(by_feature(back), by_feature(rows), atol=1e-13)


# ------------------------------------------------------------------ features


@settings(max_examples=150, deadline=None)
@given(near_pairs(), st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4))
def test_features_stay_through_a_small_motion(pair, x, y, turn):
    """They, and where they are, change little, unless another face or another side of it has become better."""
    a, b = pair
    normal, rows, owner = contact(a, b)
    also, other, same = contact(a, (b[0] + x, b[1] + y, *moved(b, turn, np.zeros(2))[2:]))
    assume(same == owner)
    assume(normal @ also > 0.99)
    incident = frame(b if owner == 0 else a)[1]
    assume(abs(abs(incident[0] @ normal) - np.sqrt(0.5)) > 1e-3)  # else its other face may be the one that faces
    kept = np.intersect1d(rows[:, 3], other[:, 3])
    for feature in kept:
        one, two = rows[rows[:, 3] == feature][0], other[other[:, 3] == feature][0]
        assert np.abs(one[:3] - two[:3]).max() <= 1e-2
    for feature in np.setxor1d(rows[:, 3], other[:, 3]):
        row = np.vstack([rows, other])
        row = row[row[:, 3] == feature][0]
        near_the_margin = abs(row[2] - MARGIN) <= 2e-3
        reference = frame(a if owner == 0 else b)
        across = np.abs((row[:2] - reference[0]) @ reference[1].T)
        near_the_end = np.abs(across - reference[2]).min() <= 2e-2
        assert near_the_margin or near_the_end


def test_features_tell_the_two_ends_and_the_four_faces():
    seen = set()
    for quarter in range(4):
        _, rows, _ = contact(box(0, 0, width=4), box(0.1, 1.01, quarter * np.pi / 2))
        assert len(rows) == 2
        seen |= set(rows[:, 3])
    assert len(seen) == 8


def test_a_sliding_box_keeps_its_features():
    """Over the whole face, with a part of it overhanging at both ends."""
    seen = {tuple(contact(box(0, 0, width=2), box(x, 1.001))[1][:, 3]) for x in np.linspace(-1.4, 1.4, 29)}
    assert len(seen) == 1
