"""Small vectors, and the position store: a tuple of d contiguous 1-D arrays, one per axis.

The store's type carries the dimension, so one source serves 1D, 2D and 3D, what a dimension lacks is
never compiled, and each axis is a unit-stride array. This module alone knows the layout.
A vector is a tuple of d floats. Functions that build a tuple recurse over it at compile time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from pbd.jit import DEVICE_OPTIONS, device

Store = tuple[np.ndarray, ...]
Vector = tuple[float, ...]


def to_store(points: np.ndarray) -> Store:
    """(n, d) array -> store; always a copy."""
    return tuple(np.array(axis, dtype=np.float64, order="C") for axis in points.T)


def from_store(store: Store) -> np.ndarray:
    """Store of arrays of shape (..., n) -> array of shape (..., n, d)."""
    return np.stack(store, axis=-1)


def zeros(shape: int | tuple[int, ...], dimension: int) -> Store:
    """A store of zeros, each axis of the given shape."""
    return tuple(np.zeros(shape) for _ in range(dimension))


def _typed(function: Any) -> Any:
    """Decorator: choose the compiled form of ``function`` from the types of its arguments."""
    return overload(function, strict=False, jit_options=DEVICE_OPTIONS)


def load(x: Store, i: int) -> Vector:
    """x_i."""
    return tuple(axis[i] for axis in x)


@_typed(load)
def _load(x: Any, i: Any) -> Any:
    if len(x) == 1:
        return lambda x, i: (x[0][i],)
    return lambda x, i: (x[0][i],) + load(x[1:], i)


def zero(x: Store) -> Vector:
    """The zero vector of a store's dimension."""
    return tuple(0.0 for _ in x)


@_typed(zero)
def _zero(x: Any) -> Any:
    if len(x) == 1:
        return lambda x: (0.0,)
    return lambda x: (0.0,) + zero(x[1:])


def subtract(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return tuple(p - q for p, q in zip(a, b, strict=True))


@_typed(subtract)
def _subtract(a: Any, b: Any) -> Any:
    if len(a) == 1:
        return lambda a, b: (a[0] - b[0],)
    return lambda a, b: (a[0] - b[0],) + subtract(a[1:], b[1:])


def scale(s: float, a: Vector) -> Vector:
    """s a."""
    return tuple(s * p for p in a)


@_typed(scale)
def _scale(s: Any, a: Any) -> Any:
    if len(a) == 1:
        return lambda s, a: (s * a[0],)
    return lambda s, a: (s * a[0],) + scale(s, a[1:])


@device
def add(a, b):
    """a + b."""
    return subtract(a, scale(-1.0, b))


@device
def dot(a, b):
    """a . b."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@device
def store(x, i, a):
    """x_i <- a."""
    for k in range(len(x)):
        x[k][i] = a[k]


@device
def accumulate(x, i, s, a):
    """x_i <- x_i + s a."""
    for k in range(len(x)):
        x[k][i] += s * a[k]
