"""Contacts of balls, discs in the plane and spheres in space, with boxes and with one another. Pure geometry.

A contact is (hit, point, gap, normal): whether the gap is at most a margin; the point halfway between the surfaces; the
gap along the normal, negative where they overlap; and the unit normal from the ball, or the first ball, to the other.
"""

from __future__ import annotations

import math
from typing import Any

from pbd.collision.frames import to_frame, to_world
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import Vector, add, dot, scale, subtract


@device
def ball_box(centre, radius, box, margin):
    """Contact of a ball with a box (centre (d,), half extents (d,), rotation (d d,) as in frames.py).

    A centre inside the box is pushed out through the nearest face.
    """
    local = to_frame(box[2], subtract(centre, box[0]))
    surface = closest(local, box[1])
    out = subtract(local, surface)
    square = dot(out, out)
    if square > 0.0:
        distance = math.sqrt(square)
        outward = scale(1.0 / distance, out)
    else:
        axis, distance = nearest_face(local, box[1])
        outward = unit(local, axis)
        surface = subtract(local, scale(distance, outward))
    gap = distance - radius
    point = add(box[0], to_world(box[2], add(surface, scale(0.5 * gap, outward))))
    return gap <= margin, point, gap, scale(-1.0, to_world(box[2], outward))


@device
def ball_ball(first, first_radius, second, second_radius, margin):
    """Contact of two balls; the normal of balls in one place is that of the last axis."""
    between = subtract(second, first)
    distance = math.sqrt(dot(between, between))
    normal = scale(1.0 / distance, between) if distance > 0.0 else unit(between, len(between) - 1)
    gap = distance - first_radius - second_radius
    return gap <= margin, add(first, scale(first_radius + 0.5 * gap, normal)), gap, normal


@device
def nearest_face(local, half):
    """(axis, signed depth) of a point in a box's frame: negative, under the face that is nearest."""
    axis, depth = 0, abs(local[0]) - half[0]
    for k in range(1, len(local)):
        if abs(local[k]) - half[k] > depth:
            axis, depth = k, abs(local[k]) - half[k]
    return axis, depth


def closest(local: Vector, half: Vector) -> Vector:
    """The point of a box that is closest to a point, both in the box's frame."""
    return tuple(max(-h, min(h, p)) for p, h in zip(local, half, strict=True))


@typed(closest)
def _closest(local: Any, half: Any) -> Any:
    if len(local) == 1:
        return lambda local, half: (max(-half[0], min(half[0], local[0])),)
    return lambda local, half: (max(-half[0], min(half[0], local[0])),) + closest(local[1:], half[1:])


def unit(v: Vector, axis: int) -> Vector:
    """The unit vector along an axis, to the side where v lies."""
    return tuple(math.copysign(1.0, p) if k == axis else 0.0 for k, p in enumerate(v))


@typed(unit)
def _unit(v: Any, axis: Any) -> Any:
    if len(v) == 1:
        return lambda v, axis: (math.copysign(1.0, v[0]) if axis == 0 else 0.0,)
    return lambda v, axis: (math.copysign(1.0, v[0]) if axis == 0 else 0.0,) + unit(v[1:], axis - 1)
