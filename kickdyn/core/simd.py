# mypy: allow-untyped-calls
"""How numba compiles `kickdyn.core.lanes`: a batch is one vector of the processor.

A compiler makes vector instructions of a loop only where it can prove that its arrays do not
overlap; plain loops in numba take 4.7 times as long for the kinematics of `kickdyn.sweeps`.
A batch needs no proof: ``+ - * /``, comparisons, ``math.sqrt``, ``math.fabs``, ``min`` and ``max``
act on each of its numbers as on a float, and a float beside a batch stands for `BATCH` equal ones.
Products and sums are rounded separately, so that the results are the same on every processor.
`batches` reads arrays in this way; `choose` takes the place of ``if``. Types, casts and operators
are registered with `numba.extending`, `numba.core` and `llvmlite.ir`, which may change: without
this file, kickdyn runs the same code on numpy's arrays.
"""

import math
import operator
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.arraydecl import GetItemBuffer, SetItemBuffer
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    lower_builtin,
    lower_cast,
    models,
    register_model,
    type_callable,
)
from numba.np.arrayobj import populate_array

from kickdyn.core.lanes import (
    BATCH,
    batches,
    choose,
    larger,
    magnitude,
    smaller,
    spread,
    square_root,
)

_BYTES = 8 * BATCH
_FLOATS = ir.VectorType(ir.DoubleType(), BATCH)
_BITS = ir.VectorType(ir.IntType(1), BATCH)


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


_FIRST = {"target": "cpu"}
"""Mark of rules for the type of a result that numba asks first.

For an operator it asks up to 18 rules, most of them for lists and strings, which takes a third of
the time of a compilation if those for batches and for entries of arrays are the last.
"""
for _access, _rule in ((operator.getitem, GetItemBuffer), (operator.setitem, SetItemBuffer)):
    infer_global(_access)(type(_rule.__name__, (_rule,), {"metadata": _FIRST}))

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
    single = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), BATCH), [0] * BATCH)
    return builder.shuffle_vector(single, undefined, zeros)


_NUMBERS, _MASKS = (_Batch, types.Float), (_Mask, types.Boolean)
"""Classes of operands that are batches or masks, or scalars that are spread."""


def _define(
    function: Any, result: Any, generate: Any, *operands: tuple[Any, ...], free: bool = False
) -> None:
    """Define a function of operands of some classes; unless it is free, not all may be scalars."""

    def is_valid(*kinds: type) -> bool:
        return free or any(issubclass(kind, _Batch | _Mask) for kind in kinds)

    class Operation(AbstractTemplate):
        metadata = _FIRST

        def generic(self, given: Any, keywords: Any) -> Any:
            valid = len(given) == len(operands) and is_valid(*map(type, given))
            valid = valid and all(map(isinstance, given, operands))
            return signature(result, *given) if valid else None

    def lower(context: Any, builder: Any, called: Any, given: Any) -> Any:
        return generate(builder, *(_spread(builder, value) for value in given))

    infer_global(function)(Operation)
    for kinds in product(*operands):
        if is_valid(*kinds):
            lower_builtin(function, *kinds)(lower)


def _called(name: str) -> Callable[..., Any]:
    def generate(builder: Any, *given: Any) -> Any:
        kind = ir.FunctionType(_FLOATS, [_FLOATS] * len(given))
        function = cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{BATCH}f64")
        return builder.call(function, given)

    return generate


def _extreme(sign: str) -> Callable[..., Any]:
    """Return the generator of ``min`` or ``max``, which prefer their first argument as numba's."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, b, a), b, a)


for _operators, _instruction in (
    ((operator.add, operator.iadd), ir.IRBuilder.fadd),
    ((operator.sub, operator.isub), ir.IRBuilder.fsub),
    ((operator.mul, operator.imul), ir.IRBuilder.fmul),
    ((operator.truediv, operator.itruediv), ir.IRBuilder.fdiv),
    ((min, smaller), _extreme("<")),
    ((max, larger), _extreme(">")),
):
    for _operator in _operators:
        _define(_operator, _batch, _instruction, _NUMBERS, _NUMBERS)
for _operator, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="),
):  # fmt: skip
    _define(
        _operator, _mask,
        lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b), _NUMBERS, _NUMBERS,
    )  # fmt: skip
_define(operator.neg, _batch, ir.IRBuilder.fneg, _NUMBERS)
for _function in (math.sqrt, square_root):
    _define(_function, _batch, _called("llvm.sqrt"), _NUMBERS)
for _function in (math.fabs, magnitude):
    _define(_function, _batch, _called("llvm.fabs"), _NUMBERS)
_define(operator.and_, _mask, ir.IRBuilder.and_, _MASKS, _MASKS)
_define(operator.or_, _mask, ir.IRBuilder.or_, _MASKS, _MASKS)
_define(spread, _batch, lambda builder, x: x, _NUMBERS, free=True)
_define(choose, _batch, ir.IRBuilder.select, (_Mask,), _NUMBERS, _NUMBERS)


@lower_cast(types.Float, _Batch)  # type: ignore[untyped-decorator]
def _cast(context: Any, builder: Any, old: Any, new: Any, value: Any) -> Any:
    return _spread(builder, value)


@type_callable(batches)
def _type_of_batches(context: Any) -> Any:
    def result_of(array: Any) -> Any:
        records = isinstance(array.dtype, types.Record)
        kind = _record_of_batches(array.dtype) if records else _batch
        ndim = array.ndim if records else array.ndim - 1
        return types.Array(kind, ndim, "C", aligned=False)

    return result_of


@lower_builtin(batches, types.Array)  # type: ignore[untyped-decorator]
def _read_batches(context: Any, builder: Any, called: Any, given: Any) -> Any:
    array, result = called.args[0], called.return_type
    old = context.make_array(array)(context, builder, given[0])
    new = context.make_array(result)(context, builder)
    size = array.dtype.size if isinstance(array.dtype, types.Record) else _BYTES
    populate_array(
        new,
        data=builder.bitcast(old.data, new.data.type),
        shape=cgutils.unpack_tuple(builder, old.shape)[: result.ndim],
        strides=cgutils.unpack_tuple(builder, old.strides)[: result.ndim],
        itemsize=context.get_constant(types.intp, size),
        meminfo=None,
    )
    return new._getvalue()


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
