r"""Events of a flight: where a function of the ball's state falls through zero.

The ground, a wall, the highest point and ends that users define are events. `fly` and `fly_many`
take the same ones: a function with floats, `math` and indices alone can be compiled.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.lanes import inlined
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import FlightStatus
from kickdyn.ground import Ground
from kickdyn.plane import Plane, plane_gaps

EventFunction = Callable[[Any, Any], Any]
"""From the seven states of `FlightEquations` and an event's numbers to a float."""

NUMBERS = 4
"""How many numbers an event may have."""

PARTS = 6
"""Equal parts of a step of the integration, at whose ends the function of an event is read."""

MOST_CHANGE = 2.0
"""How fast a function may change within a part, over its greatest change in a part of the step."""

SHORTEST_TIME, SHORTEST_WAY = 1e-3, 1e-2
"""A function is found to be negative for such a time [s] and along such a way [m]."""

DIFFERENCE = 1e-6
"""Time over which the function of an event is differentiated, as a fraction of the step."""

MOST_READINGS = 10_000
"""Most readings in a part: a step in a vacuum may take minutes."""

AT_REST = 1e-100
"""Speed below which a ball at an event does not leave it [m/s]."""


@dataclass(frozen=True, eq=False)
class Event:
    """What happens where a function of the ball's state falls through zero.

    A function that is zero at the launch, as the height over the ground of a ball that lies on it,
    ends the flight at once unless it rises; one that is negative must first become positive. Where
    the function is nan or raises, `fly` raises `InvalidInput`, and `fly_many` says `failed`.

    `fly` and `fly_many` read the function at the ends of six equal parts of every step of the
    integration. Within a part it is taken to change at most twice as fast as on average over the
    part of the step in which it changes most; where it could then fall to zero, it is read every
    1 ms or, if the ball takes longer for that, every 1 cm of its way. So an event is found if its
    function is negative for 1 ms and along 1 cm, be it a distance from a post of any thickness. A
    function that jumps, such as 1 outside of a box and -1 inside, is found if it is negative for a
    sixth of a step, some 40 ms: write how far the ball is from the box instead.

    Attributes:
        name: the status of a flight that the event ends.
        function: function of the state and of four numbers that falls through zero at the
            event. The state has seven entries: displacement from the launch [m], velocity [m/s,
            world frame] and the fraction of the spin that is left.
        numbers: up to four numbers, after which come zeros, or a function of the launch that
            returns them. That function is called with one launch by `fly`, with n launches by
            `fly_many`, and with the ball after every bounce by `follow`.
        terminal: whether the event ends the flight.
        within_steps: whether the function is also read within the steps. That of a plane needs not
            be: its values and slopes at the ends of a step suffice.

    A flight can be pickled if its functions are at the top level of a module.

    Example:
        >>> import kickdyn as kd
        >>> def over_bar(state, numbers):  # falls below a height of 2.44 m
        ...     return numbers[0] + state[2] - 2.44
        >>> below = kd.Event("below-bar", over_bar, lambda launch: (launch.position[..., 2],))
        >>> path = kd.fly(kd.BallState(velocity=(20, 0, 10)), kd.Ball(), kd.Air(), ends=[below])
        >>> path.status, round(float(path.landing.position[2]), 9)
        ('below-bar', 2.44)
    """

    name: str
    function: EventFunction
    numbers: Any = ()
    terminal: bool = True
    within_steps: bool = True

    def launched(self, launch: BallState) -> "Event":
        """Return the event with the numbers of a launch, or of n launches."""
        try:
            numbers = self.numbers(launch) if callable(self.numbers) else self.numbers
        except InvalidInput:
            raise
        except Exception as fault:
            raise InvalidInput(
                f"the numbers of the event {self.name!r} are a function that raised "
                f"{type(fault).__name__}: {fault}"
            ) from fault
        shape = launch.position.shape[:-1]
        try:
            fixed = [np.asarray(number, dtype=float) for number in numbers]
            valid = len(fixed) <= NUMBERS and all(
                number.shape in ((), shape) and np.isfinite(number).all() for number in fixed
            )
        except (TypeError, ValueError):
            valid = False
        if not valid:
            raise InvalidInput(
                f"the numbers of the event {self.name!r} are {validation.brief(numbers)}: they "
                f"must be a sequence of at most {NUMBERS} finite numbers"
                + (f", or arrays of shape {shape}" if shape else "")
            )
        fixed += (NUMBERS - len(fixed)) * [np.zeros(())]
        single = (number if number.ndim else float(number) for number in fixed)
        return replace(self, numbers=tuple(single))

    def value(self, state: Any) -> float:
        """Return the value of the function at a state; `InvalidInput` where it is no number."""
        try:
            value = float(self.function(state, self.numbers))
            fault = "gave nan"
        except Exception as error:
            value, fault = math.nan, f"raised {type(error).__name__}: {error}"
        if math.isnan(value):
            x, y, z = state[:3]
            raise InvalidInput(
                f"the function of the event {self.name!r} {fault}, with the ball displaced by "
                f"({x:g}, {y:g}, {z:g}) m from its launch"
            )
        return value

    def value_or_nan(self, state: Any) -> float:
        """Return the value of the function; nan where there is none, perhaps only beside a path."""
        try:
            return float(self.function(state, self.numbers))
        except Exception:
            return math.nan


def distance_to_plane(state: Any, numbers: Any) -> Any:
    r"""Return :math:`d + n \cdot x` of the distance d at the launch and the normal n of a plane."""
    gap, x, y, z = numbers
    return gap + x * state[0] + y * state[1] + z * state[2]


def ground_event(ball: Ball, ground: Ground | None) -> Event:
    """Return the event that a ball is on the ground, or back at the height of its launch."""
    return Event(
        FlightStatus.LANDED,
        distance_to_plane,
        lambda launch: (drops(launch.position, ball, ground), 0.0, 0.0, 1.0),
        within_steps=False,
    )


def plane_events(ball: Ball, plane: Plane | None) -> tuple[Event, ...]:
    """Return the event that a ball reaches a plane; none without a plane."""
    if plane is None:
        return ()
    normal = plane.normal.tolist()
    return (
        Event(
            FlightStatus.AT_PLANE,
            distance_to_plane,
            lambda launch: (plane_gaps(plane, ball, launch.position), *normal),
            within_steps=False,
        ),
    )


def drops(position: Array, ball: Ball, ground: Ground | None) -> Array:
    """Return the depth of each flight's end below its launch [m], shape `()` or `(n,)`."""
    if ground is None:
        return np.zeros(position.shape[:-1])
    gap = position[..., 2] - ball.radius - ground.height
    inside = np.flatnonzero(gap < -1e-9 * max(ball.radius, abs(ground.height)))  # not by rounding
    if inside.size:
        which = f"flight {inside[0]}" if gap.ndim else "the ball"
        raise InvalidInput(
            f"{which} starts {-gap.flat[inside[0]]:g} m inside the ground: the ball's centre must "
            f"be at or above {ground.height + ball.radius:g} m"
        )
    return np.maximum(gap, 0.0)


CREST = Event("crest", lambda state, _: state[5], terminal=False, within_steps=False)
"""The ball is as high as it gets before it sinks."""


@inlined
def count_readings(part: float, speed: float) -> int:
    """Return how often a function is read in a part of a step [s], the ball's speed being [m/s]."""
    often = min(part / SHORTEST_TIME, part * speed / SHORTEST_WAY)
    return 1 + int(min(often, MOST_READINGS))


def count_known(events: Sequence[Event]) -> int:
    """Return how many events come before the first whose function is read within the steps."""
    within = [event.within_steps for event in events]
    return within.index(True) if any(within) else len(within)


def checked_ends(ends: Any) -> tuple[Event, ...]:
    """Return a user's events as a tuple, or raise `InvalidInput` where one cannot end a flight."""
    events = tuple(ends)
    for event in events:
        if not isinstance(event, Event):
            raise InvalidInput(
                f"ends has {validation.brief(event)}: each entry must be a kickdyn.Event"
            )
        name = event.name
        if not (isinstance(name, str) and name.isprintable() and len(name.split()) == 1):
            raise InvalidInput(
                f"the name of an end is {validation.brief(name)}: it must be a word without spaces"
            )
        if not event.terminal or name in tuple(FlightStatus):
            raise InvalidInput(
                f"the end {name!r} must be terminal, and must not be named as a status: "
                f"{', '.join(FlightStatus)}"
            )
        if not callable(event.function):
            raise InvalidInput(f"the function of the end {name!r} cannot be called")
    return events


def end_at_launch(events: Sequence[Event], state: Array, rates: Array) -> Event | None:
    """Return the first event that ends a motion where it begins; None if the motion goes on.

    Its function is zero at the beginning, and negative shortly after. At a speed of less than
    `AT_REST` that change may be too small for float64, and zero suffices.
    """
    for event in events:
        if event.terminal and event.value(state) == 0.0:
            speed, acceleration = math.hypot(*state[3:6]), math.hypot(*rates[3:6])
            time = 1e-30 * (speed / acceleration if speed > 0.0 < acceleration else 1.0)
            later = state + time * rates
            later[:3] += 0.5 * time * time * rates[3:6]
            value = event.value(later)
            if value < 0.0 or (value == 0.0 and speed < AT_REST):
                return event
    return None


Ends = tuple[float, float, float, float]
"""Value of the function of an event and its slope times the step, at the beginning of a step and at
its end."""


@inlined
def backward_cubic(ends: Ends) -> Ends:
    """Return the coefficients of a cubic from the end of a step back to its beginning."""
    start, rise, end, last_rise = ends
    fall = start - end
    return end, -last_rise, 2.0 * last_rise + rise + 3.0 * fall, -last_rise - rise - 2.0 * fall


@inlined
def on_cubic(cubic: Ends, s: float) -> float:
    """Return the value of a cubic."""
    p0, p1, p2, p3 = cubic
    return p0 + s * (p1 + s * (p2 + s * p3))


@inlined
def cubic_slope(cubic: Ends, s: float) -> float:
    """Return the derivative of a cubic."""
    _, p1, p2, p3 = cubic
    return p1 + s * (2.0 * p2 + s * 3.0 * p3)


@inlined
def find_fall(ends: Ends) -> float:
    """Return the fraction of a step from a function's fall through zero to the end of the step."""
    cubic = backward_cubic(ends)
    low, high, s = 0.0, 1.0, ends[2] / (ends[2] - ends[0])
    for _ in range(60):
        value, slope = on_cubic(cubic, s), cubic_slope(cubic, s)
        if value > 0.0:
            high = s
        else:
            low = s
        further = s - value / slope if slope != 0.0 else -1.0
        if not low <= further <= high:
            further = 0.5 * (low + high)
        moved, s = abs(further - s), further
        if moved <= 1e-3 * s or moved < 1e-15:  # and the next one by its square
            break
    return s


@inlined
def fall_in_step(ends: Ends, is_crest: bool) -> tuple[float, float]:
    """Return where the function of an event falls in a step, and how much of it to take anew.

    The first is the fraction of the step that is left after the fall, -1 if there is none; the
    second is less than 1 if the function may fall and rise within the step. It must rise first if
    it is zero at the beginning.
    """
    start, rise, end, last_rise = ends
    if start > 0.0 >= end:
        return find_fall(ends), 1.0
    if start == 0.0 > end:
        if rise > 0.0:  # before it falls
            return -1.0, 0.5 * rise / (rise - end)
        return -1.0, 0.5 if rise == 0.0 and not is_crest else 1.0
    if not is_crest and start > 0.0 and end > 0.0:
        if rise < 0.0 < last_rise:
            cubic = backward_cubic(ends)
            _, p1, p2, p3 = cubic
            s = -p1 / (p2 + math.sqrt(max(p2 * p2 - 3.0 * p1 * p3, 0.0)))  # at the lowest value
            doubt = 0.05 * (s * (1.0 - s)) ** 2 * (last_rise - rise)
            if on_cubic(cubic, s) <= doubt and s < 1.0 - 1e-6:  # the end of a step there decides
                return -1.0, 1.0 - s
        return -1.0, 1.0
    comes_and_goes = start * end > 0.0 and start * (start + rise) < 0.0 > end * (end - last_rise)
    return -1.0, 0.5 if comes_and_goes else 1.0
