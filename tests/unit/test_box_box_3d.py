"""Contacts of boxes in space: known ones, and random ones against other ways to find them."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from pbd.collision.box_box_3d import PREFERENCE, box_box
from pbd.collision.face_face import INSIDE, SAME
from pbd.jit import kernel

CUBE = (0.5, 0.5, 0.5)
UNTURNED = np.eye(3)


@kernel
def touch(a, b, margin, hint, points):
    return box_box(a, b, margin, hint, points)


def box(centre, half=CUBE, rotation=UNTURNED):
    return tuple(map(float, centre)), tuple(map(float, half)), tuple(map(float, np.ravel(rotation)))


def parts(box):
    centre, half, rotation = map(np.array, box)
    return centre, half, rotation.reshape(3, 3)


def about(axis, angle):
    """Rotation about an axis of any length."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return UNTURNED + np.sin(angle) * turn + (1.0 - np.cos(angle)) * turn @ turn


def random_rotation(rng):
    return about(rng.normal(size=3), rng.uniform(-np.pi, np.pi))


def contact(a, b, margin=1e-3, hint=-1):
    """(normal (3,), rows (count, 5), hint)."""
    points = np.full((8, 5), np.nan)
    count, normal, hint = touch(a, b, margin, hint, points)
    return np.array(normal), points[:count].copy(), hint


def by_feature(rows):
    return rows[np.argsort(rows[:, 4])]


def gaps_of_axes(a, b):
    """((15,) or fewer gaps, unit axes): the separating axis test written out."""
    (ca, ha, ra), (cb, hb, rb) = parts(a), parts(b)
    products = np.cross(ra.T[:, None], rb.T[None]).reshape(-1, 3)
    lengths = np.linalg.norm(products, axis=1)
    axes = np.vstack([ra.T, rb.T, products[lengths > 1e-4] / lengths[lengths > 1e-4, None]])
    return np.abs(axes @ (cb - ca)) - np.abs(axes @ ra) @ ha - np.abs(axes @ rb) @ hb, axes


def distance(a, b):
    """Least distance of two points, one in each box: a bounded linear least squares problem."""
    (ca, ha, ra), (cb, hb, rb) = parts(a), parts(b)
    limits = np.r_[ha, hb]
    found = lsq_linear(np.hstack([ra, -rb]), cb - ca, bounds=(-limits, limits), method="bvls")
    return np.sqrt(2.0 * found.cost)


def outside(box, points):
    """How far points are outside of a box, in the largest of its three directions."""
    centre, half, rotation = parts(box)
    return (np.abs((points - centre) @ rotation) - half).max(axis=1)


def overlap(a, b, normal):
    """Corners (k, 3) of the overlap of the most opposed faces: x, y in one of them, and gap. Sutherland and Hodgman."""
    faces = []
    for one, direction in ((a, normal), (b, -normal)):
        centre, half, rotation = parts(one)
        along = direction @ rotation
        k = np.abs(along).argmax()
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        local = np.empty((4, 3))
        local[:, k] = np.sign(along[k]) * half[k]
        local[:, [(k + 1) % 3, (k + 2) % 3]] = signs * half[[(k + 1) % 3, (k + 2) % 3]]
        faces.append((abs(along[k]), centre + local @ rotation.T, rotation[:, [(k + 1) % 3, (k + 2) % 3, k]], half, k))
    reference, incident = (0, 1) if faces[0][0] >= faces[1][0] else (1, 0)
    _, corners, frame, half, k = faces[reference]
    outward = -normal if reference else normal
    frame = np.column_stack([frame[:, 0], frame[:, 1], outward])
    polygon = (faces[incident][1] - corners.mean(axis=0)) @ frame
    for axis, width in ((0, half[(k + 1) % 3]), (1, half[(k + 2) % 3])):
        for sign in (1.0, -1.0):
            inside = width - sign * polygon[:, axis]
            kept = []
            for m in range(len(polygon)):
                n = (m + 1) % len(polygon)
                if inside[m] >= 0.0:
                    kept.append(polygon[m])
                if inside[m] * inside[n] < 0.0:
                    kept.append(polygon[m] + inside[m] / (inside[m] - inside[n]) * (polygon[n] - polygon[m]))
            polygon = np.array(kept).reshape(-1, 3)
    return polygon, corners.mean(axis=0), frame


def area(points):
    """Of the convex polygon of at most four points in a plane."""
    if len(points) < 3:
        return 0.0
    return max(
        0.5
        * abs(sum(points[p[i], 0] * points[p[i - 1], 1] - points[p[i], 1] * points[p[i - 1], 0] for i in range(len(p))))
        for p in itertools.permutations(range(len(points)))
    )


# ------------------------------------------------------------------ known contacts

SQUARE = [[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]]


@pytest.mark.parametrize("gap", [0.0, 1e-4, -1e-4, -0.125])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_equal_boxes_on_top_of_each_other(gap, axis, sign):
    up = np.zeros(3)
    up[axis] = sign
    normal, rows, _ = contact(box((0, 0, 0)), box((1.0 + gap) * up))
    assert normal.tolist() == up.tolist()
    corners = np.array(SQUARE)
    expected = np.insert(corners, axis, sign * (0.5 + 0.5 * gap), axis=1)
    found = rows[np.lexsort(np.delete(rows[:, :3], axis, axis=1).T[::-1])]
    np.testing.assert_allclose(found[:, :3], expected, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(found[:, 3], gap, rtol=0.0, atol=2e-16)
    assert set(rows[:, 4]) <= set(range(8, 16)), "vertices of the second box"


@pytest.mark.parametrize("jitter", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_jitter_leaves_four_points_and_exact_gaps(jitter):
    rng = np.random.default_rng(0)
    for _ in range(50):
        turn = about((0, 0, 1), jitter * rng.uniform(-1.0, 1.0))
        shift = jitter * rng.uniform(-1.0, 1.0, 3)
        normal, rows, _ = contact(box((0, 0, 0)), box(np.array([0.0, 0.0, 1.0]) + shift, CUBE, turn), margin=1e-2)
        assert len(rows) == 4
        np.testing.assert_allclose(rows[:, 3], shift[2], rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(np.abs(rows[:, :2]), 0.5, rtol=0.0, atol=2.0 * jitter + 1e-15)
        assert normal.tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("jitter", [1e-12, 1e-6, 1e-3])
def test_tilted_boxes_have_the_gaps_of_their_vertices(jitter):
    """Any small turn of a smaller box on a larger one: its four lowest vertices."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        turn = about(rng.normal(size=3), jitter)
        centre = np.array([0.1, -0.2, 1.0])
        rows = contact(box((0, 0, 0), (2.0, 2.0, 0.5)), box(centre, CUBE, turn), margin=1e-2)[1]
        vertices = centre + np.array([[x, y, -0.5] for x, y in SQUARE]) @ turn.T
        np.testing.assert_allclose(np.sort(rows[:, 3]), np.sort(vertices[:, 2] - 0.5), rtol=0.0, atol=1e-15)


def test_shifted_boxes_touch_where_they_overlap():
    normal, rows, _ = contact(box((0, 0, 0)), box((0.3, 0.4, 1.0)))
    assert normal.tolist() == [0.0, 0.0, 1.0]
    expected = [[-0.2, -0.1, 0.5], [-0.2, 0.5, 0.5], [0.5, -0.1, 0.5], [0.5, 0.5, 0.5]]
    np.testing.assert_allclose(sorted(rows[:, :3].tolist()), expected, rtol=0.0, atol=1e-15)
    kinds = sorted(["a" if f < 8 else "b" if f < 16 else "ab" for f in rows[:, 4]])
    assert kinds == ["a", "ab", "ab", "b"]
    assert rows[rows[:, 4] < 8, 4] == 7, "the first box's vertex at + + +"
    assert rows[(rows[:, 4] >= 8) & (rows[:, 4] < 16), 4] == 8, "the second box's vertex at - - -"


def test_half_a_right_angle_about_the_normal_leaves_four_of_eight():
    normal, rows, _ = contact(box((0, 0, 0)), box((0, 0, 1), CUBE, about((0, 0, 1), np.pi / 4)))
    assert normal.tolist() == [0.0, 0.0, 1.0]
    assert len(rows) == 4
    np.testing.assert_allclose(rows[:, 3], 0.0, rtol=0.0, atol=1e-15)
    corner = 0.5 * np.tan(np.pi / 8)
    np.testing.assert_allclose(np.sort(np.abs(rows[:, :2]), axis=1), [[corner, 0.5]] * 4, rtol=0.0, atol=1e-15)
    eighth = 2.0 * (0.25 + corner**2)
    assert area(rows) == pytest.approx(eighth, abs=1e-14), "a square of every second corner"
    assert (rows[:, 4] >= 16).all()


def test_crossed_edges_touch_at_one_point():
    a = box((0, 0, 0), CUBE, about((1, 0, 0), np.pi / 4))
    b = box((0.1, 0.2, 2.0 * np.sqrt(0.5) - 0.01), CUBE, about((0, 1, 0), np.pi / 4))
    normal, rows, hint = contact(a, b)
    np.testing.assert_allclose(normal, [0, 0, 1], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(rows[:, :4], [[0.1, 0.0, np.sqrt(0.5) - 0.005, -0.01]], rtol=0.0, atol=1e-15)
    assert hint == 6 + 3 * 0 + 1, "the first box's x edge times the second's y edge"
    edge_a, edge_b = divmod(int(rows[0, 4]) - 16, 12)
    assert (edge_a // 4, edge_b // 4) == (0, 1)


def test_a_corner_on_a_face_is_one_point():
    turn = about((1, 1, 0), np.arctan(np.sqrt(2.0)))
    assert np.abs(turn @ np.array([0.5, -0.5, -0.5]))[2] != 0.0
    height = np.abs(turn @ np.array([0.5, 0.5, 0.5])).max()
    corner = min((turn @ np.array(c) for c in itertools.product((-0.5, 0.5), repeat=3)), key=lambda c: c[2])
    b = box(np.array([0.2, 0.1, 0.5 - 1e-3]) - corner, CUBE, turn)
    normal, rows, _ = contact(box((0, 0, 0)), b)
    assert normal.tolist() == [0.0, 0.0, 1.0]
    np.testing.assert_allclose(rows[:, :4], [[0.2, 0.1, 0.5 - 5e-4, -1e-3]], rtol=0.0, atol=1e-15)
    assert 8 <= rows[0, 4] < 16
    assert height > 0.5


def test_only_points_within_the_margin_are_kept():
    b = box((0, 0, 1.0), CUBE, about((0, 1, 0), 0.01))
    low, high = contact(box((0, 0, 0)), b, margin=1e-3)[1], contact(box((0, 0, 0)), b, margin=0.02)[1]
    assert (len(low), len(high)) == (2, 4)
    assert (low[:, 3] < 0.0).all()


@pytest.mark.parametrize("offset", [(0, 0, 1.01), (1.01, 0.2, 0.1), (0.9, 1.1, 0.0), (30.0, 40.0, 50.0)])
def test_boxes_apart_have_no_contact(offset):
    normal, rows, hint = contact(box((0, 0, 0)), box(offset))
    assert len(rows) == 0
    assert normal.tolist() == [0.0, 0.0, 0.0]
    assert contact(box((0, 0, 0)), box(offset), hint=hint)[2] == hint


def test_flat_contacts_keep_their_features_in_small_motions():
    """Of equal boxes on top of each other, shifted ones, turned ones, and a small one on a large one."""
    rng = np.random.default_rng(3)
    kinds = {
        "equal": (CUBE, (0, 0, 1.0), 0.0),
        "shifted": (CUBE, (0.2, 0.1, 1.0), 0.0),
        "turned": (CUBE, (0, 0.1, 1.0), 0.5),
        "octagon": (CUBE, (0, 0, 1.0), np.pi / 4),
        "small": ((0.2, 0.3, 0.5), (0.1, 0, 1.0), 0.3),
    }
    for name, (half, centre, angle) in kinds.items():
        features, hint = set(), -1
        for _ in range(200):
            small = about(rng.normal(size=3), 2e-7) @ about((0, 0, 1), angle)
            _, rows, hint = contact(box((0, 0, 0)), box(centre + 2e-7 * rng.normal(size=3), half, small), hint=hint)
            features.add(tuple(sorted(rows[:, 4])))
        assert len(features) == 1, name
        assert len(features.pop()) == 4


def test_bad_numbers_do_no_harm():
    for bad in (np.nan, np.inf, 1e300):
        for hint in range(-1, 15):
            contact(box((0, 0, 0)), box((0, bad, 1)), hint=hint)
            contact(box((0, 0, 0)), box((0, 0, 1), (0.5, 0.5, bad)), hint=hint)
            contact(box((0, 0, 0), CUBE, np.full(9, bad)), box((0, 0, 1)), hint=hint)


# ------------------------------------------------------------------ random contacts


def pair(seed, kind, depth):
    """Boxes whose largest gap along the 15 axes is -depth, turned against each other in a way of that kind."""
    rng = np.random.default_rng(seed)
    ha, hb = (CUBE, CUBE) if rng.random() < 0.5 else 10.0 ** rng.uniform(-0.5, 0.5, (2, 3))
    ra = random_rotation(rng)
    turn = {
        "any": random_rotation(rng),
        "aligned": UNTURNED,
        "quarter": about((0, 0, 1), np.pi / 4),
        "edge on": about((1, 0, 0), np.pi / 4),
        "tilted": about(rng.normal(size=3), 10.0 ** rng.uniform(-3, -1)),
        "yawed": about((0, 0, 1), rng.uniform(0, np.pi)),
        "askew": about(rng.normal(size=3), 10.0 ** rng.uniform(-4, -1)) @ about((0, 0, 1), rng.uniform(0, np.pi)),
    }[kind]
    towards = rng.normal(size=3) if rng.random() < 0.5 else ra[:, rng.integers(3)] + 0.3 * rng.normal(size=3)
    start, axes = gaps_of_axes(box((0, 0, 0), ha, ra), box((0, 0, 0), hb, ra @ turn))
    centre = rng.normal(size=3)
    steps = (-depth - start) / np.maximum(np.abs(axes @ towards), 1e-9)
    return box(centre, ha, ra), box(centre + steps.min() * towards, hb, ra @ turn)


KINDS = ["any", "aligned", "quarter", "edge on", "tilted", "yawed", "askew"]
pairs = st.builds(
    pair,
    st.integers(0, 2**32 - 1),
    st.sampled_from(KINDS),
    st.sampled_from([0.1, 1e-2, 1e-3, 1e-6, 0.0, -1e-4]),
)
many = settings(max_examples=400, deadline=None)


def smallest(a, b):
    return min(*a[1], *b[1])


def widest(a, b):
    return 2.0 * max(*a[1], *b[1])


@many
@given(pairs)
def test_the_gap_is_the_largest_of_fifteen_axes(ab):
    a, b = ab
    normal, rows, _ = contact(a, b, margin=1e-2)
    gap = gaps_of_axes(a, b)[0].max()
    assert 1 <= len(rows) <= 4 or gap > 0.0
    if len(rows):
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-13)
        assert normal @ (parts(b)[0] - parts(a)[0]) >= 0.0
        assert len(set(rows[:, 4])) == len(rows)
        below = PREFERENCE * smallest(a, b) + 1e-13
        assert gap - 2.0 * below <= rows[:, 3].min() <= gap + 2.0 * SAME * widest(a, b) + (gap > 0.0) * 1e-2


@many
@given(pairs)
def test_points_lie_halfway_between_the_surfaces(ab):
    a, b = ab
    normal, rows, _ = contact(a, b, margin=1e-2)
    for one, sign in ((a, -1.0), (b, 1.0)):
        surface = rows[:, :3] + sign * 0.5 * rows[:, 3:4] * normal
        assert np.abs(outside(one, surface)).max(initial=0.0) <= 2.0 * INSIDE * widest(a, b)


def off_vertex(box, number, point):
    """How far a point is from a vertex: bit k of its number is its side on axis k."""
    centre, half, rotation = parts(box)
    return np.linalg.norm(point - centre - rotation @ (half * [1 if number >> k & 1 else -1 for k in range(3)]))


def off_edge(box, number, point):
    """How far a point is from the line of an edge: 4 times its axis, and its sides on the two axes that follow."""
    centre, half, rotation = parts(box)
    axis, sides = number // 4, number % 4
    m, n = (axis + 1) % 3, (axis + 2) % 3
    local = (point - centre) @ rotation
    return np.hypot(local[m] - half[m] * (2 * (sides & 1) - 1), local[n] - half[n] * (sides - (sides & 1) - 1))


@many
@given(pairs)
def test_points_are_where_the_features_are(ab):
    a, b = ab
    normal, rows, _ = contact(a, b, margin=1e-2)
    near = 2.0 * INSIDE * widest(a, b)
    for row in rows:
        f, on_a, on_b = int(row[4]), row[:3] - 0.5 * row[3] * normal, row[:3] + 0.5 * row[3] * normal
        if f < 16:
            assert off_vertex(*((a, f, on_a) if f < 8 else (b, f - 8, on_b))) <= near
        else:
            edge_a, edge_b = divmod(f - 16, 12)
            assert off_edge(a, edge_a, on_a) <= near
            assert off_edge(b, edge_b, on_b) <= near


@settings(max_examples=300, deadline=None)
@given(pairs, st.floats(0.0, 0.3), st.integers(0, 2**32 - 1))
def test_boxes_apart_are_as_far_as_least_squares_say(ab, further, seed):
    """The gap along an axis never exceeds the distance, and the distance never the gap of a point."""
    a, b = ab
    centre, half, rotation = parts(b)
    away = centre - parts(a)[0]
    away = away / np.linalg.norm(away) + 0.5 * np.random.default_rng(seed).normal(size=3)
    b = box(centre + further * away, half, rotation)
    gap = gaps_of_axes(a, b)[0].max()
    _, rows, _ = contact(a, b, margin=0.5)
    true = distance(a, b)
    assert gap <= true + 1e-12
    if len(rows):
        assert true <= max(rows[:, 3].min(), 0.0) + 2.0 * (PREFERENCE + INSIDE) * widest(a, b)


@settings(max_examples=150, deadline=None)
@given(pairs)
def test_no_way_out_is_shorter(ab):
    """Moved out along the normal the boxes only touch; moved as far in any other direction they still overlap."""
    a, b = ab
    normal, rows, _ = contact(a, b)
    if not len(rows) or rows[:, 3].min() > -1e-3:
        return
    centre, half, rotation = parts(b)
    depth = -rows[:, 3].min() + 2.0 * (PREFERENCE + SAME) * widest(a, b)
    assert gaps_of_axes(a, box(centre + depth * normal, half, rotation))[0].max() >= -1e-12
    directions = np.random.default_rng(0).normal(size=(50, 3))
    short = 1.0 - 4.0 * (PREFERENCE + SAME) * widest(a, b) / depth
    for direction in directions / np.linalg.norm(directions, axis=1)[:, None]:
        assert gaps_of_axes(a, box(centre + max(short, 0.0) * depth * direction, half, rotation))[0].max() < 0.0


@many
@given(pairs)
def test_face_contacts_are_corners_of_the_overlap_that_span_it(ab):
    a, b = ab
    normal, rows, hint = contact(a, b, margin=100.0)
    if hint > 5 or not len(rows):
        return
    polygon, origin, frame = overlap(a, b, normal)
    local = (rows[:, :3] - origin) @ frame
    local[:, 2] = rows[:, 3]
    near = 4.0 * SAME * widest(a, b)
    for point in local:
        assert np.abs(polygon - point).max(axis=1).min() <= near, "each is a corner"
    assert local[:, 2].min() <= polygon[:, 2].min() + near, "the deepest is among them"
    if len(polygon) <= 4:
        assert area(local) == pytest.approx(area(polygon), abs=near * widest(a, b)), "all of them"
    threes = [polygon[list(three)] for three in itertools.combinations(range(len(polygon)), 3)]
    deep = local[local[:, 2] <= polygon[:, 2].min() + near]
    held = [max((area(np.vstack([corner, three])) for three in threes), default=0.0) for corner in deep]
    assert area(local) >= min(held) - near * widest(a, b), "no other three span more with one that is deepest"
    assert area(local) >= 0.75 * max(held) - near * widest(a, b)


def clear(a, b):
    """Whether one axis is clearly the best, and no rounding decides between others."""
    gaps = np.sort(gaps_of_axes(a, b)[0])
    return gaps[-1] - gaps[-2] > 4.0 * PREFERENCE * smallest(a, b)


@many
@given(pairs)
def test_the_other_way_round_it_is_the_same_contact(ab):
    a, b = ab
    if not clear(a, b):
        return
    (normal, rows, _), (back, others, _) = contact(a, b), contact(b, a)
    np.testing.assert_allclose(back, -normal, rtol=0.0, atol=1e-12)
    assert len(rows) == len(others)
    for row in rows:
        f = int(row[4])
        edge_a, edge_b = divmod(f - 16, 12)
        mirrored = f + 8 if f < 8 else f - 8 if f < 16 else 16 + 12 * edge_b + edge_a
        match = others[others[:, 4] == mirrored]
        np.testing.assert_allclose(match[:, :4], [row[:4]], rtol=0.0, atol=1e-12)


@many
@given(pairs, st.integers(0, 2**32 - 1))
def test_rigid_motions_move_the_contact(ab, seed):
    a, b = ab
    if not clear(a, b):
        return
    rng = np.random.default_rng(seed)
    turn, shift = random_rotation(rng), rng.normal(size=3)
    moved = [box(turn @ parts(one)[0] + shift, one[1], turn @ parts(one)[2]) for one in ab]
    (normal, rows, hint), (turned, others, again) = contact(a, b), contact(*moved)
    assert hint == again
    if set(rows[:, 4]) != set(others[:, 4]):
        corners = overlap(a, b, normal)[0]
        assert len(corners) > 4, "only among equally good ones may others be chosen"
        return
    np.testing.assert_allclose(turned, turn @ normal, rtol=0.0, atol=1e-12)
    rows, others = by_feature(rows), by_feature(others)
    np.testing.assert_allclose(others[:, :3], rows[:, :3] @ turn.T + shift, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(others[:, 3], rows[:, 3], rtol=0.0, atol=1e-12)


@many
@given(pairs, st.integers(-1, 14))
def test_a_hint_never_hides_a_contact(ab, hint):
    a, b = ab
    (normal, rows, _), (same, others, _) = contact(a, b), contact(a, b, hint=hint)
    assert (len(rows) > 0) == (len(others) > 0)
    if clear(a, b):
        np.testing.assert_array_equal(same, normal)
        np.testing.assert_array_equal(others, rows)


@many
@given(pairs, st.integers(0, 14))
def test_a_hint_ends_what_it_separates(ab, hint):
    a, b = ab
    centre, half, rotation = parts(b)
    b = box(parts(a)[0] + 1.2 * (centre - parts(a)[0]), half, rotation)
    gaps, _ = gaps_of_axes(a, b)
    _, rows, found = contact(a, b, hint=hint)
    if len(gaps) == 15 and abs(gaps[hint] - 1e-3) > 1e-9:
        separates = gaps[hint] > 1e-3
        assert not separates or (found == hint and len(rows) == 0)
    if gaps.max() > 1e-3 + 1e-9:
        assert len(rows) == 0
        _, rows, again = contact(a, b, hint=found)
        assert len(rows) == 0
        assert again == found


# ------------------------------------------------------------------ without a compiler

PROGRAM = """
import json
import sys
import numba
sys.path.insert(0, sys.argv[1])
import test_box_box_3d as t
assert bool(numba.config.DISABLE_JIT) == (sys.argv[2] == "NUMBA_DISABLE_JIT")
assert bool(numba.config.BOUNDSCHECK) == (sys.argv[2] == "NUMBA_BOUNDSCHECK")
print(json.dumps(t.samples()))
"""


def samples():
    found = []
    for seed, kind in enumerate(KINDS * 8):
        normal, rows, hint = contact(*pair(seed, kind, 1e-3))
        found.append([normal.tolist(), by_feature(rows).tolist(), int(hint)])
    test_bad_numbers_do_no_harm()
    return found


@pytest.mark.parametrize("variable", ["NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK"])
def test_plain_python_finds_the_same_and_no_index_is_out_of_range(variable):
    command = [sys.executable, "-c", PROGRAM, os.path.dirname(__file__), variable]
    done = subprocess.run(command, env={**os.environ, variable: "1"}, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    for mine, theirs in zip(samples(), json.loads(done.stdout), strict=True):
        assert mine[2] == theirs[2]
        np.testing.assert_allclose(theirs[0], mine[0], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(theirs[1], mine[1], rtol=0.0, atol=1e-12)
