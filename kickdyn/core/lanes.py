"""Machine code that computes several things of one kind with one instruction of the processor.

A matrix lies flat in memory, one row of `LANES` numbers after the other, so that loops over a row
become vector instructions.
"""

import math
import types
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba.extending import intrinsic

LANES = 24
"""How many flights or postures are computed side by side."""

HOW: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
"""Options of numba: a division by zero gives a number that is not finite, which spoils one lane and
stops none; a product and a sum may be one instruction."""

WITHIN: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options for what machine code calls, and Python must not: a tenth less to compile."""

inlined: Any = numba.njit(**HOW, **WITHIN, forceinline=True)  # a call would break up vectors
_intrinsic: Any = intrinsic

_INTEGER = 1.5 * 2.0**52
"""A number this large has no digits behind the point: adding it rounds, to the nearest."""
_LN2_HIGH, _LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10


@_intrinsic  # type: ignore[untyped-decorator]
def _bits(typing_context: Any, x: Any) -> Any:
    """Return the bits of a float as an integer."""
    return numba.int64(numba.float64), _reread(ir.IntType(64))


@_intrinsic  # type: ignore[untyped-decorator]
def _number(typing_context: Any, x: Any) -> Any:
    """Return the float of some bits."""
    return numba.float64(numba.int64), _reread(ir.DoubleType())


def _reread(kind: Any) -> Callable[..., Any]:
    """Return the generator of code that takes the bits of its argument for another kind."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Return the bits of the argument as another type."""
        return builder.bitcast(arguments[0], kind)

    return generate


@inlined  # type: ignore[untyped-decorator]
def exp(x: float) -> float:
    """Return e to the x without branches, within 3e-16; 0 below -708, inf above 709."""
    within = min(max(x, -708.0), 709.0)
    shifted = within * 1.4426950408889634 + _INTEGER
    count = shifted - _INTEGER
    r = (within - count * _LN2_HIGH) - count * _LN2_LOW  # |r| < 0.35: Taylor's series
    p = 1 / 479001600 + r * (1 / 6227020800)
    p = 1 / 3628800 + r * (1 / 39916800 + r * p)
    p = 1 / 40320 + r * (1 / 362880 + r * p)
    p = 1 / 720 + r * (1 / 5040 + r * p)
    p = 1 / 24 + r * (1 / 120 + r * p)
    p = 1 / 2 + r * (1 / 6 + r * p)
    p = (1 + r * (1 + r * p)) * _number((_bits(shifted) + 1023) << 52)
    p = p if x >= -708.0 else 0.0
    p = p if x <= 709.0 else math.inf
    return p if x == x else x


mathematics = types.ModuleType("math")
"""The module `math` with an `exp` for vectors; all else it has calls the C library."""

mathematics.__dict__.update({**vars(math), "exp": exp})
