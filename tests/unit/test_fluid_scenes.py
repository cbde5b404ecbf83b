"""Scenes of fluids: what is where, how much it weighs, what encloses it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from comparisons.run import build_scene
from pbd.errors import InvalidInput

NAMES = ("dam_break", "hydrostatic_column", "falling_blob", "two_blobs", "lone_particle", "floating_box")


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_particles_are_a_spacing_apart_and_half_of_it_from_walls(name, d):
    scene = build_scene(name, {"dimension": d})
    x, s = scene.masses.positions, scene.fluid.spacing
    if len(x) > 1:
        assert KDTree(x).query(x, 2)[0][:, 1].min() == pytest.approx(s, rel=1e-9)
    fluid = np.setdiff1d(np.arange(len(x)), scene.fluid.solid)
    assert scene.masses.masses[fluid] == pytest.approx(scene.fluid.density * s**d)
    if scene.planes is not None:
        heights = x @ scene.planes.normals.T - scene.planes.offsets
        assert heights.min() >= 0.5 * s * (1.0 - 1e-9)


def test_dam_breaks_time_and_column():
    scene = build_scene("dam_break", {"across": 10, "width": 0.5, "ratio": 1, "samples": 10})
    assert scene.duration == pytest.approx(3.0 * np.sqrt(0.5 / 9.81))
    assert len(scene.masses.masses) == 100
    scene = build_scene("dam_break", {"across": 10})
    assert scene.masses.positions.max(axis=0) == pytest.approx([0.95, 1.95])
    assert scene.known["unit"] == pytest.approx(np.sqrt(1.0 / (2.0 * 9.81)))


def test_dam_break_in_space_is_as_deep_as_its_tank():
    scene = build_scene("dam_break", {"across": 4, "dimension": 3, "depth": 0.5})
    assert scene.masses.positions.max(axis=0) == pytest.approx([0.875, 1.875, 0.375])
    assert scene.planes.normals.tolist()[-1] == [0.0, 0.0, -1.0]
    assert scene.planes.offsets[-1] == pytest.approx(-0.5)


@pytest.mark.parametrize("d", [2, 3])
def test_the_obstacle_stands_on_the_floor_across_the_tank(d):
    scene = build_scene("dam_break", {"across": 4, "dimension": d, "obstacle": True})
    ((low, high),) = scene.fluid.obstacles
    assert low[1] < 0.0 < high[1]
    assert len(low) == d
    assert not np.any(np.all((scene.masses.positions > low) & (scene.masses.positions < high), axis=1))
    if d == 3:
        assert low[2] < 0.0
        assert high[2] > -scene.planes.offsets[-1]


def test_the_floating_box_starts_where_it_displaces_its_weight():
    for relative in (0.25, 0.5, 0.75):
        scene = build_scene("floating_box", {"relative_density": relative})
        x, s, solid = scene.masses.positions, scene.fluid.spacing, scene.fluid.solid
        level, weight = 16 * s, scene.masses.masses[solid].sum()
        bottom = x[solid, 1].min() - 0.5 * s
        assert weight == pytest.approx(scene.fluid.density * (level - bottom) * 8 * s)


@pytest.mark.parametrize("name", ["falling_blob", "lone_particle"])
def test_thrown_fluids_fly_on_parabolas(name):
    scene = build_scene(name, {})
    motion = scene.exact(np.array([0.0, 0.1, 0.2]))
    assert motion.positions[0] == pytest.approx(scene.masses.positions)
    moved = motion.positions[1] - motion.positions[0]
    assert moved == pytest.approx(np.tile([0.1, 0.1 - 0.5 * 9.81 * 0.01], (len(moved), 1)))


@pytest.mark.parametrize(
    ("name", "wrong", "field"),
    [
        ("dam_break", {"across": 0}, "scene.across"),
        ("dam_break", {"gravity": 0.0}, "scene.gravity"),
        ("dam_break", {"dimension": 4}, "scene.dimension"),
        ("floating_box", {"relative_density": 1.5}, "scene.relative_density"),
        ("hydrostatic_column", {"width": -1.0}, "scene.width"),
        ("two_blobs", {"speed": 0.0}, "scene.speed"),
    ],
)
def test_bad_parameters_are_refused(name, wrong, field):
    with pytest.raises(InvalidInput) as refused:
        build_scene(name, wrong)
    assert refused.value.field == field
