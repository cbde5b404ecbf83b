"""Shape matching: the nearest rotation, what one projection does, what it keeps, and how it turns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pbd
from pbd.constraints.polar import extract, nearest_quaternions, nearest_rotation
from pbd.errors import InvalidInput
from pbd.projection import project
from pbd.state import State
from pbd.vector import from_store, to_store

EPS = 1e-13
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])


def nearest(A):
    """(d, d) R of the polar decomposition of A, by singular values: the best rotation, of determinant 1."""
    u, _, vt = np.linalg.svd(A)
    signs = np.append(np.ones(len(A) - 1), np.sign(np.linalg.det(u @ vt)))
    return u @ (signs[:, None] * vt)


def matrix(q):
    """(3, 3) of a unit quaternion (w, x, y, z)."""
    w, v = q[0], np.asarray(q[1:])
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew


def random_rotation(rng, dimension):
    return nearest(rng.normal(size=(dimension, dimension)))


def cloud(rng, dimension, count=6):
    """Places, turned and moved and deformed positions, and masses over two decades."""
    rest = rng.normal(size=(count, dimension))
    stretch = np.eye(dimension) + 0.2 * rng.normal(size=(dimension, dimension))
    x = rest @ (random_rotation(rng, dimension) @ stretch).T + rng.normal(size=dimension)
    return rest, x, 10.0 ** rng.uniform(-1.0, 1.0, count)


def matched(rest, x, masses, k=1.0):
    """What one projection must give: p + k (c + R r - p)."""
    share = masses / masses.sum()
    arms, c = rest - share @ rest, share @ x
    R = nearest((masses[:, None] * (x - c)).T @ arms)
    return x + k * (c + arms @ R.T - x)


def projected(rest, x, masses, law=None, iterations=1):
    """The positions after that many projections, by the batch."""
    particles = pbd.particles(x, masses=masses)
    batch = pbd.shape_matching(particles, [range(len(x))], rest=rest, law=law)
    bound = batch._replace(law=batch.law.bind(1, iterations, batch.weights(particles.w)))
    for _ in range(iterations):
        project(bound, State(particles, None, np.zeros(2, dtype=np.int64)), 0.01)
    return from_store(particles.p)


def turning(r, v, masses):
    """sum m r x v as a 3-vector."""
    lifted = [np.pad(a, ((0, 0), (0, 3 - a.shape[1]))) for a in (r, v)]
    return masses @ np.cross(*lifted)


# ------------------------------------------------------------------ the nearest rotation


@pytest.mark.parametrize(("decades", "farthest"), [(3.0, 0.3), (1.0, math.pi)])
@given(seed=st.integers(0, 10**6))
@settings(max_examples=200, deadline=None)
def test_extraction_finds_the_polar_rotation(decades, farthest, seed):
    """det > 0: R to round-off, from a fifth of a right angle for the flattest shapes, for others from anywhere."""
    rng = np.random.default_rng(seed)
    R, V, axis = random_rotation(rng, 3), random_rotation(rng, 3), rng.normal(size=3)
    A = R @ V @ np.diag(10.0 ** rng.uniform(-decades, 0.0, 3)) @ V.T
    angle = rng.uniform(0.0, farthest)
    away = np.append(math.cos(0.5 * angle), math.sin(0.5 * angle) * axis / np.linalg.norm(axis))
    q = extract(tuple(map(tuple, A)), tuple(composed(away, nearest_quaternions(R))))
    np.testing.assert_allclose(matrix(q), R, atol=1e-11)


def composed(p, q):
    """The quaternion of the rotation q and then p."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.append(p[0] * q[0] - p[1:] @ q[1:], vector)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=100, deadline=None)
def test_extraction_handles_inverted_matrices(seed):
    """det < 0: still a rotation, and the one of largest tr(R^T A)."""
    rng = np.random.default_rng(seed)
    mirrored = np.diag([3.0, 2.0, -rng.uniform(0.1, 1.0)])
    V = random_rotation(rng, 3)
    A = random_rotation(rng, 3) @ V @ mirrored @ V.T
    start = nearest_quaternions(A) + 0.1 * rng.normal(size=4)
    q = extract(tuple(map(tuple, A)), tuple(start / np.linalg.norm(start)))
    np.testing.assert_allclose(matrix(q), nearest(A), atol=1e-10)
    assert np.linalg.det(matrix(q)) == pytest.approx(1.0, abs=EPS)


def test_extraction_of_nothing_stays_where_it_is():
    """A = 0, a shape shrunk to a point, has no rotation: the last one remains."""
    start = (0.5, 0.5, -0.5, 0.5)
    np.testing.assert_allclose(extract(((0.0,) * 3,) * 3, start), start, atol=1e-15)
    np.testing.assert_array_equal(nearest_rotation(((0.0, 0.0), (0.0, 0.0)), (), 0), np.eye(2))


@given(seed=st.integers(0, 10**6))
@settings(max_examples=100, deadline=None)
def test_quaternions_of_many_matrices_at_once(seed):
    """Horn's eigenvectors give the same rotations, half turns and inverted matrices included."""
    A = np.random.default_rng(seed).normal(size=(7, 3, 3))
    for q, one in zip(nearest_quaternions(A), A, strict=True):
        np.testing.assert_allclose(matrix(q), nearest(one), atol=1e-9)
    half_turns = np.array([np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])])
    np.testing.assert_allclose([matrix(q) for q in nearest_quaternions(half_turns)], half_turns, atol=1e-15)


# ------------------------------------------------------------------ one projection


@DIMENSIONS
@pytest.mark.parametrize("k", [1.0, 0.3, 0.0])
def test_a_projection_gives_the_matched_shape(dimension, k):
    for seed in range(20):
        rest, x, masses = cloud(np.random.default_rng(seed), dimension)
        found = projected(rest, x, masses, pbd.Stiffness(k))
        np.testing.assert_allclose(found, matched(rest, x, masses, k), atol=1e-12)


@DIMENSIONS
def test_rigid_motions_are_left_alone(dimension):
    """A turned and moved shape is in place, half turns included, to round-off."""
    rng = np.random.default_rng(3)
    turns = [random_rotation(rng, dimension) for _ in range(20)]
    turns.append(np.diag([-1.0, -1.0, 1.0][:dimension]))
    for turn in turns:
        rest, _, masses = cloud(rng, dimension)
        x = rest @ turn.T + rng.normal(size=dimension)
        np.testing.assert_allclose(projected(rest, x, masses), x, atol=1e-14)


@DIMENSIONS
@pytest.mark.parametrize("iterations", [1, 2, 5, 20, 50])
def test_corrected_stiffness_leaves_the_same_for_any_number_of_iterations(dimension, iterations):
    """R stays as it is while the shape yields, so k' leaves exactly 1 - k of the misfit, and raw k (1 - k)^n."""
    rest, x, masses = cloud(np.random.default_rng(1), dimension)
    goal = matched(rest, x, masses)
    for raw, left in ((False, 0.6), (True, 0.6**iterations)):
        found = projected(rest, x, masses, pbd.Stiffness(0.4, raw=raw), iterations)
        np.testing.assert_allclose(found - goal, left * (x - goal), atol=1e-12)


@DIMENSIONS
@pytest.mark.parametrize("k", [1.0, 0.3])
def test_a_projection_keeps_both_momenta(dimension, k):
    for seed in range(20):
        rest, x, masses = cloud(np.random.default_rng(seed), dimension)
        change = projected(rest, x, masses, pbd.Stiffness(k)) - x
        assert np.abs(change).max() > 1e-3
        scale = masses.sum() * np.abs(x).max() * np.abs(change).max()
        assert np.abs(masses @ change).max() <= EPS * scale
        assert np.abs(turning(x, change, masses)).max() <= EPS * scale


def test_shapes_that_share_a_particle_follow_one_another():
    """Gauss-Seidel over shapes, each with its own stiffness."""
    rng = np.random.default_rng(0)
    rest = rng.normal(size=(5, 2))
    x, groups = rest + 0.1 * rng.normal(size=(5, 2)), ([0, 1, 2], [4, 3, 2])
    particles = pbd.particles(x, masses=2.0)
    batch = pbd.shape_matching(particles, groups, rest=rest, law=pbd.Stiffness(np.array([1.0, 0.5])))
    bound = batch._replace(law=batch.law.bind(2, 1, batch.weights(particles.w)))
    state = State(particles, None, np.zeros(2, dtype=np.int64))
    project(bound, state, 0.01)
    expected = x.copy()
    for group, k in zip(groups, (1.0, 0.5), strict=True):
        expected[group] = matched(rest[group], expected[group], np.full(3, 2.0), k)
    np.testing.assert_allclose(from_store(particles.p), expected, atol=1e-14)
    assert state.work[0] == 2


# ------------------------------------------------------------------ whole steps


def spun(dimension, omega, h, steps):
    """Angles of a free body that spins about z, its axis of inertia, from its positions."""
    corners = np.array([[-0.7, -0.2, -0.1], [0.7, -0.2, 0.1], [-0.7, 0.2, 0.1], [0.7, 0.2, -0.1]])[:, :dimension]
    velocities = np.zeros_like(corners)
    velocities[:, 0], velocities[:, 1] = -omega * corners[:, 1], omega * corners[:, 0]
    particles = pbd.particles(corners, velocities=velocities)
    batch = pbd.shape_matching(particles, [range(4)])
    out = pbd.Simulation(particles, [batch], gravity=np.zeros(dimension), settings=pbd.Settings(dt=h)).run(steps)
    edge = out.positions[:, 1] - out.positions[:, 0] + out.positions[:, 3] - out.positions[:, 2]
    return np.unwrap(np.arctan2(edge[:, 1], edge[:, 0]))


@DIMENSIONS
def test_a_free_spin_slows_by_its_own_law(dimension):
    """v = (p - x)/h: R_(n+1) is nearest to 2 R_n - R_(n-1), which turns by atan(sin a / (2 - cos a)) after a.

    The same law as that of a spinning rod; to first order in h the spin falls by omega^3 h a second.
    """
    h, omega, steps = 0.01, 5.0, 100
    turns = [math.atan(omega * h)]
    for _ in range(steps - 1):
        turns.append(math.atan(math.sin(turns[-1]) / (2.0 - math.cos(turns[-1]))))
    np.testing.assert_allclose(np.diff(spun(dimension, omega, h, steps)), turns, rtol=1e-10)
    assert (turns[1] - turns[0]) / h**2 == pytest.approx(-(omega**3) * h, rel=0.01)


def test_a_soft_shape_keeps_momentum_in_free_flight():
    rng = np.random.default_rng(4)
    rest, x, masses = cloud(rng, 3)
    v = rng.normal(size=x.shape)
    particles = pbd.particles(x, masses=masses, velocities=v)
    batch = pbd.shape_matching(particles, [range(6)], rest=rest, law=pbd.Stiffness(0.2))
    settings = pbd.Settings(dt=0.01, iterations=4)
    out = pbd.Simulation(particles, [batch], gravity=np.zeros(3), settings=settings).run(200)
    momenta = np.einsum("n,snd->sd", masses, out.velocities)
    assert np.ptp(np.sum(out.velocities**2, axis=(1, 2))) > 1.0, "the shape does pull"
    np.testing.assert_allclose(momenta, np.tile(masses @ v, (201, 1)), atol=1e-10)


# ------------------------------------------------------------------ what is refused


@pytest.mark.parametrize(
    ("shapes", "changes", "field"),
    [
        ([[0, 1, 2]], {"law": pbd.Compliance(1e-3)}, "law"),
        ([[0, 1, 2]], {"law": pbd.Stiffness(1.0, relation="at_least")}, "law"),
        ([[0, 1, 1]], {}, "shapes[0]"),
        ([[0, 1], [2]], {}, "shapes[1]"),
        ([[0, 1, 7]], {}, "shapes[0]"),
        ([[0, 1, 3]], {}, "shapes[0]"),
        ([[0, 1, 2]], {"rest": np.zeros((4, 2))}, "shapes[0]"),
        ([[0, 1, 2]], {"rest": np.zeros((4, 3))}, "rest"),
    ],
)
def test_what_is_no_shape_is_refused(shapes, changes, field):
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], pinned=[3])
    with pytest.raises(InvalidInput) as refused:
        pbd.shape_matching(particles, shapes, **changes)
    assert refused.value.field == field


def test_one_dimension_is_refused():
    with pytest.raises(InvalidInput, match="dimension 2 or 3"):
        pbd.shape_matching(pbd.particles([[0.0], [1.0]]), [[0, 1]])


@pytest.mark.parametrize("solver", [pbd.Jacobi(), pbd.Direct(), pbd.GaussSeidel("coloured")])
def test_solvers_that_cannot_match_shapes_say_so(solver):
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    batches = [pbd.distance(particles, [(0, 1)]), pbd.shape_matching(particles, [[0, 1, 2]])]
    with pytest.raises(InvalidInput, match="ShapeMatching"):
        pbd.Simulation(particles, batches, settings=pbd.Settings(solver=solver))


def test_a_batch_of_no_shapes_is_dropped():
    particles = pbd.particles(np.zeros((0, 3)))
    batch = pbd.shape_matching(particles, [])
    assert batch.size() == 0
    assert [axis.shape for axis in batch.rest] == [(0,)] * 3
    assert to_store(np.zeros((0, 3)))[0].shape == (0,)
    assert pbd.Simulation(particles, [batch], gravity=np.zeros(3)).run(1).projections == 0
