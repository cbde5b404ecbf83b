"""1/sqrt(q) by arithmetic alone: for vector loops, where square root and division share one slow unit.

The exponent's half and a linear mantissa come from the bits (Lomont 2003), with an error of 3.4 %; each Newton
step y <- y (3/2 - q y^2 / 2) squares it: 1.8e-3, 4.7e-6, 3.3e-11, and round-off. In double precision that costs
some 14 operations of which a core does 16 to 32 a cycle, against 4 cycles of its divider.

Limits: the result may be off by 2 units in the last place. q = 0 gives a large finite number, so that
0 / sqrt(0) is 0. A negative q gives no nan. In a chain of dependent projections the divider is faster.
"""

from __future__ import annotations

from typing import Any

from numba import types

from pbd.intrinsics import inverse_root_guess, multiply_add, typed
from pbd.jit import device
from pbd.vector import like

STEPS_64, STEPS_32 = 4, 3


@device
def inverse_root(q):
    """1/sqrt(q) in the precision of q."""
    y = inverse_root_guess(q)
    half = like(q, 0.5) * q
    for _ in range(steps(q)):
        y = y * multiply_add(-half * y, y, like(q, 1.5))
    return y


def steps(q: Any) -> int:
    """Newton steps to round-off in the precision of q."""
    return STEPS_64


@typed(steps)
def _steps(q: Any) -> Any:
    return (lambda q: STEPS_32) if q == types.float32 else (lambda q: STEPS_64)
