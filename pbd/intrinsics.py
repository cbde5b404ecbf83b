"""What Python cannot say and a processor can: fused operations, the bits of a number, wide registers.

Each is a plain function, which is what NUMBA_DISABLE_JIT=1 runs, and a compiled form beside it.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from pbd.jit import DEVICE_OPTIONS

WIDE_VECTORS = '"prefer-vector-width"="512"'
"""LLVM's attribute of a function that lives by its vector loops."""

MAGIC_64, MAGIC_32 = 0x5FE6EB50C7B537A9, 0x5F375A86
"""Minus half the bits of q from these are nearly the bits of 1/sqrt(q) (Lomont 2003)."""

SMALLEST = 1e-300


def typed(function: Any) -> Any:
    """Decorator: choose the compiled form of ``function`` from the types of its arguments."""
    return overload(function, strict=False, jit_options=DEVICE_OPTIONS)


def prefer_wide_vectors() -> None:
    """Let the loops of the calling function use 512-bit registers where there are such.

    LLVM keeps to half of them by default, for the sake of code that has few vector loops.
    """


def multiply_add(a: Any, b: Any, c: Any) -> Any:
    """a b + c, in one operation where the processor has it.

    Said so, not left to the compiler, which would fuse here and not there, and change bits from loop to loop.
    """
    return a * b + c


def inverse_root_guess(q: Any) -> Any:
    """1/sqrt(q) with an error of at most 3.4 %, from the bits of q."""
    return type(q)(1.0 / math.sqrt(max(q, SMALLEST)))


# ------------------------------------------------------------------ compiled forms


@intrinsic
def _widen(typing_context):
    def generate(context, builder, signature, arguments):
        set.add(builder.function.attributes, WIDE_VECTORS)  # llvmlite's own add() knows no such attribute
        return context.get_dummy_value()

    return types.none(), generate


@intrinsic
def _fuse(typing_context, a, b, c):
    kind = typing_context.unify_types(a, b, c)

    def generate(context, builder, signature, arguments):
        real = arguments[0].type
        function = builder.module.declare_intrinsic("llvm.fmuladd", [real], ir.FunctionType(real, [real] * 3))
        return builder.call(function, arguments)

    return kind(kind, kind, kind), generate


@intrinsic
def _guess(typing_context, q):
    single = q == types.float32
    bits, magic = (32, MAGIC_32) if single else (64, MAGIC_64)

    def generate(context, builder, signature, arguments):
        whole = ir.IntType(bits)
        halved = builder.lshr(builder.bitcast(arguments[0], whole), ir.Constant(whole, 1))
        return builder.bitcast(builder.sub(ir.Constant(whole, magic), halved), arguments[0].type)

    return (types.float32 if single else types.float64)(q), generate


@overload(prefer_wide_vectors, inline="always")
def _prefer_wide_vectors() -> Any:
    return lambda: _widen()  # type: ignore[call-arg]


@typed(multiply_add)
def _multiply_add(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: _fuse(a, b, c)  # type: ignore[call-arg]


@typed(inverse_root_guess)
def _inverse_root_guess(q: Any) -> Any:
    return lambda q: _guess(q)  # type: ignore[call-arg]
