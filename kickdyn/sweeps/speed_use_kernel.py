"""The least use of the joints' speed limits: `sweep_kick.least_speed_use`, many postures at once.

The candidates y of the dual linear programme are tried one after the other. The foot's velocity is
along the normal, so that w y is its speed times the last entry of y.
"""

import math

from kickdyn.core.simd import choose, spread
from kickdyn.sweeps.impact_kernel import njit
from kickdyn.sweeps.kernel_model import LIMIT
from kickdyn.sweeps.sweep_kick import ROUNDING, UNLIMITED

PARALLEL, ASKEW = ROUNDING**2, 1e-8
"""Squared sine of two columns up to which they count as parallel, and from which on their cross
product has digits enough; between them a posture is doubtful."""


@njit
def least_speed_use(carries, rows, constants, speed, use, doubt):  # type: ignore[no-untyped-def]
    """Fill in the least possible value of the largest joint speed over its limit."""
    n, flat = len(carries), rows.shape[1] == 2
    movers, bound, least = 0, 0, math.inf
    for k in range(1, n):
        most = constants[k, LIMIT]
        movers += 1 if carries[k] and most > 0.0 else 0
        bound += 1 if carries[k] and most <= UNLIMITED else 0
        least = min(least, most) if carries[k] and most > 0.0 else least
    use[0] = 0.0
    for j in range(1, n):
        if not carries[j] or bound == 0:
            continue
        a1, a2, a3 = rows[j, 0], rows[j, 1], rows[j, rows.shape[1] - 1]
        if flat:
            _raise_to_candidate(carries, rows, constants, speed, least, -a2, a1, a1, use)
            continue
        for k in range(j + 1, n):
            if not carries[k]:
                continue
            b1, b2, b3 = rows[k, 0], rows[k, 1], rows[k, 2]
            y1, y2, y3 = a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1
            whole = (a1 * a1 + a2 * a2 + a3 * a3) * (b1 * b1 + b2 * b2 + b3 * b3)
            apart = (y1 * y1 + y2 * y2 + y3 * y3) / whole
            doubt[0] = choose((apart > PARALLEL) & (apart < ASKEW), 1.0, doubt[0])
            sound = choose(apart >= ASKEW, 1.0, 0.0)
            y1, y2, y3 = sound * y1, sound * y2, sound * y3
            _raise_to_candidate(carries, rows, constants, speed, least, y1, y2, y3, use)
    if movers < (2 if flat else 3):
        doubt[0] = 1.0
    doubt[0] = choose(use[0] < 1e9, doubt[0], 1.0)  # from there on, the foot can hardly move so


@njit
def _raise_to_candidate(carries, rows, constants, speed, least, y1, y2, y3, use):  # type: ignore[no-untyped-def]
    r"""Raise `use` to the value of a candidate, :math:`w \cdot y / \sum_i l_i |a_i \cdot y|`.

    In a plane, the candidate has two components, and `y3` is not read.
    """
    flat, taken = rows.shape[1] == 2, spread(0.0)
    for k in range(1, len(carries)):
        most = constants[k, LIMIT]
        if not carries[k] or most == 0.0:
            continue
        a1, a2 = rows[k, 0], rows[k, 1]
        along = a1 * y1 + a2 * y2
        if not flat:
            along = along + rows[k, 2] * y3
        along = math.fabs(along)
        if most > 1e3 * least:  # its product with a rounding error may count beside other joints
            own, other = a1 * a1 + a2 * a2, y1 * y1 + y2 * y2
            if not flat:
                own, other = own + rows[k, 2] * rows[k, 2], other + y3 * y3
            share = most if most <= UNLIMITED else math.inf
            sound = along > ROUNDING * math.sqrt(own * other)
            taken += choose(sound, share * along, 0.0)
        else:
            taken += most * along
    gain = speed * math.fabs(y2 if flat else y3)
    use[0] = max(use[0], choose(gain > 0.0, gain / taken, 0.0))
