"""Many flights in machine code: scipy's DOP853 without its Python.

Coefficients and error estimate are scipy's. The next step is 0.7 of what the estimate allows, not
0.9: fewer are rejected, and as many evaluations give half the error. Every flight has a lane, with
its own time and step; whichever ends makes room for the next.

A step that an event falls into is taken anew so that it ends shortly after the event, as in
`integrate`. Where the event is follows from the cubic with the values and slopes of the event's
function at both ends, and from the function itself on the ball's path. Of the crests the highest is
kept. Most steps have no event: all lanes are checked for that at once, and only the others go
through `_end_step`, as do those within which a function that is read there may fall.
"""

# mypy: disable-error-code="no-untyped-def"

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from kickdyn.core import dop853
from kickdyn.core.compilation import WITHIN, Source, named
from kickdyn.core.dop853 import COUNT, STAGES, WEIGHT, WHICH_RATE, first_step
from kickdyn.core.validation import Array
from kickdyn.flight import compiling, events
from kickdyn.flight.compiling import LANES, LEFT, OPTIONS, SIGNATURE, SIZE, U, V, W, X, Z
from kickdyn.flight.events import (
    AT_REST,
    DIFFERENCE,
    MOST_CHANGE,
    NUMBERS,
    PARTS,
    backward_cubic,
    count_readings,
    cubic_slope,
    fall_in_step,
    on_cubic,
)  # fmt: skip
from kickdyn.flight.flight_result import ALOFT, FAILED, FURTHER, LANDED
from kickdyn.flight.integrate import MAX_EVALUATIONS, PART_WEIGHTS

STATES = 7

VALUE, SLOPE = range(2)
"""Rows of the function of an event: its value, and its derivative by time."""

_named_tuple: Any = numba.types.NamedTuple
_typeof: Any = numba.typeof

_FLYING = -1
_CREST, _NO_EVENT = -1, -2

_EPS = float(np.finfo(float).eps)

_OPTIONS: dict[str, Any] = {**OPTIONS, "_nrt": False}
"""No counting of references by numba, which costs time in every call: Python owns all arrays."""

njit: Any = numba.njit(**_OPTIONS, **WITHIN)
inlined: Any = numba.njit(**_OPTIONS, **WITHIN, forceinline=True)


class Flights(NamedTuple):
    """What n flights begin with, and, from `nodes` on, their results."""

    scene: Array  # height of the launch [m], spin (3) [rad/s], 1 where it decays, else 0; `(n, 5)`
    velocity: Array  # at the launch, `(n, 3)` [m/s]
    numbers: Array  # four of each of k events, `(n, 4 k)`
    tolerance: Array  # of displacement [m], velocity [m/s], and spin over that of the launch; the
    # longest step [s]; the fraction of a step, at its end, in which an event must lie; `(n, 5)`
    begin: Array  # memory: rates at the launch, first step [s], `VALUE` and `SLOPE` of the events
    nodes: Array  # time [s] and 7 states at the end and, if there is space, at the apex, `(n, 16)`
    status: NDArray[np.int8]  # `LANDED`, `ALOFT`, `FAILED`, `FURTHER` plus the number of an event
    evaluations: NDArray[np.int64]  # `(n,)`


LANE = np.dtype([
    ("rates", float, (STAGES + 1, SIZE)),  # of each stage of the step, and at its end
    ("sums", float, (4, SIZE)),  # rows to work in
    ("scene", float, 5 * LANES),  # rows of `Flights.scene`, one entry after the other
    ("state", float, SIZE),  # at the beginning of the step
    ("new", float, SIZE),  # at its end
    ("scale", float, SIZE),  # absolute tolerance of each state
    ("point", float, SIZE),  # states at an event or shortly after the launch
    ("time", float, LANES),  # at the beginning of the step [s]
    ("step", float, LANES),  # its length [s]
    ("longest", float, LANES),  # its greatest length [s]
    ("error", float, LANES),  # estimated error of the step over the tolerated one
    ("growth", float, LANES),  # factor of the next step that the error allows
    ("taken", float, LANES),  # 1 if the step is taken as it is, else 0
    ("rejected", float, LANES),  # 1 if the step before was rejected, else 0
    ("after", float, LANES),  # fraction of the step after the event `fallen`
    ("fallen", np.int64, LANES),  # event that is read to fall within the step, or `_NO_EVENT`
    ("row", np.int64, LANES),  # which flight it is; -1 for none
    ("calls", np.int64, LANES),  # evaluations so far
], align=True)  # fmt: skip
"""Flights that are stepped side by side. Machine code passes a record by its address."""


class EventValues(NamedTuple):
    """Functions of the k events of all lanes, one event after the other: `k LANES` columns."""

    begin: Array  # `VALUE` and `SLOPE` at the beginning of the step
    end: Array  # and at its end
    numbers: Array  # of the events, of all lanes, `(4 k LANES,)`
    copies: Array  # of the events, of one flight
    value: Array  # at the states `point`
    parts: Array  # values at both ends of the step and between its parts
    most: Array  # greatest change in a part of the step
    least: Array  # least sum of the values at both ends of a part, one of which is positive
    known: int  # number of events, the first ones, that need not be read within the steps


def march(
    code: Callable[..., Any],
    reading: Callable[..., Any],
    rates_of: Any,
    values_of: Any,
    flights: Flights,
    rtol: float,
    time_limit: float,
    known: int,
) -> None:
    """Fill in the results of n flights by the machine code of `source` and `reading_source`.

    The functions of all events but the first `known` ones are also read within the steps.
    """
    size = flights.numbers.shape[1] * LANES
    lanes, k = np.zeros(1, LANE), size // NUMBERS
    lanes["row"], lanes["fallen"], lanes["after"] = -1, _NO_EVENT, -1.0
    shapes = (2, k), (2, k), (size,), (size,), (k,), (PARTS + 1, k), (k,), (k,)
    measured = EventValues._make([*map(np.zeros, shapes), known])
    code(reading, rates_of, values_of, flights, lanes, measured, float(rtol), float(time_limit))


def _march(reading, rates_of, values_of, flights, lanes, measured, rtol, time_limit):
    """Fill in what `march` does: load flights into lanes, step all at once, see where each is."""
    lane = lanes[0]
    _start(rates_of, values_of, flights, lane, measured, rtol, time_limit)
    waiting, flying = 0, 0
    while True:
        for i in range(LANES):
            while lane.row[i] < 0 and waiting < len(flights.status):
                if flights.status[waiting] == _FLYING:
                    _load(i, waiting, flights, lane, measured, time_limit)
                    flying += 1
                waiting += 1
        if flying == 0:
            break
        _step(rates_of, lane)
        _estimate_error(lane, rtol)
        _measure(values_of, lane, measured, lane.new[:], lane.rates[STAGES], measured.end)
        _take_plain_steps(lane, measured, time_limit, flights.nodes.shape[1] > 8)
        reading(values_of, lanes, measured)
        for i in range(LANES):
            row = lane.row[i]
            if row >= 0 and lane.taken[i] == 0.0:
                status = _end_step(values_of, i, flights, lane, measured, time_limit)
                if status != _FLYING:
                    flights.status[row], flights.evaluations[row] = status, lane.calls[i]
                    lane.row[i], lane.step[i] = -1, 0.0
                    flying -= 1
        _advance(lane, measured, time_limit)
    for row in range(len(flights.status)):
        if flights.status[row] == FAILED:
            for c in range(flights.nodes.shape[1]):
                flights.nodes[row, c] = math.nan


@njit
def _load_start(i, row, flights, lane, measured):
    for c in range(5):
        lane.scene[c * LANES + i] = flights.scene[row, c]
    for c in range(flights.numbers.shape[1]):
        measured.numbers[c * LANES + i] = flights.numbers[row, c]
    for c in range(3):
        lane.state[X + c * LANES + i] = 0.0
        lane.state[U + c * LANES + i] = flights.velocity[row, c]
        lane.scale[X + c * LANES + i] = flights.tolerance[row, 0]
        lane.scale[U + c * LANES + i] = flights.tolerance[row, 1]
    lane.state[LEFT + i], lane.scale[LEFT + i] = 1.0, flights.tolerance[row, 2]
    lane.longest[i] = flights.tolerance[row, 3]


@njit
def _load(i, row, flights, lane, measured, time_limit):
    _load_start(i, row, flights, lane, measured)
    for c in range(STATES):
        lane.rates[0, c * LANES + i] = flights.begin[row, c]
    for event in range(measured.begin.shape[1] // LANES):
        for derivative in range(2):
            value = flights.begin[row, 8 + 2 * event + derivative]
            measured.begin[derivative, event * LANES + i] = value
    lane.time[i], lane.rejected[i], lane.row[i], lane.calls[i] = 0.0, 0.0, row, 1
    lane.step[i] = _allowed(i, flights.begin[row, 7], lane, time_limit)


@inlined
def _start(rates_of, values_of, flights, lane, measured, rtol, time_limit):
    """Find the first rates of every flight and its first step, as Hairer, Norsett & Wanner do.

    The steps are relative to the flight's own times, as in `integrate`. A flight that cannot begin,
    or ends at once, is given a status.
    """
    n = len(flights.status)
    for first in range(0, n, LANES):
        for i in range(LANES):
            _load_start(i, min(first + i, n - 1), flights, lane, measured)
        rates_of(lane.scene[:], lane.state[:], lane.rates[0])
        for i in range(LANES):
            lane.step[i] = _first_step(i, lane, rtol, time_limit)
        _measure(values_of, lane, measured, lane.state[:], lane.rates[0], measured.begin)
        _move_shortly(lane)
        values_of(measured.numbers, lane.point[:], measured.value)
        for i in range(min(LANES, n - first)):
            row = first + i
            flights.evaluations[row], flights.status[row] = 1, _FLYING
            for k in range(0, flights.nodes.shape[1], 8):
                _write_node(i, 0.0, lane.state[:], flights.nodes, row, k)
            for k in range(measured.begin.shape[1] - LANES + i, -1, -LANES):  # the first one counts
                for derivative in range(2):
                    column = 8 + 2 * (k // LANES) + derivative
                    flights.begin[row, column] = measured.begin[derivative, k]
                if math.isnan(measured.begin[VALUE, k]):
                    flights.status[row] = FAILED
                value = measured.value[k]
                rests = value == 0.0 and abs(lane.state[U + i]) < AT_REST
                rests = rests and abs(lane.state[V + i]) < AT_REST > abs(lane.state[W + i])
                if measured.begin[VALUE, k] == 0.0 and (value < 0.0 or rests):
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
    return first_step(math.sqrt(d0 / STATES), math.sqrt(d1 / STATES), time_limit)


@inlined
def _status_of(event):
    return LANDED if event == 0 else FURTHER + event - 1


@inlined
def _move_shortly(lane):
    """Put into `point` the states so shortly after the launch that only the first change counts."""
    for i in range(LANES):
        speed, acceleration = 0.0, 0.0
        for c in range(0, 3 * LANES, LANES):
            speed += lane.state[U + c + i] ** 2
            acceleration += lane.rates[0, U + c + i] ** 2
        time = 1e-30
        if speed > 0.0 and acceleration > 0.0:
            time *= math.sqrt(speed) / math.sqrt(acceleration)
        for c in range(i, SIZE, LANES):
            lane.point[c] = lane.state[c] + time * lane.rates[0, c]
        for c in range(i, U, LANES):
            lane.point[c] += 0.5 * time * time * lane.rates[0, U + c]


@inlined
def _step(rates_of, lane):
    """Take a step in every lane, from `state` to `new`, with the rates of all stages.

    Three rows of `sums` become the weighted sum of the rates before the last stage, and the
    estimates of the error; the fourth is memory to work in. Weights are read in fours, each of
    which is one pass through memory.
    """
    rates, h = lane.rates, lane.sums[3]
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            h[c + i] = lane.step[i]
    for k in range(1, STAGES + 3):
        total = lane.sums[max(k - STAGES, 0)]
        for n in range(0, COUNT[k], 4):
            i, j, p, q = (
                WHICH_RATE[k, n],
                WHICH_RATE[k, n + 1],
                WHICH_RATE[k, n + 2],
                WHICH_RATE[k, n + 3],
            )
            a, b, c, d = WEIGHT[k, n], WEIGHT[k, n + 1], WEIGHT[k, n + 2], WEIGHT[k, n + 3]
            for m in range(SIZE):
                four = (a * rates[i, m] + b * rates[j, m]) + (c * rates[p, m] + d * rates[q, m])
                total[m] = four if n == 0 else total[m] + four
        if k <= STAGES:
            for m in range(SIZE):
                lane.new[m] = lane.state[m] + h[m] * total[m]
            rates_of(lane.scene[:], lane.new[:], rates[k])


@inlined
def _estimate_error(lane, rtol):
    r"""Estimate the error of a step over the tolerated one, and the next step, as scipy does.

    :math:`h e_5^2 / \sqrt{(e_5^2 + 0.01 e_3^2) n}`, with both estimates scaled by the tolerances.
    """
    new, last = lane.new, lane.rates[STAGES]
    for i in range(LANES):
        five, three = 0.0, 0.0
        for c in range(0, SIZE, LANES):
            m = c + i
            per = 1.0 / (lane.scale[m] + rtol * max(abs(lane.state[m]), abs(new[m])))
            five += (lane.sums[1, m] * per) ** 2
            three += (lane.sums[2, m] * per) ** 2 + 0.0 * (new[m] + last[m])  # nan if not finite
        size = (five + 0.01 * three) * STATES
        error = lane.step[i] * five / math.sqrt(size) if size != 0.0 else 0.0
        lane.error[i], lane.growth[i] = error, 0.7 / math.sqrt(math.sqrt(math.sqrt(error)))


@inlined
def _measure(values_of, lane, measured, state, rate, result):
    """Put value and slope of the events' functions at some states into `result`."""
    moved = lane.sums[0]
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            moved[c + i] = state[c + i] + DIFFERENCE * lane.step[i] * rate[c + i]
    values_of(measured.numbers, state, result[VALUE])
    values_of(measured.numbers, moved, result[SLOPE])
    for c in range(0, result.shape[1], LANES):
        for i in range(LANES):
            change = result[SLOPE, c + i] - result[VALUE, c + i]
            result[SLOPE, c + i] = change / (DIFFERENCE * lane.step[i])


@inlined
def _is_plain(start, slope, end, last_slope):
    """Return whether a function neither falls to zero in a step nor turns, nor is not a number."""
    falls = (start >= 0.0) & (end <= 0.0) & (start > end)
    turns = ((slope < 0.0) & (last_slope > 0.0)) | ((slope > 0.0) & (last_slope < 0.0))
    return (end == end) & (not falls) & (not turns)


@inlined
def _take_plain_steps(lane, measured, time_limit, apex):
    """Take the steps that are exact enough, and in which no event can be, nor the apex if asked."""
    last = lane.rates[STAGES]
    for i in range(LANES):
        lane.calls[i] += STAGES
        plain = (lane.row[i] >= 0) & (lane.error[i] < 1.0) & (lane.calls[i] <= MAX_EVALUATIONS)
        plain &= lane.step[i] < time_limit - lane.time[i]
        level = _is_plain(lane.state[W + i], lane.rates[0, W + i], lane.new[W + i], last[W + i])
        plain &= level | (not apex)
        lane.taken[i] = 1.0 if plain else 0.0
    begin, end = measured.begin, measured.end
    for c in range(0, end.shape[1], LANES):
        for i in range(LANES):
            k = c + i
            plain = _is_plain(begin[VALUE, k], begin[SLOPE, k], end[VALUE, k], end[SLOPE, k])
            lane.taken[i] = lane.taken[i] if plain else 0.0


@inlined
def _advance(lane, measured, time_limit):
    """Go to the end of the step in the lanes where it is taken, and choose the next step there."""
    for i in range(LANES):
        taken, h, growth = lane.taken[i] != 0.0, lane.step[i], lane.growth[i]
        most = 1.0 if lane.rejected[i] != 0.0 else 10.0
        lane.time[i] = lane.time[i] + h if taken else lane.time[i]
        longer = _allowed(i, h * growth if growth < most else h * most, lane, time_limit)
        lane.step[i] = longer if taken else h
        lane.rejected[i] = 0.0 if taken else lane.rejected[i]
    for c in range(0, SIZE, LANES):
        for i in range(LANES):
            m, taken = c + i, lane.taken[i] != 0.0
            state, new = lane.state[m], lane.new[m]
            rate, last = lane.rates[0, m], lane.rates[STAGES, m]
            lane.state[m], lane.rates[0, m] = new if taken else state, last if taken else rate
    for c in range(0, measured.end.shape[1], LANES):
        for i in range(LANES):
            k, taken = c + i, lane.taken[i] != 0.0
            for row in range(2):
                measured.begin[row, k] = measured.end[row, k] if taken else measured.begin[row, k]


@inlined
def _ends(i, event, h, lane, measured):
    """Return the value of an event's function and its slope times h at both ends of a step."""
    if event == _CREST:  # the upward speed
        start, slope = lane.state[W + i], lane.rates[0, W + i]
        return start, h * slope, lane.new[W + i], h * lane.rates[STAGES, W + i]
    k = event * LANES + i
    start, slope = measured.begin[VALUE, k], measured.begin[SLOPE, k]
    return start, h * slope, measured.end[VALUE, k], h * measured.end[SLOPE, k]


@inlined
def _spin_cubic(i, h, lane):
    """Return the coefficients of the fraction of the spin from the end of a step back."""
    m, last = LEFT + i, lane.rates[STAGES]
    return backward_cubic((lane.state[m], h * lane.rates[0, m], lane.new[m], h * last[m]))


@inlined
def _correct_fall(values_of, i, event, s, h, lane, measured):
    """Return the fraction of `_find_fall`, corrected by the function's value there."""
    _interpolate(i, s, 0.0, h, lane)
    value = lane.point[W + i]
    if event != _CREST:
        values_of(measured.numbers, lane.point[:], measured.value)
        value = measured.value[event * LANES + i]
    cubic = backward_cubic(_ends(i, event, h, lane, measured))
    corrected = s - value / cubic_slope(cubic, s)
    return corrected if 0.0 < corrected < 1.0 else s


@njit
def _write_node(i, t, y, nodes, row, k):
    """Put a time and the states there into 8 numbers of a row, from k on."""
    nodes[row, k] = t
    for c in range(STATES):
        nodes[row, k + 1 + c] = y[c * LANES + i]


@inlined
def _quintic(m, h, lane):
    """Return the coefficients of a displacement from the end of a step back to its beginning.

    It has the velocities and accelerations at both ends.
    """
    n = U + m
    p0, p1, p2 = lane.new[m], -h * lane.new[n], 0.5 * h * h * lane.rates[STAGES, n]
    d = lane.state[m] - p0 - p1 - p2
    e = -h * lane.state[n] - p1 - 2.0 * p2
    f = h * h * lane.rates[0, n] - 2.0 * p2
    p3, p4 = 10.0 * d - 4.0 * e + 0.5 * f, 7.0 * e - 15.0 * d - f
    return p0, p1, p2, p3, p4, 6.0 * d - 3.0 * e + 0.5 * f


@inlined
def _on_quintic(quintic, s):
    """Return a displacement at a fraction before the end, and the velocity times the step."""
    p0, p1, p2, p3, p4, p5 = quintic
    slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
    return p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5)))), -slope


@njit
def _interpolate(i, s, per, h, lane):
    """Put into lane j of `point` the states of a lane at a fraction s - j per before its end."""
    for c in range(0, U, LANES):
        quintic = _quintic(c + i, h, lane)
        for j in range(LANES):
            displacement, velocity = _on_quintic(quintic, s - j * per)
            lane.point[c + j], lane.point[U + c + j] = displacement, velocity / h
    cubic = _spin_cubic(i, h, lane)
    for j in range(LANES):
        lane.point[LEFT + j] = on_cubic(cubic, s - j * per)


@inlined
def _allowed(i, h, lane, time_limit):
    """Return the length of a lane's next step that is nearest to h."""
    t, longest = lane.time[i], lane.longest[i]
    smallest = 10.0 * _EPS * t + 1e-300
    h = h if h < longest else longest
    h = h if h > smallest else smallest
    return h if h < time_limit - t else time_limit - t


@inlined
def _moves(i, lane):
    """Return whether a step moves the ball by more than is tolerated, as `Integration._step_to`."""
    moves = False
    for c in range(i, U, LANES):
        moves |= abs(lane.new[c] - lane.state[c]) > lane.scale[c]
    return moves


@inlined
def _first_event(i, h, lane, measured, until, apex):
    """Return the first event in a step of a lane, and the fraction of the step after it.

    Events from number `until` on have been read within the step. Also returned are how much of the
    step is to be taken anew (`fall_in_step`), and whether a function is not a number at its end.
    """
    first, before_end, again, unknown = _NO_EVENT, -1.0, 1.0, False
    for event in range(_CREST if apex else 0, measured.begin.shape[1] // LANES):
        ends = _ends(i, event, h, lane, measured)
        unknown |= ends[2] != ends[2]
        s, doubt = fall_in_step(ends, event == _CREST)
        again = min(again, doubt)
        if s > before_end and event < until:
            first, before_end = event, s
    return first, before_end, again, unknown


@inlined
def _end_step(values_of, i, flights, lane, measured, time_limit):
    """Reject a step, take it anew with another length, or take it; return the flight's status."""
    t, h, error, row = lane.time[i], lane.step[i], lane.error[i], lane.row[i]
    if lane.calls[i] > MAX_EVALUATIONS:
        return FAILED
    if not error < 1.0:  # or not a number
        shorter = h * max(0.2, lane.growth[i]) if error < math.inf else 0.2 * h
        lane.step[i], lane.rejected[i] = _allowed(i, shorter, lane, time_limit), 1.0
        return FAILED if shorter < lane.step[i] else _FLYING
    events, fallen, after = measured.end.shape[1] // LANES, lane.fallen[i], lane.after[i]
    apex = flights.nodes.shape[1] > 8
    first, before_end, again, unknown = _first_event(
        i, h, lane, measured, events if fallen == _NO_EVENT else measured.known, apex
    )
    if after > before_end:
        first, before_end = fallen, after
    margin, resolvable = flights.tolerance[row, 4], h > max(100.0 * _EPS * t, 1e-300)
    if again == 1.0 and before_end > margin and resolvable and _moves(i, lane):
        if first != fallen:
            before_end = _correct_fall(values_of, i, first, before_end, h, lane, measured)
        again = (1.0 - before_end) * (1.0 + 0.5 * margin)
    if again < 1.0 and resolvable:
        lane.step[i] = _allowed(i, again * h, lane, time_limit)
        return _FLYING
    if unknown and first < 0:  # the function of an event is not a number
        return FAILED
    if first != _NO_EVENT:
        _interpolate(i, before_end, 0.0, h, lane)
        event_time = t + (1.0 - before_end) * h
        if apex and lane.point[Z + i] > flights.nodes[row, 11]:
            _write_node(i, event_time, lane.point[:], flights.nodes, row, 8)
        if first != _CREST:
            _write_node(i, event_time, lane.point[:], flights.nodes, row, 0)
            return _status_of(first)
    if h < time_limit - t:
        lane.taken[i] = 1.0
        return _FLYING
    if apex and lane.new[Z + i] > flights.nodes[row, 11]:
        _write_node(i, time_limit, lane.new[:], flights.nodes, row, 8)
    _write_node(i, time_limit, lane.new[:], flights.nodes, row, 0)
    return ALOFT


def _read_within(values_of, lanes, measured):
    """Read the functions of all events but the first `measured.known` ones within the steps.

    They are read between the parts of each step, and more closely if an event is possible.
    """
    lane = lanes[0]
    state, new, h, point = lane.state[:], lane.new[:], lane.sums[3], lane.point[:]
    rate, last, most, least = lane.rates[0], lane.rates[STAGES], measured.most, measured.least
    for part in range(1, PARTS):
        a, b, c, d = PART_WEIGHTS[part - 1]
        for m in range(SIZE):
            point[m] = a * state[m] + c * new[m] + h[m] * (b * rate[m] + d * last[m])
        values_of(measured.numbers, point, measured.parts[part])
    for k in range(len(most)):
        measured.parts[0, k], measured.parts[PARTS, k] = (
            measured.begin[VALUE, k],
            measured.end[VALUE, k],
        )
    for part in range(PARTS):
        above, below = measured.parts[part], measured.parts[part + 1]
        for k in range(len(most)):
            change, total = abs(above[k] - below[k]), above[k] + below[k]
            total = total if (above[k] > 0.0) | (below[k] > 0.0) else math.inf
            most[k] = change if (part == 0) | (change > most[k]) else most[k]
            least[k] = total if (part == 0) | (total < least[k]) else least[k]
    for i in range(LANES):
        lane.fallen[i], lane.after[i], possible = _NO_EVENT, -1.0, False
        for k in range(measured.known * LANES + i, len(most), LANES):
            possible |= least[k] <= MOST_CHANGE * most[k]
        if possible and lane.row[i] >= 0 and lane.error[i] < 1.0:
            lane.taken[i] = 0.0
            lane.fallen[i], lane.after[i] = _read_fall(values_of, i, lane, measured)


@njit
def _read_fall(values_of, i, lane, measured):
    """Return which event falls first within a lane's step, and the fraction of the step after it.

    Every lane of `point` has another state of the flight. A row of `sums` has the last values.
    """
    h, last = lane.step[i], lane.sums[0]
    known, events = measured.known, measured.end.shape[1] // LANES
    speed, late_speed = 0.0, 0.0
    for c in range(U + i, LEFT, LANES):
        speed += lane.state[c] ** 2
        late_speed += lane.new[c] ** 2
    count = count_readings(h / PARTS, math.sqrt(max(speed, late_speed)))
    for c in range(0, len(measured.numbers), LANES):
        for j in range(LANES):
            measured.copies[c + j] = measured.numbers[c + i]
    for part in range(PARTS):
        possible = False
        for event in range(known, events):
            k = event * LANES + i
            last[event], above, below = 0.0, measured.parts[part, k], measured.parts[part + 1, k]
            positive = (above > 0.0) | (below > 0.0)
            possible |= positive & (above + below <= MOST_CHANGE * measured.most[k])
        which, low, per = _NO_EVENT, part / PARTS, 1.0 / (count * PARTS)
        number = count + 1 if possible else 0
        while number > 0:
            _interpolate(i, 1.0 - low, per, h, lane)
            values_of(measured.copies, lane.point[:], measured.value)
            fallen, j, most = _NO_EVENT, 0, min(number, LANES)
            while j < most and fallen == _NO_EVENT:
                for event in range(known, events):
                    if last[event] > 0.0 >= measured.value[event * LANES + j]:
                        fallen = event
                if fallen == _NO_EVENT:
                    for event in range(known, events):
                        last[event] = measured.value[event * LANES + j]
                    j += 1
            low, number = low + j * per, number - j
            if fallen != _NO_EVENT:  # it is read again, more closely
                which, low, per, number = fallen, low - per, per / LANES, LANES + 1
            if which != _NO_EVENT and (per < 1e-13 or number == 0):  # or rounding
                return which, 1.0 - low
    return _NO_EVENT, -1.0


def _read_nothing(values_of, lanes, measured):
    """Read no events within the steps, if there is none but the first `measured.known` ones."""


for _function in (_march, _read_within, _read_nothing):
    named(_function, f"{_function.__name__}_{MAX_EVALUATIONS}", compiling, events, dop853)

_equations: Any = numba.types.FunctionType(SIGNATURE)
_lanes: Any = _typeof(np.zeros(1, LANE))
_vector, _matrix = numba.float64[::1], numba.float64[:, ::1]
_measured = _named_tuple(
    [_matrix, _matrix, *(_vector,) * 3, _matrix, _vector, _vector, numba.int64], EventValues
)
_reading = numba.void(_equations, _lanes, _measured)


def source() -> Source:
    """Return the source of the machine code of `_march`."""
    flights = _named_tuple([*(_matrix,) * 6, numba.int8[::1], numba.int64[::1]], Flights)
    number, reading = numba.float64, numba.types.FunctionType(_reading)
    signature = numba.void(
        reading, _equations, _equations, flights, _lanes, _measured, number, number
    )
    return Source(_march, signature, _OPTIONS)


def reading_source(within: bool) -> Source:
    """Return the source of machine code that reads events within the steps, or reads none."""
    return Source(_read_within if within else _read_nothing, _reading, _OPTIONS)
