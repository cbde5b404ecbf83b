"""Position based fluids: densities and gradients by brute force, what is kept, closed forms, and a dam break."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pbd
from pbd.fluid.kernels import lattice_sum, new_kernel, profile
from pbd.fluid.tasks import MULTIPLIERS
from pbd.jit import kernel
from pbd.projection import begin, project
from pbd.stages import end
from pbd.state import State
from pbd.team import together
from pbd.vector import from_store

pytestmark = pytest.mark.slow

G = 9.81
S = 0.05
"""[m] Spacing."""

DIMENSIONS = pytest.mark.parametrize("d", [2, 3])
TERMS = {"viscosity": 0.1, "repulsion": 0.01, "omega": 0.5, "epsilon": 1.0}
KINDS = pytest.mark.parametrize(("d", "name"), [(2, "wendland"), (2, "poly6_spiky"), (3, "wendland")])


def block(counts, spacing=S, origin=0.0):
    """(n, d) a lattice, half a spacing from the axes."""
    axes = [(np.arange(count) + 0.5) * spacing for count in counts]
    return origin + np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(counts))


def cloud(rng, d, n=60):
    """(n, d) as dense as a fluid, in disorder."""
    return rng.uniform(0.0, S * n ** (1 / d), (n, d))


def state_of(particles):
    return State(particles, None, np.zeros(4, dtype=np.int64))


def bound(fluid, iterations=1):
    return fluid._replace(law=fluid.law.bind(fluid.size(), iterations))


@kernel
def sums_and_multipliers(fluid, state, h):
    begin(fluid, state, h)
    together(fluid.team, fluid, MULTIPLIERS, state, h)


@kernel
def one_pass(fluid, state, h):
    begin(fluid, state, h)
    project(fluid, state, h)


@kernel
def ending(fluid, state, h):
    begin(fluid, state, h)
    end(fluid, state, h)


def measured(x, **arguments):
    """(density (n,), gradient (n, d), multiplier (n,)) by the kernels, in the order given."""
    particles = pbd.particles(x)
    fluid = bound(pbd.density(particles, spacing=S, **arguments))
    sums_and_multipliers(fluid, state_of(particles), 0.01)
    n, order = len(x), fluid.cells.particle
    gradient, multiplier = np.zeros_like(x), np.zeros(n)
    gradient[order], multiplier[order] = from_store(fluid.gradient)[:n], fluid.multiplier[:n]
    density = np.zeros(n)
    density[order] = fluid.density
    return density, gradient, multiplier


def brute(x, name="wendland", support=2.5):
    """(density (n,), grad_j C_i (n, n, d)) from all pairs, without walls."""
    n, d = x.shape
    form = new_kernel(name, support * S, d)
    volume = S**d / lattice_sum(form, S, d)
    apart = x[:, None] - x[None]
    r = np.linalg.norm(apart, axis=-1)
    w, drop = profile(form, r.ravel())
    slope = np.where(r > 0, drop.reshape(n, n) / np.where(r > 0, r, 1.0), 0.0)[..., None] * apart * volume
    gradients = slope.copy()
    gradients[np.arange(n), np.arange(n)] = -slope.sum(axis=1)
    return volume * w.reshape(n, n).sum(axis=1), gradients


# ------------------------------------------------------------------ sums


@KINDS
@given(seed=st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_sums_against_all_pairs(d, name, seed):
    x = cloud(np.random.default_rng(seed), d)
    density, gradient, multiplier = measured(x, kernel=name, epsilon=0.1)
    expected, gradients = brute(x, name)
    assert density == pytest.approx(expected, rel=1e-12)
    own = gradients[np.arange(len(x)), np.arange(len(x))]
    assert gradient == pytest.approx(own, abs=1e-11 * np.abs(own).max())
    weight = (gradients**2).sum(axis=(1, 2)) + 0.1 / (2.5 * S) ** 2
    assert multiplier == pytest.approx(-np.maximum(expected - 1.0, 0.0) / weight, rel=1e-10, abs=1e-18)


@KINDS
def test_one_pass_against_all_pairs(d, name):
    x = cloud(np.random.default_rng(5), d)
    particles = pbd.particles(x)
    fluid = bound(pbd.density(particles, spacing=S, kernel=name, omega=0.7))
    one_pass(fluid, state_of(particles), 0.01)
    density, gradients = brute(x, name)
    multiplier = -0.7 * np.maximum(density - 1.0, 0.0) / (gradients**2).sum(axis=(1, 2))
    moved = np.einsum("i,ijk->jk", multiplier, gradients)
    assert from_store(particles.p) - x == pytest.approx(moved, abs=1e-12 * S)


@DIMENSIONS
def test_gradients_against_finite_differences(d):
    """grad_i C_i beside two walls, of a central difference; linear tables leave 1e-3 of it."""
    rng = np.random.default_rng(6)
    x, e = 0.2 * S + cloud(rng, d), 1e-5 * S
    walls = {"normal": np.eye(d)[:2]}
    _, gradient, _ = measured(x, **walls)
    for i in range(0, len(x), 7):
        for axis in range(d):
            moved = [x.copy(), x.copy()]
            moved[0][i, axis] += e
            moved[1][i, axis] -= e
            up, down = (measured(each, **walls)[0][i] for each in moved)
            assert gradient[i, axis] == pytest.approx((up - down) / (2.0 * e), abs=2e-3 * np.abs(gradient).max())


@DIMENSIONS
def test_lattice_has_rest_density(d):
    """In the bulk, at a wall and in a corner."""
    counts = (9,) * d
    x = block(counts)
    density, _, _ = measured(x, normal=np.eye(d))
    assert np.array_equal(pbd.densities(pbd.density(pbd.particles(x), spacing=S, normal=np.eye(d)), x), density)
    density = density.reshape(counts)
    assert density[(4,) * d] == pytest.approx(1.0, abs=1e-12)
    assert np.abs(density[(slice(0, 6),) * d] - 1.0).max() < 8e-3
    assert density[(8,) + (4,) * (d - 1)] < 0.85


# ------------------------------------------------------------------ what is kept, and closed forms


def run(x, fluid_arguments, steps=50, v=0.0, gravity=None, samples=None, members=None, **options):
    particles = pbd.particles(x, velocities=v, masses=1000.0 * S ** x.shape[1])
    fluid = pbd.density(particles, spacing=S, members=members, **fluid_arguments)
    simulation = pbd.Simulation(particles, [fluid], gravity=gravity, settings=pbd.Settings(**options))
    return simulation.run(steps, samples)


@pytest.mark.parametrize(("d", "terms"), [(2, {}), (3, {}), (2, TERMS)])
def test_linear_momentum_of_two_blobs(d, terms):
    """They meet at 1 m/s: the sum of all velocities stays, to 1e-12 of the sum of their sizes."""
    left = block((8,) * d) + np.random.default_rng(7).uniform(-0.2, 0.2, (8**d, d)) * S
    right = left + 9.0 * S * np.eye(d)[0]
    v = np.concatenate([np.full_like(left, 0.2), np.full_like(right, -0.1)])
    v[:, 0] = np.repeat([0.5, -0.5], len(left))
    out = run(np.concatenate([left, right]), terms, v=v, dt=2e-3, iterations=3)
    assert np.ptp(out.velocities[-1][:, 0]) > 1.0
    drift = np.abs(out.velocities.sum(axis=1) - v.sum(axis=0)).max()
    assert drift <= 1e-12 * np.abs(out.velocities).sum(axis=(1, 2)).max()


@pytest.mark.parametrize(
    ("d", "relation", "precision"),
    [(2, "at_most", "float64"), (3, "at_most", "float64"), (2, "equality", "float32")],
)
def test_lone_particle_flies_as_if_alone(d, relation, precision):
    """To the last bit what the same particle does without the constraint."""
    gravity = [0.0] * (d - 1) + [-G]
    x, v = np.full((1, d), 0.3), np.full((1, d), 1.7)
    fluid = {"law": pbd.Stiffness(relation=relation), "epsilon": float(relation == "equality")}
    out = run(x, fluid, v=v, gravity=gravity, dt=1e-3, iterations=3, precision=precision)
    free = pbd.particles(x, velocities=v, masses=1000.0 * S**d)
    settings = pbd.Settings(dt=1e-3, precision=precision)
    alone = pbd.Simulation(free, gravity=gravity, settings=settings).run(50)
    assert np.array_equal(out.positions, alone.positions)


@DIMENSIONS
def test_falling_blob_with_half_a_kick_less_is_on_the_parabola(d):
    """x = x0 + v t - g t^2/2: symplectic Euler from v + g dt/2 is exact, and a lattice at rest density does nothing."""
    dt, x, gravity = 1e-3, block((6,) * d), np.append(np.zeros(d - 1), -G)
    v = np.full_like(x, 0.4)
    out = run(x, {}, steps=400, v=v - 0.5 * dt * gravity, gravity=gravity, dt=dt, iterations=2)
    t = out.times[:, None, None]
    assert out.positions == pytest.approx(x + v * t + 0.5 * gravity * t**2, abs=1e-10)


@DIMENSIONS
def test_centre_of_a_falling_blob_under_pressure_is_on_the_parabola(d):
    dt, gravity = 1e-3, np.append(np.zeros(d - 1), -G)
    x = 0.97 * block((6,) * d)
    v = np.zeros_like(x) - 0.5 * dt * gravity
    out = run(x, {}, steps=200, v=v, gravity=gravity, dt=dt, iterations=2)
    assert np.ptp(out.positions[-1], axis=0).min() > 1.02 * np.ptp(x, axis=0).min()
    t = out.times[:, None]
    assert out.positions.mean(axis=1) == pytest.approx(x.mean(axis=0) + 0.5 * gravity * t**2, abs=1e-10)


def test_particles_of_another_kind_are_left_alone():
    x = np.concatenate([0.9 * block((5, 5)), 0.9 * block((5, 5))])
    out = run(x, {}, members=np.arange(25), dt=1e-3, samples=[50])
    assert np.array_equal(out.positions[-1, 25:], x[25:])
    assert not np.array_equal(out.positions[-1, :25], x[:25])


def test_stiffness_and_compliance():
    """One iteration moves by k of what it does rigidly; compliance by W/(W + alpha/h^2)."""
    x, h = cloud(np.random.default_rng(8), 2), 0.01
    density, gradients = brute(x)
    weight = (gradients**2).sum(axis=(1, 2))
    for law, factor in (
        (pbd.Stiffness(0.3, relation="at_most"), 0.3),
        (pbd.Compliance(1e-3, relation="at_most"), weight / (weight + 1e-3 / h**2)),
    ):
        _, _, multiplier = measured(x, law=law)
        expected = -factor * np.maximum(density - 1.0, 0.0) / weight
        assert multiplier == pytest.approx(expected, rel=1e-10, abs=1e-18)


@DIMENSIONS
def test_same_at_twice_the_size(d):
    """With twice the lengths and g, and every term on: twice the positions. No coefficient has a length in it."""
    rng = np.random.default_rng(10)
    x = rng.uniform(0.0, 4.0 * S, (4**d, d))
    terms = {"epsilon": 0.1, "viscosity": 0.1, "confinement": 1.0, "repulsion": 0.01, "normal": np.eye(d)}
    outs = []
    for size in (1.0, 2.0):
        particles = pbd.particles(size * x, masses=1000.0 * (size * S) ** d)
        fluid = pbd.density(particles, spacing=size * S, **terms)
        gravity = [0.0] * (d - 1) + [-size * G]
        simulation = pbd.Simulation(particles, [fluid], gravity=gravity, settings=pbd.Settings(dt=5e-3, iterations=3))
        outs.append(simulation.run(20, [20]).positions[-1])
    assert outs[1] == pytest.approx(2.0 * outs[0], abs=1e-9 * S)


def test_other_batches_are_seen():
    """A fluid alone reads positions once a step; with another batch, one that does nothing, it is to be the same."""
    x, outs = cloud(np.random.default_rng(13), 2), []
    for others in (False, True):
        particles = pbd.particles(x)
        fluid = pbd.density(particles, spacing=S, normal=[0.0, 1.0])
        batches = [fluid, pbd.plane_contact(particles, normal=[0.0, 1.0], offset=-9.0)] if others else [fluid]
        simulation = pbd.Simulation(particles, batches, settings=pbd.Settings(dt=5e-3, iterations=3))
        outs.append(simulation.run(20, [20]).positions[-1])
    assert np.array_equal(*outs)


def test_a_floor_of_another_batch_holds_a_fluid():
    """The floor's projections come after the fluid's in each iteration, and the fluid goes on from there."""
    x = block((8, 8))
    particles = pbd.particles(x)
    floor = pbd.plane_contact(particles, normal=[0.0, 1.0])
    fluid = pbd.density(particles, spacing=S)
    settings = pbd.Settings(dt=2e-3, iterations=4)
    out = pbd.Simulation(particles, [fluid, floor], gravity=[0.0, -G], settings=settings).run(200, [200])
    assert out.positions[-1][:, 1].min() >= -1e-12
    assert np.ptp(out.positions[-1][:, 0]) > 1.5 * np.ptp(x[:, 0])


def test_order_of_particles_does_not_matter():
    x = np.random.default_rng(11).uniform(0.0, 8.0 * S, (64, 2))
    order = np.random.default_rng(12).permutation(64)
    first, second = (
        run(each, tank(10 * S), gravity=[0.0, -G], dt=2e-3, iterations=3, samples=[50]) for each in (x, x[order])
    )
    assert second.positions[-1] == pytest.approx(first.positions[-1][order], abs=1e-9 * S)


# ------------------------------------------------------------------ velocities


def ended(x, v, **arguments):
    """(n, d) velocities after the end of a step."""
    particles = pbd.particles(x, velocities=v)
    fluid = bound(pbd.density(particles, spacing=S, **arguments))
    ending(fluid, state_of(particles), 0.01)
    return from_store(particles.v), fluid


@DIMENSIONS
@pytest.mark.parametrize("c", [0.01, 0.3, 1.0])
def test_viscosity_keeps_momentum_and_takes_energy(d, c):
    rng = np.random.default_rng(9)
    x, v = cloud(rng, d), rng.normal(size=(60, d))
    after, _ = ended(x, v, viscosity=c)
    form = new_kernel("wendland", 2.5 * S, d)
    r = np.linalg.norm(x[:, None] - x[None], axis=-1)
    w = profile(form, r.ravel())[0].reshape(60, 60) * S**d / lattice_sum(form, S, d)
    assert after == pytest.approx(v + c * (w @ v - w.sum(axis=1)[:, None] * v), abs=1e-12)
    assert np.abs(after.sum(axis=0) - v.sum(axis=0)).max() < 1e-12 * np.abs(v).sum()
    if c < 1.0:
        assert (after**2).sum() < (v**2).sum()


@DIMENSIONS
def test_curl_of_a_rigid_rotation(d):
    """Twice its angular velocity, where neighbours surround a particle; then confinement spins it up."""
    x = block((11,) * d)
    arm = x - x.mean(axis=0)
    v = np.zeros_like(x)
    v[:, 0], v[:, 1] = -3.0 * arm[:, 1], 3.0 * arm[:, 0]
    after, fluid = ended(x, v, confinement=2.0, support=3.0)
    curl = np.zeros(len(x))
    curl[fluid.cells.particle] = fluid.confinement.curl[-1][: len(x)]
    middle = int(np.argmin((arm**2).sum(axis=1)))
    assert curl[middle] == pytest.approx(6.0, rel=0.02)
    assert (arm[:, 0] * after[:, 1] - arm[:, 1] * after[:, 0]).sum() > (arm[:, 0] * v[:, 1] - arm[:, 1] * v[:, 0]).sum()


# ------------------------------------------------------------------ flows


def tank(width, d=2):
    """Walls at 0 and ``width`` along all axes but the last, and a floor."""
    sides = np.concatenate([np.eye(d)[:-1], -np.eye(d)[:-1], np.eye(d)[-1:]])
    return {"normal": sides, "offset": np.append(np.repeat([0.0, -width], d - 1), 0.0)}


def test_bottom_of_a_column_at_rest():
    """40 across: within 0.3 % of rest density with 4 iterations, and as high as it was."""
    n = 40
    x = block((n, n))
    dt = 0.16 * S * math.sqrt(1 / (n * S * G))
    out = run(x, tank(n * S), steps=600, gravity=[0.0, -G], samples=[600], dt=dt, iterations=4)
    final = out.positions[-1]
    density = pbd.densities(out.scene.batches[0], final)
    assert density[final[:, 1] < 3.0 * S].mean() == pytest.approx(1.0, abs=3e-3)
    assert final[:, 1].mean() == pytest.approx(0.5 * n * S, abs=0.2 * S)  # the surface, less dense, sinks a little


def dam(across, duration, precision="float64", samples=None):
    """A column 1 x 2 until T = ``duration``, recorded so many times, or at T = 1, 2, ...; and the spacing."""
    s, unit = 1.0 / across, math.sqrt(1.0 / (2.0 * G))
    x = block((across, 2 * across), s)
    particles = pbd.particles(x, masses=1000.0 * s**2)
    fluid = pbd.density(particles, spacing=s, **tank(8.0))
    samples = samples or duration
    between = math.ceil(unit * duration / samples / (0.16 * s / math.sqrt(G)))
    options = pbd.Settings(dt=unit * duration / samples / between, iterations=4, precision=precision)
    simulation = pbd.Simulation(particles, [fluid], gravity=[0.0, -G], settings=options)
    out = simulation.run(samples * between, between * np.arange(1, samples + 1))
    return out, s


REFERENCE = {1: (1.545, 0.005), 2: (2.657, 0.02)}
"""T -> front [widths] and its uncertainty, from weakly compressible SPH at 120 across."""


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_front_of_a_dam_break(precision):
    out, s = dam(28, 2, precision)
    for k, (front, uncertainty) in enumerate(REFERENCE.values()):
        assert out.positions[k][:, 0].max() + s / 2 == pytest.approx(front, abs=uncertainty + 0.01 * front)


def test_front_comes_closer_with_more_particles():
    errors = []
    for across in (10, 20, 40):
        out, s = dam(across, 1)
        errors.append(abs(out.positions[0][:, 0].max() + s / 2 - REFERENCE[1][0]))
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 0.01


def test_compression_in_a_dam_break():
    """40 across, 4 iterations, to T = 3: 0.1 % on average over particles and time, 1.5 % at the worst."""
    out, _ = dam(40, 3, samples=12)
    excess = np.array([np.maximum(pbd.densities(out.scene.batches[0], x) - 1.0, 0.0) for x in out.positions])
    assert excess.mean() <= 1e-3
    assert excess.max() <= 1.5e-2


def test_two_runs_are_equal_to_the_last_bit():
    first, second = (dam(10, 1)[0].positions for _ in range(2))
    assert np.array_equal(first, second)


def test_column_between_walls_in_space():
    """A 3D column collapses, stays in its box, and gains no energy."""
    x = block((6, 6, 12))
    walls = {**tank(12 * S, 3), "viscosity": 0.05}
    out = run(x, walls, steps=400, gravity=[0.0, 0.0, -G], dt=2e-3, iterations=4)
    final = out.positions[-1]
    assert out.status == "ok"
    assert final.min() >= 0.0
    assert final[:, :2].max() <= 12 * S
    energy = (0.5 * (out.velocities**2).sum(axis=-1) + G * out.positions[..., 2]).mean(axis=1)
    assert np.diff(energy).max() < 1e-3 * energy[0]
