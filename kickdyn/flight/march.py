"""Many flights in machine code: scipy's DOP853 without its Python.

Coefficients and error estimate are scipy's. The next step is 0.7 of what the estimate allows, not
0.9: fewer are rejected, and as many evaluations give half the error. Every flight has a lane, with
its own time and step; whichever ends makes room for the next.

A step that an event falls into is taken anew so that it ends shortly after the event, as in
`integrate`. Where the event is follows from the polynomial of fifth degree that has the values,
slopes and curvatures of the event's function at both ends. Of the crests the highest is kept.
"""

# mypy: disable-error-code="no-untyped-def"

import math
import zlib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from kickdyn.core.compilation import WITHIN, compiled, named
from kickdyn.core.validation import Array
from kickdyn.flight import compiling, events
from kickdyn.flight.compiling import HOW, LANES, LEFT, SIGNATURE, SIZE, U, V, W, X, Z
from kickdyn.flight.events import AT_REST, NUMBERS
from kickdyn.flight.integrate import MAX_EVALUATIONS

LANDED, ALOFT, FAILED, FURTHER = 0, 1, 2, 3
"""Status of a flight; `FURTHER` and more are of the events after the first, which is the ground."""

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

VALUE, SLOPE, CURVATURE = range(3)
"""Rows of the function of an event: its value, and its derivatives by time."""

DIFFERENCE = 1e-4
"""Time over which the function of an event is differentiated, as a fraction of the step."""

_named_tuple: Any = numba.types.NamedTuple

_FLYING = -1
_CREST = -1

_EPS = float(np.finfo(float).eps)

_OPTIONS: dict[str, Any] = {**HOW, "_nrt": False}
"""No counting of references by numba, which costs time in every call: Python owns all arrays."""

njit: Any = numba.njit(**_OPTIONS, **WITHIN)
inlined: Any = numba.njit(**_OPTIONS, **WITHIN, forceinline=True)


class Flights(NamedTuple):
    """What n flights begin with, and, from `nodes` on, what becomes of them.

    Attributes:
        scene: height of the launch [m], spin (3) [rad/s], 1 where it decays or else 0; `(n, 5)`.
        velocity: at the launch, `(n, 3)` [m/s].
        numbers: four numbers of each of k events, `(n, 4 k)`.
        tolerance: absolute tolerances of displacement [m], velocity [m/s] and of the spin over that
            of the launch, the longest step [s], and the fraction of a step, at its end, in which
            an event must lie; `(n, 5)`.
        begin: memory for the rates at the launch, the first step [s], and value, slope and
            curvature of the events' functions, `(n, 8 + 3 k)`.
        nodes: time and 7 states at the end, then at the apex, `(n, 16)`.
        status: `LANDED`, `ALOFT`, `FAILED`, or `FURTHER` plus the number of an event after the
            ground; `(n,)`.
        evaluations: number of evaluations, `(n,)`.
    """

    scene: Array
    velocity: Array
    numbers: Array
    tolerance: Array
    begin: Array
    nodes: Array
    status: NDArray[np.int8]
    evaluations: NDArray[np.int64]

    def row(self, i: int) -> "Flights":
        """Return one flight, in the same memory."""
        return Flights(*(array[i : i + 1] for array in self))  # type: ignore[arg-type]


class Lanes(NamedTuple):
    """The flights that are stepped side by side.

    Attributes:
        scene, numbers: rows of `Flights`, of all lanes, one entry after the other.
        scale: absolute tolerance of each state.
        state, new: states at the beginning and at the end of the step.
        rates: of each stage of the step; in row 0 at its beginning, in the last at its end.
        sums: four rows to work in.
        begin, end: value, slope and curvature of the events' functions at both ends of the step.
        time, step, longest: at the beginning of the step, its length, its greatest length [s].
        error: estimated error of the step over what is tolerated.
        growth: factor of the next step that the error allows.
        taken: 1 where the step is taken as it is, else 0.
        rejected: 1 where the step before was rejected, else 0.
        row: which flight it is; -1 for none.
        calls: evaluations so far.
    """

    scene: Array
    numbers: Array
    scale: Array
    state: Array
    new: Array
    rates: Array
    sums: Array
    begin: Array
    end: Array
    time: Array
    step: Array
    longest: Array
    error: Array
    growth: Array
    taken: Array
    rejected: Array
    row: NDArray[np.int64]
    calls: NDArray[np.int64]


def march(rates_of: Any, values_of: Any, flights: Flights, rtol: float, time_limit: float) -> None:
    """Fill in nodes, status and evaluations of n flights.

    `rates_of` is what `compiled_rates` returns, `values_of` what `compiled_ends` does.
    """
    size = flights.numbers.shape[1] * LANES
    scale, state, new = np.zeros((3, SIZE))
    begin, end = np.zeros((2, 3, size // NUMBERS))
    time, step, longest, error, growth, taken, rejected = np.zeros((7, LANES))
    memory = Lanes(
        np.zeros(5 * LANES), np.zeros(size), scale, state, new,
        np.zeros((STAGES + 1, SIZE)), np.zeros((4, SIZE)), begin, end,
        time, step, longest, error, growth, taken, rejected,
        np.full(LANES, -1), np.zeros(LANES, np.int64),
    )  # fmt: skip
    compiled_march()(rates_of, values_of, flights, memory, float(rtol), float(time_limit))


@cache
def compiled_march() -> Any:
    """Return `_march` as machine code, from the disk if it can be kept there: it takes seconds."""
    vector, matrix, integers = numba.float64[::1], numba.float64[:, ::1], numba.int64[::1]
    flights = _named_tuple([*(matrix,) * 6, numba.int8[::1], integers], Flights)
    kinds = [*(vector,) * 5, *(matrix,) * 4, *(vector,) * 7, integers, integers]
    equations = numba.types.FunctionType(SIGNATURE)
    signature = numba.void(
        equations, equations, flights, _named_tuple(kinds, Lanes),
        numba.float64, numba.float64,
    )  # fmt: skip
    # numba looks for changes in this file only; the others are part of the name
    sources = b"".join(Path(str(file.__file__)).read_bytes() for file in (compiling, events))
    function = named(_march, f"march_{zlib.crc32(sources, MAX_EVALUATIONS):08x}")
    return compiled(function, signature, "the integration of flights", **_OPTIONS)


def _march(rates_of, values_of, flights, lane, rtol, time_limit):
    """Fill in what `march` does: load flights into lanes, step all at once, see where each is."""
    _start(rates_of, values_of, flights, lane, rtol, time_limit)
    waiting, flying = 0, 0
    while True:
        for i in range(LANES):
            while lane.row[i] < 0 and waiting < len(flights.status):
                if flights.status[waiting] == _FLYING:
                    _load(i, waiting, flights, lane, time_limit)
                    flying += 1
                waiting += 1
        if flying == 0:
            break
        _step(rates_of, lane)
        _estimate_error(lane, rtol)
        _measure(values_of, lane, lane.new, lane.rates[STAGES], lane.end)
        for i in range(LANES):
            row, lane.taken[i] = lane.row[i], 0.0
            if row >= 0:
                lane.calls[i] += STAGES
                status = _end_step(i, flights, lane, time_limit)
                if status != _FLYING:
                    flights.status[row], flights.evaluations[row] = status, lane.calls[i]
                    lane.row[i], lane.step[i] = -1, 0.0
                    flying -= 1
        _advance(lane)
    for row in range(len(flights.status)):
        if flights.status[row] == FAILED:
            for c in range(16):
                flights.nodes[row, c] = math.nan


@njit
def _load_start(i, row, flights, lane):
    for c in range(5):
        lane.scene[c * LANES + i] = flights.scene[row, c]
    for c in range(flights.numbers.shape[1]):
        lane.numbers[c * LANES + i] = flights.numbers[row, c]
    for c in range(3):
        lane.state[X + c * LANES + i] = 0.0
        lane.state[U + c * LANES + i] = flights.velocity[row, c]
        lane.scale[X + c * LANES + i] = flights.tolerance[row, 0]
        lane.scale[U + c * LANES + i] = flights.tolerance[row, 1]
    lane.state[LEFT + i], lane.scale[LEFT + i] = 1.0, flights.tolerance[row, 2]
    lane.longest[i] = flights.tolerance[row, 3]


@njit
def _load(i, row, flights, lane, time_limit):
    _load_start(i, row, flights, lane)
    for c in range(STATES):
        lane.rates[0, c * LANES + i] = flights.begin[row, c]
    for event in range(lane.begin.shape[1] // LANES):
        for derivative in range(3):
            value = flights.begin[row, 8 + 3 * event + derivative]
            lane.begin[derivative, event * LANES + i] = value
    lane.time[i], lane.rejected[i], lane.row[i], lane.calls[i] = 0.0, 0.0, row, 1
    _set_step(i, flights.begin[row, 7], lane, time_limit)


@inlined
def _start(rates_of, values_of, flights, lane, rtol, time_limit):
    """Find the first rates of every flight and its first step, as Hairer, Norsett & Wanner do.

    The steps are relative to the flight's own times, as in `integrate`. A flight that cannot begin,
    or ends at once, is given a status.
    """
    n = len(flights.status)
    for first in range(0, n, LANES):
        for i in range(LANES):
            _load_start(i, min(first + i, n - 1), flights, lane)
        rates_of(lane.scene, lane.state, lane.rates[0])
        for i in range(LANES):
            lane.step[i] = _first_step(i, lane, rtol, time_limit)
        _measure(values_of, lane, lane.state, lane.rates[0], lane.begin)
        _move_shortly(lane)
        values_of(lane.numbers, lane.new, lane.end[VALUE])
        for i in range(min(LANES, n - first)):
            row = first + i
            flights.evaluations[row], flights.status[row] = 1, _FLYING
            for k in range(0, 16, 8):
                _write_node(i, 0.0, lane.state, flights.nodes, row, k)
            for k in range(lane.begin.shape[1] - LANES + i, -1, -LANES):  # the first one counts
                for derivative in range(3):
                    column = 8 + 3 * (k // LANES) + derivative
                    flights.begin[row, column] = lane.begin[derivative, k]
                if math.isnan(lane.begin[VALUE, k]):
                    flights.status[row] = FAILED
                value = lane.end[VALUE, k]
                rests = value == 0.0 and abs(lane.state[U + i]) < AT_REST
                rests = rests and abs(lane.state[V + i]) < AT_REST > abs(lane.state[W + i])
                if lane.begin[VALUE, k] == 0.0 and (value < 0.0 or rests):
                    flights.status[row] = _status_of(k // LANES)
            for c in range(STATES):
                flights.begin[row, c] = lane.rates[0, c * LANES + i]
                if not math.isfinite(flights.begin[row, c]):
                    flights.status[row] = FAILED
            flights.begin[row, 7] = lane.step[i]
            lane.step[i] = 0.0


@inlined
def _first_step(i, lane, rtol, time_limit):
    d0, d1 = 0.0, 0.0
    for c in range(i, SIZE, LANES):
        per = 1.0 / (lane.scale[c] + rtol * abs(lane.state[c]))
        d0 += (lane.state[c] * per) ** 2
        d1 += (lane.rates[0, c] * per) ** 2
    d0, d1 = max(math.sqrt(d0 / STATES), 1.0), math.sqrt(d1 / STATES)
    return min(d0 / d1 * (0.01 / d0) ** 0.125, time_limit) if d1 > 0.0 else time_limit


@inlined
def _status_of(event):
    return LANDED if event == 0 else FURTHER + event - 1


@inlined
def _move_shortly(lane):
    """Put into `new` the states so shortly after the launch that only the first change counts."""
    for i in range(LANES):
        speed, acceleration = 0.0, 0.0
        for c in range(0, 3 * LANES, LANES):
            speed += lane.state[U + c + i] ** 2
            acceleration += lane.rates[0, U + c + i] ** 2
        time = 1e-30
        if speed > 0.0 and acceleration > 0.0:
            time *= math.sqrt(speed) / math.sqrt(acceleration)
        for c in range(i, SIZE, LANES):
            lane.new[c] = lane.state[c] + time * lane.rates[0, c]
        for c in range(i, U, LANES):
            lane.new[c] += 0.5 * time * time * lane.rates[0, U + c]


@inlined
def _step(rates_of, lane):
    """Take a step in every lane, from `state` to `new`, with the rates of all stages.

    Three rows of `sums` become the weighted sum of the rates before the last stage, and the
    estimates of the error; the fourth is memory to work in.
    """
    rates, h = lane.rates, lane.sums[3]
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            h[c + i] = lane.step[i]
    for k in range(1, STAGES + 3):
        total = lane.sums[max(k - STAGES, 0)]
        for n in range(0, _COUNT[k], 4):
            i, j, p, q = _WHICH[k, n], _WHICH[k, n + 1], _WHICH[k, n + 2], _WHICH[k, n + 3]
            a, b, c, d = _WEIGHT[k, n], _WEIGHT[k, n + 1], _WEIGHT[k, n + 2], _WEIGHT[k, n + 3]
            for m in range(SIZE):
                four = (a * rates[i, m] + b * rates[j, m]) + (c * rates[p, m] + d * rates[q, m])
                total[m] = four if n == 0 else total[m] + four
        if k <= STAGES:
            for m in range(SIZE):
                lane.new[m] = lane.state[m] + h[m] * total[m]
            rates_of(lane.scene, lane.new, rates[k])


@inlined
def _estimate_error(lane, rtol):
    r"""Estimate the error of a step over what is tolerated, and the next step, as scipy does.

    :math:`h e_5^2 / \sqrt{(e_5^2 + 0.01 e_3^2) n}`, with both estimates scaled by the tolerances.
    """
    new, last, five, three = lane.new, lane.rates[STAGES], lane.sums[1], lane.sums[2]
    for m in range(SIZE):
        per = 1.0 / (lane.scale[m] + rtol * max(abs(lane.state[m]), abs(new[m])))
        five[m] = (five[m] * per) ** 2
        three[m] = (three[m] * per) ** 2 + 0.0 * (new[m] + last[m])  # nan if not finite
    for c in range(LANES, SIZE, LANES):
        for i in range(LANES):
            five[i] += five[c + i]
            three[i] += three[c + i]
    for i in range(LANES):
        size = (five[i] + 0.01 * three[i]) * STATES
        error = lane.step[i] * five[i] / math.sqrt(size)
        lane.error[i] = error if size != 0.0 else 0.0
        lane.growth[i] = 0.7 / math.sqrt(math.sqrt(math.sqrt(lane.error[i])))


@inlined
def _measure(values_of, lane, state, rate, result):
    """Put value, slope and curvature of the events' functions at some states into `result`."""
    moved = lane.sums[0]
    values_of(lane.numbers, state, result[VALUE])
    for sign in (1.0, -1.0):
        for c in range(0, U, LANES):
            for i in range(LANES):
                m, n, h = c + i, U + c + i, sign * DIFFERENCE * lane.step[i]
                moved[m] = state[m] + h * (state[n] + 0.5 * h * rate[n])
                moved[n] = state[n] + h * rate[n]
        for i in range(LANES):
            m = LEFT + i
            moved[m] = state[m] + sign * DIFFERENCE * lane.step[i] * rate[m]
        values_of(lane.numbers, moved, result[SLOPE if sign > 0.0 else CURVATURE])
    for c in range(0, result.shape[1], LANES):
        for i in range(LANES):
            k, per = c + i, 1.0 / (DIFFERENCE * lane.step[i])
            more, less = (
                result[SLOPE, k] - result[VALUE, k],
                result[VALUE, k] - result[CURVATURE, k],
            )
            result[SLOPE, k] = 0.5 * (more + less) * per
            result[CURVATURE, k] = (more - less) * per * per


@inlined
def _happens(start, rise, end, last_rise):
    """Return whether a function falls through zero in a step, or may: both tangents do."""
    falls = (start >= 0.0) & (end <= 0.0) & (start > end)
    hides = (start * (start + rise) < 0.0) & (end * (end - last_rise) < 0.0) & (start * end > 0.0)
    return falls | hides


@inlined
def _dips(start, rise, end, last_rise):
    """Return whether a function is above zero at both ends of a step, and lower in between."""
    return (start > 0.0) & (end > 0.0) & (rise < 0.0) & (last_rise > 0.0)


@inlined
def _advance(lane):
    _choose(lane.taken, lane.new, lane.state)
    _choose(lane.taken, lane.rates[STAGES], lane.rates[0])
    for derivative in range(3):
        _choose(lane.taken, lane.end[derivative], lane.begin[derivative])


@inlined
def _choose(taken, new, old):
    """Put the new numbers into the old ones in the lanes where the step is taken."""
    for c in range(0, len(old), LANES):
        for i in range(LANES):
            old[c + i] = new[c + i] if taken[i] != 0.0 else old[c + i]


@inlined
def _quintic(h, begin, slope, curvature, end, last_slope, last_curvature):
    """Return the six coefficients of a quintic, from values and derivatives at both ends.

    They are of the powers of the fraction of a step of h [s].
    """
    c1, c2 = h * slope, 0.5 * h * h * curvature
    d = end - begin - c1 - c2
    e = h * last_slope - c1 - 2.0 * c2
    f = h * h * last_curvature - 2.0 * c2
    return (
        begin, c1, c2,
        10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f,
    )  # fmt: skip


@inlined
def _backward_path(c, h, lane):
    """Return the quintic of a displacement from the end of the step back to its beginning."""
    y, new, rate, last = lane.state, lane.new, lane.rates[0], lane.rates[STAGES]
    return _quintic(-h, new[c], new[U + c], last[U + c], y[c], y[U + c], rate[U + c])


@inlined
def _event_function(i, event, h, lane):
    """Return the quintic of an event's function from the end of the step back to its beginning."""
    if event == _CREST:  # the upward speed, times the step
        _, p1, p2, p3, p4, p5 = _backward_path(Z + i, h, lane)
        return -p1, -2.0 * p2, -3.0 * p3, -4.0 * p4, -5.0 * p5, 0.0
    k, a, b = event * LANES + i, lane.begin, lane.end
    return _quintic(
        -h, b[VALUE, k], b[SLOPE, k], b[CURVATURE, k], a[VALUE, k], a[SLOPE, k], a[CURVATURE, k]
    )


@inlined
def _find_event(i, event, h, start, end, lane):
    if end == 0.0:
        return 0.0
    p0, p1, p2, p3, p4, p5 = _event_function(i, event, h, lane)
    low, high, s = 0.0, 1.0, end / (end - start)
    for _ in range(60):
        value = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        if value > 0.0:
            high = s
        else:
            low = s
        further = s - value / slope
        if not low <= further <= high:
            further = 0.5 * (low + high)
        moved, s = abs(further - s), further
        if moved <= 1e-3 * s or moved < 1e-15:  # and the next one by its square
            break
    return s


@inlined
def _find_lowest(i, event, h, lane):
    """Return how long before the end of a step an event's function is least, and that value."""
    p0, p1, p2, p3, p4, p5 = _event_function(i, event, h, lane)
    best, lowest = 0.0, p0
    for k in range(1, 33):
        s = k / 32.0
        value = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        if value < lowest:
            best, lowest = s, value
    for _ in range(4):
        slope = p1 + best * (2.0 * p2 + best * (3.0 * p3 + best * (4.0 * p4 + best * 5.0 * p5)))
        bend = 2.0 * p2 + best * (6.0 * p3 + best * (12.0 * p4 + best * 20.0 * p5))
        s = best - slope / bend if bend > 0.0 else best
        value = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        if not value < lowest:
            break
        best, lowest = s, value
    return best, lowest


@njit
def _write_node(i, t, y, nodes, row, k):
    """Put a time and the states there into 8 numbers of a row, from k on."""
    nodes[row, k] = t
    for c in range(STATES):
        nodes[row, k + 1 + c] = y[c * LANES + i]


@inlined
def _write_event(i, s, h, lane, nodes, row, k):
    """Put time and states at a fraction before the end of a step into a row, from k on."""
    nodes[row, k] = lane.time[i] + (1.0 - s) * h
    for c in range(3):
        p0, p1, p2, p3, p4, p5 = _backward_path(c * LANES + i, h, lane)
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        nodes[row, k + 1 + c] = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        nodes[row, k + 4 + c] = -slope / h
    nodes[row, k + 7] = lane.new[LEFT + i] - s * h * lane.rates[STAGES, LEFT + i]


@inlined
def _set_step(i, h, lane, time_limit):
    """Set the length of a lane's next step; return `_FLYING`, or `FAILED` where no step helps."""
    t = lane.time[i]
    smallest = max(10.0 * _EPS * t, 1e-300)
    lane.step[i] = min(max(min(h, lane.longest[i]), smallest), time_limit - t)
    vain = lane.calls[i] > MAX_EVALUATIONS or (lane.rejected[i] == 1.0 and h < smallest)
    return FAILED if vain else _FLYING


@inlined
def _end_step(i, flights, lane, time_limit):
    """Reject a step, take it anew with another length, or take it; return the flight's status."""
    h, error, growth, row = lane.step[i], lane.error[i], lane.growth[i], lane.row[i]
    if not error < 1.0:  # or not a number
        lane.rejected[i] = 1.0
        return _set_step(i, h * max(0.2, growth) if error < math.inf else 0.2 * h, lane, time_limit)
    resolvable = h > max(100.0 * _EPS * lane.time[i], 1e-300)
    first, before_end, unknown = _FLYING - 1, -1.0, False
    for event in range(_CREST, lane.begin.shape[1] // LANES):
        if event == _CREST:
            start, end = lane.state[W + i], lane.new[W + i]
            rise, last_rise = h * lane.rates[0, W + i], h * lane.rates[STAGES, W + i]
        else:
            k = event * LANES + i
            start, end = lane.begin[VALUE, k], lane.end[VALUE, k]
            rise, last_rise = h * lane.begin[SLOPE, k], h * lane.end[SLOPE, k]
        unknown |= end != end
        if event != _CREST and _dips(start, rise, end, last_rise):
            s, lowest = _find_lowest(i, event, h, lane)
            if lowest <= 0.0 and 0.0 < s < 1.0 - 1e-6 and resolvable:
                return _set_step(i, (1.0 - s) * h, lane, time_limit)  # its end will decide
            continue
        if not _happens(start, rise, end, last_rise):
            continue
        if start > 0.0 >= end:
            s = _find_event(i, event, h, start, end, lane)
            if s > before_end:
                first, before_end = event, s
        elif resolvable and (start != 0.0 or rise > 0.0 or (event != _CREST and rise == 0.0)):
            # it may come and go within the step, or rises before it falls
            shorter = 0.5 * rise / (rise - end) if start == 0.0 and rise > 0.0 else 0.5
            return _set_step(i, shorter * h, lane, time_limit)
    margin = flights.tolerance[row, 4]
    if before_end > margin and resolvable:
        return _set_step(i, (1.0 - before_end) * (1.0 + 0.5 * margin) * h, lane, time_limit)
    if first >= 0:
        _write_event(i, before_end, h, lane, flights.nodes, row, 0)
        if flights.nodes[row, 3] > flights.nodes[row, 11]:
            for c in range(8):
                flights.nodes[row, 8 + c] = flights.nodes[row, c]
        return _status_of(first)
    if unknown:  # the function of an event is not a number
        return FAILED
    if first == _CREST and lane.new[Z + i] > flights.nodes[row, 11]:
        _write_event(i, before_end, h, lane, flights.nodes, row, 8)
    lane.taken[i] = 1.0
    last = h == time_limit - lane.time[i]
    lane.time[i] = time_limit if last else lane.time[i] + h
    further = h * min(growth, 1.0 if lane.rejected[i] == 1.0 else 10.0)
    lane.rejected[i] = 0.0
    if not last:
        return _set_step(i, further, lane, time_limit)
    if lane.new[Z + i] > flights.nodes[row, 11]:
        _write_node(i, time_limit, lane.new, flights.nodes, row, 8)
    _write_node(i, time_limit, lane.new, flights.nodes, row, 0)
    return ALOFT
