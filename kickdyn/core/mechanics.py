"""Gravity, rotations, and three-vectors as Python's floats, for which numpy takes much longer.

For stacks of vectors there is `np.cross`, for the matrix of a cross product `pin.skew`.
"""

import math
from collections.abc import Callable, Iterable

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


def rotation_between(a: Array, b: Array) -> Array:
    """Return the rotation by the least angle that turns one direction into another, `(3, 3)`.

    Vectors of any length but 0, shape `(3,)`. Of opposite ones, the axis is any that is
    perpendicular. Where they are nearly opposite, 1 + a . b has few digits left (with which Eigen's
    `FromTwoVectors` computes): a is turned by half a turn first, about the same axis.
    """
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    half_turn = np.eye(3)
    if a @ b < 0.0:
        total = a + b  # exact where they are nearly opposite
        axis = cross(a, total)
        if math.hypot(*axis) <= 0.5 * math.hypot(*total):  # nothing but rounding
            axis = cross(a, np.eye(3)[np.argmin(np.abs(a))])
        axis /= math.hypot(*axis)
        half_turn, a = 2.0 * np.outer(axis, axis) - np.eye(3), -a
    x, y, z = cross3(a, b)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray((np.eye(3) + skew + skew @ skew / (1.0 + a @ b)) @ half_turn)


WEIGHTS = (1.0, -2), (-8.0, -1), (8.0, 1), (-1.0, 2)
"""Weights of the values, and at how many steps from the middle they are."""


def difference_slopes(function: Callable[[Array], Array], sizes: Array, count: int) -> Array:
    r"""Return derivatives by :math:`(f_{-2} - 8 f_{-1} + 8 f_1 - f_2) / 12 h`, `(n, m, count)`.

    The function of changes of n rows of arguments, `(n, count)`, returns n rows of m values. Each
    row has a step h, of `sizes`.
    """
    columns = []
    for k in range(count):
        total = np.zeros(1)
        for weight, steps in WEIGHTS:
            change = np.zeros((len(sizes), count))
            change[:, k] = steps * sizes
            total = total + weight / (12.0 * sizes)[:, None] * function(change)
        columns.append(total)
    return np.stack(columns, axis=2)
