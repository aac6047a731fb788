import numpy as np
import pytest
from tolerances import closed_form

from kickdyn.core.differences import difference_slopes


def test_slopes_of_fourth_order_polynomials_are_exact():
    """Of rows with steps of their own, by each argument: d/dx (x^4 + x y), d/dy."""
    x, y, sizes = np.array([0.5, 2.0]), np.array([1.0, -3.0]), np.array([1e-2, 0.1])

    def values(change):
        a, b = x + change[:, 0], y + change[:, 1]
        return np.stack([a**4 + a * b, b**3, a - b], axis=1)

    slopes = difference_slopes(values, sizes, 2)
    right = np.stack([
        np.stack([4 * x**3 + y, np.zeros(2), np.ones(2)], axis=1),
        np.stack([x, 3 * y**2, -np.ones(2)], axis=1),
    ], axis=2)  # fmt: skip
    assert slopes.shape == (2, 3, 2)
    assert slopes == pytest.approx(right, rel=closed_form(100), abs=closed_form(100))
