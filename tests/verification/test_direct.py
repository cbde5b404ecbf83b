"""The direct solver: tridiagonal systems, Newton's convergence, what it equals and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

import pbd

pytestmark = pytest.mark.slow


def overstretched(links, stretch=1.1, dimension=2, **changes):
    x = np.zeros((links + 1, dimension))
    x[:, 0] = stretch / links * np.arange(links + 1)
    particles = pbd.particles(x, pinned=[0], **changes)
    return particles, pbd.distance(particles, [(i, i + 1) for i in range(links)], rest_length=1.0 / links)


@pytest.mark.parametrize("links", [1, 2, 3, 10, 100, 1000])
def test_one_step_meets_all_lengths_to_round_off(links):
    particles, batch = overstretched(links)
    settings = pbd.Settings(solver=pbd.Direct())
    out = pbd.Simulation(particles, [batch], gravity=(0.0, 0.0), settings=settings).run(1)
    lengths = np.linalg.norm(np.diff(out.positions[-1], axis=0), axis=1)
    assert np.abs(links * lengths - 1.0).max() < 1e-12
    assert out.unconverged == 0
    assert out.projections <= 6 * links, "Newton's method is quadratic: 3 to 5 solves"


@pytest.mark.parametrize("dimension", [2, 3])
def test_it_is_where_gauss_seidel_converges_to_along_frozen_gradients(dimension):
    """On a bent chain, whose links pull in different directions."""
    rng = np.random.default_rng(1)
    steps = rng.normal(size=(6, dimension))
    x = np.vstack([np.zeros(dimension), np.cumsum(steps / np.linalg.norm(steps, axis=1)[:, None], axis=0)])
    particles = pbd.particles(x, masses=rng.uniform(0.5, 3.0, 7), pinned=[0, 6])
    batch = pbd.distance(particles, [(i, i + 1) for i in range(6)], rest_length=1.0)
    runs = [
        pbd.Simulation(
            particles,
            [batch],
            gravity=-9.81 * np.eye(dimension)[1],
            settings=pbd.Settings(dt=1e-3, integrator=pbd.Shake(), solver=solver, iterations=iterations),
        ).run(50)
        for solver, iterations in ((pbd.Direct(), 1), (pbd.GaussSeidel(), 2000))
    ]
    np.testing.assert_allclose(runs[0].positions, runs[1].positions, rtol=0, atol=1e-11)


def test_several_chains_are_solved_each_by_itself():
    x = np.column_stack([np.tile(np.arange(4.0), 2), np.repeat([0.0, 5.0], 4)])
    both = pbd.particles(x, pinned=[0, 4])
    batches = [pbd.distance(both, [(k + i, k + i + 1) for i in range(3)]) for k in (0, 4)]
    settings = pbd.Settings(dt=1e-2, solver=pbd.Direct(), integrator=pbd.Shake())
    out = pbd.Simulation(both, batches, gravity=(0, -9.81), settings=settings).run(20)
    one = pbd.particles(x[:4], pinned=[0])
    alone = pbd.Simulation(one, [pbd.distance(one, [(0, 1), (1, 2), (2, 3)])], gravity=(0, -9.81), settings=settings)
    np.testing.assert_allclose(out.positions[:, :4], alone.run(20).positions, rtol=0, atol=1e-14)
    np.testing.assert_allclose(out.positions[:, 4:] - [0.0, 5.0], out.positions[:, :4], rtol=0, atol=1e-13)


def test_prediction_saves_iterations_and_changes_nothing_else():
    """Counted: more than one Newton iteration in the first steps, mostly one once three steps are known."""
    particles, batch = overstretched(10, stretch=1.0)
    settings = pbd.Settings(dt=1e-3, solver=pbd.Direct(), integrator=pbd.Shake())
    simulation = pbd.Simulation(particles, [batch], gravity=(0, -9.81), settings=settings)
    assert simulation.run(1000, [0]).projections <= 1.3 * 1000 * 10
    assert simulation.run(3, [0]).projections > 3 * 10


def test_a_step_too_large_for_any_solution_says_so():
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0]], velocities=[[0.0, 0.0], [0.0, 1e3]], pinned=[0])
    settings = pbd.Settings(dt=1.0, solver=pbd.Direct(), integrator=pbd.Shake())
    rod = pbd.distance(particles, [(0, 1)])
    out = pbd.Simulation(particles, [rod], gravity=(0.0, 0.0), settings=settings).run(1)
    assert out.unconverged == 1 or out.status == "diverged"


TWO = pbd.particles([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], pinned=[0])


@pytest.mark.parametrize(
    ("batches", "changes"),
    [
        ([pbd.distance(TWO, [(0, 2), (1, 2)])], {}),
        ([pbd.distance(TWO, [(0, 1), (1, 2)], law=pbd.Compliance(1e-3))], {}),
        ([pbd.distance(TWO, [(0, 1), (1, 2)], law=pbd.Stiffness(relation="at_most"))], {}),
        ([pbd.plane_contact(TWO, normal=(0, 1))], {}),
        ([pbd.distance(TWO, [(0, 1), (1, 2)])], {"iterations": 3}),
        ([pbd.distance(TWO, [(0, 1)]), pbd.distance(TWO, [(1, 2)])], {}),
    ],
)
def test_what_is_no_rigid_chain_is_refused(batches, changes):
    with pytest.raises(pbd.InvalidInput) as error:
        pbd.Simulation(TWO, batches, settings=pbd.Settings(solver=pbd.Direct(), **changes))
    assert error.value.field in ("settings.solver", "settings.iterations")
    assert "\n" not in str(error.value)
