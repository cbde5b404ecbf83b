"""What the scheme must give, to round-off: the closed form of the DISCRETE equations, not of the system's.

Only the last two groups compare with the continuous system, by fitted orders.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import pbd

G = 9.81
DOWN = (0.0, -1.0)
ROUND_OFF = 1e-12


def fitted_order(steps, errors):
    """Slope of log(error) over log(step)."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def spring(law, *, stretch=0.5, direction=(1.0, 0.0), velocity=0.0):
    """A unit mass on a fixed anchor at the origin, rest length 1, in 2D."""
    along = np.asarray(direction) / np.linalg.norm(direction)
    particles = pbd.particles(
        [[0.0, 0.0], (1.0 + stretch) * along], velocities=[[0.0, 0.0], velocity * along], pinned=[0]
    )
    return particles, pbd.distance(particles, [(0, 1)], rest_length=1.0, law=law)


def chain(links, law, *, length=1.0, stretch=1.0, order=1):
    """A chain hanging straight down from the pinned particle 0, each link ``stretch`` times its rest length."""
    y = -stretch * length * np.arange(links + 1.0)
    particles = pbd.particles(np.column_stack([np.zeros(links + 1), y]), pinned=[0])
    pairs = [(i, i + 1) for i in range(links)][::order]
    return particles, pbd.distance(particles, pairs, rest_length=length, law=law)


def run(scene, steps, samples=None, *, gravity=0.0, **settings):
    particles, batch = scene
    simulation = pbd.Simulation(particles, [batch], gravity=(0.0, -gravity), settings=pbd.Settings(**settings))
    outcome = simulation.run(steps, samples)
    assert outcome.status == "ok"
    return outcome


def lengths(outcome):
    """Link lengths (s, m) of a chain or spring."""
    return np.linalg.norm(np.diff(outcome.positions, axis=1), axis=2)


def sag(scene, steps, **settings):
    """How much longer than its rest length a scene is after ``steps`` steps under gravity."""
    final = lengths(run(scene, steps, [steps], gravity=G, **settings))[0]
    return float(final.sum() - scene[1].rest.sum())


# ------------------------------------------------------------------ free fall


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_free_fall_is_the_symplectic_euler_sum(dimension):
    """x_n = x_0 + n h v_0 + g h^2 n (n + 1) / 2 and v_n = v_0 + n h g."""
    start = np.array([[0.3, -0.2, 0.1], [0.0, 0.5, 0.4]])[:, :dimension]
    velocity = np.array([[1.0, 2.0, -1.0], [0.0, -0.5, 0.25]])[:, :dimension]
    gravity = np.array([-G, 1.0, 0.5])[:dimension]
    h, steps = 0.01, 100
    particles = pbd.particles(start, velocities=velocity, masses=[1.0, 7.0])
    outcome = pbd.Simulation(particles, gravity=gravity, settings=pbd.Settings(dt=h)).run(steps)
    n = np.arange(steps + 1)[:, None, None]
    np.testing.assert_allclose(
        outcome.positions, start + n * h * velocity + gravity * h * h * n * (n + 1) / 2, rtol=ROUND_OFF, atol=ROUND_OFF
    )
    # v = (p - x)/h loses about 1e-16 |x|/h in each step
    np.testing.assert_allclose(outcome.velocities, velocity + n * h * gravity, rtol=ROUND_OFF, atol=1e-11)
    np.testing.assert_allclose(outcome.times, n[:, 0, 0] * h, rtol=1e-15)


def test_substeps_are_steps():
    """One step of n sub-steps is n steps of dt/n."""
    scene = spring(pbd.Compliance(1e-3))
    coarse = run(scene, 20, gravity=G, dt=0.01, substeps=5, iterations=3)
    fine = run(scene, 100, np.arange(0, 101, 5), gravity=G, dt=0.002, iterations=3)
    np.testing.assert_array_equal(coarse.positions, fine.positions)
    np.testing.assert_array_equal(coarse.velocities, fine.velocities)


# ------------------------------------------------------------------ XPBD on one spring


def backward_euler(alpha, beta, h, steps, *, stretch, velocity):
    """x+ = x + h v+, v+ = v - h ((x+ - 1)/alpha + beta v+) for a unit mass: both forces at the new state."""
    x, v = 1.0 + stretch, velocity
    samples = [(x, v)]
    for _ in range(steps):
        v = (v - h * (x - 1.0) / alpha) / (1.0 + h * h / alpha + h * beta)
        x = x + h * v
        samples.append((x, v))
    return np.array(samples).T


@pytest.mark.parametrize("iterations", [1, 5, 10, 50])
def test_xpbd_spring_is_backward_euler(iterations):
    """Macklin et al. 2016, figure 2: the number of iterations does not matter (claim 1)."""
    alpha, h, steps = 1e-3, 1 / 360, 180
    outcome = run(spring(pbd.Compliance(alpha)), steps, dt=h, iterations=iterations)
    x, v = backward_euler(alpha, 0.0, h, steps, stretch=0.5, velocity=0.0)
    np.testing.assert_allclose(outcome.positions[:, 1, 0], x, rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(outcome.velocities[:, 1, 0], v, rtol=0, atol=ROUND_OFF / h)


@pytest.mark.parametrize("iterations", [1, 4])
@pytest.mark.parametrize("beta", [0.5, 40.0])
def test_xpbd_damping_is_the_implicit_damper(beta, iterations):
    """Equation 26: backward Euler with the force -C/alpha - beta dC/dt of spring and damper."""
    alpha, h, steps = 1e-3, 1 / 360, 180
    scene = spring(pbd.Compliance(alpha, beta), velocity=3.0)
    outcome = run(scene, steps, dt=h, iterations=iterations)
    x, v = backward_euler(alpha, beta, h, steps, stretch=0.5, velocity=3.0)
    np.testing.assert_allclose(outcome.positions[:, 1, 0], x, rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(outcome.velocities[:, 1, 0], v, rtol=0, atol=ROUND_OFF / h)


@pytest.mark.parametrize("h", [1 / 60, 1 / 360])
def test_numerical_damping_law(h):
    """(omega C, v) shrinks by (1 + omega^2 h^2)^(-1/2) in each step, exactly (claim 2)."""
    omega2, steps = 1000.0, 144
    outcome = run(spring(pbd.Compliance(1 / omega2)), steps, dt=h)
    size = np.hypot(math.sqrt(omega2) * (outcome.positions[:, 1, 0] - 1.0), outcome.velocities[:, 1, 0])
    law = (1.0 + omega2 * h * h) ** (-0.5 * np.arange(steps + 1))
    np.testing.assert_allclose(size / size[0], law, rtol=1e-10, atol=1e-13)


def test_decay_per_period_of_the_published_spring():
    """dt = 1/360 s and omega^2 = 1000: 71.7 steps a period, peak ratio 0.759 (figure 2 shows 0.76)."""
    h, omega = 1 / 360, math.sqrt(1000.0)
    x = run(spring(pbd.Compliance(1e-3)), 360, dt=h).positions[:, 1, 0] - 1.0
    crossings = np.flatnonzero((x[:-1] > 0.0) & (x[1:] <= 0.0))
    at = crossings + x[crossings] / (x[crossings] - x[crossings + 1])
    assert np.diff(at).mean() == pytest.approx(2 * math.pi / math.atan(omega * h), rel=2e-3)
    assert np.diff(at).mean() == pytest.approx(71.7, abs=0.2)
    peaks = [x[a:b].max() for a, b in itertools.pairwise(crossings)]
    assert peaks[1] / peaks[0] == pytest.approx(0.759, abs=0.005)


@pytest.mark.parametrize("iterations", [1, 7])
def test_zero_compliance_is_rigid_pbd(iterations):
    """alpha = 0 is PBD with k = 1."""
    x = np.column_stack([np.linspace(0.0, 1.0, 6), np.zeros(6)])
    ends = []
    for law in (pbd.Stiffness(), pbd.Compliance(0.0)):
        particles = pbd.particles(x, pinned=[0])
        batch = pbd.distance(particles, [(i, i + 1) for i in range(5)], law=law)
        ends.append(run((particles, batch), 100, gravity=G, dt=0.005, iterations=iterations).positions)
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-11)
    assert np.ptp(ends[0][:, -1, 1]) > 0.5  # it did swing


@pytest.mark.parametrize("iterations", [1, 10])
@pytest.mark.parametrize(("dt", "steps"), [(1 / 60, 600), (1 / 240, 6000), (1 / 960, 60000)])
def test_xpbd_static_sag_is_that_of_the_spring(dt, steps, iterations):
    """m g alpha for every time step and number of iterations (claim 4)."""
    scene = spring(pbd.Compliance(1e-3), stretch=0.0, direction=DOWN)
    assert sag(scene, steps, dt=dt, iterations=iterations) == pytest.approx(G * 1e-3, abs=1e-10)


# ------------------------------------------------------------------ PBD's stiffness


@pytest.mark.parametrize("k", [0.01, 0.5, 0.97])
def test_corrected_stiffness_leaves_one_minus_k(k):
    """k' = 1 - (1 - k)^(1/n): the residual of one constraint is 1 - k for n = 1..100 (claim 6)."""
    for n in range(1, 101):
        scene = spring(pbd.Stiffness(k), direction=(1.0, 2.0))
        residual = (lengths(run(scene, 1, [1], dt=0.01, iterations=n))[0, 0] - 1.0) / 0.5
        assert residual == pytest.approx(1.0 - k, abs=ROUND_OFF)


@pytest.mark.parametrize("k", [0.01, 0.5, 0.97])
def test_raw_stiffness_leaves_the_nth_power(k):
    """Without the correction (1 - k)^n remains."""
    for n in (1, 2, 3, 5, 10, 30, 100):
        scene = spring(pbd.Stiffness(k, raw=True), direction=(1.0, 2.0))
        residual = (lengths(run(scene, 1, [1], dt=0.01, iterations=n))[0, 0] - 1.0) / 0.5
        assert residual == pytest.approx((1.0 - k) ** n, abs=ROUND_OFF)


@pytest.mark.parametrize(("n", "expected"), [(1, 1.0938), (5, 1.1617), (100, 1.1827), (1000, 1.1838)])
def test_corrected_stiffness_of_a_chain_depends_a_little_on_the_iterations(n, expected):
    """Largest link error over the start's: 10 links from a pin, each 10 % too long, k = 0.5, swept from the pin."""
    error = lengths(run(chain(10, pbd.Stiffness(0.5), stretch=1.1), 1, [1], dt=0.01, iterations=n))[0] - 1.0
    assert np.abs(error).max() / 0.1 == pytest.approx(expected, abs=1e-4)


def test_corrected_stiffness_of_a_chain_has_a_limit_and_the_raw_one_has_not():
    limits, raw = [], []
    for order in (1, -1):  # the order of the sweep matters for few iterations alone
        for law, found in ((pbd.Stiffness(0.5), limits), (pbd.Stiffness(0.5, raw=True), raw)):
            scene = chain(10, law, stretch=1.1, order=order)
            found.append(np.abs(lengths(run(scene, 1, [1], dt=0.01, iterations=10_000))[0] - 1.0).max() / 0.1)
    assert limits == pytest.approx([1.1840, 1.1840], abs=2e-4)
    assert max(raw) < 1e-12


@pytest.mark.parametrize("k", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("iterations", [1, 3, 20])
def test_pbd_static_sag(k, iterations):
    """g dt^2 (1 - k)/k with k', g dt^2 (1-k)^n / (1 - (1-k)^n) with raw k (claim 5)."""
    for dt in (1 / 60, 1 / 120):
        settings = {"dt": dt, "iterations": iterations}
        corrected = sag(spring(pbd.Stiffness(k), stretch=0.0, direction=DOWN), 600, **settings)
        assert corrected == pytest.approx(G * dt * dt * (1.0 - k) / k, abs=ROUND_OFF)
        left = (1.0 - k) ** iterations
        raw = sag(spring(pbd.Stiffness(k, raw=True), stretch=0.0, direction=DOWN), 600, **settings)
        assert raw == pytest.approx(G * dt * dt * left / (1.0 - left), abs=ROUND_OFF)


def test_pbd_chain_sags_with_the_square_of_the_time_step():
    """A quarter of dt: a sixteenth of the stretch; the k-laws are not independent of the time step (claim 8)."""
    coarse, fine = (sag(chain(20, pbd.Stiffness(0.5)), 6000, dt=dt, iterations=10) for dt in (1 / 60, 1 / 240))
    assert coarse / fine == pytest.approx(16.0, rel=1e-9)


def test_xpbd_chain_sags_as_its_springs_once_iterated():
    """10 links of alpha = 1e-3 at dt = 1/60: 0.662, 0.53965, 0.53955 m after 1, 5, 20 sweeps; exact 55 g alpha."""
    sags = [sag(chain(10, pbd.Compliance(1e-3)), 4000, dt=1 / 60, iterations=n) for n in (1, 5, 20)]
    assert sags == pytest.approx([0.662, 0.53965, 0.53955], abs=6e-4)
    assert sags[1:] == pytest.approx([0.53965, 55 * G * 1e-3], abs=6e-6)


def test_plain_damping_lowers_the_sag():
    """v <- 0.9 v after the gravity kick, as lines 5-6 have it, removes a tenth of the weight."""
    particles, batch = spring(pbd.Stiffness(0.5), stretch=0.0, direction=DOWN)
    settings = pbd.Settings(dt=1 / 60, damping=pbd.Damping(0.1, plain=True))
    final = pbd.Simulation(particles, [batch], gravity=(0.0, -G), settings=settings).run(2000, [2000])
    assert lengths(final)[0, 0] - 1.0 == pytest.approx(0.9 * G / 3600, abs=ROUND_OFF)


# ------------------------------------------------------------------ forces and lengths of hanging chains


def hanging(**settings):
    """Stretch [m] and link forces [N] of 19 hanging unit masses, links of 0.01 m, after 1000 frames of 1/60 s."""
    scene = chain(19, pbd.Compliance(0.0), length=0.01)
    outcome = run(scene, 1000, [1000], gravity=G, dt=1 / 60, **settings)
    h = (1 / 60) / settings.get("substeps", 1)
    return lengths(outcome).sum() - 0.19, -outcome.scene.batches[0].law.multiplier / h**2


@pytest.mark.parametrize("settings", [{"substeps": 2}, {"substeps": 10}, {"iterations": 2}, {"iterations": 20}])
def test_multipliers_are_the_forces(settings):
    """lambda / h^2: each link carries the weight below it, to 0.1 % (claim 10)."""
    _, force = hanging(**settings)
    np.testing.assert_allclose(force, G * np.arange(19, 0, -1), rtol=1.5e-3)
    assert force[0] == pytest.approx(186.39, rel=1e-3)


def test_substeps_converge_with_the_square_and_iterations_with_the_first_power():
    """Macklin et al. 2019: error ~ n^-2 for n sub-steps, n^-1 for n iterations, at equal cost (claims 12, 13)."""
    n = np.array([2, 5, 10, 20])
    by_substeps = np.array([hanging(substeps=int(m))[0] for m in n])
    by_iterations = np.array([hanging(iterations=int(m))[0] for m in n])
    np.testing.assert_allclose(by_substeps, 0.4660 / n**2, rtol=0.05)
    np.testing.assert_allclose(by_iterations, 0.460 / n, rtol=0.05)
    assert fitted_order(1 / n, by_substeps) == pytest.approx(2.0, abs=0.02)
    assert fitted_order(1 / n, by_iterations) == pytest.approx(1.0, abs=0.03)
    assert np.all(by_iterations / by_substeps >= 0.7 * n)


# ------------------------------------------------------------------ against the continuous system


def spring_error(dt):
    """rms error [m] of the XPBD spring over 0.5 s against 1 + 0.5 cos(omega t)."""
    steps = round(0.5 / dt)
    outcome = run(spring(pbd.Compliance(1e-3)), steps, dt=dt)
    exact = 1.0 + 0.5 * np.cos(math.sqrt(1000.0) * outcome.times)
    return float(np.sqrt(np.mean((outcome.positions[:, 1, 0] - exact) ** 2)))


def test_xpbd_spring_errors_as_published():
    """0.289, 0.0743 and 0.0085 m at dt = 1/60, 1/600, 1/6000 s (claim 3)."""
    errors = [spring_error(dt) for dt in (1 / 60, 1 / 600, 1 / 6000)]
    assert errors == pytest.approx([0.289, 0.0743, 0.0085], rel=0.02)


def test_xpbd_spring_is_of_first_order():
    steps = 0.5 / np.array([8000, 16000, 32000, 64000])
    errors = [spring_error(dt) for dt in steps]
    assert fitted_order(steps, errors) == pytest.approx(1.0, abs=0.1)


def test_pendulum_is_of_first_order():
    """A rigid pendulum against its energy: the loss over a fixed time is proportional to dt."""
    losses = []
    steps = np.array([400, 800, 1600, 3200])
    for count in steps:
        particles = pbd.particles([[0.0, 0.0], [1.0, 0.0]], pinned=[0])
        batch = pbd.distance(particles, [(0, 1)])
        outcome = run((particles, batch), int(count), [count], gravity=G, dt=0.5 / count)
        x, v = outcome.positions[0, 1], outcome.velocities[0, 1]
        losses.append(-(0.5 * v @ v + G * x[1]) / G)
    assert min(losses) > 0.0  # it only ever loses
    assert fitted_order(1 / steps, losses) == pytest.approx(1.0, abs=0.1)


def test_substeps_damp_less_than_iterations():
    """At equal cost, 40 sub-steps keep more of a spring's energy than 40 iterations (claim 15)."""
    amplitudes = []
    for settings in ({"iterations": 40}, {"substeps": 40}):
        outcome = run(spring(pbd.Compliance(1e-3)), 30, dt=1 / 60, **settings)
        amplitudes.append(np.abs(outcome.positions[15:, 1, 0] - 1.0).max())
    assert amplitudes[0] < 0.1 < 0.3 < amplitudes[1]


def test_heavy_end_needs_substeps():
    """A mass ratio of 1e5: 100 sub-steps leave at most a twentieth of the error of 100 iterations (claim 14)."""
    errors = []
    for settings in ({"iterations": 100}, {"substeps": 100}):
        masses = np.ones(20)
        masses[-1] = 1e5
        x = np.column_stack([np.zeros(20), -0.01 * np.arange(20)])
        particles = pbd.particles(x, masses=masses, pinned=[0])
        batch = pbd.distance(particles, [(i, i + 1) for i in range(19)], law=pbd.Compliance(0.0))
        outcome = run((particles, batch), 1000, [1000], gravity=G, dt=1 / 60, **settings)
        errors.append(lengths(outcome).sum() - 0.19)
    assert errors[0] >= 20 * errors[1] > 0.0
