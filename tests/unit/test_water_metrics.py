"""Metrics of fluids on arrangements whose answer is known; nothing of the solver runs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from comparisons import water
from comparisons.metrics import (
    Refused,
    Subject,
    _water,
    bottom_density,
    density_error,
    density_peak,
    floating_depth_error,
    front,
    front_error,
    front_offset,
    neighbours,
    volume_loss,
)
from comparisons.run import build_scene
from comparisons.trajectory import Trajectory


def still(scene, *positions):
    """A trajectory through the given positions (n, d), at rest."""
    x = np.array(positions)
    times = np.linspace(0.0, scene.duration, len(x))
    return Subject(Trajectory(times, x, np.zeros_like(x), 0), scene)


def water_scene(name="hydrostatic_column", **parameters):
    return build_scene(name, parameters)


# ------------------------------------------------------------------ density


@pytest.mark.parametrize(("d", "allowed"), [(2, 8e-4), (3, 5e-3)])
def test_a_lattice_between_walls_has_rest_density(d, allowed):
    scene = water_scene(across=8, dimension=d)
    x = scene.masses.positions
    rho = _water.densities(still(scene, x))[0]
    s = scene.fluid.spacing
    below_surface = x[:, 1] < 1.0 - 2.6 * s
    assert np.abs(rho[below_surface] - 1.0).max() < allowed
    inside = np.all((x > 2.6 * s) & (x < 1.0 - 2.6 * s), axis=1)
    assert inside.any()
    assert rho[inside] == pytest.approx(1.0, abs=1e-12), "by the definition of rest density"
    at_surface = x[:, 1] > 1.0 - s
    assert np.all((rho[at_surface] > 0.6) & (rho[at_surface] < 0.92)), "the surface lacks half of its neighbours"


def test_density_grows_as_a_lattice_is_squeezed():
    scene = water_scene(across=12)
    x = scene.masses.positions
    squeezed = x * [1.0, 0.99]
    subject = still(scene, x, squeezed)
    inside = np.all((x > 0.25) & (x < 0.7), axis=1)
    assert subject.densities[1, inside] == pytest.approx(1.0 / 0.99, abs=1e-3)
    assert density_peak.measure(subject) == pytest.approx(1.0 / 0.99 - 1.0, abs=2e-3)
    assert 0.0 < density_error.measure(subject) < density_peak.measure(subject)
    assert bottom_density.measure(subject) == pytest.approx(0.01, abs=4e-3)


def test_an_obstacle_counts_as_fluid_beside_its_faces():
    scene = build_scene("dam_break", {"across": 20, "obstacle": True})
    (low, high), s = scene.fluid.obstacles[0], scene.fluid.spacing
    beside = np.array([[low[0] - 0.5 * s, 0.25], [low[0] - 5.0 * s, 0.25], [0.5 * (low + high)[0], 0.25]])
    filled = _water._filled(scene, beside)
    right_wall = _water._beside(np.array([0.5]), 2)[0]
    assert filled[0] == pytest.approx(right_wall, abs=1e-9), "as a wall half a spacing away"
    assert filled[1] == 0.0
    assert filled[2] == pytest.approx(1.0, abs=2e-2)


def test_packed_discs_have_lost_the_volume_that_packing_gains():
    """A hexagonal packing of discs takes sqrt(3)/2 of a square one's area."""
    scene = water_scene(across=20)
    s = scene.fluid.spacing
    i, j = np.meshgrid(np.arange(20), np.arange(20), indexing="ij")
    packed = np.column_stack([((i + 0.5 * (j % 2)) * s).ravel(), (j * np.sqrt(3.0) / 2.0 * s).ravel()])
    free = dataclasses.replace(scene, planes=None)
    assert volume_loss.measure(still(free, scene.masses.positions, packed)) == pytest.approx(
        1.0 - np.sqrt(3.0) / 2.0, abs=0.02
    )
    assert volume_loss.measure(still(free, packed, scene.masses.positions)) == 0.0


def test_neighbours_of_a_lattice_are_counted():
    scene = build_scene("falling_blob", {"across": 40})
    assert neighbours.measure(still(scene, scene.masses.positions)) == pytest.approx(20.0, abs=1.5)


# ------------------------------------------------------------------ front


def test_front_is_the_farthest_particle_that_hangs_together_with_the_rest():
    scene = build_scene("dam_break", {"across": 10})
    x = scene.masses.positions.copy()
    assert front.measure(still(scene, x)) == pytest.approx(1.0)
    x[-1] = [3.0, 0.0]
    assert front.measure(still(scene, scene.masses.positions, x)) == pytest.approx(1.0), "spray is left out"
    x[-1] = [1.1, 0.05]
    assert front.measure(still(scene, scene.masses.positions, x)) == pytest.approx(1.15)
    few = _water.fronts(still(scene, x), 99.5)[0]
    assert few == pytest.approx(1.0, abs=2e-3), "a percentile is behind the farthest"


def test_height_is_taken_at_the_wall():
    scene = build_scene("dam_break", {"across": 10})
    x = scene.masses.positions
    lowered = x * np.where(x[:, :1] < 0.5, [1.0, 0.8], [1.0, 1.0])
    assert _water.heights(still(scene, x, lowered)) == pytest.approx([2.0, 1.95 * 0.8 + 0.05])


def test_front_error_is_relative_to_the_reference():
    scene = build_scene("dam_break", {"across": 10, "duration": 2.0, "samples": 2})
    reference = water.front_reference()
    z = np.interp([1.0, 2.0], reference.times, reference.values)
    ends = np.array([1.0, z[0], 1.02 * z[1]]) - 0.05
    shots = [np.column_stack([np.linspace(0.0, end, 200), np.zeros(200)]) for end in ends]
    assert front_error.measure(still(scene, *shots)) == pytest.approx(0.02, rel=1e-9)


def test_a_shift_in_time_is_found_and_taken_out():
    measured = water.experiment("martin_moyce_n2_2_table2.csv")
    times = np.linspace(0.0, 3.0, 301)
    curve = np.interp(times, measured[:, 0] - 0.25, measured[:, 1])
    offset, left = _water.fitted(times, curve, measured)
    assert offset == pytest.approx(0.25, abs=0.005)
    assert left < 0.01
    assert _water.misfit(times, curve, measured, 0.0) > 0.2


def test_reference_is_below_ritters_bound_and_its_gap_is_small():
    reference = water.front_reference()
    assert reference.times[0] == 0.0
    assert reference.times[-1] == pytest.approx(3.0)
    assert np.all(np.diff(reference.values) > -1e-3)
    assert np.all(reference.values <= water.ritter(reference.times) + 0.02)
    judged = (reference.times >= 1.0) & (reference.times <= 2.0)
    assert np.all(reference.uncertainty[judged] < 0.05)


# ------------------------------------------------------------------ floating


def test_floating_depth_follows_from_the_water_displaced():
    scene = build_scene("floating_box", {})
    x = scene.masses.positions
    assert floating_depth_error.measure(still(scene, x, x)) == pytest.approx(0.0, abs=1e-9)
    sunk = x.copy()
    share = 1.0 - scene.known["edge"] / 1.0
    sunk[scene.fluid.solids[0], 1] -= 0.5 * scene.fluid.spacing * share
    assert floating_depth_error.measure(still(scene, sunk, sunk)) == pytest.approx(0.5)


# ------------------------------------------------------------------ refusals


@pytest.mark.parametrize("metric", [density_error, density_peak, volume_loss, bottom_density, floating_depth_error])
def test_metrics_of_fluids_are_refused_without_one(metric):
    scene = build_scene("free_fall", {})
    with pytest.raises(Refused):
        metric.measure(still(scene, scene.masses.positions))


def test_fronts_are_refused_where_nothing_breaks():
    scene = build_scene("falling_blob", {})
    with pytest.raises(Refused, match="dam break"):
        front_offset.measure(still(scene, scene.masses.positions))


def test_front_error_is_refused_without_a_reference_or_before_it_counts():
    short = build_scene("dam_break", {"across": 4, "duration": 0.5})
    with pytest.raises(Refused, match="T = 1"):
        front_error.measure(still(short, short.masses.positions, short.masses.positions))
    square = build_scene("dam_break", {"across": 4, "ratio": 1})
    assert "front_error" not in square.metrics
    with pytest.raises(Refused, match="reference"):
        front_error.measure(still(square, square.masses.positions))
