"""A user's constraint, field and second state group join from a file outside the package; and how runs end."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pbd
from pbd.stages import evaluate
from pbd.vector import to_store

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent


def load_by_path(name):
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


scenes = load_by_path("user_scenes")
user = scenes.user
G = scenes.G


def area(x):
    a, b = x[1] - x[0], x[2] - x[0]
    return 0.5 * (a[0] * b[1] - a[1] * b[0])


# ------------------------------------------------------------------ constraints


def test_a_user_constraint_is_solved():
    """Area and line are both satisfied, and the generic projection has counted its work."""
    outcome = scenes.triangle(iterations=200, steps=20)
    assert outcome.status == "ok"
    x = outcome.positions[-1]
    assert area(x) == pytest.approx(1.2, abs=1e-9)
    assert x[0].sum() == pytest.approx(0.0, abs=1e-9)
    assert outcome.projections == 20 * 200 * 2
    assert area(outcome.positions[0]) < 0.6


def test_a_user_constraint_takes_every_law():
    """XPBD's first step from rest leaves a/(W + a) of C to first order: the laws know no constraint's name."""
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    rest, h, alpha = 0.5 + 1e-7, 0.01, 1e-4
    batch = user.Area(np.array([[0, 1, 2]]), np.array([rest]), pbd.Compliance(alpha))
    _, value, _, norms = evaluate(batch, 0, to_store(x))
    settings = pbd.Settings(dt=h)
    outcome = pbd.Simulation(pbd.particles(x), [batch], gravity=(0.0, 0.0), settings=settings).run(1)
    left = alpha / h**2 / (sum(norms) + alpha / h**2)
    assert area(outcome.positions[1]) - rest == pytest.approx(left * value, rel=1e-5)


def test_a_user_constraint_has_right_gradients():
    x = np.random.default_rng(3).normal(size=(3, 2))
    batch = user.Area(np.array([[2, 0, 1]]), np.array([0.3]), pbd.Stiffness())
    indices, _, gradients, norms = evaluate(batch, 0, to_store(x))
    for i, gradient, norm in zip(indices, gradients, norms, strict=True):
        for axis in range(2):
            moved = [x.copy(), x.copy()]
            moved[0][i, axis] += 1e-6
            moved[1][i, axis] -= 1e-6
            difference = evaluate(batch, 0, to_store(moved[0]))[1] - evaluate(batch, 0, to_store(moved[1]))[1]
            assert gradient[axis] == pytest.approx(difference / 2e-6, rel=1e-7, abs=1e-9)
        assert norm == pytest.approx(np.dot(gradient, gradient), rel=1e-12)


def test_a_constraint_without_its_methods_is_named():
    """The error says what the class lacks; in kernels too."""

    class Useless(tuple):
        __slots__ = ()

    with pytest.raises(TypeError, match=r"Useless has no method evaluate\(\)"):
        evaluate(Useless(), 0, ())


# ------------------------------------------------------------------ a second state group


def test_a_second_group_is_moved_and_recorded():
    """A mass on a drum falls with g m / (m + I/r^2): the discrete sum, for both groups, to round-off."""
    outcome = scenes.drums(100)
    n, h = np.arange(101), 0.01
    total = n * (n + 1) / 2 * h * h
    for i, (m, inertia, radius, start) in enumerate([(2.0, 0.03, 0.1, 0.0), (1.0, 0.5, 0.5, -1.0)]):
        acceleration = G * m / (m + inertia / radius**2)
        np.testing.assert_allclose(outcome.positions[:, i, 1], start - acceleration * total, atol=1e-11)
        np.testing.assert_allclose(outcome.recordings[1].angle[:, i], acceleration / radius * total, atol=1e-10)
        np.testing.assert_allclose(outcome.recordings[1].spin[:, i], acceleration / radius * n * h, atol=1e-9)
    np.testing.assert_allclose(outcome.positions[:, 2, 1], -G * total, atol=1e-11)
    assert outcome.projections == 200


def test_a_second_group_is_copied_for_each_run():
    first, second = scenes.drums(20), scenes.drums(20)
    np.testing.assert_array_equal(first.recordings[1].angle, second.recordings[1].angle)
    assert first.recordings[1].angle[0].tolist() == [0.0, 0.0]


# ------------------------------------------------------------------ how runs end


def poisoned(at, value, *, late, steps, samples=None):
    """Two falling particles, one of which gets ``value`` as a velocity in step ``at``."""
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0]])
    before = user.Poison(at, value, late, np.zeros(1, dtype=np.int64))
    after = user.Poison(at, value, late, np.zeros(1, dtype=np.int64))
    simulation = pbd.Simulation(particles, [after], external=[before], gravity=(0.0, -G))
    return simulation.run(steps, samples), simulation


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("at", [1, 777, 9_999])
def test_a_diverged_run_stops_within_a_hundredth(at, value):
    """Status, step and quantity: an infinite velocity has become a position when it is found."""
    outcome, _ = poisoned(at, value, late=False, steps=10_000, samples=[0, 10_000])
    assert (outcome.status, outcome.quantity) == ("diverged", "position")
    assert at <= outcome.step <= at + 100
    assert outcome.steps == outcome.step
    assert outcome.times.tolist() == [0.0]
    assert outcome.positions.shape == (1, 2, 2)


@pytest.mark.parametrize("steps", [50, 150])
def test_a_broken_velocity_is_named(steps):
    """Short runs are checked in every step, so a velocity is caught before it moves anything."""
    outcome, _ = poisoned(13, float("nan"), late=True, steps=steps)
    assert (outcome.status, outcome.quantity, outcome.step) == ("diverged", "velocity", 13)
    assert np.isfinite(outcome.positions).all()
    assert len(outcome.times) == len(outcome.positions) == len(outcome.velocities) == 13


def test_the_last_step_is_always_checked():
    outcome, _ = poisoned(9_950, float("nan"), late=True, steps=9_950, samples=[0])
    assert (outcome.status, outcome.quantity, outcome.step) == ("diverged", "velocity", 9_950)


def test_a_divergence_does_not_touch_the_next_run():
    """Every run starts from the state, fields and batches as they were bound."""
    first, simulation = poisoned(30, float("nan"), late=False, steps=50)
    second = simulation.run(50)
    assert (first.status, first.step) == (second.status, second.step) == ("diverged", 30)
    assert simulation.run(20).status == "ok"


def test_finite_but_huge_is_ok():
    """Only what is not a number, or infinite, ends a run."""
    particles = pbd.particles([[1e300, -1e308]])
    assert pbd.Simulation(particles, gravity=(0.0, -G)).run(10).status == "ok"


# ------------------------------------------------------------------ without compilation, and names


def run_program(*arguments, **environment):
    done = subprocess.run(
        [sys.executable, *arguments], env={**os.environ, **environment}, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.mark.parametrize("way", ["NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK"])
def test_compiled_agrees_with_plain_python_and_with_checked_bounds(way):
    """The same source runs uncompiled, and inside its arrays: laws, contacts, damping, a user's file, other groups."""
    done = run_program(str(HERE / "user_scenes.py"), **{way: "1"})
    assert "compiling" not in done.stderr or way == "NUMBA_BOUNDSCHECK"
    plain, compiled = json.loads(done.stdout), scenes.summary()
    assert plain.keys() == compiled.keys()
    for name, quantities in compiled.items():
        for quantity, value in quantities.items():
            np.testing.assert_allclose(
                plain[name][quantity], value, rtol=1e-12, atol=1e-12, err_msg=f"{name} {quantity}"
            )


@pytest.mark.parametrize("first", ["Simulation", "Outcome", "simulate", "particles"])
def test_names_do_not_depend_on_the_order_of_use(first):
    """No public name is also a module's, whatever is imported first; `import pbd` loads no compiler."""
    code = f"import sys, pbd; assert 'numba' not in sys.modules; pbd.{first}"
    run_program("-c", f"{code}; import pbd.simulation; assert all(callable(getattr(pbd, n)) for n in pbd.__all__)")


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="no attribute 'simluate'"):
        _ = pbd.simluate
    assert set(pbd.__all__) == set(dir(pbd))
