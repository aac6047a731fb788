"""Many numbers at once: numpy arrays in Python, vectors of the processor in machine code.

Code of this kind is written once. Python runs it as it is, on arrays with a number for each row,
which needs no compilation; `kickdyn.core.simd` says how numba compiles it, for batches of `BATCH`
rows. It uses ``+ - * /``, comparisons, ``&`` and ``|``, and the functions below; it must not
change an array in place that it has read before, because Python's arrays share their memory.
`jitable` marks its functions.
"""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

BATCH = 8
"""Numbers in a batch, a power of two: of 4, 8 and 16 the fastest for `strike_many` with AVX2."""

JITABLE: dict[Any, bool] = {}
"""Functions that machine code may call, and whether they are inlined."""


def jitable(function: Callable[..., Any]) -> Any:
    """Mark a function that machine code may call; Python calls it as it is."""
    JITABLE.setdefault(function, False)
    return function


def inlined(function: Callable[..., Any]) -> Any:
    """Mark a function that machine code may call, and that is inlined there."""
    JITABLE[function] = True
    return function


def spread(x: Any) -> Any:
    """Return a batch of equal numbers."""
    return x


def choose(mask: Any, a: Any, b: Any) -> Any:
    """Return a batch with the numbers of `a` where the mask is true, and of `b` elsewhere."""
    return np.where(mask, a, b)


def larger(a: Any, b: Any) -> Any:
    """Return the larger number of each pair; `a` if they are equal or one is nan."""
    return np.where(np.greater(b, a), b, a)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller number of each pair; `a` if they are equal or one is nan."""
    return np.where(np.less(b, a), b, a)


def square_root(x: Any) -> Any:
    """Return the square root of each number."""
    return np.sqrt(x)


def magnitude(x: Any) -> Any:
    """Return the absolute value of each number."""
    return np.abs(x)


def batches(array: Any) -> Any:
    """Return an array of batches in the same memory.

    The last axis of the array, or of every field of its records, has `BATCH` floats.
    """
    return array


def aligned_zeros(shape: tuple[int, ...], dtype: DTypeLike = float) -> NDArray[Any]:
    """Return zeros in memory that begins at a multiple of the size of a batch.

    The last axis, or each field of a record, has `BATCH` floats. The kernel of `kickdyn.sweeps`
    takes 1.3 times as long with memory that begins elsewhere.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    memory = np.zeros(size + 8 * BATCH, np.uint8)
    begin = -memory.ctypes.data % 8 * BATCH
    return memory[begin : begin + size].view(dtype).reshape(shape)


_INTEGER = 1.5 * 2.0**52
"""A number this large has no digits behind the point: adding it rounds, to the nearest."""
_HALF_PI_HIGH, _HALF_PI_LOW = 1.57079632673412561417e00, 6.07710050650619224932e-11

LARGEST_ANGLE = 1e5
"""Angle up to which `sine_and_cosine` is within 3e-16 [rad]."""


@inlined
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
    turned = magnitude(quarter)
    odd, opposite = turned == 1.0, turned == 2.0
    sign = choose(opposite | (quarter == -1.0), -1.0, spread(1.0))
    other_sign = choose(opposite | (quarter == 1.0), -1.0, spread(1.0))
    return sign * choose(odd, cosine, sine), other_sign * choose(odd, sine, cosine)


def namespaces(records: NDArray[Any]) -> list[SimpleNamespace]:
    """Return structured records as Python's objects, whose attributes are the fields."""
    names = records.dtype.names or ()
    return [SimpleNamespace(**{name: record[name] for name in names}) for record in records]


def blank_records(dtype: np.dtype[Any], count: int, rows: int) -> list[SimpleNamespace]:
    """Return objects with the fields of a dtype, arrays of zeros for `rows` in place of `BATCH`."""
    shapes = {name: dtype[name].shape[:-1] for name in dtype.names or ()}
    return [
        SimpleNamespace(**{name: np.zeros((*shape, rows)) for name, shape in shapes.items()})
        for _ in range(count)
    ]
