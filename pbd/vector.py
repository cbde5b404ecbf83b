"""Small vectors, and the position store: a tuple of d contiguous 1-D arrays, one per axis.

The store's type carries dimension and precision, so one source serves 1D to 3D in float64 and float32,
what a dimension lacks is never compiled, and each axis is a unit-stride array. This module alone knows
the layout. A vector is a tuple of d floats. Functions that build a tuple recurse over it at compile time.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from pbd.intrinsics import multiply_add, typed
from pbd.jit import device

Store = tuple[np.ndarray, ...]
Vector = tuple[float, ...]

LINE = 64
"""Bytes of a cache line. Arrays start on one, or each wide load and store would touch two."""

PAGE = 4096
_stagger = itertools.cycle(range(0, PAGE, 5 * LINE))
"""Arrays start at different places in their pages: a load and an earlier store equal in the last 12 bits of their
addresses wait for each other."""


def aligned(values: np.ndarray, dtype: Any = None) -> np.ndarray:
    """A contiguous copy that starts on a cache line."""
    values = np.asarray(values)
    dtype = np.dtype(dtype or values.dtype)
    if values.size * dtype.itemsize < PAGE:
        return np.array(values, dtype=dtype, order="C")
    copy = blank(values.shape, dtype)
    copy[...] = values
    return copy


def blank(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """Zeros that start on a cache line; pages of them that are never written take no memory."""
    dtype = np.dtype(dtype)
    size = math.prod(shape) * dtype.itemsize
    raw = np.zeros(size + 2 * PAGE, dtype=np.uint8)
    start = -raw.ctypes.data % PAGE + next(_stagger)
    return raw[start : start + size].view(dtype).reshape(shape)


def to_store(points: np.ndarray) -> Store:
    """(n, d) array -> store; always a copy."""
    return tuple(aligned(axis, np.float64) for axis in points.T)


def from_store(store: Store) -> np.ndarray:
    """Store of arrays of shape (..., n) -> array of shape (..., n, d)."""
    return np.stack(store, axis=-1)


def zeros(shape: int | tuple[int, ...], dimension: int) -> Store:
    """A store of zeros, each axis of the given shape."""
    return tuple(np.zeros(shape) for _ in range(dimension))


def like(a: Any, value: float) -> Any:
    """``value`` in the precision of a, so that a constant does not raise single precision to double."""
    return type(a)(value)


@typed(like)
def _like(a: Any, value: Any) -> Any:
    if str(a) == "float32":
        return lambda a, value: np.float32(value)
    return lambda a, value: value


class Constant(NamedTuple):
    """One number in the place of an array."""

    value: float


class One(NamedTuple):
    """The number 1 in the place of an array, in the precision of its field: a product with it costs nothing."""

    precision: float


def at(values: Any, i: int) -> Any:
    """values_i, of an array, a `Constant` or `One`."""
    if isinstance(values, One):
        return 1.0
    return values.value if isinstance(values, Constant) else values[i]


@typed(at)
def _at(values: Any, i: Any) -> Any:
    kind = getattr(values, "instance_class", None)
    if kind is One:
        return lambda values, i: like(values.precision, 1.0)
    return (lambda values, i: values.value) if kind is Constant else (lambda values, i: values[i])


def load(x: Store, i: int) -> Vector:
    """x_i."""
    return tuple(axis[i] for axis in x)


@typed(load)
def _load(x: Any, i: Any) -> Any:
    if len(x) == 1:
        return lambda x, i: (x[0][i],)
    return lambda x, i: (x[0][i],) + load(x[1:], i)


def zero(x: Store) -> Vector:
    """The zero vector of a store's dimension."""
    return tuple(0.0 for _ in x)


@typed(zero)
def _zero(x: Any) -> Any:
    if len(x) == 1:
        return lambda x: (0.0,)
    return lambda x: (0.0,) + zero(x[1:])


def subtract(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return tuple(p - q for p, q in zip(a, b, strict=True))


@typed(subtract)
def _subtract(a: Any, b: Any) -> Any:
    if len(a) == 1:
        return lambda a, b: (a[0] - b[0],)
    return lambda a, b: (a[0] - b[0],) + subtract(a[1:], b[1:])


def scale(s: float, a: Vector) -> Vector:
    """s a."""
    return tuple(s * p for p in a)


@typed(scale)
def _scale(s: Any, a: Any) -> Any:
    if len(a) == 1:
        return lambda s, a: (s * a[0],)
    return lambda s, a: (s * a[0],) + scale(s, a[1:])


def negate(a: Vector) -> Vector:
    """-a."""
    return tuple(-p for p in a)


@typed(negate)
def _negate(a: Any) -> Any:
    if len(a) == 1:
        return lambda a: (-a[0],)
    return lambda a: (-a[0],) + negate(a[1:])


@device
def add(a, b):
    """a + b."""
    return subtract(a, negate(b))


@device
def dot(a, b):
    """a . b."""
    total = a[0] * b[0]
    for k in range(1, len(a)):
        total = multiply_add(a[k], b[k], total)
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
        x[k][i] = multiply_add(s, a[k], x[k][i])


@device
def copy(x, y):
    """x <- y, whole stores."""
    for k in range(len(x)):
        for i in range(x[k].shape[0]):
            x[k][i] = y[k][i]
