"""What a user calls for contacts of rigid bodies: `planes` and `contacts`."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd.arrays import broadcast, number, unit_vectors
from pbd.collision.cells import new_cells
from pbd.collision.plane import Planes
from pbd.errors import InvalidInput
from pbd.rigid.bodies import Bodies
from pbd.rigid.contacts import SKIN, Contacts
from pbd.vector import to_store, zeros

PAIRS_PER_BODY = {2: 6, 3: 14}
"""Room for candidate pairs to begin with; a run that needs more starts again with it."""


def planes(normals: Any, offsets: Any = 0.0) -> Planes:
    """Fixed half-spaces, solid where n . y < offset.

    Parameters
    ----------
    normals : (d,) or (m, d), any length > 0; they point out of the solid
    offsets : one number or (m,) [m], along the unit normals

    Raises
    ------
    InvalidInput : a normal of length 0, offsets that do not fit
    """
    unit = unit_vectors("normals", normals, (2, 3))
    return Planes(to_store(unit), broadcast("offsets", offsets, (len(unit),)))


def contacts(
    bodies: Bodies,
    planes: Planes | None = None,
    *,
    friction: float = 0.0,
    restitution: float = 0.0,
    gravity: float = 9.81,
    depenetration: float = 1.0,
) -> Contacts:
    """Contacts of bodies with each other and with planes.

    Parameters
    ----------
    planes : from `planes`
    friction : Coulomb coefficient mu >= 0, of every pair
    restitution : Newton's e in [0, 1], of every pair
    gravity : [m/s^2], >= 0; only sets which impacts are too slow to bounce
    depenetration : speed [m/s] > 0 with which bodies that overlap are pushed apart at most

    Raises
    ------
    InvalidInput : a value outside its range, planes of another dimension
    """
    n, d = len(bodies.radius) - 1, len(bodies.x)
    if planes is not None and len(planes.normal) != d:
        raise InvalidInput("planes", f"{len(planes.normal)} dimensions", f"{d}, as the bodies have")
    radius = bodies.radius[:n].copy()
    made = Contacts(
        rows=None,
        planes=planes or Planes(zeros(0, d), np.zeros(0)),
        friction=number("friction", friction, 0.0, 1e9, "finite and >= 0"),
        restitution=number("restitution", restitution, 0.0, 1.0, "a number in [0, 1]"),
        gravity=number("gravity", gravity, 0.0, 1e9, "finite and >= 0 m/s^2"),
        most_push=number("depenetration", depenetration, 1e-300, 1e9, "finite and > 0 m/s"),
        skin=SKIN * float(np.median(radius)) if n else 0.0,
        cells=new_cells(radius, d),
        pairs=np.zeros((0, 2), dtype=np.int64),
        active=np.zeros(0, dtype=np.int64),
        counts=np.zeros(4, dtype=np.int64),
        built=zeros(n, d),
        reach=radius,
        speed=np.zeros(n + 1),
        table=np.zeros(0, dtype=np.int64),
    )
    return made.grown(16 + PAIRS_PER_BODY[d] * n)
