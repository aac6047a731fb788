"""Many flights in machine code: scipy's DOP853 without its Python.

Coefficients and error estimate are scipy's. The next step is 0.7 of what the estimate
allows, not 0.9: fewer are rejected, and as many evaluations give half the error. Apex and landing
are not read off an interpolant within a long step: the step that crosses one is taken anew with the
length that ends there, within a small fraction of a step, which a polynomial covers. A node is then
as accurate as the steps are. A step in which the ball sinks and rises again is taken anew up to its
lowest point, so that a landing there is seen. Every flight has a lane, with its own time and step;
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
from numpy.typing import NDArray
from scipy.integrate import DOP853

from kickdyn.core import lanes
from kickdyn.core.compilation import compiled, is_kept, named
from kickdyn.core.lanes import HOW, LANES, WITHIN
from kickdyn.core.validation import Array
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
_COUNT = np.count_nonzero(_TABLE, axis=1)
_WHICH = np.zeros((len(_TABLE), STAGES + 4), np.int64)
_WEIGHT = np.zeros(_WHICH.shape)
for _k, _row in enumerate(_TABLE):
    _used = np.flatnonzero(_row)
    _WHICH[_k, : len(_used)] = _used
    _WEIGHT[_k, : len(_used)] = _row[_used]

(
    T, H, LONGEST, DROP, ERROR, GROWTH, TAKEN, NEXT, LOW, HIGH, ROW, PHASE, PLACE, REJECTED, CALLS
) = range(15)  # fmt: skip
"""Rows of a lane's numbers: time, step and its limit; drop to the landing; the step's error over
what is tolerated, the factor that allows for the next one, whether it is taken; the step after one
to an event, and bounds of that event, from the beginning of the step; which flight it is, what its
step is for, where it begins, whether the step before was rejected; evaluations."""

_ROWS = 15

# phases: what a step is for
_FLYING, _TO_APEX, _TO_LANDING, _TO_LOWEST, _IDLE = 0.0, 1.0, 2.0, 3.0, 4.0
# places, which say what events a step can have
_NOT_YET_UP, _ANYWHERE, _AT_APEX, _AT_LOWEST = 0.0, 1.0, 2.0, 3.0
_CREST, _LANDING, _LOWEST = 1.0, 0.0, -1.0  # events; the sign is that of the speed before a turn

_EPS = float(np.finfo(float).eps)

_OPTIONS: dict[str, Any] = {**HOW, "_nrt": False}
"""No counting of references by numba, which costs time in every call: Python owns all arrays."""

njit: Any = numba.njit(**_OPTIONS, **WITHIN)
inlined: Any = numba.njit(**_OPTIONS, **WITHIN, forceinline=True)


def march(
    rates_of: Any, scenes: Array, velocities: Array, rtol: float, tol: float, limit: float
) -> tuple[Array, NDArray[np.int8], NDArray[np.int64]]:
    """Return nodes, status and evaluations of n flights.

    Args:
        rates_of: the equations of motion, as `compiled_rates` returns them.
        scenes: a row for each flight: height, spin (3), whether it decays, drop, absolute
            tolerances of displacement and of velocity, longest step; shape `(n, 9)`.
        velocities: at the launch, shape `(n, 3)` [m/s].
        rtol: relative tolerance.
        tol: absolute tolerance of the spin over that of the launch.
        limit: of time [s].

    Returns:
        Time and 7 states at the end, then at the apex, shape `(n, 16)`; `LANDED`, `ALOFT` or
        `FAILED`, and the number of evaluations, shape `(n,)`.
    """
    n = len(scenes)
    flown = np.empty((n, 16)), np.zeros(n, np.int8), np.zeros(n, np.int64)
    limits = float(rtol), float(tol), float(limit)
    memory = [np.zeros(shape) for shape in ((n, 8), (STAGES + 1, SIZE), (8, SIZE), (_ROWS, LANES))]
    compiled_march()(rates_of, scenes, velocities, *limits, *flown, *memory)
    return flown


@cache
def compiled_march() -> Any:
    """Return `_march` as machine code, from the disk if it can be kept there: it takes seconds."""
    matrix = numba.float64[:, ::1]
    signature = numba.void(
        numba.types.FunctionType(SIGNATURE), matrix, matrix, *(numba.float64,) * 3,
        matrix, numba.int8[::1], numba.int64[::1], *(matrix,) * 4,
    )  # fmt: skip
    return compiled(_named_march(), signature, "the integration of flights", **_OPTIONS)


def march_is_kept() -> bool | None:
    """Return whether `_march` is on disk as machine code; None where it cannot be kept."""
    return is_kept(_named_march())


@cache
def _named_march() -> Any:
    """Return `_march` under the name that it is kept by."""
    # numba looks for changes in this file only; the others are part of the name
    sources = b"".join(Path(str(file.__file__)).read_bytes() for file in (lanes, compiling))
    return named(_march, f"march_{zlib.crc32(sources, MAX_EVALUATIONS):08x}")


def _march(
    rates_of, scenes, velocities, rtol, tol, limit, out, status, evaluations,
    begin, rates, work, lane,
):  # fmt: skip
    """Fill in what `march` returns: load flights into lanes, step all at once, see where each is.

    The last four arguments are memory to work in.
    """
    y, new, scale, scene = work[0], work[1], work[2], work[3]
    _start(rates_of, scenes, velocities, rtol, tol, limit, rates, begin, status, evaluations,
           scene, scale, y, lane)  # fmt: skip
    for i in range(LANES):
        lane[PHASE, i] = _IDLE
    n, waiting, flying = len(out), 0, 0
    while True:
        for i in range(LANES):
            while lane[PHASE, i] == _IDLE and waiting < n:
                row = waiting
                waiting += 1
                _load_flight(i, row, scenes, velocities, tol, scene, y, scale, lane)
                for k in range(0, 16, 8):
                    _write_node(i, 0.0, y, out, row, k)
                if status[row] != ALOFT:
                    continue
                for c in range(7):
                    rates[0, c * LANES + i] = begin[row, c]
                climb, lifted = begin[row, 2], begin[row, 5]
                rises = climb > 0.0 or (climb == 0.0 and lifted > 0.0)
                lane[PLACE, i] = _NOT_YET_UP if rises else _ANYWHERE
                lane[T, i], lane[ROW, i], lane[CALLS, i], lane[REJECTED, i] = 0.0, row, 1.0, 0.0
                _set_step(i, begin[row, 7], limit, lane)
                flying += 1
        if flying == 0:
            break
        _step(rates_of, scene, y, lane, rates, work[4:], new)
        _estimate_error(y, new, rates, rtol, scale, lane, work[5], work[6])
        _take_ordinary_steps(y, rates, new, limit, lane)
        for i in range(LANES):
            if lane[TAKEN, i] != 0.0 or lane[PHASE, i] == _IDLE:
                continue
            row = int(lane[ROW, i])
            if lane[PHASE, i] == _FLYING:
                done = _handle_step(i, y, rates, new, lane, limit, out, row)
            else:
                done = _handle_event_step(i, y, rates, new, lane, tol, limit, out, row)
            if done >= 0:
                status[row], evaluations[row] = done, int(lane[CALLS, i])
                lane[PHASE, i], lane[H, i] = _IDLE, 0.0
                flying -= 1
        _accept(y, rates, new, lane)
    for row in range(n):
        if status[row] == FAILED:
            for c in range(16):
                out[row, c] = math.nan


@inlined
def _step(rates_of, scene, y, lane, rates, sums, new):
    """Take a step in every lane, from `y` with its rates to `new` with its rates.

    Three rows of `sums` become the weighted sum of the rates before the last stage, and those of
    both estimates of the error; the fourth is memory to work in.
    """
    h = sums[3]
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            h[c + i] = lane[H, i]
    for k in range(1, STAGES + 3):
        total = sums[max(k - STAGES, 0)]
        for n in range(0, _COUNT[k], 4):
            i, j, p, q = _WHICH[k, n], _WHICH[k, n + 1], _WHICH[k, n + 2], _WHICH[k, n + 3]
            a, b, c, d = _WEIGHT[k, n], _WEIGHT[k, n + 1], _WEIGHT[k, n + 2], _WEIGHT[k, n + 3]
            for m in range(SIZE):
                four = (a * rates[i, m] + b * rates[j, m]) + (c * rates[p, m] + d * rates[q, m])
                total[m] = four if n == 0 else total[m] + four
        if k <= STAGES:
            for m in range(SIZE):
                new[m] = y[m] + h[m] * total[m]
            rates_of(scene, new, rates[k])


@inlined
def _estimate_error(y, new, rates, rtol, scale, lane, five, three):
    r"""Estimate the error of a step over what is tolerated, and the next step, as scipy does.

    :math:`h e_5^2 / \sqrt{(e_5^2 + 0.01 e_3^2) n}`, with both estimates scaled by the tolerances.
    """
    last = rates[STAGES]
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


@inlined
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


@inlined
def _start(
    rates_of, scenes, velocities, rtol, tol, limit, rates, starts, status, evaluations,
    scene, scale, y, lane,
):  # fmt: skip
    """Find the first rates of every flight and its first step, as Hairer, Norsett & Wanner do.

    The steps are relative to the flight's own times, as in `integrate`. A flight that cannot begin,
    or ends at once, is given a status.
    """
    n = len(starts)
    for first in range(0, n, LANES):
        for i in range(LANES):
            _load_flight(i, min(first + i, n - 1), scenes, velocities, tol, scene, y, scale, lane)
        rates_of(scene, y, rates[0])
        for i in range(min(LANES, n - first)):
            row = first + i
            d0, d1 = 0.0, 0.0
            for c in range(i, SIZE, LANES):
                per = 1.0 / (scale[c] + rtol * abs(y[c]))
                d0 += (y[c] * per) ** 2
                d1 += (rates[0, c] * per) ** 2
            d0, d1 = max(math.sqrt(d0 / STATES), 1.0), math.sqrt(d1 / STATES)
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


@inlined
def _take_ordinary_steps(y, rates, new, limit, lane):
    """Take the steps that are not rejected, cross no event and end before the limit of time.

    Row `TAKEN` says in which lanes.
    """
    for i in range(LANES):
        h, t = lane[H, i], lane[T, i] + lane[H, i]
        place, climb, sink = lane[PLACE, i], y[W + i], new[W + i]
        no_apex = ((climb < 0.0) & (place != _AT_LOWEST)) | (sink > 0.0)
        no_lowest = ((climb >= 0.0) & (place != _AT_APEX)) | (sink <= 0.0)
        no_landing = (y[Z + i] + lane[DROP, i] < 0.0) | (new[Z + i] + lane[DROP, i] > 0.0)
        good = (lane[ERROR, i] < 1.0) & (h < limit - lane[T, i]) & (lane[PHASE, i] == _FLYING)
        begins, ends = climb + h * rates[0, W + i], sink - h * rates[STAGES, W + i]
        no_turns = (begins * climb >= 0.0) | (ends * sink >= 0.0) | (climb * sink <= 0.0)
        taken = (
            good & no_apex & no_lowest & no_landing & no_turns & (lane[CALLS, i] < MAX_EVALUATIONS)
        )
        most = 10.0 - 9.0 * lane[REJECTED, i]
        longer = lane[GROWTH, i] if lane[GROWTH, i] < most else most
        further = h * longer if h * longer < lane[LONGEST, i] else lane[LONGEST, i]
        smallest = 10.0 * _EPS * t + 1e-300
        further = further if further > smallest else smallest
        further = further if further < limit - t else limit - t
        lane[TAKEN, i] = 1.0 if taken else 0.0
        lane[T, i] = t if taken else lane[T, i]
        lane[H, i] = further if taken else h
        lane[CALLS, i] += STAGES
        lane[REJECTED, i] = 0.0 if taken else lane[REJECTED, i]
        lane[PLACE, i] = _ANYWHERE if taken & (place != _NOT_YET_UP) else place


@inlined
def _path(c, h, y, rates, new, new_rates):
    """Return the quintic through place, velocity and acceleration at both ends of a step of h [s].

    Six coefficients of the powers of the fraction of the step, of the state in place c.
    """
    c1, c2 = h * y[U + c], 0.5 * h * h * rates[U + c]
    d = new[c] - y[c] - c1 - c2
    e = h * new[U + c] - c1 - 2.0 * c2
    f = h * h * new_rates[U + c] - 2.0 * c2
    p3, p4, p5 = 10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f
    return y[c], c1, c2, p3, p4, p5


@inlined
def _event_path(i, event, drop, h, y, rates, new, new_rates):
    """Return six coefficients of what falls through 0 at an event, in the fraction of a step."""
    p0, p1, p2, p3, p4, p5 = _path(Z + i, h, y, rates, new, new_rates)
    if event != _LANDING:
        p1, p2, p3, p4, p5 = event * p1, event * p2, event * p3, event * p4, event * p5
        return p1, 2.0 * p2, 3.0 * p3, 4.0 * p4, 5.0 * p5, 0.0
    return p0 + drop, p1, p2, p3, p4, p5


@inlined
def _guess_event(i, y, new, h, rates, event, drop):
    """Return about where in a step the event falls through 0, as a fraction, or -1 for nowhere."""
    p0, p1, p2, p3, p4, p5 = _event_path(i, event, drop, h, y, rates[0], new, rates[STAGES])
    # An event that is zero at the start, as a level launch that lift carries up, must rise first.
    begin, end, first = 0.0, 1.0, p0
    while first <= 0.0 and end > 1e-18:
        end *= 0.5
        begin = end
        first = p0 + begin * (p1 + begin * (p2 + begin * (p3 + begin * (p4 + begin * p5))))
    if not first > 0.0:
        return -1.0
    end, last = 1.0, p0 + (p1 + (p2 + (p3 + (p4 + p5))))
    s = begin + (1.0 - begin) * first / (first - last)
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
        if moved < 1e-5:
            break
    return s


@inlined
def _write_event(i, event, y, rates, new, tol, lane, out, row):
    """Write the states at the event if a step ends close to it, else correct the step's length.

    Return whether it ends close to it; at a lowest point nothing is written. The states are those
    of the quintics through both ends of the step: of a fraction e of the step, they are wrong by e
    cubed times their error within the step.
    """
    h, drop = lane[H, i], lane[DROP, i]
    last = rates[STAGES]
    # backwards in time, which changes the sign of the speed
    p0, p1, p2, p3, p4, p5 = _event_path(i, -event, drop, -h, new, last, y, rates[0])
    s = 0.0
    for _ in range(6):
        value = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        moved = value / slope if slope != 0.0 else 0.0
        s -= moved
        if not abs(moved) > 1e-9:
            break
    exact = p0 == 0.0 or lane[HIGH, i] - lane[LOW, i] <= 1e-15 * lane[HIGH, i]
    if exact:
        s = 0.0
    elif not abs(s) ** 3 <= 1e-3 * tol:
        if p0 > 0.0:
            lane[LOW, i] = h
        else:
            lane[HIGH, i] = h
        h -= s * h
        if not lane[LOW, i] < h < lane[HIGH, i]:
            h = 0.5 * (lane[LOW, i] + lane[HIGH, i])
        lane[H, i] = h
        return False
    k = 8 if event == _CREST else 0
    if event == _LOWEST or (event == _CREST and new[Z + i] <= out[row, 11]):
        return True  # nothing to write: an earlier crest is higher
    if s == 0.0:
        _write_node(i, lane[T, i] + h, new, out, row, k)
        return True
    out[row, k] = lane[T, i] + (1.0 - s) * h
    for c in range(3):
        p0, p1, p2, p3, p4, p5 = _path(c * LANES + i, -h, new, last, y, rates[0])
        out[row, k + 1 + c] = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        out[row, k + 4 + c] = -slope / h
    out[row, k + 7] = new[LEFT + i] - s * h * last[LEFT + i]
    return True


@njit
def _write_node(i, t, y, out, row, k):
    """Put a time and the states there into 8 numbers of a row, from k on."""
    out[row, k] = t
    for c in range(7):
        out[row, k + 1 + c] = y[c * LANES + i]


@inlined
def _set_step(i, h, limit, lane):
    """Set the length of a lane's next step; return -1, or `FAILED` where no step helps."""
    t = lane[T, i]
    smallest = max(10.0 * _EPS * t, 1e-300)
    lane[H, i] = min(max(min(h, lane[LONGEST, i]), smallest), limit - t)
    lane[PHASE, i] = _FLYING
    vain = lane[CALLS, i] > MAX_EVALUATIONS or (lane[REJECTED, i] == 1.0 and h < smallest)
    return FAILED if vain else -1


@inlined
def _handle_step(i, y, rates, new, lane, limit, out, row):
    """Handle a step that is rejected, crosses an event or reaches the limit of time.

    Return the flight's status, -1 while it lasts.
    """
    h, error, growth, drop = lane[H, i], lane[ERROR, i], lane[GROWTH, i], lane[DROP, i]
    place, climb, sink = lane[PLACE, i], y[W + i], new[W + i]
    above, below = y[Z + i] + drop, new[Z + i] + drop
    if not error < 1.0:  # or not a number
        lane[REJECTED, i] = 1.0
        return _set_step(i, h * max(0.2, growth) if error < math.inf else 0.2 * h, limit, lane)
    further = h * min(growth, 1.0 if lane[REJECTED, i] == 1.0 else 10.0)
    # at a crest or a lowest point the speed is zero but for rounding, of either sign
    rose = place == _AT_LOWEST or (place != _AT_APEX and climb >= 0.0 and climb > sink)
    sank = place == _AT_APEX or (place != _AT_LOWEST and climb < 0.0)
    apex, lowest = rose and sink <= 0.0, sank and sink > 0.0 and above > 0.0
    lands = place != _NOT_YET_UP and above >= 0.0 >= below and above > below
    if apex or lands or lowest:
        event = _CREST if apex else _LANDING if lands else _LOWEST
        part = _guess_event(i, y, new, h, rates, event, drop)
        if part < 0.0 and event != _LANDING:  # it is level, and turns at the start
            lane[PLACE, i] = _AT_APEX if apex else _AT_LOWEST
            return -1
        lane[NEXT, i], lane[LOW, i], lane[HIGH, i], lane[H, i] = further, 0.0, h, max(part, 0.0) * h
        lane[PHASE, i] = _TO_APEX if apex else _TO_LANDING if lands else _TO_LOWEST
        return -1
    begins, ends = climb + h * rates[0, W + i], sink - h * rates[STAGES, W + i]
    turns = climb * sink > 0.0 and begins * climb < 0.0 and ends * sink < 0.0  # perhaps, and back
    if turns or (place == _NOT_YET_UP and below < 0.0):  # or it rose and fell unseen
        lane[REJECTED, i] = 1.0
        return _set_step(i, 0.5 * h, limit, lane)
    last = h == limit - lane[T, i]
    lane[TAKEN, i] = 1.0
    lane[T, i] = limit if last else lane[T, i] + h
    lane[REJECTED, i] = 0.0
    lane[PLACE, i] = place if place == _NOT_YET_UP else _ANYWHERE
    if not last:
        return _set_step(i, further, limit, lane)
    if new[Z + i] > out[row, 11]:
        _write_node(i, limit, new, out, row, 8)
    _write_node(i, limit, new, out, row, 0)
    return ALOFT


@inlined
def _handle_event_step(i, y, rates, new, lane, tol, limit, out, row):
    """Handle a step towards an event; return the flight's status, -1 while it lasts."""
    if not lane[ERROR, i] < math.inf:
        return FAILED
    apex, lands = lane[PHASE, i] == _TO_APEX, lane[PHASE, i] == _TO_LANDING
    event = _CREST if apex else _LANDING if lands else _LOWEST
    if not _write_event(i, event, y, rates, new, tol, lane, out, row):
        return -1
    if lands:
        out[row, 3] = -lane[DROP, i]  # by definition; the event's root says so but for rounding
        return LANDED
    below = new[Z + i] + lane[DROP, i]
    if apex and below < 0.0:  # it is a later crest: the ball landed before
        lane[REJECTED, i] = 1.0
        return _set_step(i, 0.5 * lane[H, i], limit, lane)
    if not apex and below <= 0.0:  # this step again, which now ends in the ground
        return _set_step(i, lane[H, i], limit, lane)
    lane[TAKEN, i] = 1.0
    lane[T, i] += lane[H, i]
    lane[PLACE, i], lane[REJECTED, i] = _AT_APEX if apex else _AT_LOWEST, 0.0
    return _set_step(i, lane[NEXT, i], limit, lane)
