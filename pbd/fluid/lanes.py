"""Lanes: as many numbers as fill 64 bytes, 16 in single and 8 in double precision, added and multiplied at once.

Sums over neighbours are written with them. They compile to vector instructions of any processor, in one order of
operations that no compiler's choice can change, so the last bit is the same whatever the width of its registers.
In plain Python, which NUMBA_DISABLE_JIT=1 runs, lanes are pieces of numpy arrays.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

from pbd.intrinsics import typed
from pbd.jit import DEVICE_OPTIONS

WIDTH = 64
"""Bytes."""


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


class Lanes(types.Type):
    """Numba's type of lanes of one precision."""

    def __init__(self, dtype: Any) -> None:
        self.dtype, self.count = dtype, WIDTH * 8 // dtype.bitwidth
        super().__init__(name=f"Lanes({dtype})")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _vector(kind))


def _vector(kind: Lanes) -> ir.VectorType:
    real = ir.FloatType() if kind.dtype == types.float32 else ir.DoubleType()
    return ir.VectorType(real, kind.count)


def _splat(builder: Any, value: Any, count: int) -> Any:
    """A vector with the same value in every lane."""
    vector = ir.VectorType(value.type, count)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), count), [0] * count)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), mask)


def _widened(context: Any, builder: Any, value: Any, kind: Any, lanes_kind: Lanes) -> Any:
    if isinstance(kind, Lanes):
        return value
    return _splat(builder, context.cast(builder, value, kind, lanes_kind.dtype), lanes_kind.count)


def _kind_of(*kinds: Any) -> Any:
    return next((kind for kind in kinds if isinstance(kind, Lanes)), None)


def _operation(name: str) -> Any:
    @intrinsic
    def apply(typing_context, a, b):
        kind = _kind_of(a, b)

        def generate(context, builder, signature, arguments):
            left, right = (_widened(context, builder, v, t, kind) for v, t in zip(arguments, signature.args))
            return getattr(builder, name)(left, right)

        return kind(a, b), generate

    def find(a: Any, b: Any) -> Any:
        return (lambda a, b: apply(a, b)) if _kind_of(a, b) else None

    return find


for _operator, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    overload(_operator, strict=False, jit_options=DEVICE_OPTIONS)(_operation(_name))


def _pointer(context: Any, builder: Any, signature: Any, arguments: Any) -> tuple[Any, Any]:
    """Where array[k] lies, as a pointer to lanes, and the bytes of one number."""
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    real = context.get_data_type(signature.args[0].dtype)
    at = builder.gep(array.data, [arguments[1]], source_etype=real)
    lanes_kind = Lanes(signature.args[0].dtype)
    return builder.bitcast(at, _vector(lanes_kind).as_pointer()), signature.args[0].dtype.bitwidth // 8


@intrinsic
def _load(typing_context, array, k):
    kind = Lanes(array.dtype)

    def generate(context, builder, signature, arguments):
        pointer, size = _pointer(context, builder, signature, arguments)
        return builder.load(pointer, align=size, typ=_vector(kind))

    return kind(array, types.intp), generate


@intrinsic
def _store(typing_context, array, k, values):
    def generate(context, builder, signature, arguments):
        pointer, size = _pointer(context, builder, signature, arguments)
        value = _widened(context, builder, arguments[2], signature.args[2], Lanes(array.dtype))
        builder.store(value, pointer, align=size)
        return context.get_dummy_value()

    return types.none(array, types.intp, values), generate


@intrinsic
def _zeros(typing_context, array):
    kind = Lanes(array.dtype)

    def generate(context, builder, signature, arguments):
        return ir.Constant(_vector(kind), [0.0] * kind.count)

    return kind(array), generate


@intrinsic
def _fuse(typing_context, a, b, c):
    kind = _kind_of(a, b, c)

    def generate(context, builder, signature, arguments):
        wide = [_widened(context, builder, v, t, kind) for v, t in zip(arguments, signature.args)]
        return builder.call(_library(builder, "fmuladd", kind, 3), wide)

    return kind(a, b, c), generate


@intrinsic
def _root(typing_context, a):
    def generate(context, builder, signature, arguments):
        return builder.call(_library(builder, "sqrt", a, 1), arguments)

    return a(a), generate


def _library(builder: Any, name: str, kind: Lanes, arguments: int) -> Any:
    """LLVM's own function of that name for lanes."""
    bits = kind.dtype.bitwidth
    whole = f"llvm.{name}.v{kind.count}f{bits}"
    function = ir.FunctionType(_vector(kind), [_vector(kind)] * arguments)
    return cgutils.get_or_insert_function(builder.module, function, whole)


@intrinsic
def _positive_part(typing_context, a):
    def generate(context, builder, signature, arguments):
        zeros = ir.Constant(_vector(a), [0.0] * a.count)
        return builder.select(builder.fcmp_ordered(">", arguments[0], zeros), arguments[0], zeros)

    return a(a), generate


@intrinsic
def _reciprocal(typing_context, a):
    def generate(context, builder, signature, arguments):
        return builder.fdiv(ir.Constant(_vector(a), [1.0] * a.count), arguments[0])

    return a(a), generate


@intrinsic
def _sums(typing_context, parts):
    kind = parts.dtype
    result = types.UniTuple(kind.dtype, len(parts))

    def generate(context, builder, signature, arguments):
        vectors = cgutils.unpack_tuple(builder, arguments[0], len(parts))
        packed, group = _packed(builder, vectors, kind.count)
        while group > 1:
            group //= 2
            packed = builder.fadd(packed, _picked(builder, packed, packed, [k ^ group for k in range(kind.count)]))
        step = kind.count // _power(len(parts))
        found = [builder.extract_element(packed, ir.Constant(ir.IntType(32), k * step)) for k in range(len(parts))]
        return context.make_tuple(builder, result, found)

    return result(parts), generate


def _power(count: int) -> int:
    """The smallest power of two that is not less."""
    return 1 << (count - 1).bit_length()


def _packed(builder: Any, vectors: list[Any], count: int) -> tuple[Any, int]:
    """One vector with a group of lanes for each of several, in their order; a group's lanes are still to be added."""
    group = count
    vectors = vectors + [ir.Constant(vectors[0].type, [0.0] * count)] * (_power(len(vectors)) - len(vectors))
    while len(vectors) > 1:
        low = [k for k in range(2 * count) if k % group < group // 2]
        high = [k + group // 2 for k in low]
        pairs = zip(vectors[::2], vectors[1::2], strict=True)
        vectors = [builder.fadd(_picked(builder, a, b, low), _picked(builder, a, b, high)) for a, b in pairs]
        group //= 2
    return vectors[0], group


def _picked(builder: Any, a: Any, b: Any, places: list[int]) -> Any:
    """The lanes of a and b at these places."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(places)), places))


@typed(width)
def _width(array: Any) -> Any:
    count = Lanes(array.dtype).count
    return lambda array: count


@typed(lanes)
def _lanes(array: Any, k: Any) -> Any:
    return lambda array, k: _load(array, k)  # type: ignore[call-arg]


@typed(put_lanes)
def _put_lanes(array: Any, k: Any, values: Any) -> Any:
    return lambda array, k, values: _store(array, k, values)  # type: ignore[call-arg]


@typed(no_lanes)
def _no_lanes(array: Any) -> Any:
    return lambda array: _zeros(array)  # type: ignore[call-arg]


@typed(fused)
def _fused(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: _fuse(a, b, c)  # type: ignore[call-arg]


@typed(square_root)
def _square_root(a: Any) -> Any:
    return lambda a: _root(a)  # type: ignore[call-arg]


@typed(positive)
def _positive(a: Any) -> Any:
    return lambda a: _positive_part(a)  # type: ignore[call-arg]


@typed(inverse)
def _inverse(a: Any) -> Any:
    return lambda a: _reciprocal(a)  # type: ignore[call-arg]


@typed(totals)
def _totals(sums: Any) -> Any:
    return lambda sums: _sums(sums)  # type: ignore[call-arg]
