"""Many flights in machine code: scipy's DOP853 without its Python.

Coefficients and error estimate are scipy's. The next step is 0.7 of what the estimate
allows, not 0.9: fewer are rejected, and as many evaluations give half the error. Events are not
read off an interpolant: the step that crosses one is taken anew with the length that ends there, so
that a node is as accurate as the steps are. Every flight has a lane, with its own time and step;
whichever ends makes room for the next.
"""

# mypy: disable-error-code="no-untyped-def"

import math
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from scipy.integrate import DOP853

from kickdyn.core import lanes
from kickdyn.core.compilation import compiled, named
from kickdyn.core.lanes import HOW, LANES, inlined, njit
from kickdyn.flight import compiling
from kickdyn.flight.compiling import LEFT, SIGNATURE, SIZE, U, W, X, Z
from kickdyn.flight.integrate import MAX_EVALUATIONS

LANDED, ALOFT, FAILED = 0, 1, 2

STATES = 7

STAGES = DOP853.n_stages
"""Evaluations of a step. Row 0 of the rates is of its beginning, row `STAGES` of its end."""

# Weights of the rates before stage i, then of the step itself, then of both estimates of its error:
# without zeros, in fours, each of which is one pass through memory.
_TABLE = np.vstack([DOP853.A, DOP853.B, DOP853.E5[:-1], DOP853.E3[:-1]])
_FIFTH, _THIRD = STAGES + 1, STAGES + 2
_COUNT = np.count_nonzero(_TABLE, axis=1)
_WHICH = np.zeros((len(_TABLE), STAGES + 4), np.int64)
_WEIGHT = np.zeros(_WHICH.shape)
for _k, _row in enumerate(_TABLE):
    _used = np.flatnonzero(_row)
    _WHICH[_k, : len(_used)] = _used
    _WEIGHT[_k, : len(_used)] = _row[_used]

T, H, LONGEST, DROP, ERROR, GROWTH, TAKEN, NEXT, SPAN, LOW, HIGH = range(11)
"""Rows of a lane's numbers: time, step and its limit; drop to the landing; the step's error over
what is tolerated, the factor that allows for the next one, whether it is taken; the next step, the
whole step that an event lies in, and bounds of the event within it."""

_LANE_ROWS = 11

_EPS = float(np.finfo(float).eps)

_FLYING, _TO_APEX, _TO_LANDING, _IDLE = range(4)  # what a lane's step is for
_ROW, _PHASE, _REJECTED, _RISES, _CALLS = range(5)  # rows of a lane's integers


@cache
def compiled_march() -> Any:
    """Return `_march` as machine code, from the disk if it can be kept there: it takes seconds."""
    matrix = numba.float64[:, ::1]
    signature = numba.void(
        numba.types.FunctionType(SIGNATURE), matrix, matrix, *(numba.float64,) * 3,
        matrix, numba.int8[::1], numba.int64[::1],
    )  # fmt: skip
    # numba looks for changes in this file only; the others are part of the name
    sources = b"".join(Path(str(file.__file__)).read_bytes() for file in (lanes, compiling))
    name = f"march_{zlib.crc32(sources, MAX_EVALUATIONS):08x}"
    return compiled(named(_march, name), signature, "the integration of flights", **HOW)


def _march(rates_of, scenes, velocities, rtol, tol, limit, out, status, evaluations):
    """Fly every row: load flights into lanes, step all lanes at once, see where each one stands.

    A scene is height, spin (3), whether it decays, drop, absolute tolerances of displacement and of
    velocity, longest step; the velocity at the launch [m/s] has shape `(3,)`. The relative
    tolerance is `rtol`, the absolute one of the spin `tol`, the limit of time `limit` [s]. Rows of
    `out` are filled with time and 7 states at the end, then at the apex; `status` with `LANDED`,
    `ALOFT` or `FAILED`.
    """
    n = len(out)
    rates, begin = np.zeros((STAGES + 1, SIZE)), np.empty((n, 8))
    _start(rates_of, scenes, velocities, rtol, tol, limit, rates, begin, status, evaluations)
    scene, scale = np.zeros(5 * LANES), np.ones(SIZE)
    y, new, far, far_rates = np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE)
    five, three = np.zeros(SIZE), np.zeros(SIZE)
    lane, counts = np.zeros((_LANE_ROWS, LANES)), np.zeros((5, LANES), np.int64)
    counts[_PHASE] = _IDLE
    waiting, flying = 0, 0
    while True:
        for i in range(LANES):
            while counts[_PHASE, i] == _IDLE and waiting < n:
                row = waiting
                waiting += 1
                _load_flight(i, row, scenes, velocities, tol, scene, y, scale, lane)
                _write_node(i, 0.0, y, out[row])
                _write_node(i, 0.0, y, out[row, 8:])
                if status[row] != ALOFT:
                    continue
                lane[T, i] = 0.0
                for c in range(7):
                    rates[0, c * LANES + i] = begin[row, c]
                climb, lifted = begin[row, 2], begin[row, 5]
                counts[_ROW, i], counts[_CALLS, i], counts[_REJECTED, i] = row, 1, 0
                counts[_RISES, i] = climb > 0.0 or (climb == 0.0 and lifted > 0.0)
                _set_step(i, begin[row, 7], limit, lane, counts)
                flying += 1
        if flying == 0:
            break
        _step(rates_of, scene, y, lane, rates, five, three, new)
        _estimate_error(y, new, rates, rtol, scale, lane, five, three)
        for i in range(LANES):
            if counts[_PHASE, i] == _IDLE:
                continue
            row = counts[_ROW, i]
            counts[_CALLS, i] += STAGES
            lane[TAKEN, i] = 0.0
            here = (i, y, rates, new, lane, counts)
            if counts[_PHASE, i] == _FLYING:
                done = _after_step(*here, limit, far, far_rates, out[row])
            else:
                done = _after_event_step(*here, tol, limit, far, far_rates, out[row])
            if done >= 0:
                status[row], evaluations[row] = done, counts[_CALLS, i]
                counts[_PHASE, i], lane[H, i] = _IDLE, 0.0
                flying -= 1
        _accept(y, rates, new, lane)
    for row in range(n):
        if status[row] == FAILED:
            out[row] = math.nan


@njit
def _weighted_sum(k, rates, total):
    """Put the sum of the rates, weighted by row k of the table, into `total`."""
    for n in range(0, _COUNT[k], 4):
        i, j, p, q = _WHICH[k, n], _WHICH[k, n + 1], _WHICH[k, n + 2], _WHICH[k, n + 3]
        a, b, c, d = _WEIGHT[k, n], _WEIGHT[k, n + 1], _WEIGHT[k, n + 2], _WEIGHT[k, n + 3]
        for m in range(SIZE):
            sum_of_four = (a * rates[i, m] + b * rates[j, m]) + (c * rates[p, m] + d * rates[q, m])
            total[m] = sum_of_four if n == 0 else total[m] + sum_of_four


@njit
def _add_scaled(y, h, slope, new):
    """Put `y` plus `h` times `slope` into `new`."""
    for m in range(SIZE):
        new[m] = y[m] + h[m] * slope[m]


@njit
def _broadcast(row, whole):
    """Put the number of each lane into the places of all of its states."""
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            whole[c + i] = row[i]


@njit
def _step(rates_of, scene, y, lane, rates, slope, h, new):
    """Take a step in every lane, from `y` with its rates to `new` with its rates."""
    _broadcast(lane[H], h)
    for k in range(1, STAGES + 1):
        _weighted_sum(k, rates, slope)
        _add_scaled(y, h, slope, new)
        rates_of(scene, new, rates[k])


@njit
def _estimate_error(y, new, rates, rtol, scale, lane, five, three):
    r"""Estimate the error of a step over what is tolerated, and the next step, as scipy does.

    :math:`h e_5^2 / \sqrt{(e_5^2 + 0.01 e_3^2) n}`, with both estimates scaled by the tolerances.
    """
    last = rates[STAGES]
    _weighted_sum(_FIFTH, rates, five)
    _weighted_sum(_THIRD, rates, three)
    for m in range(SIZE):
        per = 1.0 / (scale[m] + rtol * max(abs(y[m]), abs(new[m])))
        five[m] = (five[m] * per) ** 2
        three[m] = (three[m] * per) ** 2 + 0.0 * (new[m] + last[m])  # nan if not finite
    for c in range(LANES, SIZE, LANES):
        for i in range(LANES):
            five[i] += five[c + i]
            three[i] += three[c + i]
    for i in range(LANES):
        size = (five[i] + 0.01 * three[i]) * STATES
        error = lane[H, i] * five[i] / math.sqrt(size)
        lane[ERROR, i] = error if size != 0.0 else 0.0
        lane[GROWTH, i] = 0.7 / math.sqrt(math.sqrt(math.sqrt(lane[ERROR, i])))


@njit
def _accept(y, rates, new, lane):
    """Take the step in the lanes where row `TAKEN` says so."""
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            m, taken = c + i, lane[TAKEN, i] != 0.0
            y[m] = new[m] if taken else y[m]
            rates[0, m] = rates[STAGES, m] if taken else rates[0, m]


@njit
def _load_flight(i, row, scenes, velocities, tol, scene, y, scale, lane):
    """Put a flight into a lane."""
    for c in range(5):
        scene[c * LANES + i] = scenes[row, c]
    for c in range(3):
        y[X + c * LANES + i] = 0.0
        y[U + c * LANES + i] = velocities[row, c]
        scale[X + c * LANES + i] = scenes[row, 6]
        scale[U + c * LANES + i] = scenes[row, 7]
    y[LEFT + i], scale[LEFT + i] = 1.0, tol
    lane[DROP, i], lane[LONGEST, i] = scenes[row, 5], scenes[row, 8]


@njit
def _scaled_norm(i, a, y, rtol, scale):
    """Return the root mean square of a lane's numbers over what is tolerated."""
    total = 0.0
    for c in range(0, SIZE, LANES):
        total += (a[c + i] / (scale[c + i] + rtol * abs(y[c + i]))) ** 2
    return math.sqrt(total / STATES)


@njit
def _start(rates_of, scenes, velocities, rtol, tol, limit, rates, starts, status, evaluations):
    """Find the first rates of every flight and its first step, as Hairer, Norsett & Wanner do.

    The steps are relative to the flight's own times, as in `integrate`. A flight that cannot begin,
    or ends at once, is given a status.
    """
    scene, scale, y = np.zeros(5 * LANES), np.ones(SIZE), np.zeros(SIZE)
    lane = np.zeros((_LANE_ROWS, LANES))
    n = len(starts)
    for first in range(0, n, LANES):
        for i in range(LANES):
            _load_flight(i, min(first + i, n - 1), scenes, velocities, tol, scene, y, scale, lane)
        rates_of(scene, y, rates[0])
        for i in range(min(LANES, n - first)):
            row = first + i
            d0 = max(_scaled_norm(i, y, y, rtol, scale), 1.0)
            d1 = _scaled_norm(i, rates[0], y, rtol, scale)
            h = d0 / d1 * (0.01 / d0) ** 0.125 if d1 > 0.0 else limit
            starts[row, 7] = min(h, limit)
            evaluations[row], status[row] = 1, ALOFT
            for c in range(7):
                starts[row, c] = rates[0, c * LANES + i]
                if not math.isfinite(starts[row, c]):
                    status[row] = FAILED
            climb = starts[row, 2]
            if scenes[row, 5] == 0.0 and (climb < 0.0 or (climb == 0.0 and starts[row, 5] <= 0.0)):
                status[row] = LANDED


@njit
def _guess_event(i, y, new, h, rates, new_rates, drop, apex, low):
    """Return about where in a step the event falls through 0, as a fraction, or -1 for nowhere.

    The height is the quintic through height, speed and acceleration at both ends.
    """
    c1, c2 = h * y[W + i], 0.5 * h * h * rates[W + i]
    d = new[Z + i] - y[Z + i] - c1 - c2
    e = h * new[W + i] - c1 - 2.0 * c2
    f = h * h * new_rates[W + i] - 2.0 * c2
    p0, p1, p2 = y[Z + i] + drop, c1, c2
    p3, p4, p5 = 10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f
    if apex:
        p0, p1, p2, p3, p4, p5 = p1, 2.0 * p2, 3.0 * p3, 4.0 * p4, 5.0 * p5, 0.0
    # An event that is zero at the start, as a level launch that lift carries up, must rise first.
    begin, part = low, 1.0
    for _ in range(60):
        if p0 + begin * (p1 + begin * (p2 + begin * (p3 + begin * (p4 + begin * p5)))) > 0.0:
            break
        part *= 0.5
        begin = low + (1.0 - low) * part
    else:
        return -1.0
    end, s = 1.0, 0.5 * (begin + 1.0)
    for _ in range(60):
        value = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        if value > 0.0:
            begin = s
        else:
            end = s
        further = s - value / slope
        if not begin < further < end:
            further = 0.5 * (begin + end)
        moved, s = abs(further - s), further
        if moved < 1e-9:
            break
    return s


@njit
def _refine_event(i, apex, new, rates, tol, lane):
    """Move a lane's step towards an event by Newton's method; return whether it ends there.

    Once the time left is so short that its third order is far below the tolerance, a parabola
    covers it: the states are then those of the event.
    """
    h, span, drop = lane[H, i], lane[SPAN, i], lane[DROP, i]
    speed, slope = new[W + i], rates[W + i]
    if apex:
        value, more = speed, -speed / slope
    else:
        value = new[Z + i] + drop
        more = -2.0 * value / (speed - math.sqrt(max(speed * speed - 2.0 * slope * value, 0.0)))
    if abs(more) <= 0.03 * math.sqrt(tol) * span:
        more = min(max(more, -h), span - h)
        for c in (X, X + LANES, Z):
            new[c + i] += more * (new[U + c + i] + 0.5 * more * rates[U + c + i])
        for c in (U, U + LANES, W, LEFT):
            new[c + i] += more * rates[c + i]
        lane[H, i] += more
        return True
    if value == 0.0 or lane[HIGH, i] - lane[LOW, i] <= 1e-15 * span:
        return True
    if value > 0.0:
        lane[LOW, i] = h
    else:
        lane[HIGH, i] = h
    h += more
    if not lane[LOW, i] < h < lane[HIGH, i]:
        h = 0.5 * (lane[LOW, i] + lane[HIGH, i])
    lane[H, i] = h
    return False


@njit
def _write_node(i, t, y, out):
    """Put a time and the states there into 8 numbers."""
    out[0] = t
    for c in range(7):
        out[1 + c] = y[c * LANES + i]


@inlined
def _set_step(i, h, limit, lane, counts):
    """Set the length of a lane's next step; return -1, or `FAILED` where no step helps."""
    t = lane[T, i]
    smallest = max(10.0 * _EPS * t, 1e-300)
    lane[H, i] = min(max(min(h, lane[LONGEST, i]), smallest), limit - t)
    counts[_PHASE, i] = _FLYING
    vain = counts[_CALLS, i] > MAX_EVALUATIONS or (counts[_REJECTED, i] == 1 and h < smallest)
    return FAILED if vain else -1


@inlined
def _advance_clock(i, end, lane, counts, limit, out):
    """Move a lane's clock to the `end` of its step; return status, -1 while the flight lasts."""
    last = lane[SPAN, i] == limit - lane[T, i]
    lane[T, i] = limit if last else lane[T, i] + lane[SPAN, i]
    counts[_REJECTED, i] = 0
    if not last:
        return _set_step(i, lane[NEXT, i], limit, lane, counts)
    if end[Z + i] > out[11]:
        _write_node(i, limit, end, out[8:])
    _write_node(i, limit, end, out)
    return ALOFT


@inlined
def _turn_to_event(i, y, rates, lane, counts, far, far_rates):
    """Set a step to the apex or landing that lies before `far`; return whether there is one."""
    drop, span, first = lane[DROP, i], lane[SPAN, i], rates[0]
    passed = counts[_PHASE, i] == _TO_APEX
    if not passed and y[W + i] >= 0.0 >= far[W + i] and y[W + i] > far[W + i]:
        counts[_RISES, i] = 0
        part = _guess_event(i, y, far, span, first, far_rates, drop, True, 0.0)
        if part >= 0.0:
            lane[LOW, i], lane[HIGH, i], lane[H, i] = 0.0, span, part * span
            counts[_PHASE, i] = _TO_APEX
            return True
    low = lane[H, i] if passed else 0.0
    above, below = y[Z + i] + drop, far[Z + i] + drop
    if counts[_RISES, i] == 0 and above >= 0.0 >= below and above > below:
        part = _guess_event(i, y, far, span, first, far_rates, drop, False, low / span)
        lane[LOW, i], lane[HIGH, i], lane[H, i] = low, span, max(part * span, low)
        counts[_PHASE, i] = _TO_LANDING
        return True
    return False


@inlined
def _after_event_step(i, y, rates, new, lane, counts, tol, limit, far, far_rates, out):
    """Handle a step towards an event; return the flight's status, -1 while it lasts."""
    apex = counts[_PHASE, i] == _TO_APEX
    if not _refine_event(i, apex, new, rates[STAGES], tol, lane):
        return -1
    t = lane[T, i] + lane[H, i]
    if not apex:
        _write_node(i, t, new, out)
        out[3] = -lane[DROP, i]  # by definition; the event's root says so but for rounding
        return LANDED
    if new[Z + i] > out[11]:
        _write_node(i, t, new, out[8:])
    if _turn_to_event(i, y, rates, lane, counts, far, far_rates):
        return -1
    for m in range(i, SIZE, LANES):
        y[m], rates[0, m] = far[m], far_rates[m]
    return _advance_clock(i, far, lane, counts, limit, out)


@inlined
def _after_step(i, y, rates, new, lane, counts, limit, far, far_rates, out):
    """Handle an ordinary step; return the flight's status, -1 while it lasts."""
    h, error, growth = lane[H, i], lane[ERROR, i], lane[GROWTH, i]
    if not error < 1.0:  # or not a number
        counts[_REJECTED, i] = 1
        h *= max(0.2, growth) if error < math.inf else 0.2
        return _set_step(i, h, limit, lane, counts)
    lane[SPAN, i] = h
    lane[NEXT, i] = h * min(growth, 1.0 if counts[_REJECTED, i] == 1 else 10.0)
    drop = lane[DROP, i]
    if y[W + i] >= 0.0 >= new[W + i] or y[Z + i] + drop >= 0.0 >= new[Z + i] + drop:
        for m in range(i, SIZE, LANES):
            far[m], far_rates[m] = new[m], rates[STAGES, m]
        if _turn_to_event(i, y, rates, lane, counts, far, far_rates):
            return -1
    lane[TAKEN, i] = 1.0
    return _advance_clock(i, new, lane, counts, limit, out)
