"""Numba's type of lanes, and the vector instructions that they compile to; `pbd.fluid.lanes` says what they are."""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

from pbd.jit import DEVICE_OPTIONS

WIDTH = 64
"""Bytes."""


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
        return (lambda a, b: apply(a, b)) if _kind_of(a, b) else None  # type: ignore[call-arg]

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
def load(typing_context, array, k):
    """array_k and what follows it."""
    kind = Lanes(array.dtype)

    def generate(context, builder, signature, arguments):
        pointer, size = _pointer(context, builder, signature, arguments)
        return builder.load(pointer, align=size, typ=_vector(kind))

    return kind(array, types.intp), generate


@intrinsic
def store(typing_context, array, k, values):
    """The counterpart of `load`."""

    def generate(context, builder, signature, arguments):
        pointer, size = _pointer(context, builder, signature, arguments)
        value = _widened(context, builder, arguments[2], signature.args[2], Lanes(array.dtype))
        builder.store(value, pointer, align=size)
        return context.get_dummy_value()

    return types.none(array, types.intp, values), generate


@intrinsic
def zeros(typing_context, array):
    """Lanes of 0."""
    kind = Lanes(array.dtype)

    def generate(context, builder, signature, arguments):
        return ir.Constant(_vector(kind), [0.0] * kind.count)

    return kind(array), generate


@intrinsic
def fuse(typing_context, a, b, c):
    """a b + c."""
    kind = _kind_of(a, b, c)

    def generate(context, builder, signature, arguments):
        wide = [_widened(context, builder, v, t, kind) for v, t in zip(arguments, signature.args)]
        return builder.call(_library(builder, "fmuladd", kind, 3), wide)

    return kind(a, b, c), generate


@intrinsic
def root(typing_context, a):
    """Square roots."""

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
def positive_part(typing_context, a):
    """max(a, 0)."""

    def generate(context, builder, signature, arguments):
        zeros = ir.Constant(_vector(a), [0.0] * a.count)
        return builder.select(builder.fcmp_ordered(">", arguments[0], zeros), arguments[0], zeros)

    return a(a), generate


@intrinsic
def reciprocal(typing_context, a):
    """1/a."""

    def generate(context, builder, signature, arguments):
        return builder.fdiv(ir.Constant(_vector(a), [1.0] * a.count), arguments[0])

    return a(a), generate


@intrinsic
def sums_of(typing_context, parts):
    """The sums of the lanes of each of a tuple."""
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
