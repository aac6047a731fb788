"""Flights side by side: what lets a processor compute several of them with one instruction.

A matrix of `LANES` flights lies flat in memory, one row after the other, so that loops over a row
become vector instructions.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba.extending import intrinsic

from kickdyn.flight.forces import Forces, Reynolds

LANES = 24

SIZE = 7 * LANES

X, Y, Z, U, V, W, LEFT = (row * LANES for row in range(7))
"""Rows of a state: displacement, velocity, spin over that of the launch. Rows of its rate alike."""

HEIGHT, SPIN_X, SPIN_Y, SPIN_Z, DECAYS = (row * LANES for row in range(5))
"""Rows of a scene: of the launch, the height and the spin; 1 where the spin decays, else 0."""

HOW: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
"""To compile: a division by zero gives a number that is not finite, and spoils one flight instead
of stopping them all; a product and a sum may be one instruction."""

WITHIN: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""For what machine code calls, and Python must not: a tenth less to compile."""

njit: Any = numba.njit(**HOW, **WITHIN)
inlined: Any = numba.njit(**HOW, **WITHIN, forceinline=True)  # a call would break up vectors
_intrinsic: Any = intrinsic

_vector = numba.float64[::1]
SIGNATURE: Any = numba.void(_vector, _vector, _vector)
"""Of what `side_by_side` returns, the same for every ball and air: one integrator serves all."""


def side_by_side(
    acting: Forces, straight: Forces, reynolds: Reynolds, bound: float
) -> Callable[[Any, Any, Any], None]:
    """Return a function of scene and state that fills in the rates of `LANES` states.

    Args:
        acting: the forces.
        straight: the same without branches, from the Reynolds number `bound` on.
        reynolds: that number.
        bound: 0 where `straight` and `acting` are the same.
    """

    def pull(scene: Any, state: Any, rate: Any) -> None:
        for i in range(LANES):
            left = state[LEFT + i]
            ax, ay, az, k = straight(
                scene[HEIGHT + i] + state[Z + i],
                state[U + i],
                state[V + i],
                state[W + i],
                left * scene[SPIN_X + i],
                left * scene[SPIN_Y + i],
                left * scene[SPIN_Z + i],
            )
            rate[X + i], rate[Y + i] = state[U + i], state[V + i]
            rate[Z + i], rate[U + i] = state[W + i], ax
            rate[V + i], rate[W + i] = ay, az
            rate[LEFT + i] = -k * left * scene[DECAYS + i]
        slow = 0
        for i in range(LANES):
            z = scene[HEIGHT + i] + state[Z + i]
            slow += reynolds(z, state[U + i], state[V + i], state[W + i]) < bound
        if slow == 0:
            return
        for i in range(LANES):
            z = scene[HEIGHT + i] + state[Z + i]
            u, v, w = state[U + i], state[V + i], state[W + i]
            if reynolds(z, u, v, w) >= bound:
                continue
            left = state[LEFT + i]
            ax, ay, az, k = acting(
                z, u, v, w,
                left * scene[SPIN_X + i], left * scene[SPIN_Y + i], left * scene[SPIN_Z + i],
            )  # fmt: skip
            rate[U + i], rate[V + i], rate[W + i] = ax, ay, az
            rate[LEFT + i] = -k * left * scene[DECAYS + i]

    return pull


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
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
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
