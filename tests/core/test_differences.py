import numpy as np
import pytest
from tolerances import closed_form, differenced

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


def test_the_error_falls_with_the_fourth_power_of_the_step():
    errors = [
        difference_slopes(lambda change: np.sin(1.0 + change), np.array([h]), 1).item() - np.cos(1)
        for h in (0.2, 0.1)
    ]
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.02)
    assert errors[0] == pytest.approx(-np.cos(1) * 0.2**4 / 30, rel=0.02)  # h^4 f^(5) / 30
    fine = difference_slopes(lambda change: np.sin(1.0 + change), np.array([1e-3]), 1).item()
    assert fine == pytest.approx(np.cos(1), rel=differenced(4))
