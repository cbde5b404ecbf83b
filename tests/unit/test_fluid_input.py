"""Each bad input of a fluid is refused in one line that names it."""

from __future__ import annotations

import numpy as np
import pytest

import pbd

X = np.random.default_rng(0).uniform(0.0, 1.0, (9, 2))


def refused(particles=None, **arguments):
    with pytest.raises(pbd.InvalidInput) as caught:
        pbd.density(particles or pbd.particles(X), **{"spacing": 0.1, **arguments})
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("spacing", 0.0),
        ("spacing", np.nan),
        ("spacing", "wide"),
        ("support", 1.0),
        ("support", np.inf),
        ("kernel", "wendlant"),
        ("kernel", 3),
        ("omega", 0.0),
        ("omega", 2.1),
        ("epsilon", -1.0),
        ("viscosity", 1.1),
        ("confinement", -1.0),
        ("repulsion", np.inf),
        ("normal", [0.0, 0.0]),
        ("normal", [1.0, 0.0, 0.0]),
        ("members", [0, 0]),
        ("members", [9]),
        ("solids", [1, 1]),
        ("solids", [-1]),
        ("solids", "all"),
        ("law", 0.5),
        ("law", pbd.Stiffness(relation="at_least")),
    ],
)
def test_value_out_of_range(field, value):
    assert field in refused(**{field: value})


def test_name_of_a_kernel_is_guessed():
    assert "did you mean 'wendland'" in refused(kernel="wendlant")


def test_offset_for_another_number_of_walls():
    assert "offset" in refused(normal=[[1.0, 0.0], [0.0, 1.0]], offset=[0.0, 0.0, 0.0])


def test_dimension_one():
    assert "2 or 3" in refused(pbd.particles([[0.0], [1.0]]))


def test_pinned_member():
    assert "members[3]" in refused(pbd.particles(X, pinned=[3]))


def test_different_masses():
    assert "one mass" in refused(pbd.particles(X, masses=np.linspace(1.0, 2.0, 9)))


def test_masses_of_solids_may_differ():
    particles = pbd.particles(X, masses=np.append(np.ones(6), [2.0, 3.0, 4.0]), pinned=[8])
    assert pbd.density(particles, spacing=0.1, solids=[6, 7, 8]).cells.members.tolist() == list(range(9))


def test_fluid_or_solid():
    assert "solids = 4" in refused(members=[3, 4], solids=[4, 5])
    assert "solids alone need no fluid" in refused(members=[], solids=[4, 5])


def test_stiffness_for_each_particle():
    assert "law.k" in refused(law=pbd.Stiffness(np.full(9, 0.5), relation="at_most"))


def test_damping_of_a_compliance():
    assert "law.beta" in refused(law=pbd.Compliance(1e-6, 1.0, relation="at_most"))


def test_equality_without_softening():
    assert "epsilon" in refused(law=pbd.Stiffness(relation="equality"))


@pytest.mark.parametrize("solver", [pbd.Direct(), pbd.Jacobi(), pbd.GaussSeidel(order="coloured")])
def test_solvers_that_cannot_take_a_fluid(solver):
    particles = pbd.particles(X)
    with pytest.raises(pbd.InvalidInput, match="solver"):
        pbd.Simulation(particles, [pbd.density(particles, spacing=0.1)], settings=pbd.Settings(solver=solver))


def test_integrator_that_cannot_take_a_fluid():
    particles = pbd.particles(X)
    settings = pbd.Settings(integrator=pbd.Shake())
    with pytest.raises(pbd.InvalidInput, match=r"settings\.integrator"):
        pbd.Simulation(particles, [pbd.density(particles, spacing=0.1)], settings=settings)


def test_no_members_is_no_fluid():
    particles = pbd.particles(X)
    fluid = pbd.density(particles, spacing=0.1, members=[])
    assert pbd.Simulation(particles, [fluid], settings=pbd.Settings()).run(2).status == "ok"


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("a box", "a list of boxes"),
        ([1.0], "two opposite corners"),
        ([([0.0, 0.0], [1.0, 1.0, 1.0])], "obstacles[0]"),
        ([([0.0, 0.0], [1.0, 1.0]), ([0.0, 0.0], [1.0, 0.0])], "obstacles[1]"),
        ([([0.0, 0.0], [1.0, np.nan])], "finite"),
        ([([0.0, 0.0], [1.0, 0.2])], "edges >= 0.25 m"),
        ([([0.0, -2.0], [1.0, -1.0])], "before all walls"),
    ],
)
def test_obstacles(value, said):
    assert said in refused(obstacles=value, normal=[0.0, 1.0], offset=-1.0)


def test_a_step_on_the_floor_may_be_low():
    fluid = pbd.density(
        pbd.particles(X), spacing=0.1, obstacles=[([0.0, -1.0], [1.0, -0.9])], normal=[0.0, 1.0], offset=-1.0
    )
    assert fluid.walls.obstacles.start.tolist() == [0, 3]
