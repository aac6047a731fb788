"""Many flights in machine code: scipy's DOP853 again, without its Python.

Events are not read off an interpolant: the step that crosses one is taken anew with the length that
ends there, so that a node is as accurate as the steps are. Every flight has a lane, with its own
time and step; whichever ends makes room for the next.
"""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Any

import numba
import numpy as np

from kickdyn.core.compilation import compiled, named
from kickdyn.flight import lanes, steps
from kickdyn.flight.integrate import MAX_EVALUATIONS
from kickdyn.flight.lanes import HOW, LANES, LEFT, SIGNATURE, SIZE, U, W, X, Z, inlined, njit
from kickdyn.flight.steps import (
    ALOFT,
    DROP,
    ERROR,
    FAILED,
    GROWTH,
    HIGH,
    KNOWN,
    LANDED,
    LOW,
    NEXT,
    SPAN,
    STAGES,
    TAKEN,
    H,
    T,
    advance,
    board,
    judge,
    starts,
    step,
)  # fmt: skip

_EPS = float(np.finfo(float).eps)

_FLYING, _TO_APEX, _TO_LANDING, _IDLE = range(4)  # what a lane's step is for
_ROW, _PHASE, _REJECTED, _RISES, _CALLS = range(5)  # of what a lane knows in integers


@njit
def _guess(i, y, new, h, rates, new_rates, drop, apex, low):  # type: ignore[no-untyped-def]
    """Return about where in a step the event falls through 0, as a fraction, or -1 for nowhere.

    From the quintic through height, speed and acceleration at both ends.
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
def _arrived(i, apex, new, rates, tol, lane):  # type: ignore[no-untyped-def]
    """Move a lane's try at an event by Newton's method; return whether it is there.

    Once the way left is so short that its third order is far below the tolerance, a parabola covers
    it: the states are then those of the event.
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
def _note(i, t, y, out):  # type: ignore[no-untyped-def]
    """Put a time and the states there into 8 numbers."""
    out[0] = t
    for c in range(7):
        out[1 + c] = y[c * LANES + i]


@inlined
def _propose(i, h, limit, lane, knows):  # type: ignore[no-untyped-def]
    """Set the length of a lane's next step; return -1, or `FAILED` where that is in vain."""
    t = lane[T, i]
    smallest = max(10.0 * _EPS * t, 1e-300)
    lane[H, i] = min(max(h, smallest), limit - t)
    knows[_PHASE, i] = _FLYING
    vain = knows[_CALLS, i] > MAX_EVALUATIONS or (knows[_REJECTED, i] == 1 and h < smallest)
    return FAILED if vain else -1


@inlined
def _pass(i, end, lane, knows, limit, out):  # type: ignore[no-untyped-def]
    """Move a lane's clock to the `end` of its step; return status, -1 while the flight lasts."""
    last = lane[SPAN, i] == limit - lane[T, i]
    lane[T, i] = limit if last else lane[T, i] + lane[SPAN, i]
    knows[_REJECTED, i] = 0
    if not last:
        return _propose(i, lane[NEXT, i], limit, lane, knows)
    if end[Z + i] > out[11]:
        _note(i, limit, end, out[8:])
    _note(i, limit, end, out)
    return ALOFT


@inlined
def _seek(i, y, rates, lane, knows, far, far_rates):  # type: ignore[no-untyped-def]
    """Turn to the apex or the landing if the step whose end `far` holds crosses one, else -1."""
    drop, span, first = lane[DROP, i], lane[SPAN, i], rates[0]
    passed = knows[_PHASE, i] == _TO_APEX
    if not passed and y[W + i] >= 0.0 >= far[W + i] and y[W + i] > far[W + i]:
        knows[_RISES, i] = 0
        part = _guess(i, y, far, span, first, far_rates, drop, True, 0.0)
        if part >= 0.0:
            lane[LOW, i], lane[HIGH, i], lane[H, i] = 0.0, span, part * span
            knows[_PHASE, i] = _TO_APEX
            return True
    low = lane[H, i] if passed else 0.0
    above, below = y[Z + i] + drop, far[Z + i] + drop
    if knows[_RISES, i] == 0 and above >= 0.0 >= below and above > below:
        part = _guess(i, y, far, span, first, far_rates, drop, False, low / span)
        lane[LOW, i], lane[HIGH, i], lane[H, i] = low, span, max(part * span, low)
        knows[_PHASE, i] = _TO_LANDING
        return True
    return False


@inlined
def _sought(i, y, rates, new, lane, knows, tol, limit, far, far_rates, out):  # type: ignore[no-untyped-def]
    """Look at a step that went for an event; return the flight's status, -1 while it lasts."""
    apex = knows[_PHASE, i] == _TO_APEX
    if not _arrived(i, apex, new, rates[STAGES], tol, lane):
        return -1
    t = lane[T, i] + lane[H, i]
    if not apex:
        _note(i, t, new, out)
        out[3] = -lane[DROP, i]  # by definition; the event's root says so but for rounding
        return LANDED
    if new[Z + i] > out[11]:
        _note(i, t, new, out[8:])
    if _seek(i, y, rates, lane, knows, far, far_rates):
        return -1
    for m in range(i, SIZE, LANES):
        y[m], rates[0, m] = far[m], far_rates[m]
    return _pass(i, far, lane, knows, limit, out)


@inlined
def _flown(i, y, rates, new, lane, knows, limit, far, far_rates, out):  # type: ignore[no-untyped-def]
    """Look at an ordinary step; return the flight's status, -1 while it lasts."""
    h, error, growth = lane[H, i], lane[ERROR, i], lane[GROWTH, i]
    if not error < 1.0:  # or not a number
        knows[_REJECTED, i] = 1
        h *= max(0.2, growth) if error < math.inf else 0.2
        return _propose(i, h, limit, lane, knows)
    lane[SPAN, i] = h
    lane[NEXT, i] = h * min(growth, 1.0 if knows[_REJECTED, i] == 1 else 10.0)
    drop = lane[DROP, i]
    if y[W + i] >= 0.0 >= new[W + i] or y[Z + i] + drop >= 0.0 >= new[Z + i] + drop:
        for m in range(i, SIZE, LANES):
            far[m], far_rates[m] = new[m], rates[STAGES, m]
        if _seek(i, y, rates, lane, knows, far, far_rates):
            return -1
    lane[TAKEN, i] = 1.0
    return _pass(i, new, lane, knows, limit, out)


def _march(pull, scenes, velocities, rtol, tol, limit, out, status, evaluations):  # type: ignore[no-untyped-def]
    """Fly every row.

    Args:
        pull: the compiled rates, `lanes.side_by_side`.
        scenes: per row height, spin (3), whether it decays, drop, number of states that change,
            absolute tolerance of displacement and of velocity.
        velocities: at the launch, shape `(n, 3)` [m/s].
        rtol: relative tolerance.
        tol: absolute tolerance of the spin.
        limit: of time [s].
        out: shape `(n, 16)`: time and 7 states at the end, time and 7 states at the apex.
        status: `LANDED`, `ALOFT` or `FAILED`.
        evaluations: of the acceleration.
    """
    n = len(out)
    rates, begin = np.zeros((STAGES + 1, SIZE)), np.empty((n, 8))
    starts(pull, scenes, velocities, rtol, tol, limit, rates, begin, status, evaluations)
    scene, scale = np.zeros(5 * LANES), np.ones(SIZE)
    y, new, far, far_rates = np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE)
    five, three = np.zeros(SIZE), np.zeros(SIZE)
    lane, knows = np.zeros((KNOWN, LANES)), np.zeros((5, LANES), np.int64)
    knows[_PHASE] = _IDLE
    waiting, flying = 0, 0
    while True:
        for i in range(LANES):
            while knows[_PHASE, i] == _IDLE and waiting < n:
                row = waiting
                waiting += 1
                board(i, row, scenes, velocities, tol, scene, y, scale, lane)
                _note(i, 0.0, y, out[row])
                _note(i, 0.0, y, out[row, 8:])
                if status[row] != ALOFT:
                    continue
                lane[T, i] = 0.0
                for c in range(7):
                    rates[0, c * LANES + i] = begin[row, c]
                climb, lifted = begin[row, 2], begin[row, 5]
                knows[_ROW, i], knows[_CALLS, i], knows[_REJECTED, i] = row, 2, 0
                knows[_RISES, i] = climb > 0.0 or (climb == 0.0 and lifted > 0.0)
                _propose(i, begin[row, 7], limit, lane, knows)
                flying += 1
        if flying == 0:
            break
        step(pull, scene, y, lane, rates, five, three, new)
        judge(y, new, rates, rtol, scale, lane, five, three)
        for i in range(LANES):
            if knows[_PHASE, i] == _IDLE:
                continue
            row = knows[_ROW, i]
            knows[_CALLS, i] += STAGES
            lane[TAKEN, i] = 0.0
            here = (i, y, rates, new, lane, knows)
            if knows[_PHASE, i] == _FLYING:
                done = _flown(*here, limit, far, far_rates, out[row])
            else:
                done = _sought(*here, tol, limit, far, far_rates, out[row])
            if done >= 0:
                status[row], evaluations[row] = done, knows[_CALLS, i]
                knows[_PHASE, i], lane[H, i] = _IDLE, 0.0
                flying -= 1
        advance(y, rates, new, lane)
    for row in range(n):
        if status[row] == FAILED:
            out[row] = math.nan


def _compiled() -> Any:
    """Return `_march` as machine code, from the disk if it can be kept there: it takes seconds."""
    matrix = numba.float64[:, ::1]
    signature = numba.void(
        numba.types.FunctionType(SIGNATURE), matrix, matrix, *(numba.float64,) * 3,
        matrix, numba.int8[::1], numba.int64[::1],
    )  # fmt: skip
    # numba looks for changes in this file only; the others are part of the name
    sources = [Path(str(module.__file__)).read_bytes() for module in (lanes, steps)]
    check_type = zlib.crc32(b"".join(sources), MAX_EVALUATIONS)
    return compiled(named(_march, f"march_{check_type:08x}"), signature, **HOW)


march = _compiled()
