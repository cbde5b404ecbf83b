"""Averaged Jacobi: the mean of the corrections, what it converges to, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

import pbd
from pbd.errors import InvalidInput
from pbd.integrators.shake import Shake

L = 1.0
FLOOR = {"normal": (0.0, 1.0), "friction": 0.5}


def residual(copies, iterations, omega=1.0, law=None):
    """|C| left of one distance, 100 % over-long, that is given several times."""
    particles = pbd.particles([[0.0, 0.0], [2.0, 0.0]], masses=[1.0, 3.0])
    batches = [pbd.distance(particles, [(0, 1)], rest_length=L, law=law) for _ in range(copies)]
    settings = pbd.Settings(dt=1.0, iterations=iterations, solver=pbd.Jacobi(omega))
    end = pbd.Simulation(particles, batches, settings=settings).run(1, [1]).positions[0]
    return abs(np.linalg.norm(end[1] - end[0]) - L)


@pytest.mark.parametrize("copies", [1, 2, 3, 7])
def test_equal_constraints_are_solved_at_once(copies):
    """The plain sum leaves (1 - m) of the residual: at m = 3 it doubles in each iteration. The mean leaves none."""
    assert residual(copies, 1) < 1e-15


@pytest.mark.parametrize("omega", [0.25, 0.5, 1.5, 1.9])
def test_over_relaxation_leaves_one_minus_omega(omega):
    assert residual(3, 10, omega) == pytest.approx(abs(1.0 - omega) ** 10, rel=1e-9)


def test_omega_one_and_a_half_needs_ten_iterations_to_a_thousandth():
    assert residual(3, 10, 1.5) < 1e-3 < residual(3, 9, 1.5)


def test_stiffness_holds_for_one_constraint():
    """k' over n iterations leaves 1 - k, as with Gauss-Seidel."""
    assert residual(1, 7, law=pbd.Stiffness(0.75)) == pytest.approx(0.25, rel=1e-12)


def chain(solver, iterations=1, precision="float64", pairs=((0, 1), (1, 2), (2, 3))):
    particles = pbd.particles([[1.1 * i, 0.1 * i * i] for i in range(4)], masses=[1.0, 2.0, 3.0, 4.0], pinned=[0])
    links = pbd.distance(particles, pairs, rest_length=L)
    settings = pbd.Settings(dt=0.01, iterations=iterations, solver=solver, precision=precision)
    return pbd.Simulation(particles, [links], gravity=(0.0, -9.81), settings=settings).run(1, [1])


def test_one_iteration_is_the_mean_of_the_single_corrections():
    """Against a plain loop over the constraints, all at the same positions."""
    x, w = np.array([[1.1 * i, 0.1 * i * i] for i in range(4)]), np.array([0.0, 1 / 2, 1 / 3, 1 / 4])
    p = x + np.where(w[:, None] > 0.0, (0.0, -9.81 * 0.01**2), 0.0)
    total, count = np.zeros_like(p), np.zeros(4)
    for i, j in ((0, 1), (1, 2), (2, 3)):
        d = p[i] - p[j]
        change = -(np.linalg.norm(d) - L) / (w[i] + w[j]) * d / np.linalg.norm(d)
        total[i] += w[i] * change
        total[j] -= w[j] * change
        count[[i, j]] += 1
    outcome = chain(pbd.Jacobi())
    np.testing.assert_allclose(outcome.positions[0], p + total / count[:, None], rtol=0, atol=1e-15)
    assert outcome.projections == 3


def test_order_does_not_matter():
    there, back = ([(0, 1), (1, 2), (2, 3)][::step] for step in (1, -1))
    ends = [chain(pbd.Jacobi(), 20, pairs=pairs).positions for pairs in (there, back)]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-15)


def test_converges_to_the_lengths_and_more_slowly_than_gauss_seidel():
    def left(solver, iterations):
        end = chain(solver, iterations).positions[0]
        return np.abs(np.linalg.norm(np.diff(end, axis=0), axis=1) - L).max()

    assert left(pbd.Jacobi(), 2000) < 1e-12
    assert left(pbd.Jacobi(), 20) > left(pbd.GaussSeidel(), 20)


def test_single_precision():
    single, double = (chain(pbd.Jacobi(), 10, precision) for precision in ("float32", "float64"))
    np.testing.assert_allclose(single.positions, double.positions, rtol=0, atol=1e-5)
    assert single.scene.state.particles.p[0].dtype == np.float32


def test_a_satisfied_inequality_does_not_count():
    """A slack rope beside a rod: the mean is over the rod alone."""
    particles = pbd.particles([[0.0, 0.0], [2.0, 0.0]])
    rod = pbd.distance(particles, [(0, 1)], rest_length=L)
    rope = pbd.distance(particles, [(0, 1)], rest_length=5.0, law=pbd.Stiffness(relation="at_most"))
    settings = pbd.Settings(dt=1.0, solver=pbd.Jacobi())
    end = pbd.Simulation(particles, [rod, rope], settings=settings).run(1, [1]).positions[0]
    assert end[1, 0] - end[0, 0] == pytest.approx(L, abs=1e-15)


def test_contacts_push_and_rub():
    """A particle slides on the floor: it stays on it, and friction slows it by mu g t."""
    particles = pbd.particles([[0.0, 0.0]], velocities=[[1.0, 0.0]])
    settings = pbd.Settings(dt=1e-3, iterations=3, solver=pbd.Jacobi())
    floor = pbd.plane_contact(particles, **FLOOR)
    outcome = pbd.Simulation(particles, [floor], gravity=(0.0, -9.81), settings=settings).run(100, [100])
    assert outcome.velocities[0, 0, 0] == pytest.approx(1.0 - 0.5 * 9.81 * 0.1, rel=1e-9)
    assert outcome.positions[0, 0, 1] == pytest.approx(0.0, abs=1e-12)


def test_contacts_that_share_a_push_remember_their_part():
    """Each of two equal floors pushes half; what it remembers is the half, not the whole that it asked for."""
    particles = pbd.particles([[0.0, 0.0]])
    floors = [pbd.plane_contact(particles, **FLOOR) for _ in range(2)]
    settings = pbd.Settings(dt=1e-2, iterations=4, solver=pbd.Jacobi())
    outcome = pbd.Simulation(particles, floors, gravity=(0.0, -9.81), settings=settings).run(1)
    pushes = [batch.law.push[0] for batch in outcome.scene.batches]
    np.testing.assert_allclose(pushes, 0.5 * 9.81 * 1e-4, rtol=1e-12)


class OwnProjection(tuple):
    """Stands for a batch that projects itself."""

    def project(self, state, h):
        """Nothing."""


def refusals():
    particles = pbd.particles([[0.0, 0.0], [2.0, 0.0]])
    links = pbd.distance(particles, [(0, 1)])
    soft = pbd.distance(particles, [(0, 1)], law=pbd.Compliance(1e-3))
    strut = pbd.distance(particles, [(0, 1)], law=pbd.Compliance(relation="at_least"))
    settings = pbd.Settings(solver=pbd.Jacobi())
    shake = pbd.Settings(solver=pbd.Jacobi(), integrator=Shake())
    yield "multiplier", lambda: pbd.Simulation(particles, [soft], settings=settings)
    yield "multiplier", lambda: pbd.Simulation(particles, [strut], settings=settings)
    yield "projects itself", lambda: pbd.Simulation(particles, [OwnProjection()], settings=settings)
    yield "there are none", lambda: pbd.Simulation(None, [], settings=settings)
    yield "with shake", lambda: pbd.Simulation(particles, [links], settings=shake)
    for omega in (0.0, 2.0, -1.0, 3.0, float("nan"), None, "1"):
        yield "omega", lambda omega=omega: pbd.Jacobi(omega)


@pytest.mark.parametrize(("reason", "make"), list(refusals()))
def test_refused_in_one_line(reason, make):
    with pytest.raises(InvalidInput) as caught:
        make()
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
    assert ": must be " in str(caught.value)
