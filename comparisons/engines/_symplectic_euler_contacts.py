"""Penalty contacts: at every point a spring and a damper along the normal, a spring and a slider across it.

N = k d + c d' at depth d, and across the normal the spring-slider with memory of Cundall and Strack (1979,
doi:10.1680/geot.1979.29.1.47), the standard of the discrete element method: f = -(k_t s + c_t v_t), s the tangential
displacement since the point came to stick, and |f| <= mu N, at which s slides along. The other usual law, Coulomb's
with a regularised velocity, min(mu N, c_t |v_t|), has no memory: with it what should stick creeps without end.

The damper gives one collision's restitution e exactly: c = 2 zeta sqrt(k m), zeta = -ln e / sqrt(pi^2 + ln^2 e),
critical for e = 0, m the mass that the points of the pair feel. For that it may pull while there is overlap. A contact
that never pulls would return 0.14 of the velocity at e = 0, and 0.55 at e = 0.5, whatever its stiffness (Schwager and
Poeschel 2007, doi:10.1007/s10035-007-0065-z). Friction counts pushes alone, of which an impact has a little more than
Newton's m (1 + e) v: 14 % at e = 0, 3 % at e = 0.5.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from comparisons.engines._symplectic_euler_neighbours import (
    Memory,
    Neighbours,
    behind,
    have_moved,
    list_pairs,
    recall,
    remember,
)
from comparisons.engines._symplectic_euler_shapes import Patch, Shapes, find_between, find_on_plane
from comparisons.engines._symplectic_euler_space import State, moment, respond, turned
from pbd.collision.plane import Planes
from pbd.jit import device
from pbd.vector import Store, Vector, accumulate, add, dot, load, scale, store, subtract, zero

TANGENTIAL = 2.0 / 7.0
"""k_t / k, at which the spring across a solid ball's contact has the period of the one along (Silbert et al. 2001)."""


class Law(NamedTuple):
    """Stiffnesses (n,) [N/m] of a point on each body, inf on the fixed; damping ratio; Coulomb's coefficient."""

    stiffness: np.ndarray
    ratio: float
    friction: float


class World(NamedTuple):
    """All of a run. ``reaction``: total force of the planes, store of (1,); ``work``: point forces and pairs tested."""

    state: State
    shapes: Shapes
    planes: Planes
    gravity: Vector
    law: Law
    patch: Patch
    memory: Memory
    neighbours: Neighbours
    reaction: Store
    work: np.ndarray


@device
def press(world, m, a, b, normal, count, h):
    """Add the forces of pair m's points, whose normal points to body a from body b or, for b < 0, from a plane.

    A point on a body is as stiff as every other; its damper is for its share of the mass that all points of the pair
    feel together. Returns the total force on a.
    """
    patch, total = world.patch, zero(world.state.x)
    active, weight, centre = gather(world, a, b, normal, count, h)
    if world.law.friction > 0.0:
        recall(world, m, a, b, normal, active)
    if active > 0:
        springs = coefficients(world, a, b, normal, weight, scale(1.0 / weight, centre), h)
        for c in range(active):
            force = push(patch, c, normal, springs, world.law.friction, h)
            total = add(total, force)
            add_force(world.state, a, load(patch.point, c), 1.0, force)
            if b >= 0:
                add_force(world.state, b, load(patch.point, c), -1.0, force)
        world.work[0] += active
    if world.law.friction > 0.0:
        remember(world, m, active)
    return total


@device
def gather(world, a, b, normal, count, h):
    """Bring the points that touch to the front: (their number, sum of weights, weighted sum of points).

    Depths become means over the step around now, of which a point that comes or leaves touches only a part: springs
    and, the more, dampers that begin and end with whole steps would make a rebound err by h.
    """
    patch = world.patch
    active, total, centre = 0, 0.0, zero(patch.point)
    for c in range(count):
        point, depth, weight = load(patch.point, c), patch.depth[c], patch.weight[c]
        velocity = velocity_at(world.state, a, point)
        if b >= 0:
            velocity = subtract(velocity, velocity_at(world.state, b, point))
        way = 0.5 * h * abs(dot(velocity, normal))
        if depth > -way and weight > 0.0:
            inside = depth >= way
            patch.part[active] = 1.0 if inside else 0.5 * (depth + way) / way
            patch.depth[active] = depth if inside else 0.25 * (depth + way) ** 2 / way
            patch.weight[active] = weight
            store(patch.point, active, point)
            store(patch.velocity, active, velocity)
            total += weight
            centre = add(centre, scale(weight, point))
            active += 1
    return active, total, centre


@device
def coefficients(world, a, b, normal, weight, centre, h):
    """(k, c, k_t, c_t) for weight 1; across the normal the damping is critical, for the least mass that may be felt."""
    along, across = mobility(world.state, a, normal, centre)
    k = world.law.stiffness[a]
    if b >= 0:
        more = mobility(world.state, b, normal, centre)
        along, across = along + more[0], across + more[1]
        k = min(k, world.law.stiffness[b])
    k_t = TANGENTIAL * k
    return k, damper(world.law.ratio, k, weight * along, h), k_t, damper(1.0, k_t, weight * across, h)


@device
def damper(ratio, k, w, h):
    """c for inverse mass w, corrected for a velocity that is half a step behind: c -> 2 ratio sqrt(k/w) as h -> 0.

    The scheme multiplies the square of an amplitude by 1 - h c w in each step. That this is exp(-y - y^2/4), with
    y = 2 ratio h sqrt(k w), makes the ratio of damping right to second order in h, and h c w less than 1 for any h.
    """
    c = 2.0 * ratio * math.sqrt(k / w)
    y = h * c * w
    return -c * math.expm1(-y - 0.25 * y * y) / y if y > 0.0 else c


@device
def mobility(state, i, normal, point):
    """Inverse masses of body i felt at a point, along the normal and, at most, across it."""
    arm = subtract(point, load(state.x, i))
    turning = moment(arm, normal)
    along = state.w[i] + dot(turning, respond(turning, state, i))
    return along, state.w[i] + state.lightest[i] * dot(arm, arm)


@device
def push(patch, c, normal, springs, friction, h):
    """The force of point c on body a."""
    k, damping, k_t, damping_t = springs
    velocity = load(patch.velocity, c)
    approach = -dot(velocity, normal)
    pressure = k * patch.depth[c] + patch.part[c] * damping * approach
    force = scale(pressure, normal)
    if friction > 0.0:
        across = add(velocity, scale(approach, normal))
        slip = add(load(patch.slip, c), scale(h, across))
        pull = add(scale(k_t, slip), scale(damping_t, across))
        size, limit = math.sqrt(dot(pull, pull)), friction * max(pressure, 0.0)
        if size > limit:
            pull = scale(limit / size, pull)
            slip = scale(1.0 / k_t, subtract(pull, scale(damping_t, across)))
        store(patch.slip, c, slip)
        force = subtract(force, pull)
    return scale(patch.weight[c], force)


@device
def velocity_at(state, i, point):
    return add(load(state.v, i), turned(load(state.spin, i), subtract(point, load(state.x, i))))


@device
def add_force(state, i, point, sign, force):
    accumulate(state.force, i, sign, force)
    accumulate(state.torque, i, sign, moment(subtract(point, load(state.x, i)), force))


# ------------------------------------------------------------------ who touches whom


@device
def add_contacts(world, h):
    """Add the forces of all contacts; False when there are more pairs than the list of neighbours has room for."""
    if have_moved(world, h) and not list_pairs(world):
        return False
    for m in range(behind(world) + world.neighbours.listed[0]):
        a, b, count, normal = find(world, m, h)
        force = press(world, m, a, b, normal, count, h)
        if b < 0:
            accumulate(world.reaction, 0, 1.0, force)
    world.work[1] += world.neighbours.listed[0]
    return True


@device
def find(world, m, h):
    """Pair m, first of bodies and planes, then of neighbours: (a, b, number of contact points, unit normal to a)."""
    state, p = world.state, m - behind(world)
    if p < 0:
        k, a = m // state.w.shape[0], m % state.w.shape[0]
        normal, count = load(world.planes.normal, k), 0
        if state.w[a] > 0.0:
            way = half_way(state, world.shapes, a, load(state.v, a), h)
            count = find_on_plane(world.patch, state, world.shapes, world.planes, k, a, way)
        return a, -1, count, normal
    a, b = world.neighbours.first[p], world.neighbours.second[p]
    way = half_way(state, world.shapes, a, subtract(load(state.v, a), load(state.v, b)), h)
    way += half_way(state, world.shapes, b, zero(state.v), h)
    count, normal = find_between(world.patch, state, world.shapes, a, b, way)
    return a, b, count, normal


@device
def half_way(state, shapes, i, velocity, h):
    """At most so far goes any point of body i in half a step, at a velocity of its centre."""
    spin = load(state.spin, i)
    return 0.5 * h * (math.sqrt(dot(velocity, velocity)) + math.sqrt(dot(spin, spin)) * shapes.bound[i])
