"""Derivatives of many answers at once, by differences of fourth order."""

from collections.abc import Callable

import numpy as np

from kickdyn.core.validation import Array

WEIGHTS = (1.0, -2), (-8.0, -1), (8.0, 1), (-1.0, 2)
"""Weights of the values, and at how many steps from the middle they are."""


def difference_slopes(function: Callable[[Array], Array], sizes: Array, count: int) -> Array:
    r"""Return derivatives by :math:`(f_{-2} - 8 f_{-1} + 8 f_1 - f_2) / 12 h`, `(n, m, count)`.

    Args:
        function: of changes of n rows of arguments, shape `(n, count)`; it returns n rows of m
            values.
        sizes: step h of each row, shape `(n,)`.
        count: number of arguments.
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
