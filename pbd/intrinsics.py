"""What Python cannot say and a processor can: fused operations, the bits of a number, wide registers, shared words.

Each is a plain function, which is what NUMBA_DISABLE_JIT=1 runs, and a compiled form beside it.
"""

from __future__ import annotations

import math
import os
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
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


# ------------------------------------------------------------------ words that threads share, of arrays of int64


def read_shared(words: Any, k: int) -> Any:
    """words_k; what a thread wrote before it wrote this word is seen too."""
    return int(words[k])


def write_shared(words: Any, k: int, value: int) -> None:
    """words_k <- value, after all that this thread has written before."""
    words[k] = value


def replace_shared(words: Any, k: int, old: int, new: int) -> Any:
    """words_k <- new if it is ``old``, and whether it was, with no other thread in between; not so in plain Python."""
    same = bool(words[k] == old)
    words[k] = new if same else words[k]
    return same


def add_shared(words: Any, k: int, value: int) -> None:
    """words_k <- words_k + value, as `write_shared` and with no other thread in between; not so in plain Python."""
    words[k] += value


def give_way() -> None:
    """Let another thread run, if one waits for this processor."""
    os.sched_yield()


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


def _word(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """A pointer to words_k."""
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.gep(array.data, [arguments[1]], source_etype=ir.IntType(64))


@intrinsic
def _load_word(typing_context, words, k):
    def generate(context, builder, signature, arguments):
        pointer = _word(context, builder, signature, arguments)
        return builder.load_atomic(pointer, "acquire", 8, typ=ir.IntType(64))

    return types.int64(words, types.int64), generate


@intrinsic
def _store_word(typing_context, words, k, value):
    def generate(context, builder, signature, arguments):
        builder.store_atomic(arguments[2], _word(context, builder, signature, arguments), "release", 8)
        return context.get_dummy_value()

    return types.none(words, types.int64, types.int64), generate


@intrinsic
def _replace_word(typing_context, words, k, old, new):
    def generate(context, builder, signature, arguments):
        pointer = _word(context, builder, signature, arguments)
        return builder.extract_value(builder.cmpxchg(pointer, *arguments[2:], "acq_rel", "acquire"), 1)

    return types.boolean(words, types.int64, types.int64, types.int64), generate


@intrinsic
def _add_word(typing_context, words, k, value):
    def generate(context, builder, signature, arguments):
        builder.atomic_rmw("add", _word(context, builder, signature, arguments), arguments[2], "acq_rel")
        return context.get_dummy_value()

    return types.none(words, types.int64, types.int64), generate


@intrinsic
def _yield_processor(typing_context):
    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(ir.IntType(32), [])
        builder.call(cgutils.get_or_insert_function(builder.module, kind, "sched_yield"), [])
        return context.get_dummy_value()

    return types.none(), generate


@typed(read_shared)
def _read_shared(words: Any, k: Any) -> Any:
    return lambda words, k: _load_word(words, k)  # type: ignore[call-arg]


@typed(write_shared)
def _write_shared(words: Any, k: Any, value: Any) -> Any:
    return lambda words, k, value: _store_word(words, k, value)  # type: ignore[call-arg]


@typed(replace_shared)
def _replace_shared(words: Any, k: Any, old: Any, new: Any) -> Any:
    return lambda words, k, old, new: _replace_word(words, k, old, new)  # type: ignore[call-arg]


@typed(add_shared)
def _add_shared(words: Any, k: Any, value: Any) -> Any:
    return lambda words, k, value: _add_word(words, k, value)  # type: ignore[call-arg]


@typed(give_way)
def _give_way() -> Any:
    return lambda: _yield_processor()  # type: ignore[call-arg]
