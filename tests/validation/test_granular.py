"""Fluids in engines of rigid bodies: grains in the place of particles, poured before they are let go."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from comparisons import engine
from comparisons.bodies import Ball, Box
from comparisons.engines import _granular
from comparisons.run import build_scene

pytestmark = pytest.mark.slow

G = 9.81
ENGINES = ("pymunk", "pybullet")


def column(**parameters):
    return build_scene("dam_break", {"across": 6, "duration": 1.0, "samples": 10, **parameters})


@pytest.fixture(params=ENGINES)
def adapter(request):
    pytest.importorskip(request.param)
    return engine.load(request.param)


def matched(adapter, **changes):
    return adapter.Settings(**{**adapter.PRESETS["matched"], "dt": None, **changes})


@pytest.mark.parametrize("d", [2, 3])
def test_grains_have_the_places_masses_and_walls_of_the_particles(d):
    scene = column(dimension=d, obstacle=True)
    built = _granular.grains(scene)
    bodies, n = built.bodies, len(scene.masses.masses)
    assert bodies.shapes[:n] == (Ball(0.5 * scene.fluid.spacing, d),) * n
    assert np.array_equal(bodies.positions[:n], scene.masses.positions)
    assert np.array_equal(bodies.masses[:n], scene.masses.masses)
    assert built.planes is scene.planes
    assert (built.friction, built.restitution, built.fluid) == (0.0, 0.0, None)
    ((low, high),) = scene.fluid.obstacles
    assert bodies.shapes[n:] == (Box(tuple(high - low)),)
    assert np.allclose(bodies.positions[n:], 0.5 * (low + high))
    assert bodies.fixed == (n,)


def test_grains_are_poured_between_their_own_bounds():
    scene = column()
    built = _granular.enclosed(_granular.grains(scene), len(scene.masses.masses))
    x, radius = built.bodies.positions, 0.5 * scene.fluid.spacing
    assert pdist(x).min() > 2.0 * radius * (1.0 - 1e-12)
    heights = x @ built.planes.normals.T - built.planes.offsets
    assert heights.min() > radius * (1.0 - 1e-9)
    assert (built.planes.normals[:, 0] == -1.0).sum() == 2, "the tank's far wall, and one at the column's side"
    assert not (built.planes.normals[:, 1] < 0.0).any(), "open above"


def test_a_poured_column_is_at_rest_without_overlap(adapter):
    scene, starts = column(), []

    def keep(built, settings):
        starts.append(built)
        return adapter.prepare(built, settings)

    out = _granular.prepare(scene, _granular.with_step(scene, matched(adapter)), keep)()
    spacing = scene.fluid.spacing
    _, start = (built.bodies for built in starts)
    assert pdist(start.positions).min() > 0.97 * spacing
    assert np.all(start.velocities == 0.0)
    assert start.positions[:, 0].max() < 1.0 - 0.49 * spacing
    assert start.positions[:, 1].max() < 2.2, "fallen together"
    assert out.positions.shape == (11, len(scene.masses.masses), 2)
    assert out.work == {"particle steps": out.steps * len(scene.masses.masses)}
    assert out.positions[-1, :, 0].max() > 1.1, "let go"
    assert out.positions[..., 1].min() > 0.0


def test_free_grains_are_not_poured(adapter):
    scene = build_scene("falling_blob", {"across": 4, "duration": 0.2, "samples": 4})
    out = adapter.prepare(scene, matched(adapter))()
    exact = scene.exact(out.times)
    assert np.abs(out.positions - exact.positions).max() < 1e-9
    assert np.abs(out.velocities - exact.velocities).max() < 1e-9


def test_what_grains_are_not_is_said(adapter):
    settings = matched(adapter)
    assert adapter.unsupported(column(), settings) == ""
    assert "solids" in adapter.unsupported(build_scene("floating_box", {}), settings)
    assert "dt" in adapter.unsupported(build_scene("pendulum_chain", {"links": 1}), settings)


def test_a_step_is_a_part_of_the_sample_interval(adapter):
    scene = column()
    chosen = _granular.with_step(scene, matched(adapter))
    assert scene.steps_per_sample(chosen.dt) >= 1
    assert chosen.dt * scene.fluid.speed <= _granular.COURANT * scene.fluid.spacing * (1.0 + 1e-9)
    assert _granular.with_step(scene, dataclasses.replace(chosen, dt=1e-3)).dt == 1e-3
