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
"""The rates of change of the states, as a function of the time [s] and the states."""

Node = tuple[float, Array, Array]
"""A time [s], the states there and their rates."""

_STAGES = DOP853.n_stages
_ERRORS = np.array([DOP853.E5, DOP853.E3])
_WEIGHTS = np.vstack([DOP853.A, DOP853.B])
_EXTRA = [row[: _STAGES + 1 + k] for k, row in enumerate(DOP853.A_EXTRA)]
_TIMES, _EXTRA_TIMES = DOP853.C.tolist(), DOP853.C_EXTRA.tolist()


class Event(NamedTuple):
    """What happens where a function of the states falls through zero.

    Attributes:
        value: that function.
        rate: its rate of change, a linear function of the states, so that of their rates it is the
            second derivative; or None. With it, a value that falls and rises again within a step is
            seen too, as of a ball that grazes a wall.
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

    @property
    def first(self) -> Node:
        """Return the node at the beginning."""
        return self.t_old, self.begin, self.slopes[0]

    @property
    def last(self) -> Node:
        """Return the node at the end."""
        return self.t, self.end, self.slopes[_STAGES]

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
    A step in which the rate of an event may change its sign twice is halved, so that neither the
    event nor a crest can come and go within it. Where the integrator gives up, `KickdynError` is
    raised.
    """
    began, state = start
    node = began, state, np.array(rates(began, state))
    if not np.isfinite(node[2]).all():  # the step size would become NaN
        raise KickdynError(f"the acceleration of the ball is not finite at {began:g} s")

    def up(states: Array) -> float:
        """Return the upward speed, whose fall through zero is a crest."""
        return float(states[climb])

    solver = _Solver(rates, rtol, atol, longest)
    turning = [event.rate for event in events if event.rate is not None]
    h = _first_step(*node[1:], rtol, atol)
    pieces: list[Step] = []
    crests: list[Callable[[], tuple[float, Array]]] = []
    with np.errstate(over="ignore", invalid="ignore"):  # in a step that is then tried anew
        while node[0] < time_limit:
            step, h = solver.step(node, h, time_limit)
            while any(_turns_twice(rate, step) for rate in turning):
                step, h = solver.step(node, 0.5 * (step.t - step.t_old), time_limit)
            if climb is not None and _falls(up, step):
                step = solver.up_to_crest(climb, step)
            if climb is not None and _falls(up, step):  # if cut, perhaps only the next step does
                crests.append(partial(solver.refined, up, step))
            node = step.last
            times = [_when(event, step) for event in events]
            if min(times) == math.inf:
                pieces.append(step)
                continue
            event = events[times.index(min(times))]
            reached, final, end, state = solver.first_of(events, event, step, min(times))
            used = 1 + solver.evaluations
            return FlightArc(end, state, [*pieces, *final], used, reached, crests)
    return FlightArc(time_limit, node[1], pieces, 1 + solver.evaluations, None, crests)


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

    def step(self, node: Node, h: float, bound: float) -> tuple[Step, float]:
        """Return the step from a node, of at most h and up to `bound` [s], and the next one's h."""
        t, y, rate = node
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
                raise _given_up(t, f"it takes more than {MAX_EVALUATIONS} evaluations of forces")
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

    def up_to_crest(self, climb: int, step: Step) -> Step:
        """Return a step across a crest, cut there if the ball goes straight up.

        Such a ball reverses its drag at the crest, where drag by the square of the speed has a jump
        in its second derivative. A step across it has the larger an error, which its estimate may
        not see.
        """
        level = math.hypot(*step.end[climb - 2 : climb])
        before, after = float(step.begin[climb]), float(step.end[climb])
        if before == 0.0 or level > 0.1 * (before - after):  # at the crest, or not so steep
            return step
        crest = _root(lambda y: float(y[climb]), step, (before, after))
        part = (crest - step.t_old) / (step.t - step.t_old)
        if not 1e-6 < part < 1.0 - 1e-6:  # it ends there already
            return step
        return self.step(step.first, crest - step.t_old, crest)[0]

    def first_of(
        self, events: Sequence[Event], event: Event, step: Step, end: float
    ) -> tuple[Event, list[Step], float, Array]:
        """Return the event that ends a step, steps up to it, its time and the states there.

        `event` is the first on the interpolant of the step; on the steps taken anew, another may
        be.
        """
        pieces, end, state = self._landed(event.value, step.first, end)
        for other in events:
            if other is not event and other.value(step.begin) >= 0.0 > other.value(state):
                event = other
                pieces, end, state = self._landed(other.value, step.first, end)
        return event, pieces, end, state

    def refined(self, value: Callable[[Array], float], step: Step) -> tuple[float, Array]:
        """Return time and states where a value falls through zero within a step."""
        with np.errstate(over="ignore", invalid="ignore"):
            when = _root(value, step, (value(step.begin), value(step.end)))
            return self._landed(value, step.first, when)[1:]

    def _landed(
        self, value: Callable[[Array], float], start: Node, end: float
    ) -> tuple[list[Step], float, Array]:
        """Return steps to where a value falls through zero, the time and the states there.

        `end` is where it does so on an interpolant, which within a long step is far less exact than
        the step. The end of the steps taken anew is therefore a little off the zero; a cubic covers
        a time so short that its error is far below the tolerance.
        """
        began = start[0]
        end = max(end, math.nextafter(began, math.inf))
        ahead = 1e-7 * (end - began)

        def missing(state: Array, rate: Array) -> float:
            """Return the time from a state to the zero [s], by the rate of the value."""
            fall = value(state) - value(state + ahead * rate)
            return value(state) * ahead / fall if fall > 0.0 else 0.0

        for _ in range(5):
            node, pieces, h = start, list[Step](), end - began
            while node[0] < end:
                step, h = self.step(node, h, end)
                node = step.last
                pieces.append(step)
            _, state, rate = node
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
        return pieces, node[0], state


def _given_up(t: float, reason: str) -> KickdynError:
    """Return the error of an integration that ends too soon."""
    return KickdynError(f"the flight could not be integrated beyond {t:g} s: {reason}")


def _turns_twice(rate: Callable[[Array], float], step: Step) -> bool:
    """Return whether a rate perhaps changes its sign twice within a step.

    It has the same sign at both ends, and both tangents there reach the other sign within the step.
    """
    h, begins, ends = step.t - step.t_old, rate(step.begin), rate(step.end)
    return (
        begins * ends > 0.0
        and begins * (begins + h * rate(step.slopes[0])) < 0.0
        and ends * (ends - h * rate(step.slopes[_STAGES])) < 0.0
    )


def _falls(value: Callable[[Array], float], step: Step) -> bool:
    """Return whether a value falls to zero or through it between the ends of a step."""
    return value(step.begin) >= 0.0 >= value(step.end) < value(step.begin)


def _when(event: Event, step: Step) -> float:
    """Return about when an event comes within a step, inf if it does not."""
    value, rate = event
    if _falls(value, step):
        return _root(value, step, (value(step.begin), value(step.end)))
    if rate is None or not rate(step.begin) < 0.0 < rate(step.end):
        return math.inf
    lowest = _root(lambda y: -rate(y), step, (-rate(step.begin), -rate(step.end)))
    least = value(step(lowest))
    return math.inf if least > 0.0 else _root(value, step, (value(step.begin), least), lowest)


def _root(
    value: Callable[[Array], float],
    step: Step,
    ends: tuple[float, float],
    until: float | None = None,
) -> float:
    """Return about when a value falls through zero between the start of a step and `until`.

    That is the end of the step where it is None; the values at both ends are known.
    """
    began = float(step.t_old)
    ended = float(step.t if until is None else until)
    near = max(1e-9 * (ended - began), 1e-300)

    def value_at(t: float) -> float:
        """Return the value at a time of the step."""
        return ends[0] if t == began else ends[1] if t == ended else value(step(t))

    # A value that is zero at the start, as a level launch that lift carries up, must rise first.
    times = (began, *(began + (ended - began) * 0.5**k for k in range(1, 60)))
    low = next((t for t in times if value_at(t) > 0.0), None)
    if low is None:
        return began
    if value_at(ended) >= 0.0:
        return ended
    return float(brentq(value_at, low, ended, xtol=near, disp=False))
