"""The solver of rigid bodies against closed forms at 60 Hz, by its two presets: what it promises, in 2D and 3D."""

from __future__ import annotations

import math

import numpy as np
import pytest

from comparisons.record import RunSpec
from comparisons.run import execute

DT = 1.0 / 60.0
PHASES = 8
DIMENSIONS = (2, 3)


def errors(scene, preset, metric, leads=(0.0,), **parameters):
    """The metric over shifts of the scene's events against the grid of steps."""
    found = []
    for lead in leads:
        given = {**parameters, **({"lead": lead} if lead else {})}
        record = execute(
            RunSpec(
                scene=scene, engine="rattle", preset=preset, parameters=given, settings={"dt": DT}, metrics=(metric,)
            )
        )
        assert record.status.code == "ok", record.status
        found.append(record.metric(metric))
    return found


PHASED = tuple(k * DT / PHASES for k in range(PHASES))
EXACT = [
    ("drop", "position_error", PHASED),
    ("rebound", "rebound", PHASED),
    ("bouncing_ball", "apexes", PHASED),
    ("elastic_ball", "energy_drift", (0.0, 0.3 * DT)),
    ("rolling", "position_error", (0.0,)),
    ("incline_stick", "creep", (0.0,)),
    ("box_impact", "velocity_error", PHASED),
]


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("preset", ["fast", "accurate"])
@pytest.mark.parametrize(("scene", "metric", "leads"), EXACT)
def test_exact_to_round_off(scene, metric, leads, preset, dimension):
    assert max(errors(scene, preset, metric, leads, dimension=dimension)) < 1e-12


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_stick_at_97_percent_of_the_limit_and_slip_at_103(dimension):
    assert max(errors("incline_stick", "fast", "creep", dimension=dimension, ratio=0.97)) < 1e-9
    assert max(errors("incline_slip", "accurate", "position_error", dimension=dimension, ratio=1.03)) < 1e-9


@pytest.mark.parametrize(
    ("dimension", "preset", "goal"),
    [(2, "fast", 2e-4), (3, "fast", 5e-4), (2, "accurate", 1e-6), (3, "accurate", 2e-6)],
)
def test_slide(dimension, preset, goal):
    """In space a slip that ends is solved by sweeps, of which ``fast`` makes few."""
    assert max(errors("slide", preset, "stop_distance", PHASED, dimension=dimension)) < goal


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_rocking_and_stop_time(dimension):
    assert max(errors("rocking", "accurate", "position_error", PHASED[::4], dimension=dimension)) < 1e-3
    assert max(errors("bouncing_ball", "accurate", "stop_time", PHASED[::2], dimension=dimension)) < 1e-2


def test_top_in_one_sub_step():
    assert max(errors("top", "fast", "attitude_error")) < 1e-5
    assert max(errors("top", "fast", "angular_momentum_drift")) < 1e-12
    assert max(errors("top", "fast", "energy_drift")) < 1e-12


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_stack_of_twenty_and_mass_ratio(dimension):
    for seed in range(2):
        assert max(errors("stack", "accurate", "drift", dimension=dimension, count=20, seed=seed)) < 2e-4
        assert max(errors("stack", "accurate", "penetration", dimension=dimension, count=20, seed=seed)) < 2e-4
    assert max(errors("mass_ratio", "accurate", "penetration", dimension=dimension)) < 3e-4


@pytest.mark.parametrize("seed", range(3))
def test_a_heap_comes_to_rest_and_never_gains_energy(seed):
    for metric, goal in (("energy_rise", 1e-5), ("residual_kinetic_energy", 1e-6), ("penetration", 4e-4)):
        assert max(errors("pile", "accurate", metric, count=30, seed=seed)) < goal


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_planes_carry_the_weight_of_a_stack(dimension):
    assert max(errors("stack", "accurate", "contact_force_error", dimension=dimension, count=10)) < 1e-2


def test_top_is_of_order_four():
    """The discrete Moser-Veselov algorithm with modified moments, over sub-steps."""
    counts, found = (1, 2, 4, 8), []
    for count in counts:
        settings = {"dt": DT, "substeps": count}
        record = execute(RunSpec(scene="top", engine="rattle", settings=settings, metrics=("attitude_error",)))
        found.append(record.metric("attitude_error"))
    slope = np.polyfit(np.log(counts), np.log(found), 1)[0]
    assert slope == pytest.approx(-4.0, abs=0.1)


def test_rocking_is_of_second_order():
    """Through two impacts; from 16 sub-steps on its error is below that of the impacts' times."""
    counts, found = (1, 2, 4, 8), []
    for count in counts:
        settings = {"dt": DT, "substeps": count, "iterations": 20, "velocity_iterations": 10}
        spec = RunSpec(
            scene="rocking",
            engine="rattle",
            settings=settings,
            metrics=("position_error",),
        )
        found.append(execute(spec).metric("position_error"))
    slope = np.polyfit(np.log(counts), np.log(found), 1)[0]
    assert slope < -1.85, found


def test_an_overlapping_start_stays_calm():
    """Boxes are pushed apart at the chosen speed at most, not shot away."""
    import pbd

    pair = pbd.bodies([pbd.Box((1.0, 1.0))] * 2, [(0.0, 0.5), (0.1, 1.1)])
    contacts = pbd.contacts(pair, pbd.planes((0.0, 1.0)), friction=0.5, depenetration=1.0)
    settings = pbd.Settings(dt=DT, iterations=20, substeps=4, integrator=pbd.Rattle(), solver=pbd.ConjugateSweeps())
    out = pbd.simulate(
        None, [contacts], bodies=pair, gravity=(0.0, -9.81), settings=settings, duration=2.0, samples=120
    )
    speed = np.linalg.norm(out.bodies.velocities, axis=2).max()
    assert speed < 0.1
    rise = np.diff(np.linalg.norm(out.bodies.positions[:, 1] - out.bodies.positions[:, 0], axis=1))
    assert 0.5 * DT < rise.max() <= 2.0 * DT
    assert np.abs(out.bodies.velocities[-1]).max() < 1e-3
    assert math.isclose(out.bodies.loads[-1, 1], 2 * 9.81, rel_tol=1e-2)


def test_a_heap_with_too_little_room_gives_the_same():
    """Room for pairs is found when it lacks; nothing of the first attempt remains."""
    from comparisons.engines import rattle
    from comparisons.run import build_scene

    scene = build_scene("pile", {"count": 20, "duration": 0.5, "samples": 10})
    settings = rattle.Settings(dt=DT)
    bound = rattle._simulation(scene, settings)
    tight = rattle._simulation(scene, settings)
    tight._scene = tight._scene._replace(batches=(tight._scene.batches[0].grown(4),))
    np.testing.assert_array_equal(tight.run(30).bodies.positions, bound.run(30).bodies.positions)
