"""The frame of a box: components of vectors in it and in the world.

A rotation is a tuple, the matrix from the box's frame to the world's row by row: 4 numbers in 2D, 9 in 3D.
Components whose number is known only at run time are chosen without memory.
"""

from __future__ import annotations

from typing import Any

from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import Vector, dot


def to_frame(rotation: tuple[float, ...], v: Vector) -> Vector:
    """R^T v: the components of a world vector in the box's frame."""
    d = len(v)
    return tuple(dot(rotation[k::d], v) for k in range(d))


@typed(to_frame)
def _to_frame(rotation: Any, v: Any) -> Any:
    if len(v) == 2:
        return lambda rotation, v: (dot((rotation[0], rotation[2]), v), dot((rotation[1], rotation[3]), v))
    return lambda rotation, v: (
        dot((rotation[0], rotation[3], rotation[6]), v),
        dot((rotation[1], rotation[4], rotation[7]), v),
        dot((rotation[2], rotation[5], rotation[8]), v),
    )


def to_world(rotation: tuple[float, ...], v: Vector) -> Vector:
    """R v: the world's components of a vector in the box's frame."""
    d = len(v)
    return tuple(dot(rotation[d * k : d * k + d], v) for k in range(d))


@typed(to_world)
def _to_world(rotation: Any, v: Any) -> Any:
    if len(v) == 2:
        return lambda rotation, v: (dot(rotation[:2], v), dot(rotation[2:], v))
    return lambda rotation, v: (dot(rotation[:3], v), dot(rotation[3:6], v), dot(rotation[6:], v))


@device
def axes(rotation):
    """The three axes of a box in the world: columns of R."""
    r = rotation
    return (r[0], r[3], r[6]), (r[1], r[4], r[7]), (r[2], r[5], r[8])


@device
def cosines(first, second):
    """Rows of R_1^T R_2: component (i, j) is the cosine between axis i of one box and axis j of the other."""
    x, y, z = axes(first)
    return to_frame(second, x), to_frame(second, y), to_frame(second, z)


@device
def transposed(rows):
    """Rows -> columns."""
    x, y, z = rows
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@device
def cross(a, b):
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@device
def pick(v, k):
    """v_k."""
    return v[0] if k == 0 else v[1] if k == 1 else v[2]


@device
def cycle(v, k):
    """The components of v in cyclic order, so that the k-th is the last."""
    if k == 0:
        return v[1], v[2], v[0]
    if k == 1:
        return v[2], v[0], v[1]
    return v[0], v[1], v[2]


@device
def column(rotation, k):
    """Axis k of a box in the world."""
    x, y, z = axes(rotation)
    return pick((x[0], y[0], z[0]), k), pick((x[1], y[1], z[1]), k), pick((x[2], y[2], z[2]), k)
