"""Euler's step with half a kick first: free flights are parabolas, whatever else there is; what it refuses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import pbd
from pbd.arrangement import Problem

pytestmark = pytest.mark.slow

GRAVITY = np.array([0.0, -9.81])
S = 0.05
"""[m] Spacing."""


def parabola(out, x, v):
    """(positions, velocities) of free particles at the sample times."""
    t = out.times[:, None, None]
    return x + v * t + 0.5 * GRAVITY * t**2, v + GRAVITY * t


def flight(particles, batches, steps=400, **options):
    settings = pbd.Settings(**{"dt": 1e-3, "integrator": pbd.Euler(half_kick=True), **options})
    return pbd.Simulation(particles, batches, gravity=GRAVITY, settings=settings).run(steps)


def test_blob_of_fluid_falls_along_the_parabola():
    """Positions and velocities, at rest density, with several iterations and sub-steps; and again in a second run."""
    x = S * np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0), indexing="ij"), -1).reshape(-1, 2)
    v = np.full_like(x, 0.4)
    particles = pbd.particles(x, velocities=v)
    settings = pbd.Settings(dt=2e-3, iterations=2, substeps=2, integrator=pbd.Euler(half_kick=True))
    simulation = pbd.Simulation(particles, [pbd.density(particles, spacing=S)], gravity=GRAVITY, settings=settings)
    out = simulation.run(200)
    positions, velocities = parabola(out, x, v)
    assert out.positions == pytest.approx(positions, abs=1e-10)
    assert out.velocities == pytest.approx(velocities, abs=1e-10)
    again = simulation.run(200)
    assert np.array_equal(again.positions, out.positions)
    assert np.array_equal(again.velocities, out.velocities)


def test_centre_of_a_dumbbell_above_a_floor_falls_along_the_parabola():
    """Beside it a pinned particle, which stays where it is."""
    x = np.array([[0.0, 3.0], [0.5, 3.0], [5.0, 5.0]])
    v = np.array([[0.2, 1.0], [0.2, -1.0], [0.0, 0.0]])
    particles = pbd.particles(x, velocities=v, pinned=[2])
    batches = [pbd.distance(particles, [(0, 1)]), pbd.plane_contact(particles, normal=[0.0, 1.0])]
    out = flight(particles, batches)
    positions, velocities = parabola(out, x[:2].mean(axis=0), v[:2].mean(axis=0))
    assert out.positions[:, :2].mean(axis=1, keepdims=True) == pytest.approx(positions, abs=1e-10)
    assert out.velocities[:, :2].mean(axis=1, keepdims=True) == pytest.approx(velocities, abs=1e-10)
    assert np.all(out.positions[:, 2] == x[2])


def test_what_lies_on_a_floor_is_recorded_with_half_a_kick():
    particles = pbd.particles([[0.0, 0.0]])
    out = flight(particles, [pbd.plane_contact(particles, normal=[0.0, 1.0])], steps=50)
    assert np.abs(out.positions[-1]).max() <= 1e-12
    assert out.velocities[-1, 0] == pytest.approx(0.5e-3 * GRAVITY, abs=1e-12)


class Balloons(NamedTuple):
    """Bodies of a kind of their own, which know line 7."""

    radius: np.ndarray

    def predict(self, h):
        """Nothing moves."""


def test_bodies_are_refused():
    problem = Problem(None, (), pbd.Settings(), Balloons(np.ones(2)))
    assert pbd.Euler().bind(problem) == ()
    with pytest.raises(pbd.InvalidInput, match=r"integrator\.half_kick = True: must be false with bodies; Balloons"):
        pbd.Euler(half_kick=True).bind(problem)


@pytest.mark.parametrize("value", [1, None, "yes"])
def test_what_is_neither_true_nor_false_is_refused(value):
    with pytest.raises(pbd.InvalidInput, match=r"integrator\.half_kick"):
        pbd.Euler(half_kick=value)
