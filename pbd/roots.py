"""1/sqrt(q) by arithmetic alone: for vector loops, where square root and division share one slow unit.

The bits of q give a guess that is off by at most 3.4 % (`pbd.intrinsics`). A step of Newton's method,
y <- y (3/2 - q y^2 / 2), leaves 1.5 times the square of the error; a step of third order,
y <- y + y e (1/2 + 3/8 e) with e = 1 - q y^2, leaves 2.5 times its cube: 1.8e-3, then 1.3e-8, the round-off of
single precision; and another of Newton's, 3e-16. In double precision that is 11 operations after the guess, of which
a core does 16 to 32 a cycle, against 4 cycles of its divider.

Limits: the result may be off by 2 units in the last place. q = 0 gives a large finite number, so that
0 / sqrt(0) is 0. A negative q gives no nan. In a chain of dependent projections the divider is faster.
"""

from __future__ import annotations

from typing import Any

from numba import types

from pbd.intrinsics import inverse_root_guess, multiply_add, typed
from pbd.jit import device
from pbd.vector import like


@device
def inverse_root(q):
    """1/sqrt(q) in the precision of q."""
    half = like(q, 0.5) * q
    y = newton_step(half, inverse_root_guess(q))
    error = multiply_add(-q * y, y, like(q, 1.0))
    y = multiply_add(y * error, multiply_add(like(q, 0.375), error, like(q, 0.5)), y)
    return last_step(half, y)


@device
def newton_step(half, y):
    return y * multiply_add(-half * y, y, like(half, 1.5))


def last_step(half: Any, y: Any) -> Any:
    """Newton's, for what single precision cannot hold."""
    return newton_step(half, y)


@typed(last_step)
def _last_step(half: Any, y: Any) -> Any:
    return (lambda half, y: y) if half == types.float32 else (lambda half, y: newton_step(half, y))
