"""User arrays, checked and copied: what comes in is never aliased, and is finite when it passes."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd.errors import InvalidInput
from pbd.fields import Rule


def real_array(field: str, values: Any) -> np.ndarray:
    """A float64 copy of ``values``; refused when not real numbers or not finite."""
    try:
        array = np.asarray(values)
        if array.dtype == object or not np.can_cast(array.dtype, np.float64, "same_kind"):
            raise TypeError
        array = array.astype(np.float64)
    except (TypeError, ValueError):
        raise InvalidInput(field, values, "an array of real numbers") from None
    finite = np.isfinite(array)
    if not finite.all():
        where = tuple(int(i) for i in np.argwhere(~finite)[0])
        raise InvalidInput(f"{field}{list(where) if where else ''}", float(array[where]), "finite")
    return array


def broadcast(field: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A writable array of ``shape`` from one number or an array of that shape."""
    array = real_array(field, values)
    if array.shape not in ((), shape):
        raise InvalidInput(field, array.shape, f"one number or an array of shape {shape}")
    return np.broadcast_to(array, shape).copy()


def unit_vectors(field: str, values: Any, dimensions: tuple[int, ...]) -> np.ndarray:
    """(m, d) of length 1, from (d,) or (m, d); refused when d is none of ``dimensions``, or a length is 0."""
    vectors = np.atleast_2d(real_array(field, values))
    lengths = np.linalg.norm(vectors, axis=-1)
    if vectors.ndim != 2 or vectors.shape[1] not in dimensions or not np.all(lengths > 0.0):
        allowed = f"of {' or '.join(map(str, dimensions))} components and length > 0"
        raise InvalidInput(field, np.asarray(values).tolist(), allowed)
    return vectors / lengths[:, None]


def number(field: str, value: Any, low: float, high: float, allowed: str) -> float:
    """``value`` as a float; refused when it is no finite real number in [low, high]."""
    if not Rule("real", low=low, high=high).holds(value):
        raise InvalidInput(field, value, allowed)
    return float(value)


def indices(field: str, values: Any, n: int) -> np.ndarray:
    """Indices as int64, each checked to lie in [0, n)."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        raise InvalidInput(field, values, "an array of whole numbers") from None
    if array.size == 0:
        return np.zeros(array.shape, dtype=np.int64)
    if not np.issubdtype(array.dtype, np.integer):
        raise InvalidInput(field, values, "whole numbers")
    bad = array[(array < 0) | (array >= n)]
    if bad.size:
        raise InvalidInput(field, int(bad.flat[0]), f"an index >= 0 and < {n}")
    return array.astype(np.int64)
