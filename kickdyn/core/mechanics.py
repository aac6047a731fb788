"""Gravity, and three-vectors as Python's floats, for which numpy takes several times as long.

For stacks of vectors there is `np.cross`, for the matrix of a cross product `pin.skew`.
"""

from collections.abc import Iterable

import numpy as np

from kickdyn.core.validation import Array

GRAVITY = 9.81
"""Acceleration along -z of the world frame [m/s2], as in Table 3 of the paper."""

Triple = tuple[float, float, float]


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors, shape `(3,)`."""
    return np.array(cross3(a.tolist(), b.tolist()))


def cross3(a: Iterable[float], b: Iterable[float]) -> Triple:
    """Return the cross product of two vectors of three floats, as a tuple."""
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def largest(array: Array) -> float:
    """Return the largest absolute entry of a short, finite array."""
    return float(max(map(abs, array.tolist())))
