# mypy: allow-untyped-calls
"""Batches: `BATCH` numbers that compiled code computes with one instruction of the processor.

Compilers make vector instructions of a loop only where they can prove that its arrays do not
overlap. A batch needs no proof: ``+ - * /``, comparisons, ``math.sqrt``, ``math.fabs``, ``min`` and
``max`` act on each of its numbers as they do on a float, and a float beside a batch stands for
`BATCH` equal ones. Products and sums are rounded separately, so that the results are the same on
every processor. `batches` reads arrays in this way; `choose` and `any_of` take the place of ``if``.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, builtin_registry, signature
from numba.extending import intrinsic, register_model
from numba.np.arrayobj import populate_array

BATCH = 32
"""Numbers in a batch, a power of two; so many that addresses and branches cost little beside."""

_FLOATS = ir.VectorType(ir.DoubleType(), BATCH)
_BITS = ir.VectorType(ir.IntType(1), BATCH)
_intrinsic: Any = intrinsic


class _Batch(types.Type):
    """The type of `BATCH` floats."""

    def __init__(self) -> None:
        super().__init__("Batch")

    def can_convert_from(self, typing_context: Any, other: Any) -> Any:
        """Return that a float becomes a batch of equal numbers where one is needed."""
        return Conversion.safe if isinstance(other, types.Float) else None


class _Mask(types.Type):
    """The type of `BATCH` answers, yes or no."""

    def __init__(self) -> None:
        super().__init__("Mask")


_batch, _mask = _Batch(), _Mask()


def _represent(kind: Any, vector: Any) -> None:
    """Tell numba which vector of LLVM a type is."""

    class Model(PrimitiveModel):
        """A value that LLVM knows by itself."""

        def __init__(self, manager: Any, own_type: Any) -> None:
            super().__init__(manager, own_type, vector)

    register_model(kind)(Model)


_represent(_Batch, _FLOATS)
_represent(_Mask, _BITS)


def _spread(builder: Any, value: Any) -> Any:
    """Return a vector: the value itself, or as many equal ones of a scalar."""
    if isinstance(value.type, ir.VectorType):
        return value
    kind = ir.VectorType(value.type, BATCH)
    first = builder.insert_element(
        ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
    )
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), BATCH), [0] * BATCH)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), zeros)


def _define(
    function: Any, scalar: Any, vector: Any, result: Any, generate: Any, count: int
) -> None:
    """Define a function of `count` vectors, of which all but one may be scalars."""

    class Template(AbstractTemplate):
        """Finds the type of a call's result."""

        key = function

        def generic(self, given: Any, keywords: Any) -> Any:
            """Return the signature, or None where the call is not of this kind."""
            known = all(each is vector or isinstance(each, scalar) for each in given)
            return signature(result, *given) if known and vector in given else None

    def lower(context: Any, builder: Any, called: Any, given: Any) -> Any:
        """Return the result in LLVM's language."""
        return generate(builder, *(_spread(builder, each) for each in given))

    builtin_registry.register_global(function)(Template)
    for at in range(2**count - 1):
        kinds = [scalar if at >> k & 1 else vector for k in range(count)]
        lower_builtin(function, *kinds)(lower)


def _called(name: str) -> Callable[..., Any]:
    """Return the generator of an instruction that LLVM has as a function."""

    def generate(builder: Any, *given: Any) -> Any:
        """Return the instruction's result."""
        kind = ir.FunctionType(_FLOATS, [_FLOATS] * len(given))
        found = cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{BATCH}f64")
        return builder.call(found, given)

    return generate


def _larger(first: str) -> Callable[..., Any]:
    """Return the generator of ``min`` or ``max``, which prefer their first argument as numba's."""

    def generate(builder: Any, a: Any, b: Any) -> Any:
        """Return the smaller or larger of each pair."""
        return builder.select(builder.fcmp_ordered(first, b, a), b, a)

    return generate


for _operators, _instruction in (
    ((operator.add, operator.iadd), ir.IRBuilder.fadd),
    ((operator.sub, operator.isub), ir.IRBuilder.fsub),
    ((operator.mul, operator.imul), ir.IRBuilder.fmul),
    ((operator.truediv, operator.itruediv), ir.IRBuilder.fdiv),
    ((min,), _larger("<")),
    ((max,), _larger(">")),
):
    for _operator in _operators:
        _define(_operator, types.Float, _batch, _batch, _instruction, 2)
for _operator, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="),
):  # fmt: skip
    _define(
        _operator, types.Float, _batch, _mask,
        lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b), 2,
    )  # fmt: skip
_define(operator.neg, types.Float, _batch, _batch, ir.IRBuilder.fneg, 1)
_define(math.sqrt, types.Float, _batch, _batch, _called("llvm.sqrt"), 1)
_define(math.fabs, types.Float, _batch, _batch, _called("llvm.fabs"), 1)
_define(operator.and_, types.Boolean, _mask, _mask, ir.IRBuilder.and_, 2)
_define(operator.or_, types.Boolean, _mask, _mask, ir.IRBuilder.or_, 2)


@lower_cast(types.Float, _Batch)  # type: ignore[untyped-decorator]
def _cast(context: Any, builder: Any, old: Any, new: Any, value: Any) -> Any:
    """Return a batch of equal numbers."""
    return _spread(builder, value)


@_intrinsic  # type: ignore[untyped-decorator]
def spread(typing_context: Any, x: Any) -> Any:
    """Return a batch of equal numbers."""

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        """Return the vector."""
        return _spread(builder, given[0])

    return _batch(numba.float64), generate


@_intrinsic  # type: ignore[untyped-decorator]
def choose(typing_context: Any, mask: Any, a: Any, b: Any) -> Any:
    """Return a batch with the numbers of `a` where the mask is true, and those of `b` elsewhere."""

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        """Return the selection."""
        return builder.select(*(_spread(builder, each) for each in given))

    return _batch(mask, a, b), generate


@_intrinsic  # type: ignore[untyped-decorator]
def any_of(typing_context: Any, mask: Any) -> Any:
    """Return whether a mask is true anywhere."""

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        """Return the comparison of all bits with 0."""
        bits = builder.bitcast(given[0], ir.IntType(BATCH))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return numba.boolean(_mask), generate


@_intrinsic  # type: ignore[untyped-decorator]
def batches(typing_context: Any, array: Any) -> Any:
    """Return an array whose last axis has `BATCH` floats as an array of batches, without a copy."""
    found = types.Array(_batch, array.ndim - 1, "C", aligned=False)

    def generate(context: Any, builder: Any, called: Any, given: Any) -> Any:
        """Return the description of the same memory."""
        old = context.make_array(array)(context, builder, given[0])
        new = context.make_array(found)(context, builder)
        populate_array(
            new,
            data=builder.bitcast(old.data, new.data.type),
            shape=cgutils.unpack_tuple(builder, old.shape)[:-1],
            strides=cgutils.unpack_tuple(builder, old.strides)[:-1],
            itemsize=context.get_constant(types.intp, 8 * BATCH),
            meminfo=None,
        )
        return new._getvalue()

    return found(array), generate
