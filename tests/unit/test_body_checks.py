"""What is refused of rigid bodies before any engine sees them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from comparisons.bodies import Ball, Box, Planes, at_rest
from comparisons.engines._body_checks import check_bodies
from comparisons.scene import Scene, empty, no_masses
from pbd.errors import InvalidInput


def scene(dimension):
    shapes = (Box((1.0,) * dimension), Ball(0.5, dimension))
    bodies = at_rest(shapes, np.array([1.0, 2.0]), np.arange(2.0 * dimension).reshape(2, dimension))
    planes = Planes(np.eye(dimension), np.zeros(dimension))
    gravity = np.zeros(dimension)
    return Scene("", "", no_masses(dimension), (), gravity, 1.0, 1, (), bodies, planes, 0.5, 0.5)


def changed(good, part, name, value):
    """The scene with the last number of an array of its bodies or planes changed."""
    owner = getattr(good, part)
    array = np.array(getattr(owner, name))
    array.flat[-1] = value
    return dataclasses.replace(good, **{part: dataclasses.replace(owner, **{name: array})})


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_is_sound_passes(dimension):
    good = scene(dimension)
    check_bodies(good)
    check_bodies(empty(good))
    for friction, restitution in ((0.0, 0.0), (3.0, 1.0)):
        check_bodies(dataclasses.replace(good, friction=friction, restitution=restitution))


BAD = [
    ("bodies", "masses", np.nan),
    ("bodies", "masses", np.inf),
    ("bodies", "masses", 0.0),
    ("bodies", "masses", -1.0),
    ("bodies", "positions", np.nan),
    ("bodies", "velocities", -np.inf),
    ("bodies", "orientations", np.nan),
    ("bodies", "spins", np.inf),
    ("planes", "normals", np.nan),
    ("planes", "normals", 0.9),
    ("planes", "offsets", np.nan),
]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("part", "name", "value"), BAD)
def test_a_bad_number_names_its_array_and_body(dimension, part, name, value):
    with pytest.raises(InvalidInput, match=f"it is number {1 if part == 'bodies' else dimension - 1}") as error:
        check_bodies(changed(scene(dimension), part, name, value))
    assert error.value.field == f"scene.{part}.{name}"


@pytest.mark.parametrize(("off", "passes"), [(0.9e-9, True), (2e-9, False)])
def test_quaternions_are_of_unit_length(off, passes):
    good = scene(3)
    turned = dataclasses.replace(good.bodies, orientations=good.bodies.orientations * (1.0 + off))
    if passes:
        check_bodies(dataclasses.replace(good, bodies=turned))
        return
    with pytest.raises(InvalidInput, match="unit quaternion"):
        check_bodies(dataclasses.replace(good, bodies=turned))


@pytest.mark.parametrize(
    "shape", [Box((1.0, 0.0)), Box((np.nan, 1.0)), Ball(-1.0), Ball(np.inf), Box((1.0,) * 3), Ball(1.0, 3)]
)
def test_shapes_have_positive_sizes_and_the_scene_s_dimension(shape):
    good = scene(2)
    bodies = dataclasses.replace(good.bodies, shapes=(shape, good.bodies.shapes[1]))
    with pytest.raises(InvalidInput, match=r"scene\.bodies\.shapes"):
        check_bodies(dataclasses.replace(good, bodies=bodies))


@pytest.mark.parametrize(
    ("name", "value"),
    [("friction", -0.1), ("friction", np.inf), ("restitution", -0.1), ("restitution", 1.1), ("restitution", np.nan)],
)
def test_coefficients_are_in_range(name, value):
    with pytest.raises(InvalidInput) as error:
        check_bodies(dataclasses.replace(scene(2), **{name: value}))
    assert (error.value.field, error.value.remedy) == (f"scene.{name}", "")


def test_gravity_is_checked_too():
    with pytest.raises(InvalidInput, match=r"scene\.gravity"):
        check_bodies(dataclasses.replace(scene(2), gravity=np.array([0.0, np.nan])))
