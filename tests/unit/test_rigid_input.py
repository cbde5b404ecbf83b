"""Rigid bodies: bad input is refused with one line that names the field, the value and what is allowed."""

from __future__ import annotations

import math

import pytest

import pbd

BOX = [pbd.Box((1.0, 1.0))]
HERE = [(0.0, 0.0)]
BODY = pbd.bodies(BOX, HERE)
BAD_BODIES = [
    ({"shapes": [pbd.Box((0.0, 1.0))]}, "size"),
    ({"shapes": [pbd.Box((1.0, math.nan))]}, "size"),
    ({"shapes": [pbd.Box((1.0, 1.0, 1.0))]}, "size"),
    ({"shapes": [pbd.Ball(-1.0)]}, "radius"),
    ({"shapes": []}, "shapes"),
    ({"masses": -1.0}, "masses"),
    ({"positions": [(math.nan, 0.0)]}, "positions"),
    ({"positions": [(0.0, 0.0, 0.0, 0.0)]}, "positions"),
    ({"orientations": math.nan}, "orientations"),
    ({"fixed": [1]}, "fixed"),
]


@pytest.mark.parametrize(("changes", "field"), BAD_BODIES)
def test_bodies(changes, field):
    given = {"shapes": BOX, "positions": HERE, **changes}
    with pytest.raises(pbd.InvalidInput, match=field) as refused:
        pbd.bodies(given.pop("shapes"), given.pop("positions"), **given)
    assert "\n" not in str(refused.value)


def test_quaternions_have_length_one():
    with pytest.raises(pbd.InvalidInput, match="length 1"):
        pbd.bodies([pbd.Ball(1.0)], [(0.0, 0.0, 0.0)], orientations=[(1.0, 1.0, 0.0, 0.0)])


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"friction": -0.1}, "friction"),
        ({"restitution": 2.0}, "restitution"),
        ({"gravity": math.nan}, "gravity"),
        ({"depenetration": 0.0}, "depenetration"),
        ({"planes": pbd.planes((0.0, 1.0, 0.0))}, "planes"),
    ],
)
def test_contacts(changes, field):
    with pytest.raises(pbd.InvalidInput, match=field):
        pbd.contacts(BODY, **changes)


@pytest.mark.parametrize("normals", [(0.0, 0.0), (1.0,), [(0.0, math.inf)]])
def test_planes(normals):
    with pytest.raises(pbd.InvalidInput, match="normals"):
        pbd.planes(normals)


@pytest.mark.parametrize(
    ("settings", "bodies"),
    [
        ({}, BODY),
        ({"integrator": pbd.Shake()}, BODY),
        ({"integrator": pbd.Rattle()}, None),
        ({"solver": pbd.ConjugateSweeps()}, None),
        ({"integrator": pbd.Rattle(), "precision": "float32"}, BODY),
        ({"integrator": pbd.Rattle(), "damping": pbd.Damping(0.1)}, BODY),
    ],
)
def test_what_does_not_go_together(settings, bodies):
    particles = None if bodies is not None else pbd.particles([(0.0, 0.0)])
    with pytest.raises(pbd.InvalidInput, match="settings"):
        pbd.Simulation(particles, [], bodies=bodies, settings=pbd.Settings(**settings))
