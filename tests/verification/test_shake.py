"""SHAKE: its order and those of its compositions, what it keeps, its discrete answers, what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

import pbd
from comparisons import reference
from comparisons.fit import fit_order
from comparisons.run import build_scene

pytestmark = pytest.mark.slow

G = 9.81
LADDERS = {
    (1, 2): [1e-2 / 2**k for k in range(5)],
    (1, 4): [2.5e-2 / 2**k for k in range(5)],
    (1, 6): [5e-2 / 1.5**k for k in range(5)],
    (2, 2): [2e-3 / 2**k for k in range(5)],
    (2, 4): [5e-3 / 2**k for k in range(5)],
    (2, 6): [1e-2 / 1.5**k for k in range(5)],
    (10, 2): [2e-3 / 2**k for k in range(5)],
    (10, 4): [2e-3 / 2**k for k in range(4)],
    (10, 6): [4e-3 / 2**k for k in range(4)],
}
"""Time steps [s] between the coarse range and round-off."""

SAMPLES = 10


def shaken(scene, dt, order=2, solver=None, velocity="impulses", iterations=1):
    """A run of a chain over its duration, recorded at SAMPLES times."""
    masses, rods = scene.masses, scene.links[0]
    particles = pbd.particles(masses.positions, masses=masses.masses, pinned=masses.pinned)
    links = pbd.distance(particles, rods.pairs, rest_length=rods.lengths)
    settings = pbd.Settings(
        dt=dt, integrator=pbd.Shake(order, velocity), solver=solver or pbd.Direct(), iterations=iterations
    )
    every = round(scene.duration / SAMPLES / dt)
    assert every * SAMPLES * dt == pytest.approx(scene.duration)
    return pbd.Simulation(particles, [links], gravity=scene.gravity, settings=settings).run(
        every * SAMPLES, np.arange(SAMPLES + 1) * every
    )


def chain(links, duration=1.0, **changes):
    return build_scene("pendulum_chain", {"links": links, "duration": duration, "samples": SAMPLES, **changes})


def energy(outcome, masses):
    return 0.5 * np.sum(outcome.velocities**2, axis=2) @ masses + G * outcome.positions[:, :, 1] @ masses


@pytest.mark.parametrize(("links", "order"), LADDERS)
def test_orders_of_convergence(links, order):
    """Of positions and of velocities, which live half a step away and off the constraints until they are recorded."""
    scene = chain(links, duration=1.2)
    dts = [scene.duration / SAMPLES / max(1, round(scene.duration / SAMPLES / dt)) for dt in LADDERS[links, order]]
    exact = reference.solve(scene)
    runs = [shaken(scene, dt, order) for dt in dts]
    for found, wanted in (("positions", exact.positions), ("velocities", exact.velocities)):
        errors = [np.abs(getattr(run, found) - wanted).max() for run in runs]
        fit = fit_order(dts, errors)
        assert fit.order is not None, (found, errors)
        assert fit.order >= order - 0.15, (found, errors)
    assert all(run.unconverged == 0 for run in runs)


def test_energy_of_a_pendulum_stays_for_a_hundred_seconds():
    """At 1 kHz, in units of m g L; PBD loses most of it, whatever its iterations or its solver."""
    scene = chain(1, duration=100.0)
    masses = np.array([0.0, 1.0])
    kept = energy(shaken(scene, 1e-3), masses)
    assert np.abs(kept - kept[0]).max() <= 1e-5 * G
    particles = pbd.particles(scene.masses.positions, pinned=[0])
    link = pbd.distance(particles, [(0, 1)])
    for settings in (pbd.Settings(dt=1e-3), pbd.Settings(dt=1e-3, solver=pbd.Direct())):
        lost = pbd.simulate(particles, [link], gravity=(0, -G), settings=settings, duration=100.0, samples=10)
        assert energy(lost, masses)[-1] < -0.7 * G


@pytest.mark.parametrize("order", [2, 4, 6])
def test_links_keep_their_lengths_and_velocities_lie_along_them(order):
    scene = chain(10)
    out = shaken(scene, 1e-3, order)
    links, rates = np.diff(out.positions, axis=1), np.diff(out.velocities, axis=1)
    np.testing.assert_allclose(np.linalg.norm(links, axis=2), 0.1, rtol=0, atol=1e-14)
    assert np.abs(np.sum(links * rates, axis=2)).max() < 1e-13


@pytest.mark.parametrize("order", [2, 4, 6])
def test_time_runs_backwards(order):
    """A symmetric method returns to its start when the velocities are turned round."""
    scene = chain(3)
    there = shaken(scene, 1e-2, order)
    particles = pbd.particles(there.positions[-1], velocities=-there.velocities[-1], pinned=[0])
    links = pbd.distance(particles, scene.links[0].pairs, rest_length=scene.links[0].lengths)
    settings = pbd.Settings(dt=1e-2, integrator=pbd.Shake(order), solver=pbd.Direct())
    back = pbd.simulate(particles, [links], gravity=(0, -G), settings=settings, duration=1.0, samples=1)
    np.testing.assert_allclose(back.positions[-1], there.positions[0], rtol=0, atol=1e-11)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_free_fall_is_exact(order):
    """The half kick makes a parabola exact: no merit of the constraints, and said so."""
    ball = pbd.particles([[0.3, 2.0]], velocities=[[1.0, 3.0]])
    settings = pbd.Settings(dt=0.01, integrator=pbd.Shake(order), solver=pbd.Direct())
    out = pbd.simulate(ball, [], gravity=(0.0, -G), settings=settings, duration=1.0, samples=10)
    t = out.times[:, None]
    np.testing.assert_allclose(out.positions[:, 0], [0.3, 2.0] + t * [1.0, 3.0] - 0.5 * t**2 * [0, G], atol=1e-12)
    np.testing.assert_allclose(out.velocities[:, 0], [1.0, 3.0] - t * [0, G], atol=1e-12)


def test_a_free_chain_keeps_both_momenta():
    rng = np.random.default_rng(3)
    x, masses = np.cumsum(rng.normal(size=(6, 3)), axis=0), rng.uniform(0.5, 2.0, 6)
    particles = pbd.particles(x, masses=masses, velocities=rng.normal(size=(6, 3)))
    links = pbd.distance(particles, [(i, i + 1) for i in range(5)])
    settings = pbd.Settings(dt=1e-3, integrator=pbd.Shake(), solver=pbd.Direct())
    out = pbd.simulate(particles, [links], gravity=np.zeros(3), settings=settings, duration=1.0, samples=10)
    p = masses @ out.velocities
    spin = np.einsum("i,sij->sj", masses, np.cross(out.positions, out.velocities))
    # the first recorded velocity is projected onto the links: a start that violates them is no start
    np.testing.assert_allclose(p[1:], np.broadcast_to(p[1], p[1:].shape), rtol=0, atol=1e-11)
    np.testing.assert_allclose(spin[1:], np.broadcast_to(spin[1], spin[1:].shape), rtol=0, atol=1e-11)


def test_gauss_seidel_converges_to_the_direct_solution():
    scene = chain(5, duration=0.5)
    direct, swept = shaken(scene, 1e-3), shaken(scene, 1e-3, solver=pbd.GaussSeidel(), iterations=400)
    np.testing.assert_allclose(swept.positions, direct.positions, rtol=0, atol=1e-11)
    np.testing.assert_allclose(swept.velocities, direct.velocities, rtol=0, atol=1e-4)


def test_velocities_from_impulses_and_from_differences_agree_until_round_off():
    scene = chain(2, duration=0.5)
    one, other = (shaken(scene, 1e-3, velocity=v) for v in ("impulses", "differences"))
    np.testing.assert_allclose(one.positions, other.positions, rtol=0, atol=1e-11)
    exact = reference.solve(scene).positions
    errors = [np.abs(shaken(scene, 5e-6, 4, velocity=v).positions - exact).max() for v in ("impulses", "differences")]
    assert errors[0] < 0.2 * errors[1], "v = (p - x)/h has a round-off of 1e-16/h, impulses have none"


# ------------------------------------------------------------------ what it refuses

PARTICLES = pbd.particles([[0.0, 0.0], [1.0, 0.0]], pinned=[0])
LINK = [(0, 1)]


@pytest.mark.parametrize(
    ("batch", "changes", "field"),
    [
        (pbd.distance(PARTICLES, LINK, law=pbd.Compliance(1e-3)), {}, "settings.integrator"),
        (pbd.distance(PARTICLES, LINK, law=pbd.Stiffness(0.5)), {}, "settings.integrator"),
        (pbd.distance(PARTICLES, LINK, law=pbd.Stiffness(relation="at_most")), {}, "settings.integrator"),
        (pbd.plane_contact(PARTICLES, normal=(0, 1)), {}, "settings.integrator"),
        (pbd.distance(PARTICLES, LINK), {"damping": pbd.Damping(0.1)}, "settings.damping"),
        (pbd.distance(PARTICLES, LINK), {"solver": pbd.GaussSeidel("coloured")}, "settings.solver"),
        (pbd.distance(PARTICLES, LINK), {"precision": "float32"}, "settings.precision"),
    ],
)
def test_what_would_spoil_the_order_is_refused(batch, changes, field):
    settings = pbd.Settings(integrator=pbd.Shake(), **changes)
    with pytest.raises(pbd.InvalidInput) as error:
        pbd.Simulation(PARTICLES, [batch], settings=settings)
    assert error.value.field == field
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("order", "velocity"), [(3, "impulses"), (8, "impulses"), (2, "impulse")])
def test_unknown_orders_and_velocities_are_refused(order, velocity):
    with pytest.raises(pbd.InvalidInput):
        pbd.Shake(order, velocity)
