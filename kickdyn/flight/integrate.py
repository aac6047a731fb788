"""Integration of a differential equation by DOP853, up to the first of some events.

DOP853 is an explicit Runge-Kutta method of order 8(5,3): Hairer, Norsett & Wanner, Solving Ordinary
Differential Equations I, II.5. Coefficients, error estimate, step sizes and interpolant are
scipy's; the steps are our own, because scipy's spend more time on bookkeeping than on a ball's
acceleration, and because an interpolant is computed only when it is read.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853, DenseOutput
from scipy.optimize import brentq

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError

MAX_EVALUATIONS = 250_000
"""Most evaluations of the rates: a ball in syrup would take an explicit method for ever."""

Rates = Callable[[float, Array], list[float]]

_STAGES = DOP853.n_stages
_ERRORS = np.array([DOP853.E5, DOP853.E3])
_WEIGHTS = np.vstack([DOP853.A, DOP853.B])
_EXTRA = [row[: _STAGES + 1 + k] for k, row in enumerate(DOP853.A_EXTRA)]
_TIMES, _EXTRA_TIMES = DOP853.C.tolist(), DOP853.C_EXTRA.tolist()


class Event(NamedTuple):
    """What happens where a function of the states falls through zero.

    Attributes:
        value: that function.
        rate: its rate of change as a function of the states, or None. With it, a value that falls
            and rises again within a step is seen too, as of a ball that grazes a wall.
    """

    value: Callable[[Array], float]
    rate: Callable[[Array], float] | None = None


class Step(DenseOutput):  # type: ignore[misc]
    """A step of DOP853, as scipy's interpolant of order 7 that is computed when it is first read.

    Attributes:
        t_old, t: beginning and end [s].
        begin, end: the states there, shape `(m,)`.
        slopes: the rates of each stage, of the beginning in row 0 and of the end in the last,
            shape `(13, m)`.
    """

    def __init__(
        self, rates: Rates, t_old: float, t: float, begin: Array, end: Array, slopes: Array
    ) -> None:
        super().__init__(t_old, t)
        self.begin, self.end, self.slopes = begin, end, slopes
        self._rates = rates
        self._terms: Array | None = None

    def terms(self) -> Array:
        """Return the terms of the interpolant, shape `(7, m)`, which takes three evaluations."""
        if self._terms is None:
            h = self.t - self.t_old
            k = np.empty((_STAGES + 1 + len(_EXTRA), len(self.begin)))
            k[: _STAGES + 1] = self.slopes
            for i, (row, part) in enumerate(zip(_EXTRA, _EXTRA_TIMES, strict=True), _STAGES + 1):
                k[i] = self._rates(self.t_old + part * h, self.begin + h * (row @ k[:i]))
            moved = self.end - self.begin
            bent = h * k[0] - moved, 2.0 * moved - h * (k[_STAGES] + k[0])
            self._terms = np.array([moved, *bent, *(h * (DOP853.D @ k))])
        return self._terms

    def _call_impl(self, t: Array) -> Array:
        """Return the states at one time or n, shape `(m,)` or `(m, n)`."""
        x = (t - self.t_old) / (self.t - self.t_old)
        x = x if np.ndim(x) == 0 else np.asarray(x)[:, None]
        return np.asarray(self.begin + _moved(x, self.terms())).T

    def near_end(self, late: float) -> tuple[Array, Array]:
        """Return states and rates shortly before or after the end, of the cubic through both ends.

        After a time of e steps the error is that within the step times e squared.
        """
        h, first, last = self.t - self.t_old, self.slopes[0], self.slopes[_STAGES]
        moved = self.end - self.begin
        bend = (2.0 * last + first - 3.0 * moved / h) / h
        skew = (last + first - 2.0 * moved / h) / (h * h)
        states = self.end + late * (last + late * (bend + late * skew))
        return states, last + late * (2.0 * bend + late * 3.0 * skew)


def _moved(x: Array, terms: Array) -> Array:
    """Return how far the states have moved after a fraction of a step, from the terms of it."""
    a, b, c, d, e, f, g = terms
    z = 1.0 - x
    return np.asarray(x * (a + z * (b + x * (c + z * (d + x * (e + z * (f + x * g)))))))


class FlightArc(NamedTuple):
    """A solution up to an event, or to the time limit.

    Attributes:
        end: time of the event or the limit [s].
        state: there, shape `(m,)`.
        pieces: the steps, each of which is an interpolant.
        evaluations: of the rates, without those that interpolants and crests take later.
        reached: the event that ended it; None where the time limit did.
        crests: functions that return time and state wherever the height had a maximum, as exact as
            the end; those after the end do not count.
    """

    end: float
    state: Array
    pieces: list[Step]
    evaluations: int
    reached: Event | None
    crests: list[Callable[[], tuple[float, Array]]]


def joined(arcs: Sequence[FlightArc], begin: Array) -> Callable[[Array], Array]:
    """Return the states `(m, n)` at n times as a function of the times, from consecutive arcs.

    Without any arc they are those at the beginning.
    """
    pieces = [piece for arc in arcs for piece in arc.pieces]
    begins = np.array([piece.t_old for piece in pieces])

    def states(t: Array) -> Array:
        """Return the states at times, shape `(states, n)`."""
        if not pieces or not t.size:
            return np.tile(begin[:, None], (1, t.size))
        which = np.maximum(np.searchsorted(begins, t, side="right") - 1, 0)
        first = int(which.min())
        few, which = pieces[first : int(which.max()) + 1], which - first
        began, ended = np.array([(piece.t_old, piece.t) for piece in few])[which].T
        terms = np.array([piece.terms() for piece in few]).transpose(1, 0, 2)[:, which]
        x = ((t - began) / (ended - began))[:, None]
        return np.asarray((np.array([piece.begin for piece in few])[which] + _moved(x, terms)).T)

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

    def up(states: Array) -> float:
        """Return the upward speed, whose fall through zero is a crest."""
        return float(states[climb])

    solver = _Solver(rates, rtol, atol, longest)
    h, t = _first_step(state, rate, rtol, atol), began
    pieces: list[Step] = []
    crests: list[Callable[[], tuple[float, Array]]] = []
    with np.errstate(over="ignore", invalid="ignore"):  # in a step that is then tried anew
        while t < time_limit:
            step, h = solver.step(t, state, rate, h, time_limit)
            if climb is not None and up(state) > 0.0 > up(step.end):
                step, h = solver.up_to_crest(climb, (t, state, rate), step, h)
            before, node = state, (t, state, rate)
            t, state, rate = step.t, step.end, step.slopes[_STAGES]
            times = [_when(each, step, before, state) for each in events]
            end = min(times)
            if climb is not None and up(before) >= 0.0 >= up(state) and up(before) > up(state):
                crests.append(partial(solver.refined, up, node, step))
            if end == math.inf:
                pieces.append(step)
                continue
            event = events[times.index(end)]
            reached, final, end, state = solver.first_of(events, event, node, end)
            used = 1 + solver.evaluations
            return FlightArc(end, state, [*pieces, *final], used, reached, crests)
    return FlightArc(time_limit, state, pieces, 1 + solver.evaluations, None, crests)


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


class _Solver:
    """Steps of DOP853 with given tolerances, relative and absolute, and a longest step [s].

    `evaluations` counts those of the rates.
    """

    def __init__(self, rates: Rates, rtol: float, atol: Array, longest: float) -> None:
        self.rates, self.rtol, self.atol, self.longest = rates, rtol, atol, longest
        self.evaluations = 0

    def step(self, t: float, y: Array, rate: Array, h: float, bound: float) -> tuple[Step, float]:
        """Return the next step, of at most h and up to `bound` [s], and how long the one after is.

        The step begins at the time t and the states y, with their rates.
        """
        least, most = 10.0 * (math.nextafter(t, math.inf) - t), 10.0
        h = max(min(h, self.longest), least)
        while True:
            end = t + h if h < (1.0 - 1e-9) * (bound - t) else bound  # and leave no rest
            h = end - t
            k = np.zeros((_STAGES + 1, len(y)))
            k[0], earlier, weights = rate, k[:_STAGES], h * _WEIGHTS
            for i in range(1, _STAGES):
                k[i] = self.rates(t + _TIMES[i] * h, y + weights[i].dot(earlier))
            new = y + weights[_STAGES].dot(earlier)
            k[_STAGES] = self.rates(end, new)
            self.evaluations += _STAGES
            if self.evaluations > MAX_EVALUATIONS:
                raise _given_up(t, f"it takes more than {MAX_EVALUATIONS} evaluations")
            scale = self.atol + self.rtol * np.maximum(np.abs(y), np.abs(new))
            fifth, third = ((_ERRORS @ k) / scale).tolist()
            five, three = sum(e * e for e in fifth), sum(e * e for e in third)
            size = math.sqrt((five + 0.01 * three) * len(y))
            error = h * five / size if size > 0.0 else h * (five + three)  # 0 or not a number
            if error < 1.0:
                growth = min(most, 0.9 * error**-0.125) if error > 0.0 else most
                if not np.isfinite(new).all():
                    raise _given_up(end, "the numbers overflow")
                return Step(self.rates, t, end, y, new, k), h * growth
            h *= max(0.2, 0.9 * error**-0.125) if error < math.inf else 0.2
            most = 1.0
            if h < least:
                raise _given_up(t, "the step would be shorter than time can be resolved")

    def up_to_crest(
        self, climb: int, start: tuple[float, Array, Array], step: Step, h: float
    ) -> tuple[Step, float]:
        """Return a step and the next one's length h [s], the step cut at a crest if need be.

        A ball that goes straight up reverses its drag at the crest, where drag by the square of the
        speed has a jump in its second derivative. A step across it misses the more, and its
        estimate of the error may not see that.
        """
        level = math.hypot(*step.end[climb - 2 : climb])
        fall = float(step.begin[climb] - step.end[climb])
        if level > 0.1 * fall:
            return step, h
        crest = _root(lambda y: float(y[climb]), step, (step.begin[climb], step.end[climb]))
        part = (crest - step.t_old) / (step.t - step.t_old)
        if not 1e-6 < part < 1.0 - 1e-6:  # it ends there already
            return step, h
        return self.step(*start, crest - step.t_old, crest)[0], h

    def first_of(
        self, events: Sequence[Event], event: Event, start: tuple[float, Array, Array], end: float
    ) -> tuple[Event, list[Step], float, Array]:
        """Return the event that ends a step, steps up to it, its time and the states there.

        `event` is the first on the interpolant of the step; on the steps taken anew, another may
        be.
        """
        pieces, end, state = self._landed(event.value, start, end)
        for other in events:
            if other is not event and other.value(start[1]) >= 0.0 > other.value(state):
                event = other
                pieces, end, state = self._landed(other.value, start, end)
        return event, pieces, end, state

    def refined(
        self, event: Callable[[Array], float], start: tuple[float, Array, Array], step: Step
    ) -> tuple[float, Array]:
        """Return time and states of an event in a step, which begins at `start`."""
        with np.errstate(over="ignore", invalid="ignore"):
            when = _root(event, step, (event(step.begin), event(step.end)))
            return self._landed(event, start, when)[1:]

    def _landed(
        self, event: Callable[[Array], float], start: tuple[float, Array, Array], end: float
    ) -> tuple[list[Step], float, Array]:
        """Return steps to an event that was found on an interpolant, its time and the states there.

        Within a long step the interpolant is far less exact than the step. The event then is a
        little off the end of the steps taken anew; a cubic covers a time so short that its error is
        far below the tolerance.
        """
        began = start[0]
        end = max(end, math.nextafter(began, math.inf))
        ahead = 1e-7 * (end - began)

        def missing(state: Array, rate: Array) -> float:
            """Return the time from a state to the event [s], by its rate."""
            fall = event(state) - event(state + ahead * rate)
            return event(state) * ahead / fall if fall > 0.0 else 0.0

        for _ in range(5):
            t, state, rate = start
            pieces: list[Step] = []
            h = end - t
            while t < end:
                step, h = self.step(t, state, rate, h, end)
                t, state, rate = step.t, step.end, step.slopes[_STAGES]
                pieces.append(step)
            late = more = missing(state, rate)
            if abs(late) <= 0.03 * math.sqrt(self.rtol) * (step.t - step.t_old):
                for _ in range(3):
                    if abs(more) <= 4e-16 * end:
                        break
                    state, rate = step.near_end(late)
                    more = missing(state, rate)
                    late += more
                return pieces, end + late, state
            end = max(end + late, math.nextafter(began, math.inf))
        return pieces, t, state


def _given_up(t: float, reason: str) -> KickdynError:
    """Return the error of an integration that ends too soon."""
    return KickdynError(f"the flight could not be integrated beyond {t:g} s: {reason}")


def _when(event: Event, piece: Step, before: Array, after: Array) -> float:
    """Return about when an event comes within a step, inf if it does not."""
    began, ended = event.value(before), event.value(after)
    if began >= 0.0 >= ended and began > ended:
        return _root(event.value, piece, (began, ended))
    if event.rate is None or not event.rate(before) < 0.0 < event.rate(after):
        return math.inf
    rate = event.rate
    lowest = float(brentq(lambda t: rate(piece(t)), piece.t_old, piece.t, xtol=1e-300, disp=False))
    least = event.value(piece(lowest))
    return math.inf if least > 0.0 else _root(event.value, piece, (began, least), lowest)


def _root(
    of: Callable[[Array], float],
    piece: Step,
    ends: tuple[float, float],
    until: float | None = None,
) -> float:
    """Return about when a value falls through zero between the start of a step and `until`.

    That is the end of the step where it is None; the values at both ends are known.
    """
    began = float(piece.t_old)
    ended = float(piece.t if until is None else until)
    near = max(1e-9 * (ended - began), 1e-300)

    def value(t: float) -> float:
        """Return the event's function along the step."""
        return ends[0] if t == began else ends[1] if t == ended else of(piece(t))

    # An event that is zero at the start, as a level launch that lift carries up, must rise first.
    times = (began, *(began + (ended - began) * 0.5**k for k in range(1, 60)))
    low = next((t for t in times if value(t) > 0.0), None)
    if low is None:
        return began
    if value(ended) >= 0.0:
        return ended
    return float(brentq(value, low, ended, xtol=near, disp=False))
