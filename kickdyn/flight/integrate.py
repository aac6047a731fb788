"""Integration of a differential equation by scipy's DOP853, up to the first of some events.

DOP853 is an explicit Runge-Kutta method of order 8(5,3): Hairer, Norsett & Wanner, Solving Ordinary
Differential Equations I, II.5.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853, DenseOutput, OdeSolution
from scipy.optimize import brentq

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError

MAX_EVALUATIONS = 250_000
"""Most evaluations of the rates: a ball in syrup would take an explicit method for ever."""

Rates = Callable[[float, Array], list[float]]


class Event(NamedTuple):
    """What happens where a function of the states falls through zero.

    Attributes:
        value: that function.
        rate: its rate of change as a function of the states, or None. With it, a value that falls
            and rises again within a step is seen too, as of a ball that grazes a wall.
    """

    value: Callable[[Array], float]
    rate: Callable[[Array], float] | None = None


class FlightArc(NamedTuple):
    """A solution up to an event, or to the time limit.

    Attributes:
        end: time of the event or the limit [s].
        state: there, shape `(m,)`.
        pieces: scipy's interpolants, one for each step.
        evaluations: of the rates.
        reached: the event that ended it; None where the time limit did.
        crests: time and state wherever the height had a maximum.
    """

    end: float
    state: Array
    pieces: list[DenseOutput]
    evaluations: int
    reached: Event | None
    crests: list[tuple[float, Array]]


def joined(arcs: Sequence[FlightArc], begin: Array) -> Callable[[Array], Array]:
    """Return the states `(m, n)` at n times as a function of the times, from consecutive arcs.

    Without any arc they are those at the beginning.
    """
    pieces = [piece for arc in arcs for piece in arc.pieces]
    path = OdeSolution([pieces[0].t_old, *(p.t for p in pieces)], pieces) if pieces else None

    def states(t: Array) -> Array:
        """Return the states at times, shape `(states, n)`."""
        if path is None or not t.size:  # scipy's solution takes no empty array
            return np.tile(begin[:, None], (1, t.size))
        return np.asarray(path(t))

    return states


def fly_until(
    events: Sequence[Event],
    climb: int | None,
    rates: Rates,
    start: tuple[float, Array],
    time_limit: float,
    rtol: float,
    atol: Array,
    longest: float = math.inf,
) -> FlightArc:
    """Integrate from a time and states until the first of `events`, or to the time limit [s].

    Where the upward speed, the state number `climb`, falls through zero is a crest; None is for no
    crests. Tolerances are relative and absolute, of each state, and `longest` limits a step [s].
    Where the integrator gives up, `KickdynError` is raised.
    """
    began, state = start
    rate = np.array(rates(began, state))
    if not np.isfinite(rate).all():  # the step size would become NaN
        raise KickdynError(f"the acceleration is not finite at {began:g} s: no flight from there")
    crest = None if climb is None else Event(lambda states: float(states[climb]))
    pieces: list[DenseOutput] = []
    crests: list[tuple[float, Array]] = []
    with np.errstate(over="ignore", invalid="ignore"):  # in a step that is then tried anew
        solver_from = partial(DOP853, rates, max_step=longest, rtol=rtol, atol=atol)
        first = min(_first_step(state, rate, rtol, atol), time_limit - began)
        solver = solver_from(began, state, time_limit, first_step=first)
        while solver.status == "running":
            before = state
            state, piece = _step(solver)
            times = [_when(each, piece, before, state) for each in events]
            top = math.inf if crest is None else _when(crest, piece, before, state)
            if (end := min(times)) == math.inf:
                pieces.append(piece)
                if top < math.inf:
                    crests.append((top, piece(top)))
                continue
            event, node = events[times.index(end)], (float(piece.t_old), before)
            end = max(end, math.nextafter(node[0], math.inf))
            reached, final, calls = _first_of(events, event, solver_from, node, end)
            last = final[-1]
            if top <= last.t:
                crests.append((top, piece(top)))
            total = solver.nfev + calls
            return FlightArc(last.t, last(last.t), [*pieces, *final], total, reached, crests)
    return FlightArc(time_limit, state, pieces, solver.nfev, None, crests)


def _first_step(state: Array, rate: Array, rtol: float, atol: Array) -> float:
    r"""Return the first step [s], :math:`(3 \cdot 10^{-5} / d_0)^{1/8}\, d_0 / d_1`.

    The norms d of state and rate are relative to the tolerances. It is the step of Hairer, Norsett
    & Wanner, II.4, in any unit of time; with their 0.01, which they use with the larger of two
    derivatives, the landing would be up to four times as far off.
    """
    scale = atol + rtol * np.abs(state)
    size, change = (math.sqrt(float(np.mean((part / scale) ** 2))) for part in (state, rate))
    size = max(size, 1.0)
    return size / change * (3e-5 / size) ** 0.125 if change > 0.0 else math.inf


def _step(solver: DOP853) -> tuple[Array, DenseOutput]:
    """Return the states after one more step, and its interpolant."""
    failure = solver.step()
    if not np.isfinite(solver.y).all():
        failure = "the numbers overflow"
    elif solver.nfev > MAX_EVALUATIONS:
        failure = f"it takes more than {MAX_EVALUATIONS} evaluations"
    if failure:
        raise KickdynError(f"the flight could not be integrated beyond {solver.t:g} s: {failure}")
    return solver.y, solver.dense_output()


def _first_of(
    events: Sequence[Event],
    event: Event,
    solver_from: Callable[..., DOP853],
    start: tuple[float, Array],
    end: float,
) -> tuple[Event, list[DenseOutput], int]:
    """Return the event that ends a step, the steps up to it, and their evaluations.

    `event` is the first on the interpolant of the step; on the steps taken anew, another may be.
    """
    pieces, calls = _landed(event.value, solver_from, start, end)
    for other in events:
        last = pieces[-1](pieces[-1].t)
        if other is not event and other.value(start[1]) >= 0.0 > other.value(last):
            event = other
            pieces, more = _landed(other.value, solver_from, start, pieces[-1].t)
            calls += more
    return event, pieces, calls


def _landed(
    event: Callable[[Array], float],
    solver_from: Callable[..., DOP853],
    start: tuple[float, Array],
    end: float,
) -> tuple[list[DenseOutput], int]:
    """Return steps to an event that was found on an interpolant, and their evaluations.

    Within a long step the interpolant is far less exact than the step. The event then is a little
    off zero, and its rate says how much time that is.
    """
    pieces: list[DenseOutput] = []
    calls = 0
    for _ in range(3):
        solver = solver_from(*start, end, first_step=end - start[0])
        pieces = []
        while solver.status == "running":
            state, piece = _step(solver)
            pieces.append(piece)
        calls += solver.nfev
        ahead = 1e-7 * (end - start[0])
        fall = event(state) - event(state + ahead * solver.f)  # within `ahead`
        late = -event(state) * ahead / fall if fall > 0.0 else 0.0
        if abs(late) <= 4e-16 * end:
            break
        end = max(end - late, math.nextafter(start[0], math.inf))
    return pieces, calls


def _when(event: Event, piece: DenseOutput, before: Array, after: Array) -> float:
    """Return when an event comes within a step, inf if it does not."""
    began, ended = event.value(before), event.value(after)
    if began >= 0.0 >= ended and began > ended:
        return _root(event.value, piece, piece.t)
    if event.rate is None or not event.rate(before) < 0.0 < event.rate(after):
        return math.inf
    rate = event.rate
    lowest = float(brentq(lambda t: rate(piece(t)), piece.t_old, piece.t, xtol=1e-300, disp=False))
    if event.value(piece(lowest)) > 0.0:
        return math.inf
    return _root(event.value, piece, lowest)


def _root(of: Callable[[Array], float], piece: DenseOutput, ended: float) -> float:
    """Return when a value falls through zero between the start of a step and `ended`."""

    def value(t: float) -> float:
        """Return the event's function along the step."""
        return of(piece(t))

    began = float(piece.t_old)
    # An event that is zero at the start, as a level launch that lift carries up, must rise first.
    times = (began, *(began + (ended - began) * 0.5**k for k in range(1, 60)))
    low = next((t for t in times if value(t) > 0.0), None)
    if low is None:
        return began
    if value(ended) >= 0.0:
        return float(ended)
    return float(brentq(value, low, ended, xtol=1e-300, disp=False))
