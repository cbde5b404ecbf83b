"""Gradients of every constraint against finite differences, and what holds for any chain whatever its numbers."""

from __future__ import annotations

import importlib
import pkgutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pbd
import pbd.constraints
from pbd.constraints.distance import Pairs, pair
from pbd.projection import begin, project
from pbd.stages import evaluate, size
from pbd.state import State
from pbd.vector import from_store, to_store

RELATIVE = 1e-6
coordinates = st.floats(-10.0, 10.0)
dimensions = st.integers(1, 3)


def points(draw, count, dimension):
    return np.array(draw(st.lists(coordinates, min_size=count * dimension, max_size=count * dimension))).reshape(
        count, dimension
    )


def state_of(particles):
    return State(particles, None, np.zeros(1, dtype=np.int64))


# ------------------------------------------------------------------ one maker of random batches a constraint


def distances(draw, dimension):
    """Pairs that are not closer than the finite differences can resolve."""
    x = points(draw, 4, dimension)
    x[:, 0] += 25.0 * np.arange(4)  # apart, and so large that no two coincide
    particles = pbd.particles(x)
    return particles, pbd.distance(particles, [(0, 1), (2, 1), (3, 0)], rest_length=draw(st.floats(0.1, 10.0)))


def contacts(draw, dimension):
    """Particles pushed through a random plane, some from inside."""
    normal = points(draw, 1, dimension)[0] + 20.0 * np.eye(dimension)[0]
    particles = pbd.particles(points(draw, 4, dimension))
    for axis, n in zip(particles.p, normal, strict=True):
        axis -= draw(st.floats(0.0, 2.0)) * n
    batch = pbd.plane_contact(particles, normal=normal, offset=draw(coordinates))
    begin(batch, state_of(particles), 0.01)
    return particles, batch


MAKERS = {"Distance": distances, "Contact": contacts}
INTERNAL = {"Distance"}
"""Constraints between particles alone: invariant under translation and rotation."""


def constraint_classes():
    """The names of all batch classes in pbd/constraints that have an evaluate()."""
    for info in pkgutil.iter_modules(pbd.constraints.__path__):
        module = importlib.import_module(f"pbd.constraints.{info.name}")
        for name, value in vars(module).items():
            if isinstance(value, type) and value.__module__ == module.__name__ and hasattr(value, "evaluate"):
                yield name


def test_every_constraint_is_tested():
    assert set(constraint_classes()) == set(MAKERS)


@pytest.mark.parametrize("name", sorted(MAKERS))
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_gradients_match_finite_differences(name, data):
    particles, batch = MAKERS[name](data.draw, data.draw(dimensions))
    for c in range(size(batch)):
        indices, _, gradients, norms = evaluate(batch, c, particles.p)
        assert len(indices) == len(gradients) == len(norms)
        for i, gradient, norm in zip(indices, gradients, norms, strict=True):
            assert norm == pytest.approx(np.dot(gradient, gradient), rel=1e-12)
            for axis, component in enumerate(gradient):
                difference = central_difference(batch, c, particles.p, i, axis)
                assert component == pytest.approx(difference, rel=RELATIVE, abs=RELATIVE * np.sqrt(norm))


def central_difference(batch, c, x, i, axis, step=1e-4):
    values = []
    for sign in (1.0, -1.0):
        moved = to_store(from_store(x))
        moved[axis][i] += sign * step
        values.append(evaluate(batch, c, moved)[1])
    return (values[0] - values[1]) / (2.0 * step)


@pytest.mark.parametrize("name", sorted(INTERNAL))
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_internal_gradients_carry_no_momentum(name, data):
    """sum g = 0 and sum r x g = 0."""
    particles, batch = MAKERS[name](data.draw, data.draw(dimensions))
    x = from_store(particles.p)
    for c in range(size(batch)):
        indices, _, gradients, _ = evaluate(batch, c, particles.p)
        g = np.array(gradients)
        assert np.abs(g.sum(axis=0)).max() <= 1e-14
        outer = x[list(indices)].T @ g
        assert np.abs(outer - outer.T).max() <= 1e-14 * np.abs(x).max() * 4


# ------------------------------------------------------------------ any chain


@st.composite
def laws(draw, count):
    """Any law with one value per constraint. All are compiled types that other tests use too."""
    kind = draw(st.sampled_from(["hard", "k", "alpha", "beta"]))
    many = {"min_size": count, "max_size": count}
    if kind == "hard":
        return pbd.Stiffness()
    if kind == "k":
        return pbd.Stiffness(np.array(draw(st.lists(st.floats(0.0, 0.999), **many))))
    alpha = np.array(draw(st.lists(st.floats(1e-12, 1.0), **many)))
    if kind == "alpha":
        return pbd.Compliance(alpha)
    return pbd.Compliance(alpha, np.array(draw(st.lists(st.floats(0.1, 1e4), **many))))


@st.composite
def chains(draw, pinned=True):
    """Random points in the plane, linked in a row; masses over six orders of magnitude."""
    links = draw(st.integers(1, 6))
    velocities = points(draw, links + 1, 2)
    if pinned:
        velocities[0] = 0.0  # a pinned particle follows its own velocity
    exponents = st.lists(st.floats(-3.0, 3.0), min_size=links + 1, max_size=links + 1)
    particles = pbd.particles(
        points(draw, links + 1, 2),
        velocities=velocities,
        masses=10.0 ** np.array(draw(exponents)),
        pinned=[0] if pinned else [],
    )
    rest = np.array(draw(st.lists(st.floats(1e-3, 10.0), min_size=links, max_size=links)))
    pairs = [(i, i + 1) for i in range(links)]
    return particles, pbd.distance(particles, pairs, rest_length=rest, law=draw(laws(links)))


@st.composite
def step_settings(draw):
    return pbd.Settings(
        dt=draw(st.sampled_from([1e-4, 1e-2, 1.0])),
        iterations=draw(st.integers(1, 20)),
        substeps=draw(st.integers(1, 3)),
    )


@given(chain=chains(), chosen=step_settings())
@settings(max_examples=150, deadline=None)
def test_no_chain_blows_up(chain, chosen):
    """Unconditionally stable: no faster than the start's speed, its violation released in one step and the fall."""
    particles, batch = chain
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, -9.81), settings=chosen).run(50)
    assert outcome.status == "ok"
    duration = outcome.times[-1]
    violation = 40.0 * size(batch)  # points within 10 m of the origin, rest lengths of at most 10 m
    farthest = 15.0 + duration * (15.0 + violation / chosen.h + 9.81 * duration)
    assert np.abs(outcome.positions).max() <= farthest
    assert np.isfinite(outcome.velocities).all()
    np.testing.assert_array_equal(outcome.positions[:, 0] - outcome.positions[0, 0], 0.0)


@given(chain=chains(pinned=False), chosen=step_settings())
@settings(max_examples=100, deadline=None)
def test_free_chains_keep_their_momentum(chain, chosen):
    particles, batch = chain
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, 0.0), settings=chosen).run(5)
    masses = 1.0 / particles.w
    p = np.einsum("i,sid->sd", masses, outcome.velocities)
    # round-off of v = (p - x)/h: each step rounds positions, and the difference is divided by h
    largest = np.abs(outcome.positions).max() / chosen.h + np.abs(outcome.velocities).max()
    per_step = 4.0 * chosen.substeps * (1 + chosen.iterations) * np.finfo(float).eps
    assert np.abs(np.diff(p, axis=0)).max() <= per_step * masses.sum() * largest


@given(data=st.data())
@settings(max_examples=200, deadline=None)
def test_a_projection_never_increases_the_violation(data):
    """One link alone, any law, masses and step: |C| after is at most |C| before, and of the same sign."""
    particles, batch = data.draw(chains(pinned=data.draw(st.booleans())))
    iterations = data.draw(st.integers(1, 5))
    one = batch._replace(law=batch.law.bind(size(batch), iterations))
    state = state_of(particles)
    h = data.draw(st.sampled_from([1e-4, 1e-2, 1.0]))
    for c in range(size(one)):
        for axis, start in zip(particles.p, particles.x, strict=True):
            axis[:] = start
        pairs = Pairs(*np.array(pair(one.pairs, c))[:, None])
        single = one._replace(pairs=pairs, rest=one.rest[c : c + 1], law=entry(one.law, c))
        before = evaluate(single, 0, particles.p)[1]
        begin(single, state, h)
        for _ in range(iterations):
            project(single, state, h)
            after = evaluate(single, 0, particles.p)[1]
            assert abs(after) <= abs(before) + 1e-13  # round-off of positions of up to 40 m
            assert after * np.sign(before) >= -1e-13
            before = after


def entry(law, c):
    """The kernel's law of constraint c alone."""
    return type(law)(*(value[c : c + 1].copy() if isinstance(value, np.ndarray) else value for value in law))
