"""Integration of differential equations by DOP853, up to the first of some events.

DOP853 is an explicit Runge-Kutta method of order 8(5,3): Hairer, Norsett & Wanner, Solving Ordinary
Differential Equations I, II.5. A step that an event falls into ends just after the event: the
interpolant of a step is far more accurate near its end than within it. The interpolant of the step
before predicts where that is; a step that ends elsewhere is taken anew.

Coefficients, estimate of the error and interpolant are those of `scipy.integrate.DOP853`. The loop
over the stages is our own: a flight through `brazuca` air takes 0.94 and 1.6 ms at relative
tolerances of 1e-6 and 1e-9, and took 1.5 and 2.7 ms with scipy's solver, whose loop takes longer
than the acceleration of a ball and whose interpolants cannot be computed later.
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853, DenseOutput
from scipy.optimize import brentq

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.events import Event, end_at_launch

MAX_EVALUATIONS = 100_000
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

INNER_FRACTIONS = np.linspace(0.0, 1.0, 10)[1:-1]
"""Fractions of a step at which an event that comes and goes within the step is looked for."""

_STAGES = DOP853.n_stages
_TIMES = DOP853.C.tolist()
_WEIGHTS = np.vstack([DOP853.A, DOP853.B])
_ERRORS = np.array([DOP853.E5, DOP853.E3])

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
        steps: the steps, each of which is an interpolant.
    """

    end: float
    state: Array
    reached: Event | None
    passed: list[tuple[Event, Callable[[], tuple[float, Array]]]]
    evaluations: int
    steps: "list[Step]"


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
    starts = np.array([step.t_old for step in steps])

    def states(times: Array) -> Array:
        if not steps or not times.size:
            return np.tile(begin[:, None], (1, times.size))
        which = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
        first = int(which.min())
        read, which = steps[first : int(which.max()) + 1], which - first
        terms = np.array([step.terms for step in read]).transpose(1, 0, 2)[:, which]
        lengths = np.array([step.length for step in read])[which]
        fractions = (times - starts[which + first]) / lengths
        return np.asarray(
            (np.array([step.before.state for step in read])[which]
             + _moved(fractions[:, None], terms)).T
        )  # fmt: skip

    return states


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
        InvalidInput: the function of an event raised, or is not a number, where the ball is.
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
        if math.isfinite(ahead + behind):
            fraction = _fall_of_cubic(start, end, ahead - start, end - behind)
        else:
            fraction = start / (start - end)
        return 1.0 if fraction >= 1.0 - EVENT_MARGIN else (1.0 + 0.5 * EVENT_MARGIN) * fraction

    def hides(self, step: "Step") -> bool:
        """Return whether the event may come and go within the step.

        The function then has the same sign at both ends, and the other sign on both tangents; or
        on one of them, and at one of `INNER_FRACTIONS`. A function that is zero at the beginning
        and then rises, as the speed upward of a ball that lift carries up, may be negative at the
        end.
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
        states = step(step.t_old + step.length * INNER_FRACTIONS).T
        return any(start * event.value_or_nan(state) < 0.0 for state in states)


def _changes(events: Sequence[Event], before: _Node, after: _Node) -> list[_Change]:
    """Return how the functions of events change from one node to another."""
    h = after.time - before.time
    ahead, behind = before.state + h * before.rates, after.state - h * after.rates
    states = [state.tolist() for state in (before.state, after.state, ahead, behind)]
    return [_Change(event, *map(event.value_or_nan, states)) for event in events]


class Step(DenseOutput):  # type: ignore[misc]
    """A step from one node to the next, and its interpolant of order 7.

    The interpolant takes three evaluations of the rates, when it is first read.
    """

    def __init__(self, rates: Rates, before: _Node, after: _Node, stages: Array) -> None:
        super().__init__(before.time, after.time)
        self.before, self.after, self.length = before, after, after.time - before.time
        self._rates, self._stages = rates, stages

    @cached_property
    def terms(self) -> Array:
        """The terms of the interpolant, shape `(7, m)`."""
        h, first, last, stages = self.length, self.before, self.after, self._stages
        for k, fraction in enumerate(DOP853.C_EXTRA, _STAGES + 1):
            weights = DOP853.A_EXTRA[k - _STAGES - 1, :k]
            state = first.state + h * weights.dot(stages[:k])
            stages[k] = self._rates(first.time + fraction * h, state)
        moved = last.state - first.state
        bent = h * first.rates - moved, 2.0 * moved - h * (last.rates + first.rates)
        return np.array([moved, *bent, *(h * DOP853.D.dot(stages))])

    def _call_impl(self, t: Array) -> Array:
        x = (t - self.t_old) / self.length
        x = x[:, None] if np.ndim(x) else x
        return np.asarray(self.before.state + _moved(x, self.terms)).T

    def locate(self, event: Event) -> tuple[float, Array]:
        """Return time and state of an event that the step crosses, on the interpolant."""
        states = {self.t: self.after.state}

        def value(time: float) -> float:
            if time not in states:
                states[time] = self(time)
            return event.value(states[time].tolist())

        begin = self.t - 2.0 * EVENT_MARGIN * self.length
        if value(begin) <= 0.0:
            begin = self.t_old
        precision = max(1e-14 * self.length, 1e-300)
        time = float(brentq(value, begin, self.t, xtol=precision, rtol=4.0 * EPSILON, disp=False))
        return time, states[time] if time in states else self(time)


def _moved(x: Array, terms: Array) -> Array:
    """Return the displacement of the states after a fraction of a step, from its terms."""
    a, b, c, d, e, f, g = terms
    z = 1.0 - x
    return np.asarray(x * (a + z * (b + x * (c + z * (d + x * (e + z * (f + x * g)))))))


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
        self._events, self._time_limit = events, time_limit
        self._terminal = [event for event in events if event.terminal]
        self._ending = [event for event in events if event.terminal or event.ends_step]
        self._rates, self._tolerance, self._evaluations = rates, tolerance, 0
        self._predictor: Step | None = None  # the step before, if it may predict events

    def run(self, begin: float, state: Array) -> Arc:
        """Return the solution from a time [s] and a state on."""
        node = _Node(begin, state, np.array(self._rates(begin, state)))
        self._evaluations = 1
        if not np.isfinite(node.rates).all():
            raise KickdynError(f"the acceleration of the ball is not finite at {begin:g} s")
        reached = end_at_launch(self._events, state, node.rates)
        if reached is not None:
            return Arc(begin, state, reached, [], 0, [])
        passed: list[tuple[Event, Callable[[], tuple[float, Array]]]] = []
        steps: list[Step] = []
        length = _first_length(node, self._tolerance)
        while node.time < self._time_limit:
            step, changes, length = self._step_up_to(self._ending, node, length)
            crossed = [change.event for change in changes if change.crosses()]
            passed += [(event, partial(self._locate, event, node, step.length))
                       for event in crossed if not event.terminal]  # fmt: skip
            steps.append(step)
            ends = [(*step.locate(event), event) for event in crossed if event.terminal]
            if ends:
                time, state, event = min(ends, key=lambda crossing: crossing[0])
                if time <= step.t_old:  # the step before ended there but for rounding
                    steps.pop()
                return Arc(time, state, event, passed, self._evaluations, steps)
            for change in changes:
                if math.isnan(change.end):
                    change.event.value(step.after.state.tolist())  # raises
            node = step.after
        return Arc(node.time, node.state, None, passed, self._evaluations, steps)

    def _locate(self, event: Event, node: _Node, length: float) -> tuple[float, Array]:
        """Return time and state of an event that a step of a length from a node crosses."""
        self._predictor = None
        while True:
            step, changes, length = self._step_up_to([event], node, length)
            if any(change.event is event and change.crosses() for change in changes):
                return step.locate(event)
            node = step.after

    def _step_up_to(
        self, events: Sequence[Event], node: _Node, length: float
    ) -> tuple[Step, list[_Change], float]:
        """Take a step; take it anew until it ends shortly after the first of events within it.

        Return the step, how the functions of all events change, and the length of the next [s].
        """
        shortest = max(100.0 * math.ulp(node.time), 1e-300)
        predicted = self._length_to_event(node, length)
        undisturbed = 0.0 if predicted is None else length
        length = length if predicted is None else predicted
        for _ in range(MAX_RETAKEN):
            step, next_length = self._take_step(node, length)
            changes = _changes(self._events, node, step.after)
            fraction = 1.0
            for change in changes:
                if change.event in events:
                    fraction = min(fraction, change.fraction_to_take())
                if change.hides(step):
                    fraction = min(fraction, 0.5)
            if fraction == 1.0 or step.length <= shortest:
                break
            undisturbed = max(undisturbed, step.length)
            length = max(fraction * step.length, shortest)
        self._predictor = None if undisturbed > 0.0 else step  # what it predicted was wrong
        return step, changes, max(NEXT_LENGTH * next_length, undisturbed)

    def _length_to_event(self, node: _Node, length: float) -> float | None:
        """Return the length of a step to the event that the step before predicts [s].

        It is None without such an event. The interpolant is only read beyond its step where a
        motion at a constant acceleration would meet the event.
        """
        if self._predictor is None:
            return None
        length = min(length, self._tolerance.longest, self._time_limit - node.time)
        rates = node.rates.tolist()
        moved = [y + length * rate for y, rate in zip(node.state.tolist(), rates, strict=True)]
        for axis in range(3):
            moved[axis] += 0.5 * length * length * rates[3 + axis]
        if all(event.value_or_nan(moved) > 0.0 for event in self._terminal):
            return None
        time = node.time + length
        end = self._predictor(time)
        self._evaluations += 4
        after = _Node(time, end, np.array(self._rates(time, end)))
        changes = _changes(self._terminal, node, after)
        fraction = min(change.fraction_to_take() for change in changes)
        return fraction * length if 0.0 < fraction < 1.0 else None

    def _take_step(self, node: _Node, length: float) -> tuple[Step, float]:
        """Return a step of at most a length from a node, and the length that scipy proposes next.

        It is scipy's step: coefficients, estimate of the error and control of the length.
        """
        time, state, rates = node
        least, most = 10.0 * math.ulp(time), 10.0
        length = max(min(length, self._tolerance.longest), least)
        relative, absolute, _ = self._tolerance
        while True:
            end = min(time + length, self._time_limit)
            length = end - time
            stages = np.zeros((_STAGES + 1 + len(DOP853.C_EXTRA), len(state)))
            stages[0], previous, weights = rates, stages[:_STAGES], length * _WEIGHTS
            for k in range(1, _STAGES):
                moved = state + weights[k].dot(previous)
                stages[k] = self._rates(time + _TIMES[k] * length, moved)
            new = state + weights[_STAGES].dot(previous)
            stages[_STAGES] = self._rates(end, new)
            self._evaluations += _STAGES
            if self._evaluations > MAX_EVALUATIONS:
                reason = f"it takes more than {MAX_EVALUATIONS} evaluations of forces"
                raise _given_up(time, reason)
            scale = absolute + relative * np.maximum(np.abs(state), np.abs(new))
            fifth, third = (_ERRORS.dot(stages[: _STAGES + 1]) / scale).tolist()
            five, three = math.hypot(*fifth), 0.1 * math.hypot(*third)
            size = math.hypot(five, three) * math.sqrt(len(state))
            error = length * five * (five / size) if size != 0.0 else 0.0
            growth = 0.9 * error**-0.125 if error > 0.0 else math.inf
            if error < 1.0:
                if not math.hypot(*new.tolist()) < math.inf:
                    raise _given_up(end, "the numbers overflow")
                after = _Node(end, new, stages[_STAGES])
                return Step(self._rates, node, after, stages), length * min(growth, most)
            length *= max(0.2, growth) if error < math.inf else 0.2
            most = 1.0
            if length < least:
                raise _given_up(time, "the step would be shorter than time can be resolved")


def _first_length(node: _Node, tolerance: Tolerance) -> float:
    r"""Return the length of the first step [s], :math:`(0.01 / d_0)^{1/8}\, d_0 / d_1`.

    The norms d of state and rate are relative to the tolerances. It is the step of Hairer, Norsett
    & Wanner, II.4, in any unit of time.
    """
    scale = tolerance.absolute + tolerance.relative * np.abs(node.state)
    size, change = (math.hypot(*(vector / scale).tolist()) / math.sqrt(len(scale))
                    for vector in (node.state, node.rates))  # fmt: skip
    size = max(size, 1.0)
    return size / change * (0.01 / size) ** 0.125 if change > 0.0 else math.inf


def _given_up(time: float, reason: str) -> KickdynError:
    """Return the error of an integration that ends too soon."""
    return KickdynError(f"the flight could not be integrated beyond {time:g} s: {reason}")
