"""Rotations, slopes by differences, and the weights of scipy's DOP853."""

import numpy as np
import pytest
from scipy.integrate import DOP853
from tolerances import agrees, closed_form

from kickdyn.core.dop853 import COUNT, EXTRA, INTERPOLANT, TABLE, WEIGHT, WHICH_RATE
from kickdyn.core.mechanics import difference_slopes, rotation_between


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("apart", [0.0, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
def test_the_least_rotation_turns_one_direction_into_another(apart, sign):
    """Also of nearly equal and nearly opposite ones; its trace is 1 + 2 cos of the angle."""
    a, off = np.random.default_rng(0).normal(size=(2, 3))
    b = 0.3 * (sign * a + apart * off)
    turn, a, b = rotation_between(a, b), a / np.linalg.norm(a), b / np.linalg.norm(b)
    agrees(turn @ a, b, closed_form())
    agrees(turn @ turn.T, np.eye(3), closed_form())
    assert np.trace(turn) == pytest.approx(1.0 + 2.0 * a @ b, abs=closed_form())


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


def test_the_weights_are_scipys():
    rows = np.vstack([DOP853.A, DOP853.B, DOP853.E5[:-1], DOP853.E3[:-1]])
    np.testing.assert_array_equal(TABLE, rows)
    np.testing.assert_array_equal(EXTRA, DOP853.A_EXTRA)
    np.testing.assert_array_equal(INTERPOLANT, DOP853.D)
    for row, which, weights, count in zip(rows, WHICH_RATE, WEIGHT, COUNT, strict=True):
        np.testing.assert_array_equal(row[which[:count]], weights[:count])
        assert np.count_nonzero(row) == np.count_nonzero(weights) == count
