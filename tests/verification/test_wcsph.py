"""Weakly compressible SPH, the fluids of `symplectic_euler`: what is kept, closed forms, pressure at rest."""

from __future__ import annotations

import numpy as np
import pytest

from comparisons.engines import _symplectic_euler_fluid as fluids
from comparisons.engines import symplectic_euler
from comparisons.engines._symplectic_euler_fluid_kernel import integrate
from comparisons.run import build_scene, classify
from pbd.errors import InvalidInput
from pbd.vector import from_store, to_store, zeros

pytestmark = pytest.mark.slow

G = 9.81


def settings(**changes):
    return symplectic_euler.Settings(**{"dt": None, **changes})


def run(name, parameters, **changes):
    """(scene, trajectory)."""
    scene, chosen = build_scene(name, parameters), settings(**changes)
    assert symplectic_euler.unsupported(scene, chosen) == ""
    out = symplectic_euler.prepare(scene, chosen)()
    assert classify(scene, out).code == "ok"
    return scene, out


@pytest.mark.parametrize(("d", "across"), [(2, 10), (3, 6)])
def test_a_collision_keeps_linear_momentum(d, across):
    scene, out = run("two_blobs", {"across": across, "dimension": d})
    momentum = np.einsum("i,sid->sd", scene.masses.masses, out.velocities)
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * np.abs(momentum[0]).max()
    assert np.abs(out.velocities[-1] - out.velocities[0]).max() > 0.1, "they met"
    assert out.work == {"particle steps": out.steps * len(scene.masses.masses)}


@pytest.mark.parametrize("name", ["falling_blob", "lone_particle"])
def test_free_flights_are_parabolas_under_a_half_kick(name):
    scene, out = run(name, {}, half_kick=True)
    exact = scene.exact(out.times)
    assert np.abs(out.positions - exact.positions).max() < 1e-10
    assert np.abs(out.velocities - exact.velocities).max() < 1e-10


def test_without_a_half_kick_a_flight_has_the_schemes_own_error():
    scene, out = run("lone_particle", {})
    late = 0.5 * G * out.times * scene.duration / out.steps
    assert np.abs(scene.exact(out.times).positions[:, 0, 1] - late - out.positions[:, 0, 1]).max() < 1e-12


def test_pressure_at_rest_is_that_of_the_depth():
    """In the mean over the water away from walls and surface; beside walls it is not, see the kernel."""
    across, pieces = 20, 10
    scene, chosen = (
        build_scene("hydrostatic_column", {"across": across, "duration": 2.0, "samples": pieces}),
        settings(),
    )
    water, masses, n = fluids.new_water(scene, chosen), scene.masses, across**2
    bodies = symplectic_euler.Bodies(
        to_store(masses.positions), to_store(masses.velocities), zeros(n, 2), 1.0 / masses.masses
    )
    dt, samples = fluids.step_of(scene, chosen), (zeros((pieces + 1, n), 2), zeros((pieces + 1, n), 2))
    counts = scene.steps_per_sample(dt), pieces
    assert integrate(water, bodies, (0.0, -G), (dt, 0.0), counts, samples) == (pieces, 0)
    heads = water.tait * np.maximum(water.density**7 - 1.0, 0.0) / G
    x, h = from_store(bodies.x), fluids.SUPPORT[2] / across
    depth = x[:, 1].max() + 0.5 / across - x[:, 1]
    inner = (np.abs(x[:, 0] - 0.5) < 0.5 - h) & (x[:, 1] > h) & (depth > h)
    slope, offset = np.polyfit(depth[inner], heads[inner], 1)
    assert slope == pytest.approx(1.0, abs=0.04)
    assert offset == pytest.approx(0.0, abs=0.02)


def test_steps_are_the_longest_that_sound_allows():
    scene = build_scene("dam_break", {"across": 10})
    chosen = settings()
    dt, limit = fluids.step_of(scene, chosen), fluids.limit(scene, chosen)
    interval = scene.duration / scene.samples
    assert dt <= limit < interval / (round(interval / dt) - 1)
    assert symplectic_euler.unsupported(scene, settings(dt=limit)) == ""
    assert "at most" in symplectic_euler.unsupported(scene, settings(dt=1.01 * limit))


def test_what_it_cannot_run_is_said():
    assert "solids" in symplectic_euler.unsupported(build_scene("floating_box", {}), settings())
    assert "dt" in symplectic_euler.unsupported(build_scene("pendulum_chain", {"links": 2}), settings())
    with pytest.raises(InvalidInput, match="sound_speed"):
        settings(sound_speed=0.0)
