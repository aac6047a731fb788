import math

import mpmath
import numba
import numpy as np

from kickdyn.core import lanes
from kickdyn.core.lanes import mathematics


@numba.njit
def exp(x):
    return lanes.exp(x)


def test_exp_is_right_to_the_last_digits():
    for x in np.concatenate([np.linspace(-708, 709, 2001), np.linspace(-1, 1, 500), [0.0, -0.0]]):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(mpmath.mpf(exp(float(x))) / exact - 1) < 4e-16
    assert exp(0.0) == 1.0
    assert (exp(-709.0), exp(-math.inf), exp(709.5), exp(math.inf)) == (0, 0, math.inf, math.inf)
    assert math.isnan(exp(math.nan))
    assert mathematics.sin is math.sin
