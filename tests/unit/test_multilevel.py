"""Hierarchical PBD: the levels' invariants, what passes between them, and what is refused."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import pbd
from pbd.errors import InvalidInput
from pbd.integrators.shake import Shake
from pbd.solvers.coarsening import Graph, K, coarse_levels
from pbd.vector import from_store


def grid(size, stretch=1.0, pinned=(), depth=0.0):
    """Particles and links (edges, diagonals, two-cell) of a square cloth with unit cells; (particles, pairs, rest)."""
    number = np.arange(size * size).reshape(size, size)
    ends = [
        (number[:, :-1], number[:, 1:]),
        (number[:-1], number[1:]),
        (number[:-1, :-1], number[1:, 1:]),
        (number[:-1, 1:], number[1:, :-1]),
        (number[:, :-2], number[:, 2:]),
        (number[:-2], number[2:]),
    ]
    pairs = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in ends])
    row, column = (index.ravel().astype(float) for index in np.indices((size, size)))
    x = np.column_stack([column, row, 0.0 * row])
    rest = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    x[:, 1] *= stretch
    x[:, 2] = depth * np.random.default_rng(5).standard_normal(len(x))
    return pbd.particles(x, masses=1.0 + row, pinned=pinned), pairs, rest


def chain(links, stretch=1.0, pinned=(0,), dimension=2):
    x = np.zeros((links + 1, dimension))
    x[:, 0] = stretch * np.arange(links + 1)
    return pbd.particles(x, pinned=pinned), np.column_stack([np.arange(links), np.arange(links) + 1]), np.ones(links)


def random_graph(count, seed):
    """A connected graph: a tree and as many more links."""
    rng = np.random.default_rng(seed)
    tree = [(int(rng.integers(i)), i) for i in range(1, count)]
    more = [tuple(sorted(pair)) for pair in rng.integers(count, size=(count, 2)) if pair[0] != pair[1]]
    pairs = np.array(sorted({*tree, *more}))
    particles = pbd.particles(rng.standard_normal((count, 3)), pinned=[0, count // 2])
    return particles, pairs[particles.w[pairs].sum(axis=1) > 0.0], rng.uniform(0.5, 2.0, len(pairs))


CLOUDS = {
    "chain": lambda: chain(100),
    "two particles": lambda: chain(1),
    "cloth": lambda: grid(16, pinned=(0, 15)),
    "free cloth": lambda: grid(9),
    "graph": lambda: random_graph(80, 1),
    "another graph": lambda: random_graph(200, 2),
}


@pytest.fixture(params=CLOUDS, name="levels")
def fixture_levels(request):
    particles, pairs, rest = CLOUDS[request.param]()
    m = len(pairs)
    return particles, coarse_levels(particles, Graph(pairs, rest[:m], np.zeros(m, dtype=bool), np.zeros(m)), 64)


def pairs_of(levels):
    return itertools.pairwise(levels)


def test_every_level_is_a_part_of_the_one_before(levels):
    particles, found = levels
    for fine, coarse in pairs_of(found):
        before, after = np.unique(fine.graph.pairs), np.unique(coarse.graph.pairs)
        assert set(after) <= set(before) - set(coarse.child)
        assert len(coarse.child) > 0
        assert np.all(particles.w[coarse.child] > 0.0), "a pinned particle stays coarse"


def test_every_fine_particle_has_parents_among_its_neighbours(levels):
    for fine, coarse in pairs_of(levels[1]):
        links = {frozenset(pair) for pair in fine.graph.pairs.tolist()}
        for a, i in enumerate(coarse.child):
            parents = coarse.parents.column[coarse.parents.start[a] : coarse.parents.start[a + 1]]
            assert len(parents) >= K
            assert not set(parents) & set(coarse.child)
            assert all(frozenset((int(i), int(j))) in links for j in parents)


def test_nothing_more_could_be_made_fine(levels):
    """The coarsening goes on to the top: every movable particle of the last level has a reason to stay."""
    graph = levels[1][-1].graph
    degree = np.bincount(graph.pairs.ravel(), minlength=len(levels[0].w))
    assert np.all(degree[levels[0].w > 0.0] < K)


def test_weights_have_sum_one(levels):
    for level in levels[1][1:]:
        total = np.add.reduceat(level.parents.value, level.parents.start[:-1])
        np.testing.assert_allclose(total, 1.0, rtol=1e-14)
        assert level.parents.value.min() > 0.0


def test_masses_are_passed_to_parents(levels):
    """Where no parent is pinned, nothing of the mass is lost."""
    particles, found = levels
    if particles.w.min() > 0.0:
        for level in found:
            assert level.mass.sum() == pytest.approx((1.0 / particles.w).sum(), rel=1e-13)


def test_coarse_links_stand_for_paths_between_their_ends(levels):
    """Taken as vectors between the particles as they are, the finer links add up to the coarse one exactly."""
    particles, found = levels
    x = from_store(particles.x)
    for fine, coarse in pairs_of(found):
        inner = x[fine.graph.pairs[:, 0]] - x[fine.graph.pairs[:, 1]]
        start, column, value = coarse.paths
        for c, (i, j) in enumerate(coarse.graph.pairs):
            entries = slice(start[c], start[c + 1])
            np.testing.assert_allclose(value[entries] @ inner[column[entries]], x[i] - x[j], rtol=0, atol=1e-12)


def test_a_chain_is_halved():
    particles, pairs, rest = chain(64)
    found = coarse_levels(particles, Graph(pairs, rest, np.zeros(64, dtype=bool), np.zeros(64)), 64)
    assert [len(level.graph.pairs) for level in found] == [64, 32, 16, 8, 4, 2, 1]
    assert [level.graph.length[0] for level in found] == [1, 2, 4, 8, 16, 32, 64]


# ------------------------------------------------------------------ the solve


def solve(scene, solver, iterations=1, laws=(None,), steps=1, gravity=None, floor=None):
    particles, pairs, rest = scene
    batches = [pbd.distance(particles, pairs, rest_length=rest, law=law) for law in laws]
    if floor is not None:
        batches.append(pbd.plane_contact(particles, normal=floor[0], offset=floor[1]))
    settings = pbd.Settings(dt=0.01, iterations=iterations, solver=solver)
    return pbd.Simulation(particles, batches, gravity=gravity, settings=settings).run(steps)


def worst(outcome, scene):
    x = outcome.positions[-1]
    return np.abs(np.linalg.norm(x[scene[1][:, 0]] - x[scene[1][:, 1]], axis=1) / scene[2] - 1.0).max()


def test_no_level_is_gauss_seidel_to_the_last_bit():
    scene = grid(8, 1.1, pinned=(0, 7))
    outcomes = [solve(scene, solver, 7, steps=3) for solver in (pbd.Multilevel(levels=0), pbd.GaussSeidel())]
    np.testing.assert_array_equal(outcomes[0].positions, outcomes[1].positions)
    assert outcomes[0].projections == outcomes[1].projections


def test_projections_are_counted():
    """A chain of 8 has levels of 4, 2 and 1: fine sweeps first, then a cycle with its carried lengths."""
    outcome = solve(chain(8, 1.1), pbd.Multilevel(sweeps=3, coarse_sweeps=5), iterations=2)
    assert outcome.projections == 3 * 8 + 2 * ((8 + 7) + 5 * 7 + 3 * 8)
    fixed = pbd.Multilevel(sweeps=3, coarse_sweeps=5, lengths="path", unilateral=True)
    assert solve(chain(8, 1.1), fixed, iterations=2).projections == 2 * (5 * 7 + 3 * 8)


@pytest.mark.parametrize("lengths", ["carried", "straight"])
def test_rest_is_left_as_it_is(lengths):
    """No level asks for anything where all lengths are right, however the cloth lies."""
    scene = grid(9)
    outcome = solve(scene, pbd.Multilevel(lengths=lengths), iterations=3)
    np.testing.assert_allclose(outcome.positions[-1], from_store(scene[0].x), rtol=0, atol=1e-13)


def test_linear_momentum_of_a_free_cloth_is_kept():
    """Coarse particles carry the mass of what follows them, so that interpolation gives nothing away."""
    scene = grid(12, 1.1, depth=0.1)
    x, m = from_store(scene[0].x), 1.0 / scene[0].w
    for levels in (0, 1, 64):
        end = solve(scene, pbd.Multilevel(levels=levels), iterations=2).positions[-1]
        moved = (end - x) * m[:, None]
        assert np.abs(moved).sum() > 1.0
        np.testing.assert_allclose(moved.sum(axis=0), 0.0, atol=1e-11)


def test_a_translated_and_rotated_scene_gives_the_same():
    scene = grid(8, 1.1, depth=0.1)
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    shift = np.array([3.0, -2.0, 1.0])
    moved = pbd.particles(from_store(scene[0].x) @ turn + shift, masses=1.0 / scene[0].w)
    ends = [solve((particles, *scene[1:]), pbd.Multilevel()).positions[-1] for particles in (scene[0], moved)]
    np.testing.assert_allclose(ends[0] @ turn + shift, ends[1], rtol=0, atol=1e-11)


def test_upper_limits_leave_what_is_too_short():
    """Compressed: the paper's limits do nothing that level 0 does not do; coarse equalities help."""
    scene = chain(64, 0.95)
    static = {"lengths": "path", "unilateral": True}
    alone = worst(solve(scene, pbd.Multilevel(levels=0), 4), scene)
    assert worst(solve(scene, pbd.Multilevel(**static), 1), scene) > 0.9 * alone
    assert worst(solve(scene, pbd.Multilevel(), 1), scene) < 0.1 * alone


def test_upper_limits_shorten_what_is_too_long():
    scene = chain(64, 1.05)
    for solver in (pbd.Multilevel(), pbd.Multilevel(lengths="path", unilateral=True)):
        assert worst(solve(scene, solver, 2), scene) < 0.1 * worst(solve(scene, pbd.GaussSeidel(), 16), scene)


def test_ropes_stay_ropes_on_every_level():
    slack, tight = chain(32, 0.9), chain(32, 1.1)
    rope = pbd.Stiffness(relation="at_most")
    outcome = solve(slack, pbd.Multilevel(), 2, laws=(rope,))
    np.testing.assert_allclose(outcome.positions[-1], from_store(slack[0].x), rtol=0, atol=1e-12)
    alone = worst(solve(tight, pbd.Multilevel(levels=0), 60, laws=(rope,)), tight)
    assert worst(solve(tight, pbd.Multilevel(), 4, laws=(rope,)), tight) < 0.4 * alone


@pytest.mark.parametrize("levels", [1, 64])
def test_contacts_hold_on_every_level(levels):
    """A falling chain: no particle ends below the floor."""
    particles, pairs, rest = chain(32, pinned=())
    scene = (pbd.particles(from_store(particles.x) + (0.0, 0.01)), pairs, rest)
    solver = pbd.Multilevel(levels=levels)
    outcome = solve(scene, solver, 3, steps=100, gravity=(0.0, -9.81), floor=((0.0, 1.0), 0.0))
    assert outcome.status == "ok"
    assert outcome.positions[-1, :, 1].min() > -1e-3
    assert np.abs(outcome.velocities[-1]).max() < 0.1


def test_other_constraints_are_left_to_level_0():
    """Soft links beside the rigid ones reach what Gauss-Seidel reaches."""
    particles, pairs, rest = chain(6, 1.0)
    rods = pbd.distance(particles, pairs, rest_length=rest)
    spring = pbd.distance(particles, [(0, 6)], rest_length=4.0, law=pbd.Compliance(1e-3))
    ends = []
    for solver, iterations in ((pbd.Multilevel(), 100), (pbd.GaussSeidel(), 2000)):
        settings = pbd.Settings(dt=0.01, iterations=iterations, solver=solver)
        ends.append(pbd.Simulation(particles, [rods, spring], settings=settings).run(1).positions[-1])
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-8)


# ------------------------------------------------------------------ refusals


def refusals():
    particles, pairs, rest = chain(4)
    links = pbd.distance(particles, pairs, rest_length=rest)
    soft = pbd.distance(particles, pairs, law=pbd.Compliance(1e-3))
    strut = pbd.distance(particles, pairs, law=pbd.Stiffness(relation="at_least"))
    settings = pbd.Settings(solver=pbd.Multilevel())
    shake = pbd.Settings(solver=pbd.Multilevel(), integrator=Shake())
    for batches in ([soft], [strut], []):
        yield "there are none", lambda batches=batches: pbd.Simulation(particles, batches, settings=settings)
    yield "with shake", lambda: pbd.Simulation(particles, [links], settings=shake)
    yield "pushes apart", lambda: pbd.Multilevel(lengths="path")
    for field, values in {
        "levels": (-1, 65, 1.5, None),
        "sweeps": (0, -1, 1.5),
        "coarse_sweeps": (0, None),
        "lengths": ("pathh", 1),
        "unilateral": (1, None, "yes"),
    }.items():
        for value in values:
            yield f"solver.{field}", lambda f=field, value=value: pbd.Multilevel(**{f: value})


@pytest.mark.parametrize(("reason", "make"), list(refusals()))
def test_refused_in_one_line(reason, make):
    with pytest.raises(InvalidInput) as caught:
        make()
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
    assert ": must be " in str(caught.value)
