"""The least use of the joints' speed limits: `sweep_kick.least_speed_use`, many postures at once.

The candidates y of the dual linear programme are tried one after the other. The foot's velocity is
along the normal, so that w y is its speed times the last entry of y.
"""

import math

from kickdyn.core.lanes import LANES
from kickdyn.sweeps.impact_kernel import njit
from kickdyn.sweeps.kernel_model import LIMIT
from kickdyn.sweeps.sweep_kick import ROUNDING, UNLIMITED

PARALLEL, ASKEW = ROUNDING**2, 1e-8
"""Squared sine of two columns up to which they count as parallel, and from which on their cross
product has digits enough; between them a posture is doubtful."""


@njit
def least_speed_use(carries, rows, constants, speed, y, taken, use, doubt):  # type: ignore[no-untyped-def]
    """Fill in the least possible value of the largest joint speed over its limit.

    `y` and `taken` are memory to work in, of a row for each axis and of one row.
    """
    n, flat = len(carries), rows.shape[1] == 2 * LANES
    movers, bound, least = 0, 0, math.inf
    for k in range(1, n):
        most = constants[k, LIMIT]
        movers += 1 if carries[k] and most > 0.0 else 0
        bound += 1 if carries[k] and most <= UNLIMITED else 0
        least = min(least, most) if carries[k] and most > 0.0 else least
    for i in range(LANES):
        use[i] = 0.0
    for j in range(1, n):
        if not carries[j] or bound == 0:
            continue
        a = rows[j]
        if flat:
            for i in range(LANES):
                y[i], y[LANES + i] = -a[LANES + i], a[i]
            _raise_to_candidate(carries, rows, constants, speed, least, y, taken, use)
            continue
        for k in range(j + 1, n):
            if not carries[k]:
                continue
            b = rows[k]
            for i in range(LANES):
                a1, a2, a3 = a[i], a[LANES + i], a[2 * LANES + i]
                b1, b2, b3 = b[i], b[LANES + i], b[2 * LANES + i]
                y1, y2, y3 = a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1
                whole = (a1 * a1 + a2 * a2 + a3 * a3) * (b1 * b1 + b2 * b2 + b3 * b3)
                apart = (y1 * y1 + y2 * y2 + y3 * y3) / whole
                doubt[i] = 1.0 if PARALLEL < apart < ASKEW else doubt[i]
                sound = 1.0 if apart >= ASKEW else 0.0
                y[i], y[LANES + i], y[2 * LANES + i] = sound * y1, sound * y2, sound * y3
            _raise_to_candidate(carries, rows, constants, speed, least, y, taken, use)
    for i in range(LANES):  # from 1e9 on, the foot can hardly move so
        doubt[i] = doubt[i] if use[i] < 1e9 and movers >= (2 if flat else 3) else 1.0


@njit
def _raise_to_candidate(carries, rows, constants, speed, least, y, taken, use):  # type: ignore[no-untyped-def]
    r"""Raise `use` to the value of a candidate, :math:`w \cdot y / \sum_i l_i |a_i \cdot y|`."""
    last = rows.shape[1] - LANES
    for i in range(LANES):
        taken[i] = 0.0
    for k in range(1, len(carries)):
        most, row = constants[k, LIMIT], rows[k]
        if not carries[k] or most == 0.0:
            continue
        if most > 1e3 * least:  # its product with a rounding error may count beside other joints
            share = most if most <= UNLIMITED else math.inf
            for i in range(LANES):
                along, own, other = 0.0, 0.0, 0.0
                for c in range(i, last + i + 1, LANES):
                    along += row[c] * y[c]
                    own, other = own + row[c] * row[c], other + y[c] * y[c]
                along = math.fabs(along)
                taken[i] += share * along if along > ROUNDING * math.sqrt(own * other) else 0.0
        elif last == LANES:
            for i in range(LANES):
                along = row[i] * y[i] + row[LANES + i] * y[LANES + i]
                taken[i] += most * math.fabs(along)
        else:
            for i in range(LANES):
                along = row[i] * y[i] + row[LANES + i] * y[LANES + i]
                taken[i] += most * math.fabs(along + row[2 * LANES + i] * y[2 * LANES + i])
    for i in range(LANES):
        gain = speed * math.fabs(y[last + i])
        use[i] = max(use[i], gain / taken[i] if gain > 0.0 else 0.0)
