"""Integration of differential equations by scipy's DOP853, up to the first of some events.

DOP853 is an explicit Runge-Kutta method of order 8(5,3): Hairer, Norsett & Wanner, Solving Ordinary
Differential Equations I, II.5. A step that an event falls into ends just after the event: the
interpolant of a step is far more accurate near its end than within it. The interpolant of the step
before predicts where that is; a step that ends elsewhere is taken anew.
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
from kickdyn.flight.events import Event, end_at_launch

MAX_EVALUATIONS = 250_000
"""Most evaluations of the rates. An explicit method would not come to an end where drag stops the
ball at once, as in syrup."""

EVENT_MARGIN = 0.03
"""Fraction of a step, at its end, in which an event must lie for its interpolant to be read there:
its error falls with the square of that fraction."""

MAX_RETAKEN = 60
"""Most times that a step is taken anew, with another length, on account of events."""

NEXT_LENGTH = 0.7 / 0.9
"""Length of the next step over that which scipy proposes, 0.9 of what the estimated error allows:
fewer steps are rejected, and as many evaluations give half the error."""

LOOKS = np.linspace(0.0, 1.0, 10)[1:-1]
"""Fractions of a step at which an event that comes and goes within the step is looked for."""

EPSILON = float(np.finfo(float).eps)

Rates = Callable[[float, Array], list[float]]
"""The rates of change of the states, as a function of the time [s] and the states."""


class Arc(NamedTuple):
    """A solution from a start to an event, or to the time limit.

    Attributes:
        end: time of the event or the limit [s].
        state: state at the end, shape `(m,)`.
        reached: the event that ended the integration; None where the time limit did.
        passed: the events on the way that did not end it, with functions that return time and
            state; some may be after the end.
        evaluations: number of evaluations of the rates.
        times: beginnings of the steps, and the end [s].
        steps: the interpolants of the steps.
    """

    end: float
    state: Array
    reached: Event | None
    passed: list[tuple[Event, Callable[[], tuple[float, Array]]]]
    evaluations: int
    times: list[float]
    steps: list[DenseOutput]


class Tolerance(NamedTuple):
    """Tolerances of the integration.

    Attributes:
        relative: of the states; at least 100 times the machine epsilon, as scipy demands.
        absolute: of each state, shape `(m,)`.
        longest: longest step [s].
    """

    relative: float
    absolute: Array
    longest: float = math.inf


def trajectory(arcs: Sequence[Arc], begin: Array) -> Callable[[Array], Array]:
    """Return the states `(m, n)` at n times as a function of the times, from consecutive arcs.

    Without any arc they are the states at the beginning.
    """
    steps = [step for arc in arcs for step in arc.steps]
    if not steps:
        return lambda times: np.tile(begin[:, None], (1, times.size))
    starts = [time for arc in arcs for time in arc.times[:-1]]
    solution = OdeSolution([*starts, arcs[-1].end], steps)
    return lambda times: np.asarray(solution(times)) if times.size else np.empty((len(begin), 0))


def integrate(
    rates: Rates,
    start: tuple[float, Array],
    events: Sequence[Event],
    time_limit: float,
    tolerance: Tolerance,
) -> Arc:
    """Integrate from a time and states to the first terminal event, or to the time limit [s].

    The states are those of `FlightEquations`, or of another motion with the same seven states. An
    event whose function is zero at the start counts at once unless the function rises first.

    Raises:
        KickdynError: the integrator gave up.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # the solver then tries a shorter step
        return _Integration(rates, events, time_limit, tolerance).run(*start)


class _Node(NamedTuple):
    """A time [s], the states and their rates."""

    time: float
    state: Array
    rates: Array


class _Change(NamedTuple):
    """How the function of an event changes within a step.

    Attributes:
        event: the event.
        start, end: the function at the beginning and at the end of the step.
        ahead: at the end of the step, on the tangent of the states at its beginning.
        behind: at the beginning of the step, on the tangent of the states at its end.
    """

    event: Event
    start: float
    end: float
    ahead: float
    behind: float

    def crosses(self) -> bool:
        """Return whether the function falls through zero from one end to the other.

        A terminal event that is zero at the beginning and negative at the end has risen before.
        """
        start, end = self.start, self.end
        return start > 0.0 >= end or (start == 0.0 > end and self.event.terminal)

    def fraction_to_take(self) -> float:
        """Return how much of the step to take, so that it ends shortly after the event.

        It is 1 where the step does not cross the event, or does so shortly before its end. Where
        the function is zero at the beginning, the step is to end before the event.
        """
        _, start, end, ahead, behind = self
        if not self.crosses():
            return 1.0
        if start == 0.0:
            return max(0.5 * ahead / (ahead - end), 0.0) or 0.5
        fraction = _fall_of_cubic(start, end, ahead - start, end - behind)
        return 1.0 if fraction >= 1.0 - EVENT_MARGIN else (1.0 + 0.5 * EVENT_MARGIN) * fraction

    def hides(self, step: "_Step") -> bool:
        """Return whether the event may come and go within the step.

        The function then has the same sign at both ends, and the other sign on both tangents; or
        on one of them, and at one of `LOOKS`. A function that is zero at the beginning and then
        rises, as the speed upward of a ball that lift carries up, may be negative at the end.
        """
        event, start, end, ahead, behind = self
        if start == 0.0 > end and not event.terminal:
            return ahead > 0.0
        turns, last_turns = start * ahead < 0.0, end * behind < 0.0
        if start * end <= 0.0 or not (turns or last_turns):
            return False
        if turns and last_turns:
            return True
        if not event.terminal and (ahead - start) * (end - behind) >= 0.0:
            return False
        states = step.path()(step.t_old + step.length * LOOKS).T
        return any(start * event.value(state) < 0.0 for state in states)


def _changes(events: Sequence[Event], before: _Node, after: _Node) -> list[_Change]:
    """Return how the functions of events change from one node to another."""
    h = after.time - before.time
    ahead, behind = before.state + h * before.rates, after.state - h * after.rates
    states = [state.tolist() for state in (before.state, after.state, ahead, behind)]
    return [_Change(event, *map(event.value, states)) for event in events]


class _Step:
    """The last step of a solver, and how the functions of events change within it."""

    def __init__(self, solver: DOP853, before: _Node, events: Sequence[Event]) -> None:
        self.t_old, self.t, self.length = before.time, solver.t, solver.t - before.time
        self._solver, self._end, self._path = solver, solver.y, None
        self.changes = _changes(events, before, _Node(solver.t, solver.y, solver.f))

    def path(self) -> DenseOutput:
        """Return the interpolant."""
        if self._path is None:
            self._path = self._solver.dense_output()
        return self._path

    def locate(self, event: Event) -> tuple[float, Array]:
        """Return time and state of an event that the step crosses, on the interpolant."""
        path, states = self.path(), {self.t: self._end}

        def value(time: float) -> float:
            if time not in states:
                states[time] = path(time)
            return event.value(states[time].tolist())

        begin = self.t - 2.0 * EVENT_MARGIN * self.length
        if value(begin) <= 0.0:
            begin = self.t_old
        precision = max(1e-14 * self.length, 1e-300)
        time = float(brentq(value, begin, self.t, xtol=precision, rtol=4.0 * EPSILON, disp=False))
        return time, states[time] if time in states else path(time)


def _fall_of_cubic(start: float, end: float, rise: float, last_rise: float) -> float:
    """Return where a cubic falls through zero between 0 and 1, from its values and slopes there."""
    square = 3.0 * (end - start) - 2.0 * rise - last_rise
    cube = rise + last_rise - 2.0 * (end - start)

    def value(x: float) -> float:
        return start + x * (rise + x * (square + x * cube)) if x < 1.0 else end

    return float(brentq(value, 0.0, 1.0, xtol=1e-300, rtol=1e-6, disp=False))


class _Integration:
    """Integration of some rates up to some events."""

    def __init__(
        self, rates: Rates, events: Sequence[Event], time_limit: float, tolerance: Tolerance
    ) -> None:
        self._rates, self._events, self._time_limit = rates, events, time_limit
        self._terminal = [event for event in events if event.terminal]
        self._ending = [event for event in events if event.terminal or event.ends_step]
        self._tolerance = tolerance
        self._path: DenseOutput | None = None  # of the step before, if it may predict events

    def run(self, begin: float, state: Array) -> Arc:
        """Return the solution from a time [s] and a state on."""
        solver = self._solver(begin, state)
        reached = end_at_launch(self._events, state, solver.f)
        if reached is not None:
            return Arc(begin, state, reached, [], 0, [begin], [])
        passed: list[tuple[Event, Callable[[], tuple[float, Array]]]] = []
        times, steps = [begin], list[DenseOutput]()
        while solver.t < self._time_limit:
            before = _Node(solver.t, solver.y, solver.f)
            step = self._step_up_to(self._ending, solver)
            crossed = [change.event for change in step.changes if change.crosses()]
            passed += [(event, partial(self._locate, event, before, step.length))
                       for event in crossed if not event.terminal]  # fmt: skip
            steps.append(step.path())
            ends = [(*step.locate(event), event) for event in crossed if event.terminal]
            if ends:
                time, state, event = min(ends, key=lambda crossing: crossing[0])
                if time <= step.t_old:  # the step before ended there but for rounding
                    steps.pop()
                else:
                    times.append(time)
                return Arc(time, state, event, passed, solver.nfev, times, steps)
            times.append(step.t)
        return Arc(solver.t, solver.y, None, passed, solver.nfev, times, steps)

    def _locate(self, event: Event, start: _Node, length: float) -> tuple[float, Array]:
        """Return time and state of an event that a step of a length from a node crosses."""
        solver, self._path = self._solver(start.time, start.state), None
        solver.h_abs = length
        while True:
            step = self._step_up_to([event], solver)
            if any(change.event is event and change.crosses() for change in step.changes):
                return step.locate(event)

    def _step_up_to(self, events: Sequence[Event], solver: DOP853) -> _Step:
        """Take a step; take it anew until it ends shortly after the first of events within it."""
        before = _Node(solver.t, solver.y, solver.f)
        shortest = max(100.0 * math.ulp(solver.t), 1e-300)
        next_length = self._shorten(solver)
        for _ in range(MAX_RETAKEN):
            self._take_step(solver)
            step = _Step(solver, before, self._events)
            fraction = min(
                (change.fraction_to_take() for change in step.changes if change.event in events),
                default=1.0,
            )
            if any(change.hides(step) for change in step.changes):
                fraction = min(fraction, 0.5)
            if fraction == 1.0 or step.length <= shortest:
                break
            next_length = max(next_length, step.length)
            solver.t, solver.y, solver.f = before
            solver.h_abs, solver.status = max(fraction * step.length, shortest), "running"
        solver.h_abs = max(NEXT_LENGTH * solver.h_abs, next_length)
        self._path = None if next_length > 0.0 else step.path()  # what it predicted was wrong
        return step

    def _shorten(self, solver: DOP853) -> float:
        """Shorten the next step to an event that the interpolant of the step before predicts.

        Return the length that it had [s], 0 without such an event. The interpolant is only read
        beyond its step where a motion at a constant acceleration would meet the event.
        """
        if self._path is None:
            return 0.0
        before = _Node(solver.t, solver.y, solver.f)
        length = min(solver.h_abs, self._tolerance.longest, self._time_limit - solver.t)
        moved = before.state + length * before.rates
        moved[:3] += 0.5 * length * length * before.rates[3:6]
        state = moved.tolist()
        if all(event.value(state) > 0.0 for event in self._terminal):
            return 0.0
        time = solver.t + length
        end = self._path(time)
        after = _Node(time, end, solver.fun(time, end))
        changes = _changes(self._terminal, before, after)
        fraction = min(change.fraction_to_take() for change in changes)
        if not 0.0 < fraction < 1.0:
            return 0.0
        next_length, solver.h_abs = float(solver.h_abs), fraction * length
        return next_length

    def _solver(self, time: float, state: Array) -> DOP853:
        """Return a solver at a time [s] and a state."""
        relative, absolute, longest = self._tolerance
        solver = DOP853(
            self._rates, time, state, self._time_limit, max_step=longest, rtol=relative,
            atol=absolute, first_step=self._time_limit - time,
        )  # fmt: skip
        if not np.isfinite(solver.f).all():
            raise KickdynError(f"the acceleration of the ball is not finite at {time:g} s")
        solver.h_abs = min(_first_length(state, solver.f, self._tolerance), solver.h_abs)
        return solver

    def _take_step(self, solver: DOP853) -> None:
        """Take a step of the solver."""
        solver.step()
        if solver.nfev > MAX_EVALUATIONS:
            reason = f"it takes more than {MAX_EVALUATIONS} evaluations of forces"
            raise _given_up(solver.t, reason)
        if solver.status == "failed":
            raise _given_up(solver.t, "the step would be shorter than time can be resolved")
        if not math.isfinite(math.fsum(solver.y.tolist())):
            raise _given_up(solver.t, "the numbers overflow")


def _first_length(state: Array, rate: Array, tolerance: Tolerance) -> float:
    r"""Return the length of the first step [s], :math:`(0.01 / d_0)^{1/8}\, d_0 / d_1`.

    The norms d of state and rate are relative to the tolerances. It is the step of Hairer, Norsett
    & Wanner, II.4, in any unit of time.
    """
    scale = tolerance.absolute + tolerance.relative * np.abs(state)
    size, change = (math.hypot(*vector) / math.sqrt(len(state))
                    for vector in ((state / scale).tolist(), (rate / scale).tolist()))  # fmt: skip
    size = max(size, 1.0)
    return size / change * (0.01 / size) ** 0.125 if change > 0.0 else math.inf


def _given_up(time: float, reason: str) -> KickdynError:
    """Return the error of an integration that ends too soon."""
    return KickdynError(f"the flight could not be integrated beyond {time:g} s: {reason}")
