"""Helpers that kernels call rather than take in: long loops, called from many places, whose call costs nothing.

Taken in at every place, as `pbd.jit.device` does, a solver of many such loops compiles for a minute.
"""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from pbd.jit import DEVICE_OPTIONS

ROUTINE_OPTIONS: Any = {**DEVICE_OPTIONS, "forceinline": False}

routine = register_jitable(**ROUTINE_OPTIONS)
"""Decorator for such a function."""

routine_sum = register_jitable(**{**ROUTINE_OPTIONS, "fastmath": {"contract", "reassoc", "nsz"}})
"""As `routine`, for sums that may be taken in any order, several at once."""
