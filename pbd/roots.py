"""1/sqrt(q) by arithmetic alone: for vector loops, where square root and division share one slow unit.

The exponent's half and a linear mantissa come from the bits (Lomont 2003), with an error of 3.4 %; each Newton
step y <- y (3/2 - q y^2 / 2) squares it: 1.8e-3, 4.7e-6, 3.3e-11, and round-off. In double precision that costs
some 14 operations of which a core does 16 to 32 a cycle, against 4 cycles of its divider.

Limits: the result may be off by 2 units in the last place. q = 0 gives a large finite number, so that
0 / sqrt(0) is 0. A negative q gives no nan. In a chain of dependent projections the divider is faster.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pbd.jit import device
from pbd.vector import typed

SEED_64, SEED_32 = 0x5FE6EB50C7B537A9, 0x5F375A86
SMALLEST = 1e-300


def inverse_root(q: Any) -> Any:
    """1/sqrt(q) in the precision of q."""
    return type(q)(1.0 / math.sqrt(max(q, SMALLEST)))


@typed(inverse_root)
def _inverse_root(q: Any) -> Any:
    return _single if q == types.float32 else _double


def _double(q: Any) -> Any:
    half = 0.5 * q
    y = seed(q)  # type: ignore[call-arg, var-annotated]
    for _ in range(4):
        y = newton(half, y, 1.5)
    return y


def _single(q: Any) -> Any:
    half = np.float32(0.5) * q
    y = seed(q)  # type: ignore[call-arg, var-annotated]
    for _ in range(3):
        y = newton(half, y, np.float32(1.5))
    return y


@device
def newton(half, y, one_and_half):
    return y * (one_and_half - half * y * y)


@intrinsic
def seed(typing_context, q):
    """The first guess, from the bits of q."""
    single = q == types.float32
    bits, magic = (32, SEED_32) if single else (64, SEED_64)

    def generate(context, builder, signature, arguments):
        whole = ir.IntType(bits)
        halved = builder.lshr(builder.bitcast(arguments[0], whole), ir.Constant(whole, 1))
        guess = builder.sub(ir.Constant(whole, magic), halved)
        return builder.bitcast(guess, arguments[0].type)

    return (types.float32 if single else types.float64)(q), generate
