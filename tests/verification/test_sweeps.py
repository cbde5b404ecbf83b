"""Orders of a Gauss-Seidel sweep: the wavefront is the natural order to the last bit, colours are a re-ordering."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pbd
from pbd.arrangement import Problem
from pbd.roots import inverse_root
from pbd.solvers import runs

pytestmark = pytest.mark.slow

G = 9.81
LAWS = [pbd.Stiffness(), pbd.Stiffness(0.3), pbd.Stiffness(relation="at_most"), pbd.Compliance(1e-4)]


def chain(links, dimension=2, seed=0):
    rng = np.random.default_rng(seed)
    x = np.zeros((links + 1, dimension))
    x[:, 0] = 1.1 * np.arange(links + 1)
    x += 0.01 * rng.normal(size=x.shape)
    masses = rng.uniform(0.5, 2.0, links + 1)
    return pbd.particles(x, masses=masses, pinned=[0]), [(i, i + 1) for i in range(links)]


def grid(rows, columns):
    """(positions (n, 3), pairs) of a cloth with stretch, diagonal and two-cell links."""
    index = np.arange(rows * columns).reshape(rows, columns)
    kinds = [
        (index[:, :-1], index[:, 1:]),
        (index[:-1], index[1:]),
        (index[:-1, :-1], index[1:, 1:]),
        (index[:-1, 1:], index[1:, :-1]),
        (index[:, :-2], index[:, 2:]),
        (index[:-2], index[2:]),
    ]
    r, c = np.divmod(np.arange(rows * columns), columns)
    pairs = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in kinds])
    return np.column_stack([c, r, 0 * c]).astype(float), pairs


def cloth(rows, columns, stretch=1.05, law=None):
    x, pairs = grid(rows, columns)
    rest = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    particles = pbd.particles(stretch * x, pinned=[0, columns - 1])
    return particles, pbd.distance(particles, pairs, rest_length=rest, law=law)


def run(particles, batches, order, steps=5, iterations=7, precision="float64", dimension=2):
    settings = pbd.Settings(dt=1e-3, iterations=iterations, solver=pbd.GaussSeidel(order), precision=precision)
    gravity = -G * np.eye(dimension)[1]
    return pbd.Simulation(particles, batches, gravity=gravity, settings=settings).run(steps)


# ------------------------------------------------------------------ wavefront


@pytest.mark.parametrize(("dimension", "law"), [(1, LAWS[1]), *((2, law) for law in LAWS), (3, LAWS[3])])
@pytest.mark.parametrize(("links", "iterations"), [(1, 1), (1, 5), (2, 3), (3, 20), (50, 1), (50, 16), (300, 40)])
def test_wavefront_is_natural_order_to_the_last_bit(links, iterations, dimension, law):
    """A law knows no dimension, so that not all of them need be seen in each."""
    particles, pairs = chain(links, dimension)
    batch = pbd.distance(particles, pairs, rest_length=1.0, law=law)
    gravity = None if dimension == 1 else -G * np.eye(dimension)[1]
    natural, wavefront = (
        pbd.Simulation(
            particles,
            [batch],
            gravity=gravity,
            settings=pbd.Settings(dt=1e-3, iterations=iterations, solver=pbd.GaussSeidel(order)),
        ).run(3)
        for order in ("natural", "wavefront")
    )
    np.testing.assert_array_equal(wavefront.positions, natural.positions)
    np.testing.assert_array_equal(wavefront.velocities, natural.velocities)
    assert wavefront.projections == natural.projections


def test_wavefront_refuses_what_is_no_chain():
    particles, batch = cloth(4, 4)
    with pytest.raises(pbd.InvalidInput, match="one chain"):
        run(particles, [batch], "wavefront", dimension=3)


# ------------------------------------------------------------------ coloured


def as_sorted(particles, batches):
    """The pairs in the order in which the coloured solver projects them, numbered as the user's particles."""
    simulation = pbd.Simulation(particles, batches, settings=pbd.Settings(solver=pbd.GaussSeidel("coloured")))
    user = np.full(int(simulation._slot.max()) + 1, -1)
    user[simulation._slot] = np.arange(len(simulation._slot))
    found = []
    for batch in simulation._scene.batches:
        if hasattr(batch, "source"):
            for r in range(len(batch.i)):
                c = np.arange(batch.start[r], batch.start[r + 1], dtype=np.uint64)
                c = c[batch.source[c] >= 0]
                found += zip(user[batch.i[r] + c], user[batch.j[r] + c], strict=True)
        else:
            found += [tuple(user[list(pair)]) for pair in batch.pairs.as_array(batch.size())]
    return np.array(found)


@pytest.mark.parametrize("shape", [(9, 9), (20, 33), (40, 40)])
def test_a_coloured_sweep_is_a_natural_sweep_of_the_same_order(shape):
    """To round-off: runs find 1/length by arithmetic, single pairs by division."""
    particles, batch = cloth(*shape)
    pairs = as_sorted(particles, [batch])
    assert {frozenset(p) for p in pairs.tolist()} == {frozenset(p) for p in batch.pairs.as_array(0).tolist()}
    rest = np.linalg.norm(grid(*shape)[0][pairs[:, 0]] - grid(*shape)[0][pairs[:, 1]], axis=1)
    again = pbd.distance(particles, pairs, rest_length=rest)
    coloured, natural = (
        run(particles, [batch], "coloured", dimension=3),
        run(particles, [again], "natural", dimension=3),
    )
    np.testing.assert_allclose(coloured.positions, natural.positions, rtol=0, atol=1e-13)
    assert coloured.projections == natural.projections


@pytest.mark.parametrize("law", LAWS)
def test_the_outcome_is_in_the_users_order_and_momentum_is_kept(law):
    x, pairs = grid(20, 20)
    rng = np.random.default_rng(2)
    masses, v = rng.uniform(0.5, 2.0, len(x)), rng.normal(size=x.shape)
    particles = pbd.particles(x, masses=masses, velocities=v)
    batch = pbd.distance(particles, pairs, law=law)
    settings_ = pbd.Settings(dt=1e-3, iterations=3, solver=pbd.GaussSeidel("coloured"))
    out = pbd.Simulation(particles, [batch], gravity=np.zeros(3), settings=settings_).run(10)
    np.testing.assert_array_equal(out.positions[0], x)
    lost = np.abs(masses @ (out.velocities[-1] - v)).max()
    assert lost < 1e-12 * np.sum(masses * np.linalg.norm(v, axis=1))


def test_runs_share_no_particle_and_cover_all():
    particles, batch = cloth(30, 30)
    simulation = pbd.Simulation(particles, [batch], settings=pbd.Settings(solver=pbd.GaussSeidel("coloured")))
    for part in simulation._scene.batches:
        if hasattr(part, "source"):
            for r in range(len(part.i)):
                c = np.arange(part.start[r], part.start[r + 1], dtype=np.uint64)
                i, j = part.i[r] + c, part.j[r] + c
                assert not set(i.tolist()) & set(j.tolist())
                assert max(i.max(), j.max()) < len(simulation._scene.state.particles.w)


def test_a_cloth_and_a_chain_form_runs():
    particles, batch = cloth(64, 64)
    parts = pbd.GaussSeidel("coloured").arrange(Problem(particles, (batch,), pbd.Settings())).batches
    uniform, mixed = parts[:2]
    assert uniform.size() > 0.5 * batch.size(), "equal links between equal particles"
    assert sum(part.size() for part in parts) == batch.size()
    assert uniform.size() + mixed.size() > 0.99 * batch.size()
    assert mixed.rest.shape[0] <= 1.1 * mixed.size(), "gaps filled by constraints of weight 0"
    particles, pairs = chain(1000)
    even = pbd.particles(np.column_stack([np.arange(1001.0), np.zeros(1001)]), pinned=[0])
    parts = pbd.GaussSeidel("coloured").arrange(Problem(even, (pbd.distance(even, pairs),), pbd.Settings())).batches
    assert [part.size() for part in parts] == [999, 1], "all but the link at the pin"
    uneven = pbd.GaussSeidel("coloured").arrange(Problem(particles, (pbd.distance(particles, pairs),), pbd.Settings()))
    assert [part.size() for part in uneven.batches] == [1000]


@settings(max_examples=30, deadline=None)
@given(count=st.integers(2, 60), share=st.floats(0.05, 1.0), seed=st.integers(0, 2**32 - 1))
def test_any_mesh_can_be_coloured(count, share, seed):
    rng = np.random.default_rng(seed)
    everything = np.column_stack(np.triu_indices(count, 1))
    pairs = everything[rng.random(len(everything)) < share]
    if len(pairs) == 0:
        return
    colours = runs.greedy_colours(pairs)
    for colour in range(colours.max() + 1):
        used = pairs[colours == colour].ravel()
        assert len(set(used.tolist())) == len(used)
    particles = pbd.particles(rng.normal(size=(count, 3)), pinned=[0])
    batch = pbd.distance(particles, pairs)
    out = run(particles, [batch], "coloured", steps=1, iterations=2, dimension=3)
    assert out.projections == 2 * batch.size()
    assert out.status == "ok"


def test_contacts_and_forces_follow_the_particles():
    particles, batch = cloth(20, 20, stretch=1.0)
    floor = pbd.plane_contact(particles, normal=(0, 0, 1), offset=-0.01)
    forces = pbd.point_forces(particles, np.column_stack([np.zeros((400, 2)), -np.linspace(0, 5, 400)]))
    natural, coloured = (
        pbd.Simulation(
            particles,
            [batch, floor],
            external=[forces],
            settings=pbd.Settings(dt=1e-3, iterations=300, solver=pbd.GaussSeidel(order)),
        ).run(3)
        for order in ("natural", "coloured")
    )
    np.testing.assert_allclose(coloured.positions, natural.positions, rtol=0, atol=2e-6)


def test_coloured_refuses_batches_that_cannot_follow_and_scenes_without_distances():
    particles, _ = cloth(4, 4)
    floor = pbd.plane_contact(particles, normal=(0, 0, 1))
    with pytest.raises(pbd.InvalidInput, match="there are none"):
        run(particles, [floor], "coloured", dimension=3)
    with pytest.raises(pbd.InvalidInput, match="coloured"):
        pbd.GaussSeidel("colored")


# ------------------------------------------------------------------ arithmetic


@pytest.mark.parametrize(("dtype", "units"), [(np.float64, 3.0), (np.float32, 3.0)])
def test_inverse_root_is_good_to_the_last_places(dtype, units):
    from pbd.jit import kernel

    @kernel
    def roots(q, y):
        for i in range(q.shape[0]):
            y[i] = inverse_root(q[i])

    q = np.concatenate([np.geomspace(1e-30, 1e30, 10_001), np.linspace(0.9, 1.1, 10_001)]).astype(dtype)
    y = np.empty_like(q)
    roots(q, y)
    exact = 1.0 / np.sqrt(q.astype(np.longdouble))
    assert np.abs(y / exact - 1.0).max() < units * np.finfo(dtype).eps
    zero = np.zeros(1, dtype)
    roots(zero, y[:1])
    assert np.isfinite(y[0])


@pytest.mark.parametrize("order", ["natural", "coloured"])
def test_single_precision_is_single_throughout_and_near_double(order):
    particles, batch = cloth(20, 20)
    double, single = (run(particles, [batch], order, precision=p, dimension=3) for p in ("float64", "float32"))
    assert single.scene.state.particles.x[0].dtype == np.float32
    assert single.scene.batches[0].law.factor.dtype == np.float32
    error = np.abs(single.positions - double.positions).max()
    assert 1e-9 < error < 2e-5
