"""Rotations, slopes by differences, and the weights of scipy's DOP853."""

import numpy as np
import pytest
from scipy.integrate import DOP853
from tolerances import agrees, closed_form

from kickdyn.core.dop853 import COUNT, STAGES, WEIGHT, WHICH_RATE
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


def rates(t, y):
    return np.array([y[1], -np.sin(y[0]) + 0.1 * t])


def test_a_step_by_the_table_is_scipys():
    solver = DOP853(rates, 0.0, np.array([0.3, -0.2]), 10.0, first_step=0.2, rtol=1e-6)
    y, h = solver.y.copy(), 0.2
    k = np.zeros((STAGES + 1, 2))
    k[0] = rates(0.0, y)

    def weighted(row):
        return sum(WEIGHT[row, j] * k[WHICH_RATE[row, j]] for j in range(COUNT[row]))

    for stage in range(1, STAGES):
        k[stage] = rates(DOP853.C[stage] * h, y + h * weighted(stage))
    solver.step()
    assert solver.t == pytest.approx(0.2, rel=closed_form())
    agrees(y + h * weighted(STAGES), solver.y, closed_form())
    k[STAGES] = rates(h, solver.y)
    agrees(k, solver.K, closed_form())
    # the estimates of the error are small differences of rates: they agree on the scale of these
    rounding = closed_form() * np.abs(k).max()
    np.testing.assert_allclose(weighted(STAGES + 1), k.T @ DOP853.E5, rtol=0, atol=rounding)
    np.testing.assert_allclose(weighted(STAGES + 2), k.T @ DOP853.E3, rtol=0, atol=rounding)
