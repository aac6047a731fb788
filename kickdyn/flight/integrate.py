"""Integration of differential equations by DOP853, up to the first of some events.

The steps, their error estimate and their interpolants are those of scipy's class. Several motions
are integrated side by side: each has its own time and step, and numpy computes the stages of all
steps at once.

A step that an event falls into is taken anew so that it ends just after the event: the interpolant
of a step is far more accurate near its end than within it.
"""

import math
import operator
from collections.abc import Callable, Generator, Iterable, Sequence
from functools import cache, cached_property
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np

from kickdyn.core.dop853 import EVENT_MARGIN, EXTRA, INTERPOLANT, STAGES, TABLE, first_step
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.events import (
    DIFFERENCE,
    MOST_CHANGE,
    PARTS,
    Ends,
    Event,
    count_readings,
    end_at_launch,
    fall_in_step,
    find_fall,
)  # fmt: skip

MAX_EVALUATIONS = 100_000
"""Most evaluations of the rates. An explicit method would not come to an end where drag stops the
ball at once, as in syrup."""

SAFETY, MOST_GROWTH = 0.7, 10.0
"""The next step over that which the estimated error allows, and the most over the step before:
with scipy's 0.9, more steps are rejected, and as many evaluations give twice the error."""

READ_TOGETHER = 50
"""States that are computed together where a function is read within a part of a step."""

_ENDS = np.arange(1, PARTS) / PARTS

PART_WEIGHTS = np.column_stack([
    (1.0 - _ENDS) ** 2 * (1.0 + 2.0 * _ENDS),
    (1.0 - _ENDS) ** 2 * _ENDS,
    _ENDS**2 * (3.0 - 2.0 * _ENDS),
    _ENDS**2 * (_ENDS - 1.0),
])  # fmt: skip
"""Weights of the cubics of a step, where its parts end but for the last one: of the states at its
beginning, of their changes over the step at the rates there, and of both at its end."""

MOST_SECANTS = 20
"""Secants in the search for a zero, of which usually five suffice."""

T = TypeVar("T")

Rates = Callable[[list[float]], list[float]]
"""The rates of change of the states, as a function of the states."""

Crossing = tuple[float, Array]
"""Time [s] and states of an event."""


class Arc(NamedTuple):
    """A solution from a start to an event, or to the time limit."""

    end: float  # time of the event or the limit [s]
    state: Array  # at the end, shape `(m,)`
    reached: Event | None  # the event that ended the integration; None if the time limit did
    passed: list[Crossing]  # the events on the way that did not end it
    evaluations: int  # of the rates
    steps: list["Step"]  # none if they are not kept


class Tolerance(NamedTuple):
    """Tolerances of the integration."""

    relative: float  # of the states; at least 100 times the machine epsilon
    absolute: Array  # of each state, shape `(m,)`
    longest: float = math.inf  # step [s]


def trajectory(arc: Arc, begin: Array) -> Callable[[Array], Array]:
    """Return the states `(m, n)` of an arc at n times as a function of the times.

    Without any step they are the states at the beginning. The interpolants are computed when they
    are first read.
    """
    begins = np.array([step.begin for step in arc.steps])

    def states(times: Array) -> Array:
        result = np.tile(begin[:, None], (1, times.size))
        which = np.maximum(np.searchsorted(begins, times, "right") - 1, 0)
        with np.errstate(over="ignore", invalid="ignore"):
            for k in np.unique(which) if arc.steps else ():
                result[:, which == k] = arc.steps[k].states(times[which == k]).T
        return result

    return states


StepGenerator = Generator["Step", None, T]
"""A generator that yields steps, which are taken before it goes on, and returns a result."""


def solve_together(runs: Iterable[StepGenerator[T]]) -> list[T | KickdynError]:
    """Return the results of some runs, whose steps are taken together, or what they raised."""
    results: dict[int, T | KickdynError] = {}
    going = list(enumerate(runs))
    with np.errstate(over="ignore", invalid="ignore"):  # a shorter step is tried then
        while going:
            asked, going = going, []
            steps: list[Step] = []
            for i, run in asked:
                try:
                    steps.append(next(run))
                    going.append((i, run))
                except StopIteration as stop:
                    results[i] = stop.value
                except KickdynError as error:
                    results[i] = error
            if steps:
                _take(steps)
    return [results[i] for i in range(len(results))]


def solve_one(run: StepGenerator[T]) -> T:
    """Return the result of a run, or raise what it raises."""
    (result,) = solve_together([run])
    if isinstance(result, KickdynError):
        raise result
    return result


class _Fall(NamedTuple):
    """Fractions of a step between which an event's function falls through zero, and about where."""

    low: float
    high: float
    about: float


class Step:
    """A step of an integration, `length` long, from the time `begin` [s] and the state `before`.

    Once it is taken, it has an end.
    """

    state: Array  # at the end, shape `(m,)`
    stages: Array  # rates of all stages, the first one those at the beginning; some rows follow
    error: float  # estimated, over the tolerated one
    end: list[float]  # the state at the end, as numbers
    ahead: list[float]  # the state shortly after the end

    def __init__(
        self, motion: "Integration", begin: float, before: Array, rates: Array, length: float
    ) -> None:
        self.motion, self.begin, self.before = motion, begin, before
        self.rates, self.length = rates, length

    def read_ends(self, values: dict[Event, tuple[float, float]]) -> None:
        """Read the functions of events, whose value and slope [1/s] at the beginning are known."""
        self._ends: dict[Event, Ends] = {}
        for event, (start, slope) in values.items():
            end, beyond = event.value_or_nan(self.end), event.value_or_nan(self.ahead)
            self._ends[event] = start, slope * self.length, end, (beyond - end) / DIFFERENCE

    def last_values(self) -> dict[Event, tuple[float, float]]:
        """Return value and slope [1/s] of the functions of events at the end.

        Where the function of an event is not a number, `InvalidInput` is raised.
        """
        for event, (_, _, end, _) in self._ends.items():
            if math.isnan(end):
                event.value(self.end)
        return {event: (ends[2], ends[3] / self.length) for event, ends in self._ends.items()}

    def foresee_fall(self, event: Event, length: float) -> float:
        """Return about which fraction of the next step an event falls in; 1 if it does not.

        The acceleration is taken to change as much over time as in this step.
        """
        before, _, now, rise = self._ends[event]
        if not 0.0 < now * self.length < 2.0 * length * (before - now):
            return 1.0
        state, rates, ratio = self.state, self.stages[STAGES], length / self.length
        change = (rates - self.rates) * ratio
        later = state + length * (rates + 0.5 * change)
        later[:3] = state[:3] + length * (rates[:3] + length * (rates[3:6] / 2 + change[3:6] / 6))
        last_rates = np.concatenate([later[3:6], (rates + change)[3:]])
        end = event.value_or_nan(later.tolist())
        if not end <= 0.0:
            return 1.0
        beyond = event.value_or_nan((later + DIFFERENCE * length * last_rates).tolist())
        return 1.0 - float(find_fall((now, rise * ratio, end, (beyond - end) / DIFFERENCE)))

    @cached_property
    def _terms(self) -> Array:
        """The coefficients of the interpolant, which takes a quarter more evaluations."""
        stages, h, change = self.stages, self.length, self.state - self.before
        for k, weights in enumerate(EXTRA, STAGES + 1):
            stages[k] = self.motion.rates((self.before + h * weights[:k].dot(stages[:k])).tolist())
        turn = h * stages[0] - change
        return np.vstack([change, turn, change - h * stages[STAGES] - turn,
                          h * INTERPOLANT.dot(stages)])  # fmt: skip

    def states(self, times: Any) -> Array:
        """Return the states at a time within the step `(m,)`, or at n times `(n, m)`."""
        x = (times - self.begin) / self.length
        weights = [x]
        for k in range(1, len(self._terms)):
            weights.append(weights[-1] * (1.0 - x if k % 2 else x))
        return np.asarray(np.array(weights).T.dot(self._terms) + self.before)

    @cached_property
    def _part_states(self) -> list[list[float]]:
        h = self.length
        nodes = np.concatenate([self.before, h * self.rates, self.state, h * self.stages[STAGES]])
        return (PART_WEIGHTS @ nodes.reshape(4, -1)).tolist()  # type: ignore[no-any-return]

    def _read_fall(self, event: Event) -> _Fall | None:
        """Return the first fall of a function by reading it within the step, as `Event` says."""
        start, _, end, _ = self._ends[event]
        values = [start, *map(event.value_or_nan, self._part_states), end]
        most = MOST_CHANGE * max(map(abs, map(operator.sub, values, values[1:])))
        if min(map(operator.add, values, values[1:])) > most:
            return None
        speed = max(math.hypot(*state[3:6].tolist()) for state in (self.before, self.state))
        count = count_readings(self.length / PARTS, speed)
        for k, (above, below) in enumerate(pairwise(values)):
            if max(above, below) > 0.0 and above + below <= most:
                fall = self._read_part(event, k, count)
                if fall is not None:
                    return fall
        return None

    def _read_part(self, event: Event, part: int, count: int) -> _Fall | None:
        """Return the first fall of an event's function in a part of the step."""
        above, low = 0.0, 0.0
        for first in range(0, count + 1, READ_TOGETHER):
            fractions = np.arange(first, min(first + READ_TOGETHER, count + 1)) / count
            fractions = (part + fractions) / PARTS
            states = self.states(self.begin + self.length * fractions).tolist()
            for high, state in zip(fractions.tolist(), states, strict=True):
                below = event.value_or_nan(state)
                if above > 0.0 >= below:
                    return _Fall(low, high, low + (high - low) * above / (above - below))
                low, above = high, below
        return None

    def find_fall(self, event: Event) -> tuple[_Fall | None, float]:
        """Return the first fall of an event's function, and how much of the step to take anew."""
        fall = self._read_fall(event) if event.within_steps else None
        if fall is not None:
            return fall, 1.0
        after, again = fall_in_step(self._ends[event], not event.terminal)
        return _Fall(0.0, 1.0, 1.0 - after) if after >= 0.0 else None, again

    def locate(self, event: Event, fall: _Fall) -> Crossing:
        """Return time and states of an event that falls within the step, on the interpolant."""
        low, high = (self.begin + fraction * self.length for fraction in fall[:2])
        stop = self.begin + self.length
        high = stop if fall.high == 1.0 else high

        def state(time: float) -> Array:
            return self.state if time == stop else self.states(time)

        @cache
        def value(time: float) -> float:
            return event.value(state(time).tolist())

        estimate = high - 1.0001 * (1.0 - fall.about) * self.length
        low = estimate if estimate > low and value(estimate) > 0.0 else low
        time = low
        if value(low) > 0.0:  # but for rounding
            time = high if value(high) > 0.0 else _find_zero(value, low, high, 1e-14 * self.length)
        return time, state(time)


def _find_zero(function: Callable[[float], float], low: float, high: float, width: float) -> float:
    """Return where a function falls through zero within an interval.

    It is the end of an interval that is at most as wide as stated, or as floats allow: by the
    Illinois algorithm, and by halves should that take many steps.
    """
    width = max(width, 4.0 * math.ulp(high))
    above, below, last, secants = function(low), function(high), math.nan, 0
    while high - low > width:
        middle, secants = high + (high - low) * below / (above - below), secants + 1
        if secants > MOST_SECANTS or not low <= middle <= high:  # or not a number
            middle = 0.5 * (low + high)
        middle = min(max(middle, low + 0.5 * width), high - 0.5 * width)
        value = function(middle)
        if value > 0.0:
            below *= 0.5 if last == low else 1.0
            low, above = middle, value
        else:
            above *= 0.5 if last == high else 1.0
            high, below = middle, value
        last = middle
    return high


class Integration:
    """Integration of some rates to the first terminal event, or to the time limit [s]."""

    def __init__(
        self, rates: Rates, events: Sequence[Event], time_limit: float, tolerance: Tolerance
    ) -> None:
        self.rates, self.tolerance = rates, tolerance
        self._events, self._time_limit, self._evaluations = events, time_limit, 0

    def run(self, state: Array, *, keep_steps: bool = True) -> StepGenerator[Arc]:
        """Return the solution from states at time 0, those of `FlightEquations` or as many others.

        An event whose function is zero at the start counts at once unless the function rises first.

        Raises:
            InvalidInput: the function of an event raised, or is not a number, where the ball is.
            KickdynError: the integrator gave up.
        """
        time, rates = 0.0, np.array(self.rates(state.tolist()))
        if not np.isfinite(rates).all():
            raise KickdynError("the acceleration of the ball is not finite at 0 s")
        reached = end_at_launch(self._events, state, rates)
        if reached is not None:
            return Arc(time, state, reached, [], 0, [])
        passed: list[Crossing] = []
        steps: list[Step] = []
        self._length = _first_length(state, rates, self.tolerance)
        shortly = DIFFERENCE * min(self._length, self._time_limit)
        begin, ahead = state.tolist(), (state + shortly * rates).tolist()
        values = {}
        for event in self._events:
            value = event.value_or_nan(begin)
            values[event] = value, (event.value_or_nan(ahead) - value) / shortly
        while time < self._time_limit:
            step, falls = yield from self._step_to(time, state, rates, values)
            if keep_steps:
                steps.append(step)
            crossings = [(*step.locate(event, fall), event) for event, fall in falls.items()]
            for time, state, event in sorted(crossings, key=lambda crossing: crossing[0]):
                if event.terminal:
                    return Arc(time, state, event, passed, self._evaluations, steps)
                passed.append((time, state))
            values = step.last_values()
            time, state, rates = step.begin + step.length, step.state, step.stages[STAGES]
            length = min(self._length, self._time_limit - time)
            foreseen = (step.foresee_fall(event, length) for event in self._events)
            fraction = min(foreseen, default=1.0)
            if fraction < 1.0 - EVENT_MARGIN:
                self._length = (1.0 + 0.5 * EVENT_MARGIN) * fraction * length
        return Arc(time, state, None, passed, self._evaluations, steps)

    def _step_to(
        self, time: float, state: Array, rates: Array, values: dict[Event, tuple[float, float]]
    ) -> StepGenerator[tuple[Step, dict[Event, _Fall]]]:
        """Take a step; take it anew until it ends shortly after the first of events within it.

        A step that moves the ball by less than is tolerated, as where it comes to rest at a plane,
        is not taken anew: shorter ones would follow the rounding of the event's function. Return
        the step, and where the functions of all events fall through zero in it.
        """
        shortest = max(100.0 * math.ulp(time), 1e-300)
        while True:
            step = yield from self._take_step(time, state, rates)
            step.read_ends(values)
            found = {event: step.find_fall(event) for event in self._events}
            falls = {event: fall for event, (fall, _) in found.items() if fall is not None}
            again = min((doubt for _, doubt in found.values()), default=1.0)
            about = min((fall.about for fall in falls.values()), default=1.0)
            if again == 1.0 and about < 1.0 - EVENT_MARGIN:
                moves = np.abs(step.state[:3] - step.before[:3]) > self.tolerance.absolute[:3]
                again = (1.0 + 0.5 * EVENT_MARGIN) * about if moves.any() else 1.0
            if again == 1.0 or step.length <= shortest:
                return step, falls
            self._length = max(again * step.length, shortest)

    def _take_step(self, time: float, state: Array, rates: Array) -> StepGenerator[Step]:
        """Take a step whose error is tolerated, and choose the length of the next one."""
        limit, shortest = self._time_limit, max(10.0 * math.ulp(time), 1e-300)
        most = MOST_GROWTH
        while True:
            length = max(min(self._length, self.tolerance.longest), shortest)
            end = time + length if length < limit - time else limit
            step = Step(self, time, state, rates, end - time)
            yield step
            self._evaluations += STAGES
            if self._evaluations > MAX_EVALUATIONS:
                raise _given_up(time, f"it takes more than {MAX_EVALUATIONS} evaluations of forces")
            growth = math.inf if step.error == 0.0 else SAFETY * step.error**-0.125
            if step.error < 1.0:
                break
            # where the rates are not defined, the error is nan, and this is 0.2
            self._length, most = step.length * max(0.2, growth), 1.0
            if self._length < shortest:
                raise _given_up(time, "the step would be shorter than time can be resolved")
        if not math.hypot(*step.end) < math.inf:
            raise _given_up(end, "the numbers overflow")
        self._length = step.length * min(growth, most)
        return step


def _take(steps: Sequence[Step]) -> None:
    """Take some steps of motions with as many states each."""
    n, m = len(steps), len(steps[0].before)
    functions = [step.motion.rates for step in steps]
    state, length = np.concatenate([step.before for step in steps]), [step.length for step in steps]
    h = np.repeat(length, m)
    rates: Array = np.empty((STAGES + 1 + len(EXTRA), n * m))
    rates[0] = np.concatenate([step.rates for step in steps])
    for k in range(1, STAGES + 1):
        new = state + h * TABLE[k, :k].dot(rates[:k])
        states = new.tolist()
        rates[k] = [
            rate for i, function in enumerate(functions)
            for rate in function(states[m * i : m * (i + 1)])
        ]  # fmt: skip
    relative = np.repeat([step.motion.tolerance.relative for step in steps], m)
    absolute = np.concatenate([step.motion.tolerance.absolute for step in steps])
    scale = absolute + relative * np.maximum(np.abs(state), np.abs(new))
    squares = np.square(TABLE[STAGES + 1 :].dot(rates[:STAGES]) / scale).reshape(2, n, m)
    ahead = (new + DIFFERENCE * h * rates[STAGES]).tolist()
    new, rates = new.reshape(n, m), rates.reshape(-1, n, m)
    for i, (step, five, three) in enumerate(zip(steps, *squares.sum(axis=2).tolist(), strict=True)):
        size = math.sqrt((five + 0.01 * three) * m)
        step.error = step.length * five / size if size != 0.0 else 0.0
        step.state, step.stages = new[i], rates[:, i]
        step.end, step.ahead = states[m * i : m * (i + 1)], ahead[m * i : m * (i + 1)]


def _first_length(state: Array, rates: Array, tolerance: Tolerance) -> float:
    scale = tolerance.absolute + tolerance.relative * np.abs(state)
    size, change = (math.hypot(*(vector / scale).tolist()) / math.sqrt(len(scale))
                    for vector in (state, rates))  # fmt: skip
    return float(first_step(size, change, math.inf))


def _given_up(time: float, reason: str) -> KickdynError:
    return KickdynError(f"the flight could not be integrated beyond {time:g} s: {reason}")
