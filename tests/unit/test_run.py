"""How a run is judged: ok, drifting, diverged or refused; what bad specs say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from comparisons import engine, reference
from comparisons.record import RunSpec
from comparisons.run import bind, build_scene, classify, execute
from comparisons.trajectory import Trajectory, from_samples
from pbd.errors import InvalidInput

SCENE = build_scene("pendulum_chain", {"angles": 0.0, "duration": 1.0, "samples": 10})
STEPS = 100


def rising(fraction, sample=5):
    """At rest, until the mass gains a fraction of m g L in height."""
    x = np.repeat(SCENE.masses.positions[None], 11, axis=0)
    x[sample:, 1, 1] += fraction
    return Trajectory(SCENE.times, x, 0.0 * x, STEPS)


@pytest.mark.parametrize(
    ("fraction", "code"),
    [(0.0, "ok"), (0.09, "ok"), (0.11, "drifting"), (0.99, "drifting"), (1.01, "diverged"), (1e300, "diverged")],
)
def test_energy_that_rises_is_drift_and_then_divergence(fraction, code):
    with np.errstate(over="ignore"):
        status = classify(SCENE, rising(fraction))
    assert status.code == code
    if code != "ok":
        assert (status.step, status.quantity) == (50, "energy")
        assert "smaller time step" in status.remedy


def test_energy_that_falls_is_no_drift():
    assert classify(SCENE, rising(-0.9)).code == "ok"


def test_energy_that_overflows_to_nan_is_divergence():
    """inf - inf is no number, and no comparison with it is true."""
    trajectory = rising(0.0)
    trajectory.velocities[7, 1] = 1e200
    trajectory.positions[7, 1, 1] = -1.79e308
    with np.errstate(all="ignore"):
        status = classify(SCENE, trajectory)
    assert (status.code, status.step) == ("diverged", 70)


def test_what_the_engine_found_not_finite_is_divergence():
    x = np.zeros((11, 2, 2))
    x[4, 1, 0] = np.nan
    trajectory = from_samples(SCENE.times, x, 0.0 * x, STEPS)
    assert len(trajectory.times) == len(trajectory.positions) == 4
    status = classify(SCENE, trajectory)
    assert (status.code, status.step, status.quantity) == ("diverged", 40, "position")
    v = np.zeros((11, 2, 2))
    v[9, 0, 0] = np.inf
    broken = from_samples(SCENE.times, np.zeros((11, 2, 2)), v, STEPS)
    assert (broken.diverged, broken.steps, len(broken.times)) == ("velocity", 90, 9)


@pytest.mark.parametrize(
    ("name", "settings"),
    [("symplectic_euler", {"dt": 0.01, "stiffness": 1e8}), ("pymunk", {"dt": 0.1, "error_bias": 0.0, "iterations": 1})],
)
def test_a_run_that_is_not_ok_has_no_metrics(name, settings):
    spec = RunSpec(scene="pendulum_chain", engine=name, parameters={"links": 20, "samples": 10}, settings=settings)
    record = execute(spec)
    assert record.status.code in ("diverged", "drifting")
    assert record.metrics == {}
    assert record.status.quantity
    assert record.status.remedy
    assert 0 < record.status.step <= record.steps


def test_a_reference_that_breaks_off_is_refused(monkeypatch):
    """Rather than compared with a shorter array."""

    def broken(scene, *_):
        whole = reference._integrate(scene, reference.form(scene), reference.form(scene).initial, 1e-6, 1e-6)
        return dataclasses.replace(whole, positions=whole.positions[:3], diverged="step size")

    monkeypatch.setattr(reference, "solve", broken)
    spec = RunSpec(scene="pendulum_chain", engine="dop853", parameters={"gravity": 7.77, "samples": 10})
    record = execute(spec)
    assert record.status.code == "refused"
    assert record.metrics == {}


def test_metrics_are_the_scenes_own_or_those_asked_for():
    spec = RunSpec(scene="pendulum_chain", engine="dop853")
    assert set(execute(spec).metrics) == {"position_error", "energy_drift", "link_violation"}
    asked = RunSpec(scene="pendulum_chain", engine="dop853", metrics=("energy_drift",))
    assert set(execute(asked).metrics) == {"energy_drift"}
    assert execute(RunSpec(scene="pendulum_chain", engine="dop853", metrics=())).metrics == {}


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"metrics": ("position_eror",)}, "metric"),
        ({"engine": "pdb"}, "engine"),
        ({"scene": "chain"}, "scene"),
        ({"preset": "matched"}, "dop853.preset"),
        ({"settings": {"rtoll": 1.0}}, "dop853 setting"),
        ({"settings": {"rtol": "tight"}}, "dop853.rtol"),
        ({"parameters": {"link": 1}}, "scene parameter"),
        ({"parameters": {"links": True}}, "scene.links"),
        ({"parameters": {"masses": [1.0, "2"], "links": 2}}, "scene.masses"),
        ({"parameters": {"masses": []}}, "scene.masses"),
        ({"parameters": {"angles": [[1.0]]}}, "scene.angles"),
    ],
)
def test_bad_specs_name_their_field(changes, field):
    spec = RunSpec(**{"scene": "pendulum_chain", "engine": "dop853", **changes})
    with pytest.raises(InvalidInput) as refused:
        bind(spec)
    assert refused.value.field == field
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["pbd", "symplectic_euler", "pymunk", "pybullet"])
def test_every_stepping_engine_refuses_a_dt_off_the_sample_grid(name):
    assert hasattr(engine.load(name).Settings(), "dt")
    with pytest.raises(InvalidInput, match=r"a whole fraction of the sample interval, 0\.01 s"):
        bind(RunSpec(scene="pendulum_chain", engine=name, settings={"dt": 0.004}))


@pytest.mark.parametrize("dt", [0.02, 0.011, 0.0100001])
def test_a_step_longer_than_the_sample_interval_is_off_the_grid(dt):
    with pytest.raises(InvalidInput, match=r"the nearest is 0\.01"):
        bind(RunSpec(scene="pendulum_chain", engine="pbd", settings={"dt": dt}))


def test_round_off_in_dt_is_forgiven():
    for count in (1, 3, 7, 49, 1000):
        assert build_scene("pendulum_chain", {}).steps_per_sample(0.01 / count) == count


def test_more_steps_than_anyone_waits_for_are_refused_with_an_estimate():
    with pytest.raises(
        InvalidInput, match=r"dt = 1e-12: .* at most 1e\+10 steps; 1\.0e\+12 steps asked, at least 1e\+01 h"
    ):
        bind(RunSpec(scene="pendulum_chain", engine="pbd", settings={"dt": 1e-12}))
