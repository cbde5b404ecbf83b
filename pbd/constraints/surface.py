"""Distances between parts of boxes made of particles, with exact gradients: C, n and weights b_j, grad_j C = b_j n.

    a point over a line (2D) or a plane (3D)   C = (q - p1) . n,    PBD 2006, section 3.4: point over triangle
    a line over a line (3D)                    C = (p3 - p1) . n,   n along (p2 - p1) x (p4 - p3)

The weights are those of the points that are nearest to each other: 1 and minus barycentric ones, or for two lines
-(1 - s), -s, 1 - t, t. They add up to 0, and so do the torques of forces b_j n: those of the two sides act on one line.

Limit: particles that coincide, and parallel lines, have no normal; it is then 0, and nothing is pushed.
"""

from __future__ import annotations

import math
from typing import Any

from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import Store, dot, load, scale, subtract


@device
def cross(a, b):
    """a x b, in 3D."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@device
def inverse_of(a):
    """1/a; 0 for 0."""
    return 1.0 / a if a > 0.0 else 0.0


@device
def point_over_line(x, indices):
    """Particle 0 over the line from 1 to 2; the normal is (t_y, -t_x), t the direction of the line."""
    origin = load(x, indices[1])
    along, arm = subtract(load(x, indices[2]), origin), subtract(load(x, indices[0]), origin)
    squared = dot(along, along)
    normal = scale(inverse_of(math.sqrt(squared)), (along[1], -along[0]))
    share = dot(arm, along) * inverse_of(squared)
    return dot(arm, normal), normal, (1.0, share - 1.0, -share)


@device
def point_over_plane(x, indices):
    """Particle 0 over the plane through 1, 2 and 3, counter-clockwise from above."""
    origin = load(x, indices[1])
    e, f = subtract(load(x, indices[2]), origin), subtract(load(x, indices[3]), origin)
    arm, across = subtract(load(x, indices[0]), origin), cross(e, f)
    squared = dot(across, across)
    normal, inverse = scale(inverse_of(math.sqrt(squared)), across), inverse_of(squared)
    ee, ef, ff, ae, af = dot(e, e), dot(e, f), dot(f, f), dot(arm, e), dot(arm, f)
    second, third = (ff * ae - ef * af) * inverse, (ee * af - ef * ae) * inverse
    return dot(arm, normal), normal, (1.0, second + third - 1.0, -second, -third)


@device
def line_over_line(x, indices):
    """The line from 2 to 3 over the one from 0 to 1."""
    origin, other = load(x, indices[0]), load(x, indices[2])
    e, f, apart = subtract(load(x, indices[1]), origin), subtract(load(x, indices[3]), other), subtract(other, origin)
    across = cross(e, f)
    squared = dot(across, across)
    normal, inverse = scale(inverse_of(math.sqrt(squared)), across), inverse_of(squared)
    ee, ef, ff, ae, af = dot(e, e), dot(e, f), dot(f, f), dot(apart, e), dot(apart, f)
    s, t = (ff * ae - ef * af) * inverse, (ef * ae - ee * af) * inverse
    return dot(apart, normal), normal, (s - 1.0, -s, 1.0 - t, t)


@device
def in_space(x, indices, are_lines):
    return line_over_line(x, indices) if are_lines else point_over_plane(x, indices)


def gap_between(x: Store, indices: tuple[Any, ...], are_lines: Any) -> tuple:
    """(C, n, weights) of d + 1 particles: a corner and the face below it or, with ``are_lines``, two crossing edges."""
    return point_over_line(x, indices) if len(indices) == 3 else in_space(x, indices, are_lines)


@typed(gap_between)
def _gap_between(x: Any, indices: Any, are_lines: Any) -> Any:
    if len(indices) == 3:
        return lambda x, indices, are_lines: point_over_line(x, indices)
    return lambda x, indices, are_lines: in_space(x, indices, are_lines)
