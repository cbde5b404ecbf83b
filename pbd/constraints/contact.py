"""Contact of particles with static planes (PBD 2006, sections 3.4 and 3.5)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast, indices, number, unit_vectors
from pbd.collision.plane import Planes, closest_point, height, ray_cast
from pbd.errors import InvalidInput
from pbd.jit import device
from pbd.projection import inverse_weight, reset
from pbd.stages import evaluate
from pbd.state import Particles
from pbd.vector import Store, accumulate, dot, load, scale, store, subtract, to_store, zeros

RESTING_SPEED = 2.0
"""Impacts slower than this times g h do not bounce, g h being gravity's kick in a sub-step (Mueller 2020)."""


class Pushes(NamedTuple):
    """Law of contacts: rigid, C >= 0, and remembers the total push (m,) [kg m] for friction."""

    push: np.ndarray

    def reset(self):
        self.push[:] = 0.0

    def increment(self, c, row, particles, h):
        if row[1] >= 0.0:
            return 0.0
        change = -row[1] * inverse_weight(particles.w, row, 1.0, 0.0)
        self.push[c] += change
        return change


class Contact(NamedTuple):
    """Contacts of the step, filled anew in `begin`: slot a holds (particle, plane, surface point).

    C(p) = (p - q) . n >= 0 with q the entry point of the ray x -> p, or, when the particle started
    inside, the surface point closest to p (the static fall-back).
    ``candidates`` are the particles tested, ``filled[0]`` slots are in use; slot arrays hold one entry for each
    candidate and plane.
    """

    planes: Planes
    friction: float
    restitution: float
    gravity: float
    candidates: np.ndarray
    filled: np.ndarray
    particle: np.ndarray
    plane: np.ndarray
    point: Store
    speed: np.ndarray
    law: Pushes

    def size(self):
        return self.filled[0]

    def evaluate(self, c, x):
        normal = load(self.planes.normal, self.plane[c])
        i = self.particle[c]
        return (i,), dot(subtract(load(x, i), load(self.point, c)), normal), (normal,), (1.0,)

    def renumbered(self, slot: np.ndarray) -> Contact:
        """The same for particles that now stand in ``slot``."""
        return self._replace(candidates=slot[self.candidates])

    def begin(self, state, h):
        reset(self.law)
        self.filled[0] = 0
        for k in range(self.planes.offset.shape[0]):
            for a in range(self.candidates.shape[0]):
                find_contact(self, state.particles, self.candidates[a], k)

    def end(self, state, h):
        """Restitution and Coulomb friction on the velocities of colliding particles."""
        for c in range(self.filled[0]):
            if self.law.push[c] > 0.0:
                change_velocity(self, state.particles, c, h)


@device
def find_contact(contact, particles, i, k):
    """Write a slot for particle i and plane k if its ray enters the plane or it ends inside."""
    planes = contact.planes
    target = load(particles.p, i)
    hits, point = ray_cast(planes, k, load(particles.x, i), target)
    if not hits:
        if height(planes, k, target) >= 0.0:
            return
        point = closest_point(planes, k, target)
    c = contact.filled[0]
    contact.filled[0] = c + 1
    contact.particle[c] = i
    contact.plane[c] = k
    store(contact.point, c, point)
    contact.speed[c] = dot(load(particles.v, i), load(planes.normal, k))


@device
def change_velocity(contact, particles, c, h):
    """v_n <- -e v_n(before); |v_t| reduced by at most mu times the normal velocity change.

    Limits: friction acts on velocities alone, as in the 2006 paper, so a sticking particle still creeps
    by the tangential part of h^2 g in each step. A particle that other constraints carry away from
    the surface keeps its velocity.
    """
    indices, value, _, _ = evaluate(contact, c, particles.x)
    i = indices[0]
    pushed = particles.w[i] * contact.law.push[c]
    if value > pushed:
        return
    normal = load(contact.planes.normal, contact.plane[c])
    velocity = load(particles.v, i)
    along = dot(velocity, normal)
    before = contact.speed[c]
    is_impact = -before > RESTING_SPEED * contact.gravity * h
    target = -contact.restitution * before if is_impact else 0.0
    tangential = subtract(velocity, scale(along, normal))
    slip = math.sqrt(dot(tangential, tangential))
    limit = contact.friction * max(target - before, pushed / h)
    kept = 1.0 - min(limit / slip, 1.0) if slip > 0.0 else 0.0
    store(particles.v, i, scale(kept, tangential))
    accumulate(particles.v, i, target, normal)


def plane_contact(
    particles: Particles,
    *,
    normal: Any,
    offset: Any = 0.0,
    friction: float = 0.0,
    restitution: float = 0.0,
    gravity: float = 9.81,
    candidates: Any = None,
) -> Contact:
    """Contacts of particles with static planes n . y >= offset.

    Parameters
    ----------
    normal : (d,) or (m, d), any length > 0
    offset : one number or (m,) [m], along the unit normal
    friction : Coulomb coefficient mu >= 0, of the pair
    restitution : e in [0, 1], of the pair
    gravity : acceleration [m/s^2] toward the plane, >= 0; only sets which impacts are too slow to bounce
    candidates : indices of the particles tested; default all

    Raises
    ------
    InvalidInput : a value outside its range
    """
    n, d = particles.w.shape[0], len(particles.x)
    normals = unit_vectors("normal", normal, (d,))
    if len(normals) == 0:
        raise InvalidInput("normal", np.asarray(normal).tolist(), f"of {d} components and length > 0")
    tested = indices("candidates", np.arange(n) if candidates is None else candidates, n)
    tested = tested[particles.w[tested] > 0.0]
    slots = len(tested) * len(normals)
    return Contact(
        planes=Planes(to_store(normals), broadcast("offset", offset, (len(normals),))),
        friction=number("friction", friction, 0.0, math.inf, "finite and >= 0"),
        restitution=number("restitution", restitution, 0.0, 1.0, "a number in [0, 1]"),
        gravity=number("gravity", gravity, 0.0, math.inf, "finite and >= 0 m/s^2"),
        candidates=tested,
        filled=np.zeros(1, dtype=np.int64),
        particle=np.zeros(slots, dtype=np.int64),
        plane=np.zeros(slots, dtype=np.int64),
        point=zeros(slots, d),
        speed=np.zeros(slots),
        law=Pushes(np.zeros(slots)),
    )
