"""The Runge-Kutta method DOP853 (Hairer, Norsett & Wanner): its weights, and steps of scipy's."""

import numpy as np
from scipy.integrate import DOP853

from kickdyn.core.lanes import inlined

STAGES = DOP853.n_stages
"""Evaluations of a step. Row 0 of the rates is of its beginning, row `STAGES` of its end."""

TABLE = np.vstack([DOP853.A, DOP853.B, DOP853.E5[:-1], DOP853.E3[:-1]])
"""Weights of the rates in stage i, in the step itself, and in two error estimates."""

COUNT = np.count_nonzero(TABLE, axis=1)
"""How many rates stage i is a weighted sum of; then the step itself, and two error estimates."""

WHICH_RATE = np.zeros((len(TABLE), STAGES + 4), np.int64)
"""Which rates these are, the first ones of each row; some zeros follow."""

WEIGHT = np.zeros(WHICH_RATE.shape)
"""Their weights, none of them 0."""

for _k, _row in enumerate(TABLE):
    _used = np.flatnonzero(_row)
    WHICH_RATE[_k, : len(_used)], WEIGHT[_k, : len(_used)] = _used, _row[_used]

EVENT_MARGIN = 0.03
"""Fraction of a step, at its end, in which an event must lie for its interpolant to be read there:
its error falls with the square of that fraction."""


@inlined
def first_step(size: float, change: float, longest: float) -> float:
    r"""Return the length of the first step [s], :math:`(0.01 / d_0)^{1/8}\, d_0 / d_1`.

    The norms d of state and rate are relative to the tolerances. It is the step of Hairer, Norsett
    & Wanner, Solving Ordinary Differential Equations I, II.4, in any unit of time.
    """
    size = max(size, 1.0)
    return min(size / change * (0.01 / size) ** 0.125, longest) if change > 0.0 else longest
