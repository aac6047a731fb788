"""The sparse table of weights makes the steps of scipy's DOP853."""

import numpy as np
import pytest
from scipy.integrate import DOP853
from tolerances import agrees, closed_form

from kickdyn.core.dop853 import COUNT, STAGES, WEIGHT, WHICH_RATE


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
