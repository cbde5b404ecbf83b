"""The exact projection against known answers, its conditions of optimality, and what it must keep."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest
from scipy.optimize import minimize

from comparisons import store
from comparisons.exact_projection import distance, project, project_links
from comparisons.reference import NoReference
from comparisons.run import build_scene
from comparisons.scene import PointMasses

pytestmark = pytest.mark.slow


def cloth(**parameters):
    return build_scene("hanging_cloth", {"stretch": 1.1, **parameters})


def chain(**parameters):
    return build_scene("pendulum_chain", {"stretch": 1.1, **parameters})


def jacobian(x, pairs):
    """(m, n d) dense gradients of the lengths."""
    result = np.zeros((len(pairs), *x.shape))
    normals = x[pairs[:, 0]] - x[pairs[:, 1]]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    rows = np.arange(len(pairs))
    result[rows, pairs[:, 0]] = normals
    result[rows, pairs[:, 1]] = -normals
    return result


def assert_optimal(scene, x, tolerance=1e-7):
    """All links at rest, and M (x - x0) within the span of their gradients, by dense least squares."""
    link, masses = scene.links[0], scene.masses
    lengths = np.linalg.norm(x[link.pairs[:, 0]] - x[link.pairs[:, 1]], axis=1)
    assert (np.abs(lengths - link.lengths) / link.lengths).max() < 1e-9
    free = masses.free
    pull = (masses.masses[:, None] * (x - masses.positions))[free].ravel()
    gradients = jacobian(x, link.pairs)[:, free].reshape(len(link.pairs), -1)
    left = pull - gradients.T @ np.linalg.lstsq(gradients.T, pull, rcond=1e-12)[0]
    assert np.linalg.norm(left) < tolerance * np.linalg.norm(pull)
    np.testing.assert_array_equal(x[~free], masses.positions[~free])


@pytest.mark.parametrize("pinned", ["none", "edge", "corners"])
@pytest.mark.parametrize("start", ["horizontal", "vertical"])
@pytest.mark.parametrize("size", [2, 5, 16])
def test_an_overstretched_cloth_goes_back_to_its_rest(size, start, pinned):
    """Its links leave it only rigid motions; the nearest is none, but for the centre of mass of one that is free."""
    scene = cloth(size=size, start=start, pinned=pinned, lumping="area")
    m, x0 = scene.masses.masses, scene.masses.positions
    rest = build_scene("hanging_cloth", {"size": size, "start": start}).masses.positions
    if pinned == "none":
        rest = rest + m @ (x0 - rest) / m.sum()
    found = project(scene)
    assert np.abs(found.positions - rest).max() < 1e-9
    assert found.violation < 1e-10
    assert found.stationarity < 1e-8
    assert found.distance == pytest.approx(distance(scene.masses, rest, x0), rel=1e-8)


@pytest.mark.parametrize("stretch", [0.9, 1.1, 1.5])
def test_a_straight_chain_shortens_along_itself(stretch):
    scene = chain(links=20, angles=40.0, stretch=stretch)
    assert np.abs(project(scene).positions - chain(links=20, angles=40.0, stretch=1.0).masses.positions).max() < 1e-9


@pytest.mark.parametrize("links", [3, 30])
def test_a_bent_chain_meets_the_conditions_of_optimality(links):
    angles = (60.0 + 40.0 * np.cos(np.arange(links))).tolist()
    scene = chain(links=links, angles=angles, masses=np.linspace(1.0, 3.0, links).tolist())
    found = project(scene)
    assert_optimal(scene, found.positions)
    assert found.violation < 1e-10


def bent(**parameters):
    """A cloth of 6 x 6 that starts out of its plane."""
    scene = cloth(size=6, **parameters)
    off = np.column_stack([np.zeros(36), 0.05 * np.sin(np.arange(36.0)), np.zeros(36)])
    x = scene.masses.positions + np.where(scene.masses.free[:, None], off, 0.0)
    return dataclasses.replace(scene, masses=dataclasses.replace(scene.masses, positions=x))


def test_a_cloth_out_of_its_plane_meets_the_conditions_of_optimality():
    """Without two-cell links and diagonals, hung along its edge, it may leave its plane."""
    scene = bent(diagonals=False, bending="none", pinned="edge")
    found = project(scene)
    assert_optimal(scene, found.positions)
    assert np.ptp(found.positions[:, 1]) > 0.01, "it is still out of its plane"


def test_a_cloth_that_cannot_leave_its_plane_has_no_multipliers_for_a_start_out_of_it():
    with pytest.raises(NoReference, match="regular constraints"):
        project(bent(pinned="edge"))


def test_the_projection_of_a_projection_is_itself():
    scene = bent(diagonals=False, bending="none", pinned="edge")
    x = project(scene).positions
    for off in (0.0, 1e-7):
        near = x + off * np.sin(np.arange(36.0))[:, None] * scene.masses.free[:, None]
        start = dataclasses.replace(scene, masses=dataclasses.replace(scene.masses, positions=near))
        found = project(start)
        assert found.distance <= 1.1 * off
        assert found.violation < 1e-10


def test_a_general_optimiser_finds_no_nearer_state():
    scene = chain(links=3, angles=[80.0, 30.0, 100.0], masses=[2.0, 0.3, 1.0])
    x0, m, link = scene.masses.positions, scene.masses.masses[1:], scene.links[0]

    def whole(q):
        return np.vstack([x0[:1], q.reshape(-1, 2)])

    def violation(q):
        steps = np.diff(whole(q), axis=0)
        return np.linalg.norm(steps, axis=1) - link.lengths

    found = minimize(
        lambda q: 0.5 * m @ np.sum((whole(q) - x0)[1:] ** 2, axis=1),
        x0[1:].ravel(), method="SLSQP", constraints={"type": "eq", "fun": violation}, options={"ftol": 1e-14},
    )  # fmt: skip
    assert np.abs(whole(found.x) - project(scene).positions).max() < 1e-6


def test_a_free_projection_keeps_both_momenta():
    """sum m (x - x0) = 0 and sum m x cross (x - x0) = 0, as for each projection of a link."""
    rng = np.random.default_rng(3)
    x = rng.standard_normal((5, 3))
    masses = PointMasses(x, 0.0 * x, rng.uniform(0.5, 2.0, 5))
    pairs = np.array([(i, j) for i in range(5) for j in range(i)])[:7]
    found = project_links(masses, pairs, 1.05 * np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1))
    moved = masses.masses[:, None] * (found.positions - x)
    assert np.abs(moved).max() > 1e-3
    assert np.abs(moved.sum(axis=0)).max() < 1e-9
    assert np.abs(np.cross(found.positions, moved).sum(axis=0)).max() < 1e-8


def test_links_that_are_met_move_nothing():
    scene = cloth(size=5, stretch=1.0)
    found = project(scene)
    assert found.distance < 1e-15
    assert found.stationarity < 1e-12


def test_links_that_cannot_be_met_together_are_refused():
    scene = chain(links=3, stretch=1.0)
    pairs = np.array([[0, 1], [1, 2], [0, 2]])
    with pytest.raises(NoReference, match="cannot be met"):
        project_links(scene.masses, pairs, np.array([1.0, 1.0, 3.0]))


def test_the_cloth_of_the_xpbd_paper_is_projected_within_a_minute():
    scene = cloth(size=64)
    began = time.perf_counter()
    found = project(scene)
    assert time.perf_counter() - began < 60.0
    rest = build_scene("hanging_cloth", {"size": 64}).masses.positions
    assert np.abs(found.positions - rest).max() < 1e-9
    assert found.violation < 1e-10
    assert found.stationarity < 1e-8


def test_a_projection_is_computed_once(monkeypatch):
    scene = cloth(size=3)
    first = store.projection(scene)
    monkeypatch.setattr("comparisons.exact_projection.project", None)
    np.testing.assert_array_equal(store.projection(scene), first)
