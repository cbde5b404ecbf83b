"""Shape matching: particles move toward where their rest shape, moved rigidly, fits them best (Mueller et al. 2005).

    c = sum m p / M,    A = sum m (p - c) r^T = R S,    p_i <- p_i + k (c + R r_i - p_i)

With k = 1 the shape is rigid: so "Unified Particle Physics" (Macklin et al. 2014, section 5) makes rigid bodies of
particles. Both momenta are kept: c is where it was, and sum m (p - c) x R r = 0 because R^T A is symmetric.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import indices, real_array
from pbd.constraints.polar import add_outer, nearest_quaternions, nearest_rotation, times, zero_matrix
from pbd.errors import InvalidInput
from pbd.jit import device
from pbd.state import Particles
from pbd.stiffness import Stiffness
from pbd.vector import Store, accumulate, add, at, from_store, load, scale, subtract, to_store, zero


class ShapeMatching(NamedTuple):
    """Shape c holds the particles ``member[start[c]:start[c + 1]]``.

    start (m + 1,), member (t,) : indices
    rest : store of (t,) places r_i about the shape's centre of mass, unturned [m]; ``mass`` (t,) [kg]
    turn : in 3D a store of (m,) unit quaternions, the rotations found last; empty in 2D
    law : `Stiffness`; each projection is a displacement, of weight 1
    """

    start: np.ndarray
    member: np.ndarray
    rest: Store
    mass: np.ndarray
    turn: Store
    law: Any

    def size(self):
        return self.start.shape[0] - 1

    def weights(self, w: np.ndarray) -> np.ndarray:
        """(m,) ones: the law's factor is then k' itself."""
        return np.ones(self.size())

    def project(self, state, h):
        for c in range(self.start.shape[0] - 1):
            match(self, state.particles.p, c)
        state.work[0] += self.start.shape[0] - 1


@device
def match(shapes, p, c):
    """p_i <- p_i + k (c + R r_i - p_i) for all particles of shape c."""
    first, last = shapes.start[c], shapes.start[c + 1]
    total = 0.0
    center = zero(p)
    for a in range(first, last):
        total += shapes.mass[a]
        center = add(center, scale(shapes.mass[a], load(p, shapes.member[a])))
    center = scale(1.0 / total, center)
    moment = zero_matrix(p, p)
    for a in range(first, last):
        arm = subtract(load(p, shapes.member[a]), center)
        moment = add_outer(moment, shapes.mass[a], arm, load(shapes.rest, a))
    rotation = nearest_rotation(moment, shapes.turn, c)
    k = at(shapes.law.factor, c)
    for a in range(first, last):
        i = shapes.member[a]
        goal = add(center, times(rotation, load(shapes.rest, a)))
        accumulate(p, i, k, subtract(goal, load(p, i)))


def shape_matching(
    particles: Particles, shapes: Sequence[Any], *, rest: Any = None, law: Stiffness | None = None
) -> ShapeMatching:
    """A batch of shapes, each matched as a whole.

    Parameters
    ----------
    particles : the group that the indices refer to, in 2D or 3D
    shapes : for each shape the indices of its particles, at least two, all different
    rest : (n, d) places of all particles in their rest shapes [m]; the present positions where not given
    law : `Stiffness` (default, k = 1)

    Raises
    ------
    InvalidInput : another dimension; an index outside [0, n), one that is pinned or stands twice in a shape; a shape
        whose particles coincide; a law that is no `Stiffness` of an equality
    """
    n, d = particles.w.shape[0], len(particles.x)
    if d not in (2, 3):
        raise InvalidInput("particles", d, "of dimension 2 or 3", "in 1D a shape is a distance")
    if law is not None and not (isinstance(law, Stiffness) and law.relation == "equality"):
        raise InvalidInput("law", law, "a Stiffness with relation equality", "a shape is no single constraint C")
    members = [_members(particles, f"shapes[{c}]", shape, n) for c, shape in enumerate(shapes)]
    places = from_store(particles.x) if rest is None else real_array("rest", rest)
    if places.shape != (n, d):
        raise InvalidInput("rest", places.shape, f"of shape {(n, d)}")
    member = np.concatenate([np.zeros(0, dtype=np.int64), *members])
    mass = 1.0 / particles.w[member]
    arms = [_arms(f"shapes[{c}]", places[each], 1.0 / particles.w[each]) for c, each in enumerate(members)]
    return ShapeMatching(
        start=np.cumsum([0, *map(len, members)]).astype(np.int64),
        member=member,
        rest=to_store(np.concatenate([np.zeros((0, d)), *arms])),
        mass=mass,
        turn=_turns(particles, members, arms),
        law=law or Stiffness(),
    )


def _members(particles: Particles, field: str, shape: Any, n: int) -> np.ndarray:
    index = indices(field, shape, n)
    if index.ndim != 1 or len(index) < 2 or len(np.unique(index)) < len(index):
        raise InvalidInput(field, np.asarray(shape).tolist(), "at least two different particles")
    if not np.all(particles.w[index] > 0.0):
        pinned = int(index[particles.w[index] == 0.0][0])
        raise InvalidInput(field, pinned, "of particles that can move", "leave a shape that stands still out")
    return index


def _arms(field: str, places: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """(k, d) places about their centre of mass [m]."""
    arms = places - mass @ places / mass.sum()
    if not np.ptp(arms, axis=0).max() > 0.0:
        raise InvalidInput(field, places[0].tolist(), "of particles that do not all coincide")
    return arms


def _turns(particles: Particles, members: list[np.ndarray], arms: list[np.ndarray]) -> Store:
    """In 3D the quaternions by which the shapes are turned at the start, from where the kernel goes on."""
    x = from_store(particles.x)
    if x.shape[1] == 2:
        return ()
    moments = [(x[i] - x[i].mean(axis=0)).T @ (r / particles.w[i][:, None]) for i, r in zip(members, arms, strict=True)]
    return to_store(nearest_quaternions(np.array(moments).reshape(-1, 3, 3)))
