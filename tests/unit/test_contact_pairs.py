"""Candidate pairs of bodies: room for them, when they are sought, and what the counters of work tell."""

from __future__ import annotations

import numpy as np
import pytest

import pbd
from pbd.rigid.contact_input import PAIRS_PER_BODY

G, DT = 9.81, 1.0 / 60.0


def up(d):
    return np.eye(d)[1]


def batch(bodies, offset=0.0, **changes):
    return pbd.contacts(bodies, pbd.planes(up(len(bodies.x)), offset), **{"friction": 0.5, **changes})


def simulation(bodies, contacts=None, *, substeps=1, iterations=10, velocity_iterations=3, tolerance=1e-6, gravity=G):
    settings = pbd.Settings(
        dt=DT,
        substeps=substeps,
        iterations=iterations,
        integrator=pbd.Rattle(),
        solver=pbd.ConjugateSweeps(velocity_iterations, tolerance),
    )
    d = len(bodies.x)
    contacts = batch(bodies) if contacts is None else contacts
    return pbd.Simulation(None, [contacts], bodies=bodies, gravity=-gravity * up(d), settings=settings)


def stack(d, n, **changes):
    x = np.zeros((n, d))
    x[:, 1] = np.arange(n) + 0.5
    return pbd.bodies([pbd.Box((1.0,) * d)] * n, x, **changes)


def heap(d, n, balls=True):
    """Boxes, and some balls, in a loose grid, about to fall."""
    rng = np.random.default_rng(3)
    across = 4 if d == 2 else 3
    x = np.zeros((n, d))
    index = np.arange(n)
    for axis in (0, 2)[: d - 1]:
        x[:, axis] = 0.45 * (index % across) + rng.uniform(-0.05, 0.05, n)
        index = index // across
    x[:, 1] = 0.3 + 0.5 * index
    shapes = [pbd.Ball(0.15) if balls and k % 4 == 0 else pbd.Box(tuple(rng.uniform(0.2, 0.35, d))) for k in range(n)]
    return pbd.bodies(shapes, x, spins=0.5)


def same(one, other):
    for left, right in zip(one, other, strict=True):
        np.testing.assert_array_equal(left, right)


# ------------------------------------------------------------------ room


@pytest.mark.parametrize("d", [2, 3])
def test_a_run_that_lacks_room_starts_again_with_it(d):
    """The same to the bit as with room from the start; the next run has it."""
    bodies = heap(d, 24)
    small, large = batch(bodies).grown(2), batch(bodies).grown(5000)
    short, roomy = simulation(bodies, small), simulation(bodies, large)
    first, again, whole = short.run(60), short.run(60), roomy.run(60)
    assert len(small.pairs) == 2
    assert len(first.scene.batches[0].pairs) > 24
    same(first.bodies, whole.bodies)
    same(again.bodies, whole.bodies)
    assert (first.steps, len(first.times), first.projections) == (60, 61, whole.projections)
    assert first.pairs == whole.pairs


@pytest.mark.parametrize("d", [2, 3])
def test_a_crowd_needs_more_than_the_room_to_begin_with(d):
    """Many small bodies around a large one: it alone has more pairs than the mean allowed for."""
    n = 16 + PAIRS_PER_BODY[d] * 40
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (40, d)) * 0.2
    crowd = pbd.bodies([pbd.Ball(0.3)] * 40, x + up(d))
    outcome = simulation(crowd, iterations=2, velocity_iterations=1).run(2)
    assert outcome.status == "ok"
    assert len(outcome.scene.batches[0].pairs) > n
    roomy = simulation(crowd, batch(crowd).grown(4000), iterations=2, velocity_iterations=1).run(2)
    same(outcome.bodies, roomy.bodies)


# ------------------------------------------------------------------ work


@pytest.mark.parametrize("d", [2, 3])
def test_a_lone_body_tests_no_pairs(d):
    lone = pbd.bodies([pbd.Box((1.0,) * d)], [2.0 * up(d)], spins=1.0)
    outcome = simulation(lone, batch(lone, offset=-1e6)).run(60)
    assert (outcome.pairs, outcome.projections) == (0, 0)
    np.testing.assert_allclose(outcome.bodies.positions[:, 0, 1], 2.0 - 0.5 * G * outcome.times**2, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_bodies_far_apart_test_no_pairs(d):
    """But for the floor's, when they come near it."""
    x = np.array([[20.0 * k, 0.0, 0.0][:d] for k in range(5)])
    few = pbd.bodies([pbd.Ball(0.5)] * 5, x + 50.0 * up(d))
    outcome = simulation(few).run(60)
    assert (outcome.pairs, outcome.projections) == (0, 0)


@pytest.mark.parametrize("n", [1, 5])
@pytest.mark.parametrize("d", [2, 3])
def test_a_stack_projects_each_of_its_contacts_once_a_sweep(d, n):
    """n contacts, of which none is left out and none comes twice, in each of two passes."""
    sweeps, steps, substeps = (6, 4), 20, 3
    made = simulation(
        stack(d, n), substeps=substeps, iterations=sweeps[0], velocity_iterations=sweeps[1], tolerance=0.0
    )
    outcome = made.run(steps)
    assert outcome.projections % n == 0
    assert 2 * n * steps * substeps <= outcome.projections <= sum(sweeps) * n * steps * substeps
    one = simulation(stack(d, n), iterations=1, velocity_iterations=1, tolerance=0.0).run(steps)
    assert one.projections == 2 * n * steps


@pytest.mark.parametrize("d", [2, 3])
def test_a_pass_that_has_converged_ends(d):
    """One box at rest is solved by one sweep of each pass but in its first step, whatever is allowed."""
    few, many = (simulation(stack(d, 1), iterations=k, velocity_iterations=k).run(60) for k in (5, 500))
    assert 2 * 60 <= few.projections <= 2 * 60 + 8
    assert many.projections == few.projections
    np.testing.assert_array_equal(few.bodies.positions, many.bodies.positions)


@pytest.mark.parametrize("d", [2, 3])
def test_contacts_are_found_once_a_step(d):
    """A stack at rest: n candidate pairs, or those and neighbours within reach, tested once in each step."""
    n, steps = 5, 60
    whole, divided = (simulation(stack(d, n), substeps=k).run(steps) for k in (1, 7))
    assert n * steps <= whole.pairs <= 3 * n * steps
    assert divided.pairs == whole.pairs


@pytest.mark.parametrize("d", [2, 3])
def test_a_settled_heap_seeks_no_pairs(d):
    """Searches are counted; what moves seeks now and then, what lies does not. Balls would roll on."""
    bodies = heap(d, 24, balls=False)
    walls = pbd.planes([up(d), np.eye(d)[0], -np.eye(d)[0], *([np.eye(d)[2], -np.eye(d)[2]] if d == 3 else [])])
    offsets = np.array([0.0, -0.5, -2.0, -0.5, -2.0][: len(walls.offset)])
    contacts = pbd.contacts(bodies, pbd.planes(np.transpose(walls.normal), offsets), friction=0.5)
    made = simulation(bodies, contacts, substeps=4, iterations=20, velocity_iterations=10)
    builds = [int(made.run(steps, []).scene.batches[0].counts[2]) for steps in (120, 480, 960)]
    assert 1 < builds[0] < 120
    assert builds[1] == builds[2]


@pytest.mark.parametrize("d", [2, 3])
def test_a_fast_body_does_not_pass_through(d):
    """A ball of 0.1 m at 300 m/s, 5 m a step, stops at a wall of boxes, of 0.2 m: pairs are sought far enough ahead."""
    x = np.array([[-3.05, 1.0, 0.0], [0.0, 1.0, 0.0]])[:, :d]
    shapes = [pbd.Ball(0.1), pbd.Box((0.2, 2.0, 2.0)[:d])]
    bodies = pbd.bodies(shapes, x, velocities=[[300.0, 0.0, 0.0][:d], [0.0] * d], fixed=[1])
    end = simulation(bodies, batch(bodies, offset=-1e6, friction=0.0), gravity=0.0).run(3).bodies
    assert end.positions[-1, 0, 0] == pytest.approx(-0.2, abs=1e-6)
    assert abs(end.velocities[-1, 0, 0]) <= 1e-9
