"""Lanes: as many numbers as fill 64 bytes, 16 in single and 8 in double precision, added and multiplied at once.

Sums over neighbours are written with them. They compile to vector instructions of any processor, in one order of
operations that no compiler's choice can change, so the last bit is the same whatever the width of its registers.
In plain Python, which NUMBA_DISABLE_JIT=1 runs, lanes are pieces of numpy arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd.fluid import registers
from pbd.fluid.registers import WIDTH
from pbd.intrinsics import typed


def width(array: Any) -> int:
    """Numbers in the lanes of an array's precision."""
    return WIDTH // array.dtype.itemsize


def lanes(array: Any, k: int) -> Any:
    """array_k, array_k+1, ..., as many as there are lanes."""
    return array[k : k + width(array)]


def put_lanes(array: Any, k: int, values: Any) -> None:
    """The counterpart of `lanes`."""
    array[k : k + width(array)] = values


def no_lanes(array: Any) -> Any:
    """Zeros in the precision of an array: where sums start."""
    return np.zeros(width(array), dtype=array.dtype)


def fused(a: Any, b: Any, c: Any) -> Any:
    """a b + c, in one operation where the processor has it; one of them at least is of lanes."""
    return a * b + c


def square_root(a: Any) -> Any:
    """The square root of each lane."""
    return np.sqrt(a)


def positive(a: Any) -> Any:
    """max(a, 0) of each lane; 0 for what is no number."""
    return np.where(a > 0, a, a.dtype.type(0))


def inverse(a: Any) -> Any:
    """1/a of each lane."""
    return a.dtype.type(1) / a


def totals(sums: tuple) -> tuple:
    """The sum of the lanes of each, all of them at once: each step adds halves, and packs two results in one register.

    Of four it takes 13 operations, where one after the other takes 32.
    """
    return tuple(lanes_.sum() for lanes_ in sums)


# ------------------------------------------------------------------ compiled forms


@typed(width)
def _width(array: Any) -> Any:
    count = registers.Lanes(array.dtype).count
    return lambda array: count


@typed(lanes)
def _lanes(array: Any, k: Any) -> Any:
    return lambda array, k: registers.load(array, k)  # type: ignore[call-arg]


@typed(put_lanes)
def _put_lanes(array: Any, k: Any, values: Any) -> Any:
    return lambda array, k, values: registers.store(array, k, values)  # type: ignore[call-arg]


@typed(no_lanes)
def _no_lanes(array: Any) -> Any:
    return lambda array: registers.zeros(array)  # type: ignore[call-arg]


@typed(fused)
def _fused(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: registers.fuse(a, b, c)  # type: ignore[call-arg]


@typed(square_root)
def _square_root(a: Any) -> Any:
    return lambda a: registers.root(a)  # type: ignore[call-arg]


@typed(positive)
def _positive(a: Any) -> Any:
    return lambda a: registers.positive_part(a)  # type: ignore[call-arg]


@typed(inverse)
def _inverse(a: Any) -> Any:
    return lambda a: registers.reciprocal(a)  # type: ignore[call-arg]


@typed(totals)
def _totals(sums: Any) -> Any:
    return lambda sums: registers.sums_of(sums)  # type: ignore[call-arg]
