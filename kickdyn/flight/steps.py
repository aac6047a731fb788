"""One step of DOP853 for every lane: coefficients, error estimate and first step are scipy's.

The next step is 0.7 of what the estimate allows, not 0.9: fewer are rejected, and as many
evaluations give half the error.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop853

from kickdyn.flight.lanes import DECAYS, LANES, LEFT, SIZE, U, X, njit

LANDED, ALOFT, FAILED = 0, 1, 2

STAGES = 12
"""Evaluations a step takes; the row of its last rates, while row 0 holds those before it."""

# With which weights row i of the rates is found, then the step itself, then both estimates of its
# error: without zeros, in fours, each of which is one pass through memory.
_TABLE = np.vstack([dop853.A[:STAGES, :STAGES], dop853.B, dop853.E5[:-1], dop853.E3[:-1]])
_FIFTH, _THIRD = STAGES + 1, STAGES + 2
_COUNT = np.count_nonzero(_TABLE, axis=1)
_WHICH = np.zeros((len(_TABLE), STAGES + 4), np.int64)
_WEIGHT = np.zeros(_WHICH.shape)
for _k, _row in enumerate(_TABLE):
    _used = np.flatnonzero(_row)
    _WHICH[_k, : len(_used)] = _used
    _WEIGHT[_k, : len(_used)] = _row[_used]

T, H, DROP, STATES, ERROR, GROWTH, TAKEN, NEXT, SPAN, LOW, HIGH = range(11)
"""Rows of what a lane knows of its flight: time, step; drop to the landing, number of states that
change; the step's error over what is tolerated, what factor that allows the next one, whether it is
taken; then what only `march` needs."""

KNOWN = 11
"""Their number."""


@njit
def _mix(k, rates, total):  # type: ignore[no-untyped-def]
    """Put the sum of the rates with the weights of row k of the table into `total`."""
    for n in range(0, _COUNT[k], 4):
        i, j, p, q = _WHICH[k, n], _WHICH[k, n + 1], _WHICH[k, n + 2], _WHICH[k, n + 3]
        a, b, c, d = _WEIGHT[k, n], _WEIGHT[k, n + 1], _WEIGHT[k, n + 2], _WEIGHT[k, n + 3]
        for m in range(SIZE):
            sum_of_four = (a * rates[i, m] + b * rates[j, m]) + (c * rates[p, m] + d * rates[q, m])
            total[m] = sum_of_four if n == 0 else total[m] + sum_of_four


@njit
def _add(y, h, slope, new):  # type: ignore[no-untyped-def]
    """Put `y` plus `h` times `slope` into `new`."""
    for m in range(SIZE):
        new[m] = y[m] + h[m] * slope[m]


@njit
def _spread(row, whole):  # type: ignore[no-untyped-def]
    """Put a number of each lane into all of its states' places."""
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            whole[c + i] = row[i]


@njit
def step(pull, scene, y, lane, rates, slope, h, new):  # type: ignore[no-untyped-def]
    """Take a step in every lane, from `y` with its rates to `new` with its rates."""
    _spread(lane[H], h)
    for k in range(1, STAGES + 1):
        _mix(k, rates, slope)
        _add(y, h, slope, new)
        pull(scene, new, rates[k])


@njit
def judge(y, new, rates, rtol, scale, lane, five, three):  # type: ignore[no-untyped-def]
    """Estimate the error of a step over what is tolerated, as scipy does, and the next step."""
    last = rates[STAGES]
    _mix(_FIFTH, rates, five)
    _mix(_THIRD, rates, three)
    for m in range(SIZE):
        per = 1.0 / (scale[m] + rtol * max(abs(y[m]), abs(new[m])))
        five[m] = (five[m] * per) ** 2
        three[m] = (three[m] * per) ** 2 + 0.0 * (new[m] + last[m])  # nan if not finite
    for c in range(LANES, SIZE, LANES):
        for i in range(LANES):
            five[i] += five[c + i]
            three[i] += three[c + i]
    for i in range(LANES):
        size = (five[i] + 0.01 * three[i]) * lane[STATES, i]
        error = lane[H, i] * five[i] / math.sqrt(size)
        lane[ERROR, i] = error if size != 0.0 else 0.0
        lane[GROWTH, i] = 0.7 / math.sqrt(math.sqrt(math.sqrt(lane[ERROR, i])))


@njit
def advance(y, rates, new, lane):  # type: ignore[no-untyped-def]
    """Take the step in the lanes that are marked so."""
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            m, taken = c + i, lane[TAKEN, i] != 0.0
            y[m] = new[m] if taken else y[m]
            rates[0, m] = rates[STAGES, m] if taken else rates[0, m]


@njit
def board(i, row, scenes, velocities, tol, scene, y, scale, lane):  # type: ignore[no-untyped-def]
    """Put a flight into a lane."""
    for c in range(5):
        scene[c * LANES + i] = scenes[row, c]
    for c in range(3):
        y[X + c * LANES + i] = 0.0
        y[U + c * LANES + i] = velocities[row, c]
        scale[X + c * LANES + i] = scenes[row, 7]
        scale[U + c * LANES + i] = scenes[row, 8]
    y[LEFT + i], scale[LEFT + i] = 1.0, tol
    lane[DROP, i], lane[STATES, i] = scenes[row, 5], scenes[row, 6]


@njit
def _distance(i, a, b, y, rtol, scale, without):  # type: ignore[no-untyped-def]
    """Return the length of a - b over what is tolerated, but for the last row if `without`."""
    total = 0.0
    for c in range(0, LEFT if without else SIZE, LANES):
        total += ((a[c + i] - b[c + i]) / (scale[c + i] + rtol * abs(y[c + i]))) ** 2
    return math.sqrt(total)


@njit
def starts(pull, scenes, velocities, rtol, tol, limit, rates, starts, status, evaluations):  # type: ignore[no-untyped-def]
    """Find the first rates of every flight, and scipy's guess of its first step.

    Hairer, Norsett & Wanner, II.4. A flight that cannot begin, or ends at once, is given a status.
    """
    scene, scale = np.zeros(5 * LANES), np.ones(SIZE)
    y, new, still, h = np.zeros(SIZE), np.empty(SIZE), np.zeros(SIZE), np.empty(SIZE)
    lane = np.zeros((KNOWN, LANES))
    n = len(starts)
    for first in range(0, n, LANES):
        for i in range(LANES):
            board(i, min(first + i, n - 1), scenes, velocities, tol, scene, y, scale, lane)
        pull(scene, y, rates[0])
        for i in range(LANES):
            count = math.sqrt(lane[STATES, i])
            d0 = _distance(i, y, still, y, rtol, scale, scene[DECAYS + i] == 0.0) / count
            d1 = _distance(i, rates[0], still, y, rtol, scale, False) / count
            lane[T, i] = d1
            lane[H, i] = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, limit)
        _spread(lane[H], h)
        _add(y, h, rates[0], new)
        pull(scene, new, rates[1])
        for i in range(min(LANES, n - first)):
            row, h0, d1 = first + i, lane[H, i], lane[T, i]
            d2 = _distance(i, rates[1], rates[0], y, rtol, scale, False)
            d2 /= math.sqrt(lane[STATES, i]) * h0
            steepest = max(d1, d2)
            h1 = max(1e-6, h0 * 1e-3) if steepest <= 1e-15 else (0.01 / steepest) ** 0.125
            starts[row, 7] = min(100.0 * h0, h1, limit)
            evaluations[row], status[row] = 2, ALOFT
            for c in range(7):
                starts[row, c] = rates[0, c * LANES + i]
                if not math.isfinite(starts[row, c]):
                    evaluations[row], status[row] = 1, FAILED
            climb = starts[row, 2]
            if scenes[row, 5] == 0.0 and (climb < 0.0 or (climb == 0.0 and starts[row, 5] <= 0.0)):
                evaluations[row], status[row] = 1, LANDED
