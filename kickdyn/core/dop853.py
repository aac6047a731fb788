"""The Runge-Kutta method DOP853 (Hairer, Norsett & Wanner), as machine code reads its weights."""

import numpy as np
from scipy.integrate import DOP853

STAGES = DOP853.n_stages
"""Evaluations of a step. Row 0 of the rates is of its beginning, row `STAGES` of its end."""

_TABLE = np.vstack([DOP853.A, DOP853.B, DOP853.E5[:-1], DOP853.E3[:-1]])

COUNT = np.count_nonzero(_TABLE, axis=1)
"""How many rates stage i is a weighted sum of; then the step itself, and two error estimates."""

WHICH_RATE = np.zeros((len(_TABLE), STAGES + 4), np.int64)
"""Which rates these are, the first ones of each row; some zeros follow."""

WEIGHT = np.zeros(WHICH_RATE.shape)
"""Their weights, none of them 0."""

for _k, _row in enumerate(_TABLE):
    _used = np.flatnonzero(_row)
    WHICH_RATE[_k, : len(_used)], WEIGHT[_k, : len(_used)] = _used, _row[_used]
