"""Fluids through the harness: closed forms, conservation, and the claims of the papers (34 to 40 of the ledger).

The kernels' integrals (34), XSPH (38) and the scaling of s_corr and epsilon (37) are in ``test_fluid_kernels.py`` and
``test_fluid.py``, beside the solver's other answers.
"""

from __future__ import annotations

import numpy as np
import pytest

from comparisons.engines.pbf import RESTS
from comparisons.metrics import Subject, _water
from comparisons.record import RunSpec
from comparisons.run import bind, execute
from comparisons.studies.density_stiffness import expected
from comparisons.water import front_reference, ritter


def record_of(scene, parameters=None, metrics=None, engine="pbf", **settings):
    record = execute(
        RunSpec(scene=scene, engine=engine, parameters=parameters or {}, settings=settings, metrics=metrics)
    )
    assert record.status.code == "ok", record.status
    return record


def subject_of(scene, parameters=None, engine="pbf", **settings):
    bound = bind(RunSpec(scene=scene, engine=engine, parameters=parameters or {}, settings=settings))
    return Subject(bound.run(), bound.scene)


def test_a_blob_in_free_fall_follows_its_parabola():
    """With a half kick the scheme has no error; without it is off by g t dt/2."""
    exact = record_of("falling_blob", half_kick=True)
    assert exact.metric("position_error") < 1e-10
    plain = record_of("falling_blob")
    assert plain.metric("position_error") == pytest.approx(9.81 * 1.0 * plain.dt / 2.0, rel=1e-6)


def test_a_lone_particle_flies_as_any_mass():
    """No 0/0 (claim 39)."""
    assert record_of("lone_particle", half_kick=True).metric("position_error") < 1e-10


def test_colliding_blobs_keep_their_momentum():
    """Every displacement is equal and opposite for two neighbours (claim 36)."""
    subject = subject_of("two_blobs", {"across": 8})
    momentum = np.einsum("sid,i->sd", subject.trajectory.velocities, subject.scene.masses.masses)
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * np.abs(momentum[0]).max()
    assert subject.energy[-1] < subject.energy[0], "they have met, and inelastically"


def test_compression_falls_with_iterations():
    """And sub-steps buy more than as many iterations (claim 35)."""
    place = {"across": 10, "duration": 1.5, "samples": 10}

    def peak(**counts):
        record = record_of("dam_break", place, ("density_error", "density_peak"), **counts)
        return np.array([record.metric("density_error"), record.metric("density_peak")])

    one, three, ten = (peak(iterations=n, omega=0.5) for n in (1, 3, 10))
    assert np.all(one > three)
    assert np.all(three > ten)
    steps = peak(iterations=1, substeps=10, omega=0.5)
    assert steps[0] < ten[0]


def test_front_of_a_dam_break():
    """Below Ritter's bound (claim 40), and near the reference for so few particles."""
    subject = subject_of("dam_break", {"across": 10})
    times, fronts = _water.dimensionless(subject)
    assert np.all(fronts <= ritter(times) + 1e-9)
    reference = front_reference()
    judged = np.interp([1.0, 2.0], reference.times, reference.values)
    assert np.interp([1.0, 2.0], times, fronts) == pytest.approx(judged, rel=0.06)


def test_water_at_rest_is_hardly_compressed_at_its_bottom():
    assert abs(record_of("hydrostatic_column").metric("bottom_density")) < 3e-3


def test_a_compliant_column_is_compressed_as_its_compliance_says():
    """C = alpha m g z, whatever the relaxation: multipliers keep no more of an increment than is applied.

    Rows near the bottom sway about it, and the surface lacks neighbours, so means are compared.
    """
    alpha = 1e-3
    parameters, found = {"across": 12, "duration": 4.0}, []
    for omega in (0.5, 1.0):
        subject = subject_of(
            "hydrostatic_column", parameters, method="xpbd", compliance=alpha, iterations=8, omega=omega
        )
        start = subject.trajectory.positions[0]
        inside = start[:, 1] < 0.7
        found.append(float(subject.densities[len(subject.densities) // 2 :, inside].mean() - 1.0))
    mass, depth = subject.scene.masses.masses[0], float(np.mean(1.0 - start[inside, 1]))
    assert found[0] == pytest.approx(found[1], rel=0.02)
    assert found[1] == pytest.approx(alpha * mass * 9.81 * depth, rel=0.2)
    assert expected(alpha, 12) == pytest.approx(0.5 * alpha * mass * 9.81, rel=1e-9)


def test_a_box_floats_as_deep_as_archimedes_says():
    """Within half a spacing, from its place and from above it."""
    for lift in (0.0, 2.0):
        parameters = {"across": 32, "lift": lift, "duration": 3.0, "samples": 60}
        record = record_of("floating_box", parameters, ("floating_depth_error",), viscosity=0.05, iterations=8)
        assert record.metric("floating_depth_error") < 0.5


def test_the_start_as_rest_brings_the_front_nearer():
    """At 10 particles across by a factor of two at least; and a column at rest stays where it is."""
    errors = [
        record_of("dam_break", {"across": 10}, ("front_error",), rest=rest).metric("front_error") for rest in RESTS
    ]
    assert errors[1] < 0.5 * errors[0]


def test_water_runs_about_an_obstacle():
    """It slows the front down, keeps particles out, and is no source of energy."""
    subject = subject_of("dam_break", {"across": 10, "obstacle": True})
    (low, high), s = subject.scene.fluid.obstacles[0], subject.scene.fluid.spacing
    x = subject.trajectory.positions
    inside = np.all((x > low + 1e-6 * s) & (x < high - 1e-6 * s), axis=2)
    assert not inside.any()
    assert np.diff(subject.energy).max() < 1e-3 * subject.energy_scale
    assert _water.fronts(subject)[-1] < 3.5, "4.1 without it"
