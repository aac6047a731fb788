# mypy: allow-untyped-calls
"""Batches: `BATCH` numbers that compiled code computes with one instruction of the processor.

A compiler makes vector instructions of a loop only where it can prove that its arrays do not
overlap; plain loops in numba take 4.7 times as long for the kinematics of `kickdyn.sweeps`.
A batch needs no proof: ``+ - * /``, comparisons, ``math.sqrt``, ``math.fabs``, ``min`` and ``max``
act on each of its numbers as on a float, and a float beside a batch stands for `BATCH` equal ones.
Products and sums are rounded separately, so that the results are the same on every processor.
`batches` reads arrays in this way; `choose` takes the place of ``if``.
"""

import math
import operator
from collections.abc import Callable
from itertools import product
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typeconv.castgraph import Conversion
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    register_model,
    type_callable,
)
from numba.np.arrayobj import populate_array
from numpy.typing import DTypeLike, NDArray

from kickdyn.core.compilation import WITHIN

BATCH = 16
"""Numbers in a batch, a power of two: of 8, 16 and 32 the fastest for `kickdyn.sweeps`."""

_BYTES = 8 * BATCH
_FLOATS = ir.VectorType(ir.DoubleType(), BATCH)
_BITS = ir.VectorType(ir.IntType(1), BATCH)
_intrinsic: Any = intrinsic


class _Batch(types.Type):
    """The type of `BATCH` floats."""

    bitwidth = 64 * BATCH

    def can_convert_from(self, typing_context: Any, other: Any) -> Any:
        return Conversion.safe if isinstance(other, types.Float) else None


class _Mask(types.Type):
    """The type of `BATCH` answers, yes or no."""


class _Batches(types.Record):
    """The type of a record whose fields are batches or arrays of them."""

    @property
    def dtype(self) -> Any:
        return np.dtype((np.void, self.size))


_batch, _mask = _Batch("Batch"), _Mask("Mask")
register_model(_Batch)(lambda manager, kind: models.PrimitiveModel(manager, kind, _FLOATS))
register_model(_Mask)(lambda manager, kind: models.PrimitiveModel(manager, kind, _BITS))
register_model(_Batches)(models.RecordModel)


def _spread(builder: Any, value: Any) -> Any:
    """Return a vector: the value itself, or as many equal ones of a scalar."""
    if isinstance(value.type, ir.VectorType):
        return value
    kind = ir.VectorType(value.type, BATCH)
    undefined = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), BATCH), [0] * BATCH)
    return builder.shuffle_vector(first, undefined, zeros)


def _define(function: Any, operand: Any, result: Any, generate: Any, count: int = 2) -> None:
    """Define a function of `count` operands, of which all but one may be scalars."""
    scalar = types.Float if operand is _batch else types.Boolean

    def result_of(*kinds: Any) -> Any:
        known = all(kind is operand or isinstance(kind, scalar) for kind in kinds)
        return result if known and operand in kinds else None

    def lower(context: Any, builder: Any, called: Any, given: Any) -> Any:
        return generate(builder, *(_spread(builder, value) for value in given))

    of_one, of_two = lambda a: result_of(a), lambda a, b: result_of(a, b)
    type_callable(function)(lambda context: of_one if count == 1 else of_two)
    for kinds in product((operand, scalar), repeat=count):
        if operand in kinds:
            lower_builtin(function, *kinds)(lower)


def _called(name: str) -> Callable[..., Any]:
    def generate(builder: Any, *given: Any) -> Any:
        kind = ir.FunctionType(_FLOATS, [_FLOATS] * len(given))
        function = cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{BATCH}f64")
        return builder.call(function, given)

    return generate


def _compared(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def _extreme(sign: str) -> Callable[..., Any]:
    """Return the generator of ``min`` or ``max``, which prefer their first argument as numba's."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, b, a), b, a)


for _operators, _instruction in (
    ((operator.add, operator.iadd), ir.IRBuilder.fadd),
    ((operator.sub, operator.isub), ir.IRBuilder.fsub),
    ((operator.mul, operator.imul), ir.IRBuilder.fmul),
    ((operator.truediv, operator.itruediv), ir.IRBuilder.fdiv),
    ((min,), _extreme("<")),
    ((max,), _extreme(">")),
):
    for _operator in _operators:
        _define(_operator, _batch, _batch, _instruction)
for _operator, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="),
):  # fmt: skip
    _define(_operator, _batch, _mask, _compared(_sign))
_define(operator.neg, _batch, _batch, ir.IRBuilder.fneg, count=1)
_define(math.sqrt, _batch, _batch, _called("llvm.sqrt"), count=1)
_define(math.fabs, _batch, _batch, _called("llvm.fabs"), count=1)
_define(operator.and_, _mask, _mask, ir.IRBuilder.and_)
_define(operator.or_, _mask, _mask, ir.IRBuilder.or_)


@lower_cast(types.Float, _Batch)  # type: ignore[untyped-decorator]
def _cast(context: Any, builder: Any, old: Any, new: Any, value: Any) -> Any:
    return _spread(builder, value)


@_intrinsic  # type: ignore[untyped-decorator]
def spread(typing_context: Any, x: Any) -> Any:
    """Return a batch of equal numbers."""

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        return _spread(builder, given[0])

    return _batch(numba.float64), generate


@_intrinsic  # type: ignore[untyped-decorator]
def choose(typing_context: Any, mask: Any, a: Any, b: Any) -> Any:
    """Return a batch with the numbers of `a` where the mask is true, and of `b` elsewhere."""

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        return builder.select(*(_spread(builder, value) for value in given))

    return _batch(mask, a, b), generate


@_intrinsic  # type: ignore[untyped-decorator]
def batches(typing_context: Any, array: Any) -> Any:
    """Return an array of batches in the same memory.

    The last axis of the array, or of every field of its records, has `BATCH` floats.
    """
    records = isinstance(array.dtype, types.Record)
    kind = _record_of_batches(array.dtype) if records else _batch
    ndim = array.ndim if records else array.ndim - 1
    result = types.Array(kind, ndim, "C", aligned=False)

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        old = context.make_array(array)(context, builder, given[0])
        new = context.make_array(result)(context, builder)
        size = array.dtype.size if records else _BYTES
        populate_array(
            new,
            data=builder.bitcast(old.data, new.data.type),
            shape=cgutils.unpack_tuple(builder, old.shape)[:ndim],
            strides=cgutils.unpack_tuple(builder, old.strides)[:ndim],
            itemsize=context.get_constant(types.intp, size),
            meminfo=None,
        )
        return new._getvalue()

    return result(array), generate


def _record_of_batches(record: Any) -> Any:
    fields: Any = []
    for name, field in record.fields.items():
        *shape, _ = field.type.shape
        kind: Any = _batch
        if shape:
            kind = types.NestedArray(_batch, tuple(shape))
            kind.aligned = False
        fields.append((name, {"type": kind, "offset": field.offset}))
    return _Batches(fields, record.size, aligned=False)


def aligned_zeros(shape: tuple[int, ...], dtype: DTypeLike = float) -> NDArray[Any]:
    """Return zeros in memory that begins at a multiple of the size of a batch.

    The last axis, or each field of a record, has `BATCH` floats. The kernel of `kickdyn.sweeps`
    takes 1.3 times as long with memory that begins elsewhere.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    memory = np.zeros(size + _BYTES, np.uint8)
    begin = -memory.ctypes.data % _BYTES
    return memory[begin : begin + size].view(dtype).reshape(shape)


_INTEGER = 1.5 * 2.0**52
"""A number this large has no digits behind the point: adding it rounds, to the nearest."""
_HALF_PI_HIGH, _HALF_PI_LOW = 1.57079632673412561417e00, 6.07710050650619224932e-11

LARGEST_ANGLE = 1e5
"""Angle up to which `sine_and_cosine` is within 3e-16 [rad]."""


@numba.njit(error_model="numpy", forceinline=True, **WITHIN)  # type: ignore[untyped-decorator]
def sine_and_cosine(x: Any) -> Any:
    """Return sine and cosine of a batch of angles, by the polynomials of fdlibm's `sin`, `cos`."""
    count = (x * (2.0 / math.pi) + _INTEGER) - _INTEGER
    r = (x - count * _HALF_PI_HIGH) - count * _HALF_PI_LOW
    z = r * r
    p = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    p = -1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * p)
    sine = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * p))
    p = 2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
    p = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * p)
    p = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * p)
    cosine = 1.0 - (0.5 * z - z * z * p)
    quarter = count - 4.0 * ((0.25 * count + _INTEGER) - _INTEGER)  # -2 to 2
    turned = math.fabs(quarter)
    odd, opposite = turned == 1.0, turned == 2.0
    sign = choose(opposite | (quarter == -1.0), -1.0, spread(1.0))
    other_sign = choose(opposite | (quarter == 1.0), -1.0, spread(1.0))
    return sign * choose(odd, cosine, sine), other_sign * choose(odd, sine, cosine)
