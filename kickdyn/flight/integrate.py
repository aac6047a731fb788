"""Integration of differential equations by scipy's DOP853, up to the first of some events.

A step that an event falls into is taken anew so that it ends just after the event: the interpolant
of a step is far more accurate near its end than within it.
"""

import math
import operator
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import brentq

from kickdyn.core.dop853 import EVENT_MARGIN, first_step, keep_stages
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

NEXT_LENGTH = 0.7 / 0.9
"""Length of the next step over that which scipy proposes, 0.9 of what the estimated error allows:
fewer steps are rejected, and as many evaluations give half the error."""

TOGETHER = 50
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

EPSILON = float(np.finfo(float).eps)

Rates = Callable[[float, Array], list[float]]
"""The rates of change of the states, as a function of the time [s] and the states."""

Crossing = tuple[float, Array]
"""Time [s] and states of an event."""


class Arc(NamedTuple):
    """A solution from a start to an event, or to the time limit."""

    end: float  # time of the event or the limit [s]
    state: Array  # at the end, shape `(m,)`
    reached: Event | None  # the event that ended the integration; None if the time limit did
    passed: list[Crossing]  # the events on the way that did not end it
    evaluations: int  # of the rates
    steps: list[Callable[[], Any]]  # functions that return the interpolants of the steps


class Tolerance(NamedTuple):
    """Tolerances of the integration."""

    relative: float  # of the states; at least 100 times the machine epsilon, as scipy demands
    absolute: Array  # of each state, shape `(m,)`
    longest: float = math.inf  # step [s]


def trajectory(arc: Arc, begin: Array) -> Callable[[Array], Array]:
    """Return the states `(m, n)` of an arc at n times as a function of the times.

    Without any step they are the states at the beginning. The interpolants are computed when they
    are first read.
    """
    solution: OdeSolution | None = None

    def states(times: Array) -> Array:
        nonlocal solution
        if not (arc.steps and times.size):
            return np.tile(begin[:, None], (1, times.size))
        if solution is None:
            with np.errstate(over="ignore", invalid="ignore"):
                steps = [interpolant() for interpolant in arc.steps]
            solution = OdeSolution([*(step.t_old for step in steps), steps[-1].t], steps)
        return np.asarray(solution(times))

    return states


def integrate(
    rates: Rates,
    start: tuple[float, Array],
    events: Sequence[Event],
    time_limit: float,
    tolerance: Tolerance,
) -> Arc:
    """Integrate from a time and states to the first terminal event, or to the time limit [s].

    The states belong to `FlightEquations`, or of another motion with the same seven states. An
    event whose function is zero at the start counts at once unless the function rises first.

    Raises:
        InvalidInput: the function of an event raised, or is not a number, where the ball is.
        KickdynError: the integrator gave up.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # the solver then tries a shorter step
        return _Integration(rates, events, time_limit, tolerance).run(*start)


class _Fall(NamedTuple):
    """Fractions of a step between which an event's function falls through zero, and about where."""

    low: float
    high: float
    about: float


class _Step:
    """The last step of a solver, from a state and rates `before` it."""

    def __init__(
        self, solver: DOP853, before: Array, rates: Array, events: Sequence[Event]
    ) -> None:
        self.solver, self.before, self.begin = solver, before, float(solver.t_old)
        self.rates, self.length = rates, float(solver.t) - self.begin
        solver.f = np.array(solver.f)
        states = _states_at_ends(self.length, before, rates, solver.y, solver.f)
        self._ends = {event: _read_ends(event, states) for event in events}

    def check_values(self) -> None:
        """Raise `InvalidInput` where the function of an event is not a number after the step."""
        for event, (_, _, end, _) in self._ends.items():
            if math.isnan(end):
                event.value(self.solver.y.tolist())

    def foresee_fall(self, event: Event, length: float) -> float:
        """Return about which fraction of the next step an event falls in; 1 if it does not.

        The acceleration is taken to change as much over time as in this step.
        """
        before, _, now, _ = self._ends[event]
        if not 0.0 < now * self.length < 2.0 * length * (before - now):
            return 1.0
        state, rates = self.solver.y, self.solver.f
        change = (rates - self.rates) * (length / self.length)
        later = state + length * (rates + 0.5 * change)
        later[:3] = state[:3] + length * (rates[:3] + length * (rates[3:6] / 2 + change[3:6] / 6))
        last_rates = np.concatenate([later[3:6], (rates + change)[3:]])
        ends = _read_ends(event, _states_at_ends(length, state, rates, later, last_rates))
        return 1.0 - find_fall(ends) if ends[0] > 0.0 >= ends[2] else 1.0

    @cached_property
    def interpolant(self) -> Callable[[float | Array], Array]:
        """The states at times of the step; to be read before the solver takes the next one."""
        return self.solver.dense_output()  # type: ignore[no-any-return]

    @cached_property
    def _part_states(self) -> list[list[float]]:
        h, end, last_rates = self.length, self.solver.y, self.solver.f
        nodes = np.concatenate([self.before, h * self.rates, end, h * last_rates])
        return (PART_WEIGHTS @ nodes.reshape(4, -1)).tolist()  # type: ignore[no-any-return]

    def _read_fall(self, event: Event) -> _Fall | None:
        """Return the first fall of a function by reading it within the step, as `Event` says."""
        start, _, end, _ = self._ends[event]
        values = [start, *map(event.value_or_nan, self._part_states), end]
        most = MOST_CHANGE * max(map(abs, map(operator.sub, values, values[1:])))
        if min(map(operator.add, values, values[1:])) > most:
            return None
        speed = max(math.hypot(*state[3:6].tolist()) for state in (self.before, self.solver.y))
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
        for first in range(0, count + 1, TOGETHER):
            fractions = np.arange(first, min(first + TOGETHER, count + 1)) / count
            fractions = (part + fractions) / PARTS
            states = self.interpolant(self.begin + self.length * fractions).T.tolist()
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
        high = float(self.solver.t) if fall.high == 1.0 else high

        def state(time: float) -> Array:
            return self.solver.y if time == self.solver.t else self.interpolant(time)

        def value(time: float) -> float:
            return event.value(state(time).tolist())

        estimate = high - 1.0001 * (1.0 - fall.about) * self.length
        low = estimate if estimate > low and value(estimate) > 0.0 else low
        time, above, below = low, value(low), value(high)
        if above > 0.0:
            time = high
        if above > 0.0 >= below:  # but for rounding
            precision = max(1e-14 * self.length, 1e-300)
            time = float(brentq(value, low, high, xtol=precision, rtol=4.0 * EPSILON, disp=False))
        return time, state(time)


def _states_at_ends(
    length: float, begin: Array, rates: Array, end: Array, last_rates: Array
) -> list[list[float]]:
    """Return the states at both ends of a step, each with those shortly after it."""
    shortly = DIFFERENCE * length
    states = begin, begin + shortly * rates, end, end + shortly * last_rates
    return [state.tolist() for state in states]


def _read_ends(event: Event, states: list[list[float]]) -> Ends:
    """Return value and slope of the function of an event at `_states_at_ends`."""
    start, ahead, end, beyond = map(event.value_or_nan, states)
    return start, (ahead - start) / DIFFERENCE, end, (beyond - end) / DIFFERENCE


class _Integration:
    """Integration of some rates up to some events."""

    def __init__(
        self, rates: Rates, events: Sequence[Event], time_limit: float, tolerance: Tolerance
    ) -> None:
        self._rates, self._events, self._time_limit = rates, events, time_limit
        self._tolerance, self._evaluations = tolerance, 0

    def run(self, begin: float, state: Array) -> Arc:
        rates = np.array(self._rates(begin, state))
        if not np.isfinite(rates).all():
            raise KickdynError(f"the acceleration of the ball is not finite at {begin:g} s")
        reached = end_at_launch(self._events, state, rates)
        if reached is not None:
            return Arc(begin, state, reached, [], 0, [])
        passed: list[Crossing] = []
        steps: list[Callable[[], Any]] = []
        solver = self._solver(begin, state, _first_length(state, rates, self._tolerance))
        while solver.status == "running":
            step, falls = self._step_to(solver)
            steps.append(keep_stages(solver).dense_output)
            crossings = [(*step.locate(event, fall), event) for event, fall in falls.items()]
            for time, state, event in sorted(crossings, key=lambda crossing: crossing[0]):
                if event.terminal:
                    return Arc(time, state, event, passed, self._evaluations, steps)
                passed.append((time, state))
            step.check_values()
            length = min(solver.h_abs, self._time_limit - solver.t)
            foreseen = (step.foresee_fall(event, length) for event in self._events)
            fraction = min(foreseen, default=1.0)
            if fraction < 1.0 - EVENT_MARGIN:
                solver.h_abs = (1.0 + 0.5 * EVENT_MARGIN) * fraction * length
        return Arc(float(solver.t), solver.y, None, passed, self._evaluations, steps)

    def _step_to(self, solver: DOP853) -> tuple[_Step, dict[Event, _Fall]]:
        """Take a step; take it anew until it ends shortly after the first of events within it.

        Return the step, and where the functions of all events fall through zero in it.
        """
        while True:
            step = self._take_step(solver)
            found = {event: step.find_fall(event) for event in self._events}
            falls = {event: fall for event, (fall, _) in found.items() if fall is not None}
            again = min((doubt for _, doubt in found.values()), default=1.0)
            about = min((fall.about for fall in falls.values()), default=1.0)
            if again == 1.0 and about < 1.0 - EVENT_MARGIN:
                again = (1.0 + 0.5 * EVENT_MARGIN) * about
            shortest = max(100.0 * math.ulp(step.begin), 1e-300)
            if again == 1.0 or step.length <= shortest:
                return step, falls
            length = again * step.length
            solver.t, solver.y, solver.f = step.begin, step.before, step.rates
            solver.h_abs, solver.status = max(length, shortest), "running"

    def _solver(self, begin: float, state: Array, length: float) -> DOP853:
        relative, absolute, longest = self._tolerance
        longest, limit = min(longest, self._time_limit - begin), self._time_limit
        length = min(max(length, 10.0 * math.ulp(begin)), longest)
        solver = DOP853(self._rates, begin, state, limit, longest, relative, absolute,
                        first_step=length)  # fmt: skip
        solver.fun_single = self._rates  # scipy's own converts the rates to an array twice
        return solver

    def _take_step(self, solver: DOP853) -> _Step:
        time, state, rates, evaluations = float(solver.t), solver.y, solver.f, solver.nfev
        solver.step()
        self._evaluations += solver.nfev - evaluations
        if self._evaluations > MAX_EVALUATIONS:
            raise _given_up(time, f"it takes more than {MAX_EVALUATIONS} evaluations of forces")
        if solver.status == "failed":
            raise _given_up(time, "the step would be shorter than time can be resolved")
        if not math.hypot(*solver.y.tolist()) < math.inf:
            raise _given_up(float(solver.t), "the numbers overflow")
        solver.h_abs *= NEXT_LENGTH
        return _Step(solver, state, rates, self._events)


def _first_length(state: Array, rates: Array, tolerance: Tolerance) -> float:
    scale = tolerance.absolute + tolerance.relative * np.abs(state)
    size, change = (math.hypot(*(vector / scale).tolist()) / math.sqrt(len(scale))
                    for vector in (state, rates))  # fmt: skip
    return float(first_step(size, change, math.inf))


def _given_up(time: float, reason: str) -> KickdynError:
    return KickdynError(f"the flight could not be integrated beyond {time:g} s: {reason}")
