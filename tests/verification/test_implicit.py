"""Implicit Euler: the minimum that compliant XPBD approaches, against recurrences and a minimiser of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pbd
from comparisons.minimiser import implicit_euler_step
from comparisons.scene import PointMasses, Springs

pytestmark = pytest.mark.slow

GRAVITY = np.array([0.0, -9.81, 0.0])
ROUND_OFF = 1e-15
"""[m] Of the norm of some hundred coordinates of about 1 m. The first small steps from a flat start move by 1e-9 m."""

PAIR = pbd.particles([[0.0, 0.0], [1.0, 0.0]])


def grid(size, stretch=1.0):
    """(positions, pairs) of a horizontal cloth of 1 m with links along edges, diagonals and over two cells."""
    number = np.arange(size * size).reshape(size, size)
    row, column = np.indices((size, size)) * stretch / (size - 1)
    positions = np.column_stack([column.ravel(), np.zeros(size * size), row.ravel()])
    ends = [
        (number[:, :-1], number[:, 1:]),
        (number[:-1], number[1:]),
        (number[:-1, :-1], number[1:, 1:]),
        (number[:-1, 1:], number[1:, :-1]),
        (number[:, :-2], number[:, 2:]),
        (number[:-2], number[2:]),
    ]
    return positions, np.concatenate([np.column_stack([one.ravel(), other.ravel()]) for one, other in ends])


def cloth(size, stiffness, dt, *, pinned=True, stretch=1.0, gravity=GRAVITY, **solver):
    """A simulation of it, masses 1 kg each, and its (masses, springs) for the reference."""
    positions, pairs = grid(size)
    rest = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    fixed = (0, size - 1) if pinned else ()
    particles = pbd.particles(stretch * positions, pinned=list(fixed))
    law = pbd.Compliance(alpha=1.0 / stiffness)
    links = pbd.distance(particles, pairs, rest_length=rest, law=law)
    settings = pbd.Settings(dt=dt, solver=pbd.Implicit(**solver))
    masses = PointMasses(stretch * positions, np.zeros_like(positions), np.ones(len(positions)), fixed)
    springs = Springs(pairs, rest, np.full(len(pairs), 1.0 / stiffness))
    return pbd.Simulation(particles, [links], gravity=gravity, settings=settings), masses, springs


def farthest(outcome, masses, springs, dt, steps):
    """The largest |x - x*|_M / |x* - x_hat|_M of the given steps, each from the state before it, beyond round-off."""
    found = []
    for n in steps:
        x, v, y = outcome.positions[n - 1], outcome.velocities[n - 1], outcome.positions[n]
        before = PointMasses(x, v, masses.masses, masses.pinned)
        exact = implicit_euler_step(before, springs, GRAVITY, dt, start=y).positions
        predicted = np.where(masses.free[:, None], x + dt * v + dt**2 * GRAVITY, x)
        found.append(max(np.linalg.norm(y - exact) - ROUND_OFF, 0.0) / np.linalg.norm(exact - predicted))
    return max(found)


def hang_one_spring(dimension):
    """In the plane it is two, side by side, in two batches."""
    dt, mass, stiffness, gravity = 0.02, 2.0, 500.0, np.zeros(dimension)
    gravity[0] = -9.81
    start = np.zeros((2, dimension))
    start[1, 0] = -1.3
    particles = pbd.particles(start, masses=mass, pinned=[0])
    batches = 2 if dimension == 2 else 1
    law = pbd.Compliance(alpha=batches / stiffness)
    springs = [pbd.distance(particles, [[1, 0]], rest_length=1.0, law=law) for _ in range(batches)]
    settings = pbd.Settings(dt=dt, solver=pbd.Implicit())
    outcome = pbd.Simulation(particles, springs, gravity=gravity, settings=settings).run(50)
    x, v = 0.3, 0.0  # of the stretch, downwards
    for n in range(1, 51):
        v = (v + dt * (9.81 - stiffness / mass * x)) / (1.0 + dt**2 * stiffness / mass)
        x += dt * v
        assert outcome.positions[n, 1, 0] == pytest.approx(-1.0 - x, abs=1e-12)
    assert outcome.unconverged == 0
    forces = [batch.law.multiplier[0] / dt**2 for batch in outcome.scene.batches]
    assert forces == pytest.approx([-stiffness * x / batches] * batches, abs=1e-8)


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_spring_is_backward_euler(dimension):
    hang_one_spring(dimension)


def test_so_it_is_in_1d():
    in_plain_python("test_implicit.hang_one_spring(1)")


@pytest.mark.parametrize("period", [0, 5])
@pytest.mark.parametrize("dt", [1 / 60, 1 / 600])
@pytest.mark.parametrize("stiffness", [1e4, 1e5])
def test_each_step_is_the_minimum(stiffness, dt, period):
    simulation, masses, springs = cloth(12, stiffness, dt, period=period)
    outcome = simulation.run(40)
    assert outcome.unconverged == 0
    assert outcome.solver.counts[:2].sum() == 40
    assert farthest(outcome, masses, springs, dt, (1, 2, 10, 25, 40)) < 1e-8


def test_xpbd_stalls_where_implicit_does_not():
    dt, stiffness = 1 / 60, 1e4
    simulation, masses, springs = cloth(12, stiffness, dt)
    outcome = simulation.run(20)
    x, v, y = outcome.positions[19], outcome.velocities[19], outcome.positions[20]
    particles = pbd.particles(x, velocities=v, pinned=list(masses.pinned))
    law = pbd.Compliance(alpha=1.0 / stiffness)
    links = pbd.distance(particles, springs.pairs, rest_length=springs.lengths, law=law)
    settings = pbd.Settings(dt=dt, iterations=3000)
    xpbd = pbd.Simulation(particles, [links], gravity=GRAVITY, settings=settings).run(1).positions[1]
    predicted = np.where(masses.free[:, None], x + dt * v + dt**2 * GRAVITY, x)
    assert np.linalg.norm(xpbd - y) > 1e-3 * np.linalg.norm(y - predicted)


def test_irregular_order_changes_nothing():
    one, masses, _ = cloth(10, 1e4, 1 / 60)
    first = one.run(10)
    rng = np.random.default_rng(0)
    positions, pairs = grid(10)
    rest = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    name = rng.permutation(len(positions))
    mixed = np.empty_like(positions)
    mixed[name] = positions
    particles = pbd.particles(mixed, pinned=list(name[list(masses.pinned)]))
    links = pbd.distance(particles, name[pairs], rest_length=rest, law=pbd.Compliance(alpha=1e-4))
    settings = pbd.Settings(dt=1 / 60, solver=pbd.Implicit())
    shuffled = pbd.Simulation(particles, [links], gravity=GRAVITY, settings=settings).run(10)
    assert np.abs(first.positions - shuffled.positions[:, name]).max() < 1e-9


def test_soft_springs_are_accepted_by_resynchronisation_alone():
    simulation, _, _ = cloth(12, 1e4, 1 / 600, period=5)
    outcome = simulation.run(20)
    assert outcome.solver.counts[0] == 20
    assert outcome.solver.counts[1] == 0
    assert outcome.projections > 0


def test_where_resynchronisation_diverges_newton_takes_over():
    simulation, masses, springs = cloth(12, 1e5, 1 / 60, period=5)
    outcome = simulation.run(20)
    assert outcome.solver.counts[1] > 0
    assert outcome.unconverged == 0
    assert farthest(outcome, masses, springs, 1 / 60, (1, 5, 20)) < 1e-8


def test_a_compressed_cloth_buckles_and_still_converges():
    positions, pairs = grid(10)
    rng = np.random.default_rng(1)
    rest = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    start = 0.9 * positions + 1e-6 * rng.standard_normal(positions.shape)
    particles = pbd.particles(start, pinned=[0, 9, 90, 99])
    links = pbd.distance(particles, pairs, rest_length=rest, law=pbd.Compliance(alpha=1e-4))
    settings = pbd.Settings(dt=1 / 60, solver=pbd.Implicit())
    outcome = pbd.Simulation(particles, [links], gravity=GRAVITY, settings=settings).run(20)
    assert outcome.unconverged == 0
    masses = PointMasses(start, np.zeros_like(start), np.ones(100), (0, 9, 90, 99))
    springs = Springs(pairs, rest, np.full(len(pairs), 1e-4))
    assert farthest(outcome, masses, springs, 1 / 60, (1, 2, 5, 20)) < 1e-8


def test_a_free_cloth_keeps_its_momentum():
    positions, pairs = grid(10)
    rng = np.random.default_rng(2)
    velocities = rng.standard_normal(positions.shape)
    particles = pbd.particles(positions, velocities=velocities)
    links = pbd.distance(particles, pairs, law=pbd.Compliance(alpha=1e-4))
    settings = pbd.Settings(dt=1 / 60, solver=pbd.Implicit())
    outcome = pbd.Simulation(particles, [links], gravity=np.zeros(3), settings=settings).run(30)
    size = np.abs(velocities).sum()
    assert np.abs(outcome.velocities.sum(axis=1) - velocities.sum(axis=0)).max() < 1e-10 * size


@pytest.mark.parametrize("dt", [1 / 60, 1 / 600])
def test_the_energy_never_rises(dt):
    simulation, _, springs = cloth(12, 1e4, dt, stretch=1.02)
    outcome = simulation.run(60)
    x, v = outcome.positions, outcome.velocities
    lengths = np.linalg.norm(x[:, springs.pairs[:, 0]] - x[:, springs.pairs[:, 1]], axis=2)
    elastic = 0.5 * np.sum((lengths - springs.lengths) ** 2 / springs.compliances, axis=1)
    energy = 0.5 * np.sum(v**2, axis=(1, 2)) + 9.81 * x[:, :, 1].sum(axis=1) + elastic
    assert np.diff(energy).max() <= 1e-9 * np.ptp(energy)


def refused(law=None, extra=None, **settings):
    particles = PAIR
    links = [pbd.distance(particles, [[0, 1]], law=law or pbd.Compliance(alpha=1e-3)), *(extra or [])]
    with pytest.raises(pbd.InvalidInput) as error:
        pbd.Simulation(particles, links, settings=pbd.Settings(solver=pbd.Implicit(), **settings))
    assert "\n" not in str(error.value)
    return str(error.value)


def test_refusals_say_why_in_one_line():
    assert "alpha > 0" in refused(pbd.Compliance(alpha=0.0))
    assert "alpha > 0" in refused(pbd.Stiffness(0.5))
    assert "beta" in refused(pbd.Compliance(alpha=1e-3, beta=1.0))
    assert "one-sided" in refused(pbd.Compliance(alpha=1e-3, relation="at_most"))
    assert "Contact is no distance" in refused(extra=[pbd.plane_contact(PAIR, normal=(0.0, 1.0))])
    assert "iterations" in refused(iterations=2)
    assert "precision" in refused(precision="float32")
    assert "its step is Euler's" in refused(integrator=pbd.Shake())


@pytest.mark.parametrize("field", ["tolerance", "period"])
def test_fields_are_checked(field):
    with pytest.raises(pbd.InvalidInput, match=field):
        pbd.Implicit(**{field: -1})


def in_plain_python(code):
    """What a program prints, with this module, that is not compiled."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    head = "import sys, numba, numpy as np, pbd; sys.path.insert(0, sys.argv[1]); import test_implicit"
    program = f"{head}\nassert numba.config.DISABLE_JIT\n{code}"
    command = [sys.executable, "-c", program, str(Path(__file__).parent)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


PLAIN = """
for period in (0, 3):
    for batches in ([[[1, 0], [1, 2]]], [[[1, 0]], [[1, 2]]]):
        particles = pbd.particles([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.1, 0.0]], pinned=[0])
        springs = [pbd.distance(particles, pairs, law=pbd.Compliance(alpha=1e-3)) for pairs in batches]
        settings = pbd.Settings(dt=0.02, solver=pbd.Implicit(period=period))
        outcome = pbd.Simulation(particles, springs, gravity=(0.0, -9.81, 0.0), settings=settings).run(3)
        assert outcome.unconverged == 0
        print(*outcome.positions[-1].ravel().tolist())
"""


def test_plain_python_gives_the_numbers_of_the_kernel():
    """With its springs in one batch, and in two."""
    particles = pbd.particles([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.1, 0.0]], pinned=[0])
    springs = pbd.distance(particles, [[1, 0], [1, 2]], law=pbd.Compliance(alpha=1e-3))
    settings = pbd.Settings(dt=0.02, solver=pbd.Implicit())
    outcome = pbd.Simulation(particles, [springs], gravity=(0.0, -9.81, 0.0), settings=settings).run(3)
    lines = in_plain_python(PLAIN).splitlines()
    assert len(lines) == 4
    for line in lines:
        assert np.array(line.split(), dtype=float) == pytest.approx(outcome.positions[-1].ravel(), abs=1e-10)


NOTHING = """
particles = pbd.particles(np.zeros((3, 2)))
settings = pbd.Settings(dt=0.1, solver=pbd.Implicit())
outcome = pbd.Simulation(particles, gravity=(0.0, -10.0), settings=settings).run(2)
print(outcome.unconverged, outcome.positions[2, 0, 1])
"""


def test_nothing_to_hold_is_free_fall():
    """As plain Python: the list of batches of every kernel ends in an empty one."""
    unconverged, height = in_plain_python(NOTHING).split()
    assert unconverged == "0"
    assert float(height) == pytest.approx(-0.3)
