"""Flight through the air: scipy's integrators, cut exactly at apex and landing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import brentq

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError

METHOD = "DOP853"

MAX_EVALUATIONS = 250_000
"""Of the acceleration; a ball in syrup would take an explicit method for ever."""

Rates = Callable[[float, Sequence[float]], list[float]]


class Event(NamedTuple):
    """What happens where a value, of the states, falls through zero.

    Attributes:
        value: what falls.
        rate: its rate of change, where the states tell it: then a value that falls and rises again
            within a step is seen too, as of a ball that grazes a wall.
    """

    value: Callable[[Array], float]
    rate: Callable[[Array], float] | None = None


class Arc(NamedTuple):
    """A piece of flight that ends at an event.

    Attributes:
        end: time of the event, or of the time limit [s].
        state: there, shape `(m,)`.
        trajectory: the states at many times, shape `(m, n)`.
        evaluations: of the acceleration.
        reached: the event that ended it; None where the time limit did.
        crests: time and state wherever the ball was highest for a while.
    """

    end: float
    state: Array
    trajectory: Callable[[Array], Array]
    evaluations: int
    reached: Event | None
    crests: list[tuple[float, Array]]


def fly_until(
    events: Sequence[Event],
    climb: int,
    rates: Rates,
    start: tuple[float, Array],
    time_limit: float,
    rtol: float,
    atol: Array,
) -> Arc:
    """Integrate until the first of `events`, or to the time limit.

    Args:
        events: any of them ends the flight.
        climb: index of the upward speed, whose falling through zero marks a crest.
        rates: derivative of the states.
        start: time and states to begin with.
        time_limit: [s].
        rtol: relative tolerance.
        atol: absolute tolerance of each state.

    Raises:
        KickdynError: the integrator gave up.
    """
    began, state = start
    if not np.isfinite(rates(began, state.tolist())).all():  # the step size would become NaN
        raise KickdynError(f"the acceleration is not finite at {began:g} s: no flight from there")

    def upward(states: Array) -> float:
        return float(states[climb])

    pieces: list[Any] = []
    crests: list[tuple[float, Array]] = []
    with np.errstate(over="ignore", invalid="ignore"):  # in a step that is then tried anew
        solver = DOP853(rates, began, state, time_limit, rtol=rtol, atol=atol)
        while solver.status == "running":
            before = state
            failure = solver.step()
            state = solver.y
            if not np.isfinite(state).all():
                failure = "the numbers overflow"
            elif solver.nfev > MAX_EVALUATIONS:
                failure = f"it takes more than {MAX_EVALUATIONS} evaluations"
            if failure:
                raise KickdynError(
                    f"the flight could not be integrated beyond {solver.t:g} s: {failure}"
                )
            piece = solver.dense_output()
            pieces.append(piece)
            end, event = min(
                ((_when(event, piece, before, state), event) for event in events),
                key=lambda found: found[0],
            )
            crest = _when(Event(upward), piece, before, state)
            if end < math.inf:
                end = max(end, math.nextafter(piece.t_old, math.inf))
                pieces.pop()
                node, calls = (piece.t_old, before), solver.nfev
                final, more = _landed(event.value, rates, node, end, rtol, atol)
                for other in events:  # which the interpolant saw after this one
                    last = final[-1](final[-1].t)
                    if other is not event and other.value(before) >= 0.0 > other.value(last):
                        event, end, calls = other, final[-1].t, calls + more
                        final, more = _landed(event.value, rates, node, end, rtol, atol)
                pieces += final
                path = OdeSolution([began, *(p.t for p in pieces)], pieces)
                if crest <= path.t_max:
                    crests.append((crest, piece(crest)))
                return Arc(path.t_max, path(path.t_max), path, calls + more, event, crests)
            if crest < math.inf:
                crests.append((crest, piece(crest)))
    path = OdeSolution([began, *(p.t for p in pieces)], pieces)
    return Arc(time_limit, state, path, solver.nfev, None, crests)


def _landed(
    event: Callable[[Array], float],
    rates: Rates,
    start: tuple[float, Array],
    end: float,
    rtol: float,
    atol: Array,
) -> tuple[list[Any], int]:
    """Step anew to the event, which was found on an interpolant, to the integrator's own accuracy.

    Within a long step the interpolant is far less exact than the step. The event then is a little
    off zero, and its rate says how much time that is.
    """
    pieces: list[Any] = []
    calls = 0
    for _ in range(3):
        solver = DOP853(
            rates, start[0], start[1], end, rtol=rtol, atol=atol, first_step=end - start[0]
        )
        pieces = []
        while solver.status == "running":
            failure = solver.step()
            if failure or not np.isfinite(solver.y).all():
                raise KickdynError(
                    f"the landing near {end:g} s could not be integrated: "
                    f"{failure or 'the numbers overflow'}"
                )
            pieces.append(solver.dense_output())
        calls += solver.nfev
        state = solver.y
        ahead = 1e-7 * (end - start[0])
        fall = event(state) - event(state + ahead * solver.f)  # within `ahead`
        late = -event(state) * ahead / fall if fall > 0.0 else 0.0
        if abs(late) <= 4e-16 * end:
            break
        end = max(end - late, math.nextafter(start[0], math.inf))
    return pieces, calls


def _when(event: Event, piece: Any, before: Array, after: Array) -> float:
    """Return when an event comes within a step, inf if it does not."""
    if _falls(event.value, before, after):
        return _root(event.value, piece, piece.t)
    if event.rate is None or not event.rate(before) < 0.0 < event.rate(after):
        return math.inf
    rate = event.rate
    lowest = float(brentq(lambda t: rate(piece(t)), piece.t_old, piece.t, xtol=1e-300, disp=False))
    if event.value(piece(lowest)) > 0.0:
        return math.inf
    return _root(event.value, piece, lowest)


def _falls(value: Callable[[Array], float], before: Array, after: Array) -> bool:
    return value(before) >= 0.0 >= value(after) and value(before) > value(after)


def _root(of: Callable[[Array], float], piece: Any, ended: float) -> float:
    """Return when a value falls through zero between the start of a step and `ended`."""

    def value(t: float) -> float:
        return of(piece(t))

    began = piece.t_old
    # An event that is zero at the start, as a level launch that lift carries up, must rise first.
    times = (began, *(began + (ended - began) * 0.5**k for k in range(1, 60)))
    low = next((t for t in times if value(t) > 0.0), None)
    if low is None:
        return float(began)
    if value(ended) >= 0.0:
        return float(ended)
    return float(brentq(value, low, ended, xtol=1e-300, disp=False))
