"""The minimiser against closed forms, finite differences, balances of forces and momentum, and itself."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from comparisons import store
from comparisons.minimiser import implicit_euler, implicit_euler_step, springs_of, static_state
from comparisons.network import Network, factorise
from comparisons.newton import Energy, minimise
from comparisons.record import RunSpec
from comparisons.reference import NoReference
from comparisons.run import build_scene, execute
from comparisons.scene import PointMasses, Springs

G = 9.81
HEAVY = {"density": 16.0, "size": 4}
"""A cloth of 16 masses of 1 kg."""


def cloth(**parameters):
    return build_scene("hanging_cloth", {"compliance": 1e-3, **parameters})


def chain(**parameters):
    return build_scene("pendulum_chain", {"compliance": 1e-3, "angles": 0.0, **parameters})


def crumpled(scene, seed=0):
    """Positions off the scene's by a third of a cell, the pinned where they are."""
    x, cell = scene.masses.positions, scene.links[0].lengths.min()
    off = 0.3 * cell * np.random.default_rng(seed).uniform(-1.0, 1.0, x.shape)
    return np.where(scene.masses.free[:, None], x + off, x)


def pulls(scene, x):
    """(n, d) forces [N] of the springs at positions x, summed link by link."""
    springs, force = springs_of(scene), np.zeros_like(x)
    for (i, j), rest, alpha in zip(springs.pairs, springs.lengths, springs.compliances):
        e = x[j] - x[i]
        pull = (np.linalg.norm(e) - rest) / alpha * e / np.linalg.norm(e)
        force[i] += pull
        force[j] -= pull
    return force


def unbalanced(scene, x, acceleration=0.0):
    """The largest of m a - m g - pulls on a free particle [N]."""
    left = scene.masses.masses[:, None] * (acceleration - scene.gravity) - pulls(scene, x)
    return np.abs(left[scene.masses.free]).max()


# ------------------------------------------------------------------ derivatives


@pytest.mark.parametrize("scene", [cloth(**HEAVY), chain(links=3)])
def test_gradient_and_hessian_are_derivatives(scene):
    net, springs = Network(scene.masses, scene.links[0].pairs), springs_of(scene)
    energy = Energy(
        net, 1.0 / springs.compliances[net.kept], springs.lengths[net.kept], scene.masses.positions, 7.0, scene.gravity
    )
    x, step = crumpled(scene), 1e-5
    gradient = energy.gradient(x, net.edges(x))[0]
    hessian = energy.hessian(net.edges(x)).toarray()
    np.testing.assert_array_equal(hessian, hessian.T)
    for k in range(len(gradient)):
        unit = step * np.eye(len(gradient))[k]
        up, down = net.moved(x, unit), net.moved(x, -unit)
        slope = (energy.value(up)[0] - energy.value(down)[0]) / (2.0 * step)
        assert slope == pytest.approx(gradient[k], abs=1e-6 * np.abs(gradient).max())
        curve = (energy.gradient(up, net.edges(up))[0] - energy.gradient(down, net.edges(down))[0]) / (2.0 * step)
        np.testing.assert_allclose(hessian[k], curve, atol=1e-6 * np.abs(hessian).max())


def test_factors_are_refused_unless_positive_definite():
    scene = cloth(**HEAVY)
    net, x = Network(scene.masses, scene.links[0].pairs), crumpled(scene)
    ones = np.ones(len(net.pairs))
    for transverse in (0.0, -0.3, -2.0):
        matrix = net.hessian(net.edges(x), ones, transverse * ones, 0.5 * np.ones(len(net.inertia)))
        positive = np.linalg.eigvalsh(matrix.toarray()).min() > 0.0
        assert (factorise(matrix) is not None) == positive
        assert positive == (transverse == 0.0)


# ------------------------------------------------------------------ implicit Euler


@pytest.mark.parametrize("stretch", [1.0, 1.3])
@pytest.mark.parametrize("h", [1e-3, 1e-2, 0.1])
def test_one_spring_is_the_backward_euler_recurrence(stretch, h):
    """u = (u + h v - h^2 u*) / (1 + w^2 h^2) with u the extension, u* = -g for a hanging mass."""
    m, alpha = 2.0, 1e-3
    scene = chain(masses=m, compliance=alpha, stretch=stretch, duration=20 * h, samples=20)
    found = implicit_euler(scene, h)
    u, v, exact = stretch - 1.0, 0.0, []
    for _ in range(21):
        exact.append(-1.0 - u)
        new = (u + h * v + h**2 * G) / (1.0 + h**2 / (m * alpha))
        u, v = new, (new - u) / h
    assert np.abs(found.positions[:, 1, 1] - exact).max() < 1e-12
    assert np.abs(found.positions[:, 1, 0]).max() == 0.0
    assert found.velocities[-1, 1, 1] == pytest.approx((exact[-1] - exact[-2]) / h, abs=1e-9)


@pytest.mark.parametrize("alpha", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("h", [1 / 60, 1 / 600])
def test_two_starts_find_one_minimum(alpha, h):
    scene = cloth(size=8, density=64.0, compliance=alpha, stretch=1.1)
    masses, springs = scene.masses, scene.links[0]
    found = implicit_euler_step(masses, springs, scene.gravity, h)
    start = masses.positions + (1e-3 * (crumpled(scene) - masses.positions))
    other = implicit_euler_step(masses, springs, scene.gravity, h, start)
    assert np.abs(found.positions - other.positions).max() < 1e-12
    assert max(found.error, other.error) < 1e-12
    assert np.abs(found.positions - masses.positions).max() > 1e-4, "it moved"


def test_a_step_balances_its_forces():
    """M (x - 2 x_0 + x_-1) / h^2 = m g + pulls(x): no force is taken where the step began."""
    h, scene = 1 / 60, cloth(**HEAVY, stretch=1.1)
    masses = dataclasses.replace(scene.masses, velocities=np.full((16, 3), 0.1))
    x = implicit_euler_step(masses, scene.links[0], scene.gravity, h).positions
    assert unbalanced(scene, x, (x - masses.positions - h * masses.velocities) / h**2) < 1e-10


def test_momentum_grows_by_gravity_alone():
    """Linear momentum exactly; implicit Euler loses angular momentum, so that is not asked."""
    scene = cloth(**HEAVY, pinned="none", stretch=1.1, duration=0.1, samples=10)
    v = implicit_euler(scene, 0.01).velocities
    momentum = np.einsum("i,sik->sk", scene.masses.masses, v)
    expected = scene.times[:, None] * scene.gravity * scene.masses.masses.sum()
    assert np.abs(momentum - expected).max() < 1e-10
    assert np.ptp(v[-1], axis=0).max() > 1.0, "and not all move alike"


# ------------------------------------------------------------------ static states


def test_a_hanging_chain_stretches_by_the_weight_below():
    """Link i of n carries n - i masses: it is longer by (n - i) m g alpha."""
    n, m, alpha = 10, 0.5, 1e-3
    scene = chain(links=n, masses=m, compliance=alpha, angles=90.0)
    found = static_state(scene)
    sag = 1.0 / n + m * G * alpha * np.arange(n, 0, -1)
    assert np.abs(found.positions[1:, 1] + np.cumsum(sag)).max() < 1e-12
    assert np.abs(found.positions[:, 0]).max() < 1e-12


@pytest.mark.parametrize("start", ["vertical", "horizontal"])
@pytest.mark.parametrize("size", [4, 16])
def test_a_cloth_without_diagonals_hangs_as_columns(size, start):
    alpha = 1e-3
    scene = cloth(size=size, density=2.0, pinned="edge", diagonals=False, bending="none", start=start)
    x = static_state(scene).positions.reshape(size, size, 3)
    rows, weight = np.arange(size - 1, 0, -1), 2.0 * G / size**2
    depth = np.concatenate([[0.0], np.cumsum(1.0 / (size - 1) + alpha * weight * rows)])
    assert np.abs(x[..., 1] + depth[:, None]).max() < 1e-11
    assert np.abs(x[..., 2]).max() < 1e-11


@pytest.mark.parametrize("parameters", [{"pinned": "edge"}, {"diagonals": False, "bending": "none"}])
@pytest.mark.parametrize("start", ["vertical", "horizontal"])
def test_forces_balance_in_a_static_state(parameters, start):
    scene = cloth(size=8, start=start, **parameters)
    found = static_state(scene)
    assert unbalanced(scene, found.positions) < 1e-10
    assert found.error < 1e-11


def test_implicit_euler_comes_to_rest_in_the_static_state():
    scene = cloth(size=4, density=2.0, pinned="edge", start="vertical", duration=100.0, samples=1)
    moved = implicit_euler(scene, 0.5).positions[-1]
    assert np.abs(moved - static_state(scene).positions).max() < 1e-10


def test_the_metric_measures_the_distance_to_it():
    parameters = {"size": 4, "compliance": 1e-3, "pinned": "edge", "start": "vertical", "density": 2.0, "duration": 0.1}
    spec = RunSpec(scene="hanging_cloth", engine="pbd", parameters=parameters, metrics=("static_error",))
    scene = build_scene("hanging_cloth", parameters)
    difference = (store.static_state(scene) - scene.masses.positions)[scene.masses.free]
    sag = math.sqrt(np.mean(np.sum(difference**2, axis=1)))
    assert 0.0 < execute(spec).metric("static_error") < 3.0 * sag


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"compliance": 0.0}, "springs only"),
        ({"pinned": "none"}, "without a pinned"),
        ({"pinned": "corners", "start": "vertical"}, "buckles"),
    ],
)
def test_what_has_no_static_state_says_why(parameters, reason):
    with pytest.raises(NoReference, match=reason):
        static_state(cloth(size=4, **parameters))


def test_a_saddle_is_no_minimum():
    """A chain pressed together along itself is stationary, and would buckle to either side."""
    x = np.array([[0.0, 0.0], [0.0, -0.5], [0.0, -1.0]])
    masses = PointMasses(x, np.zeros_like(x), np.ones(3), pinned=(0, 2))
    springs = Springs(np.array([[0, 1], [1, 2]]), np.ones(2), np.full(2, 1e-3))
    with pytest.raises(NoReference, match="compressed"):
        implicit_euler_step(masses, springs, np.zeros(2), 1.0)
    net = Network(masses, springs.pairs)
    energy = Energy(net, np.full(2, 1e3), np.ones(2), x, 1.0, np.zeros(2))
    ends = [minimise(energy, x + [[0, 0], [side, 0], [0, 0]]).positions[1, 0] for side in (0.01, -0.01)]
    assert ends[0] == pytest.approx(-ends[1])
    assert ends[0] > 0.8
