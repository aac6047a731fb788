"""One flight after the other in machine code: scipy's DOP853 again, without its Python.

Coefficients, error estimate and step control are scipy's. Events are not read off an interpolant:
the step that crosses one is taken anew with the length that ends there, so that a node is as
accurate as the steps are.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop853

from kickdyn.flight.compiling import SIGNATURE
from kickdyn.flight.integrate import MAX_EVALUATIONS

LANDED, ALOFT, FAILED = 0, 1, 2

_STAGES = 12
# What row i of the rates is found with, then the step itself, then both estimates of its error:
# column 0, and columns from _FIRST to _LAST.
_TABLE = np.vstack(
    [dop853.A[:_STAGES, :_STAGES], dop853.B, dop853.E5[:_STAGES], dop853.E3[:_STAGES]]
)
_FIFTH, _THIRD = _STAGES + 1, _STAGES + 2
_LAST = np.minimum(np.arange(len(_TABLE)), _STAGES)
_FIRST = np.array(
    [next((j for j in range(1, n) if row[j]), n) for n, row in zip(_LAST, _TABLE, strict=True)]
)
_NEW, _AT = _STAGES, _STAGES + 1  # rows for the rates after the step, and at an event

_ACTING = numba.types.FunctionType(SIGNATURE)
_VECTOR, _MATRIX = numba.float64[::1], numba.float64[:, ::1]

_njit: Any = numba.njit


@_njit(error_model="numpy")
def _rate(acting, scene, y, rate):  # type: ignore[no-untyped-def]
    """Put the derivative of displacement, velocity and spin over that of the launch in `rate`."""
    left = y[6]
    ax, ay, az, k = acting(
        scene[0] + y[2], y[3], y[4], y[5], left * scene[1], left * scene[2], left * scene[3]
    )
    rate[0], rate[1], rate[2] = y[3], y[4], y[5]
    rate[3], rate[4], rate[5] = ax, ay, az
    rate[6] = -k * left * scene[4]


@_njit(error_model="numpy")
def _mix(k, rates):  # type: ignore[no-untyped-def]
    """Return the sum of the rates with the weights of row k of the table.

    Seven sums side by side, so that none waits for another; no views, which would be counted.
    """
    w = _TABLE[k, 0]
    x, y, z, u = w * rates[0, 0], w * rates[0, 1], w * rates[0, 2], w * rates[0, 3]
    v, climb, left = w * rates[0, 4], w * rates[0, 5], w * rates[0, 6]
    for j in range(_FIRST[k], _LAST[k]):
        w = _TABLE[k, j]
        x += w * rates[j, 0]
        y += w * rates[j, 1]
        z += w * rates[j, 2]
        u += w * rates[j, 3]
        v += w * rates[j, 4]
        climb += w * rates[j, 5]
        left += w * rates[j, 6]
    return x, y, z, u, v, climb, left


@_njit(error_model="numpy")
def _step(acting, scene, old, h, rates, new):  # type: ignore[no-untyped-def]
    """Take one step from `old`, whose rates are in row 0, to `new`."""
    for i in range(1, _STAGES + 1):
        x, y, z, u, v, climb, left = _mix(i, rates)
        new[0] = old[0] + h * x
        new[1] = old[1] + h * y
        new[2] = old[2] + h * z
        new[3] = old[3] + h * u
        new[4] = old[4] + h * v
        new[5] = old[5] + h * climb
        new[6] = old[6] + h * left
        if i < _STAGES:
            _rate(acting, scene, new, rates[i])


@_njit(error_model="numpy")
def _error(y, new, h, rates, rtol, scale, count):  # type: ignore[no-untyped-def]
    """Return scipy's estimate of the error of a step over what is tolerated."""
    fifth, third = 0.0, 0.0
    fives, threes = _mix(_FIFTH, rates), _mix(_THIRD, rates)
    for c in range(7):
        near = scale[c] + rtol * max(abs(y[c]), abs(new[c]))
        five, three = fives[c] / near, threes[c] / near
        fifth += five * five
        third += three * three
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return h * fifth / math.sqrt((fifth + 0.01 * third) * count)


@_njit(error_model="numpy")
def _first_step(acting, scene, y, rates, rtol, scale, count, limit, new):  # type: ignore[no-untyped-def]
    """Return scipy's guess of a first step (Hairer, Norsett & Wanner, II.4)."""
    d0, d1 = 0.0, 0.0
    for c in range(7):
        near = scale[c] + rtol * abs(y[c])
        if c != 6 or scene[4] > 0.0:
            d0 += (y[c] / near) ** 2
        d1 += (rates[0, c] / near) ** 2
    d0, d1 = math.sqrt(d0 / count), math.sqrt(d1 / count)
    h0 = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, limit)
    for c in range(7):
        new[c] = y[c] + h0 * rates[0, c]
    _rate(acting, scene, new, rates[1])
    d2 = 0.0
    for c in range(7):
        d2 += ((rates[1, c] - rates[0, c]) / (scale[c] + rtol * abs(y[c]))) ** 2
    d2 = math.sqrt(d2 / count) / h0
    h1 = max(1e-6, h0 * 1e-3) if max(d1, d2) <= 1e-15 else (0.01 / max(d1, d2)) ** 0.125
    return min(100.0 * h0, h1, limit)


@_njit(error_model="numpy")
def _guess(y, new, h, rates, drop, apex, low):  # type: ignore[no-untyped-def]
    """Return about where in a step the event falls through 0, as a fraction, or -1 for nowhere.

    From the quintic through height, speed and acceleration at both ends.
    """
    c1, c2 = h * y[5], 0.5 * h * h * rates[0, 5]
    d = new[2] - y[2] - c1 - c2
    e = h * new[5] - c1 - 2.0 * c2
    f = h * h * rates[_NEW, 5] - 2.0 * c2
    p0, p1, p2 = y[2] + drop, c1, c2
    p3, p4, p5 = 10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f
    if apex:
        p0, p1, p2, p3, p4, p5 = p1, 2.0 * p2, 3.0 * p3, 4.0 * p4, 5.0 * p5, 0.0
    # An event that is zero at the start, as a level launch that lift carries up, must rise first.
    start, part = low, 1.0
    for _ in range(60):
        if p0 + start * (p1 + start * (p2 + start * (p3 + start * (p4 + start * p5)))) > 0.0:
            break
        part *= 0.5
        start = low + (1.0 - low) * part
    else:
        return -1.0
    end, s = 1.0, 0.5 * (start + 1.0)
    for _ in range(60):
        value = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        if value > 0.0:
            start = s
        else:
            end = s
        further = s - value / slope
        if not start < further < end:
            further = 0.5 * (start + end)
        moved, s = abs(further - s), further
        if moved < 1e-9:
            break
    return s


@_njit(error_model="numpy")
def _cut(acting, scene, y, h, rates, drop, apex, guess, low, tol, at):  # type: ignore[no-untyped-def]
    """Put the states at the event in `at`; return its time since `y` and the evaluations taken.

    Newton's method on the length of the step. Once the way left is so short that its third order
    is far below the tolerance, a parabola covers it.
    """
    short = 0.03 * math.sqrt(tol) * h
    begin, end, t = low, h, guess
    taken = 0
    for _ in range(100):
        _step(acting, scene, y, t, rates, at)
        _rate(acting, scene, at, rates[_AT])
        taken += _STAGES
        speed, slope = at[5], rates[_AT, 5]
        if apex:
            value, more = speed, -speed / slope
        else:
            value = at[2] + drop
            more = -2.0 * value / (speed - math.sqrt(max(speed * speed - 2.0 * slope * value, 0.0)))
        if abs(more) <= short or value == 0.0 or end - begin <= 1e-15 * h:
            break
        if value > 0.0:
            begin = t
        else:
            end = t
        t += more
        if not begin < t < end:
            t = 0.5 * (begin + end)
    if abs(more) <= short:
        more = min(max(more, -t), h - t)
        for c in range(3):
            at[c] += more * (at[c + 3] + 0.5 * more * rates[_AT, c + 3])
        for c in range(3, 7):
            at[c] += more * rates[_AT, c]
        t += more
    return t, taken


@_njit(error_model="numpy")
def _one(acting, scene, start, rtol, tol, limit, rates, work, out):  # type: ignore[no-untyped-def]
    """Fly once; return status and evaluations, and fill `out` as `march` says."""
    drop, count = scene[5], scene[6]
    y, new, at, scale = work[0], work[1], work[2], work[3]
    y[:] = 0.0
    y[3:6] = start
    y[6] = 1.0
    scale[:3], scale[3:6], scale[6] = scene[7], scene[8], tol
    out[:] = 0.0
    out[1:8] = y
    out[9:16] = y
    _rate(acting, scene, y, rates[0])
    rises = y[5] > 0.0 or (y[5] == 0.0 and rates[0, 5] > 0.0)
    if not rises and drop == 0.0:
        return LANDED, 1
    for c in range(7):
        if not math.isfinite(rates[0, c]):
            return FAILED, 1
    t, evaluations = 0.0, 2
    h = _first_step(acting, scene, y, rates, rtol, scale, count, limit, new)
    rejected = False
    while t < limit:
        smallest = 10.0 * (np.nextafter(t, math.inf) - t)
        if evaluations > MAX_EVALUATIONS or (rejected and h < smallest):
            return FAILED, evaluations
        h = max(h, smallest)
        h = min(h, limit - t)
        _step(acting, scene, y, h, rates, new)
        evaluations += _STAGES - 1
        error = _error(y, new, h, rates, rtol, scale, count)
        if not error < 1.0:  # or not a number
            h *= max(0.2, 0.9 * error**-0.125) if error < math.inf else 0.2
            rejected = True
            continue
        _rate(acting, scene, new, rates[_NEW])
        evaluations += 1
        for c in range(7):
            if not math.isfinite(new[c]) or not math.isfinite(rates[_NEW, c]):
                return FAILED, evaluations
        low = 0.0
        if y[5] >= 0.0 >= new[5] and y[5] > new[5]:
            rises = False
            part = _guess(y, new, h, rates, drop, True, 0.0)
            if part >= 0.0:
                low, taken = _cut(acting, scene, y, h, rates, drop, True, part * h, 0.0, tol, at)
                evaluations += taken
                if at[2] > out[11]:
                    out[8] = t + low
                    out[9:16] = at
        if not rises and y[2] + drop >= 0.0 >= new[2] + drop and y[2] > new[2]:
            part = max(_guess(y, new, h, rates, drop, False, low / h), low / h)
            end, taken = _cut(acting, scene, y, h, rates, drop, False, part * h, low, tol, at)
            out[0] = t + end
            out[1:8] = at
            out[3] = -drop  # by definition; the event's root says so but for rounding
            return LANDED, evaluations + taken
        t = limit if h == limit - t else t + h
        y[:] = new
        rates[0] = rates[_NEW]
        grow = 10.0 if error == 0.0 else min(10.0, 0.9 * error**-0.125)
        h *= min(1.0, grow) if rejected else grow
        rejected = False
    if y[2] > out[11]:
        out[8] = t
        out[9:16] = y
    out[0] = t
    out[1:8] = y
    return ALOFT, evaluations


def _march(acting, scenes, velocities, rtol, tol, limit, out, status, evaluations):  # type: ignore[no-untyped-def]
    """Fly every row.

    Args:
        acting: the compiled forces.
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
    rates, work = np.empty((_STAGES + 2, 7)), np.empty((4, 7))
    for i in range(len(out)):
        status[i], evaluations[i] = _one(
            acting, scenes[i], velocities[i], rtol, tol, limit, rates, work, out[i]
        )
        if status[i] == FAILED:
            out[i] = math.nan


def _compiled() -> Any:
    """Return `_march` as machine code, from the disk if it can be kept there: 7 s to compile."""
    signature = numba.void(
        _ACTING, _MATRIX, _MATRIX, *(numba.float64,) * 3, _MATRIX, numba.int8[::1], numba.int64[::1]
    )
    try:
        return _njit(signature, error_model="numpy", nogil=True, cache=True)(_march)
    except (RuntimeError, OSError):  # nowhere to keep it
        return _njit(signature, error_model="numpy", nogil=True)(_march)


march = _compiled()
