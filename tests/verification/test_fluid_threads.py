"""Fluids on several threads: the same bits as on one, and no thread is left behind, whatever happens."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

import pbd
from pbd.fluid.tasks import MULTIPLIERS
from pbd.intrinsics import add_shared, read_shared, replace_shared, write_shared
from pbd.jit import config, kernel
from pbd.team import FINISHED, PASS, TASK, TICKET, helpers

pytestmark = pytest.mark.slow

S = 0.05
"""[m] Spacing."""


def tank(threads, speed=0.0):
    """24 x 40 particles in disorder in a corner, in single precision, with terms of velocities."""
    rng = np.random.default_rng(0)
    axes = [(np.arange(count) + 0.5) * S for count in (24, 40)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2) + rng.uniform(0.0, 0.2 * S, (960, 2))
    particles = pbd.particles(rng.permutation(x), velocities=[[speed, 0.0]] * 960, masses=1000.0 * S**2)
    fluid = pbd.density(particles, spacing=S, normal=np.eye(2), viscosity=0.1, confinement=1.0)
    settings = pbd.Settings(dt=2e-3, iterations=3, precision="float32", threads=threads)
    return pbd.Simulation(particles, [fluid], gravity=[0.0, -9.81], settings=settings)


def test_same_bits_for_any_number_of_threads():
    before = threading.active_count()
    first, *others = (tank(threads).run(60, [20, 60]) for threads in (1, 2, 2, 3))
    assert first.status == "ok"
    assert first.scene.batches[0].team is None
    assert others[0].scene.batches[0].team.pieces > 8
    for other in others:
        assert np.array_equal(other.positions, first.positions)
        assert np.array_equal(other.velocities, first.velocities)
    assert threading.active_count() == before


def test_a_helper_does_what_it_takes():
    """Of a pass that is begun here and has no kernel, it does all pieces."""
    scene = tank(2).run(1, [1]).scene
    fluid = scene.batches[0]
    fluid.density[:] = 0.0
    words, deadline = fluid.team.words, time.monotonic() + 60.0
    with helpers(scene.batches, scene.state):
        words[TASK], words[FINISHED] = MULTIPLIERS, 0
        words[TICKET] = (1 << PASS) + fluid.team.pieces
        while words[FINISHED] < fluid.team.pieces and time.monotonic() < deadline:
            time.sleep(0.001)
    assert words[FINISHED] == fluid.team.pieces
    assert np.all(fluid.density > 0.0)


def test_no_thread_outlives_a_run_that_diverges():
    before = threading.active_count()
    assert tank(2, speed=1e38).run(60, [60]).status == "diverged"
    assert threading.active_count() == before


def test_no_thread_outlives_a_run_that_is_broken_off(monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    before = threading.active_count()
    simulation = tank(3)
    monkeypatch.setattr("pbd.simulation.simulation", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulation.run(60, [60])
    assert threading.active_count() == before


# ------------------------------------------------------------------ shared words


def use_words(words):
    write_shared(words, 1, 7)
    add_shared(words, 1, 5)
    words[0] += replace_shared(words, 1, 11, 3)
    words[0] += 2 * replace_shared(words, 1, 12, 4)
    return read_shared(words, 1)


def test_shared_words_compiled_and_plain():
    for use in (use_words, kernel(use_words)):
        words = np.zeros(2, dtype=np.int64)
        assert use(words) == 4
        assert words.tolist() == [2, 4]


# ------------------------------------------------------------------ refusals


@pytest.mark.parametrize("threads", [0, 65, 1.5, True, "2"])
def test_number_of_threads_out_of_range(threads):
    with pytest.raises(pbd.InvalidInput, match=r"settings\.threads.*a whole number >= 1 and <= 64"):
        pbd.Settings(threads=threads)


def test_threads_without_a_fluid():
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(pbd.InvalidInput, match=r"settings\.threads.*only fluids") as caught:
        pbd.Simulation(particles, [pbd.distance(particles, [[0, 1]])], settings=pbd.Settings(threads=2))
    assert "\n" not in str(caught.value)


def test_threads_in_plain_python(monkeypatch):
    monkeypatch.setattr(config, "DISABLE_JIT", True)
    with pytest.raises(pbd.InvalidInput, match=r"settings\.threads.*NUMBA_DISABLE_JIT") as caught:
        tank(2)
    assert "\n" not in str(caught.value)
