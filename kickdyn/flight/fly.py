"""The flight of a ball, from launch to landing."""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.events import (
    CREST,
    Event,
    checked_ends,
    distance_to_plane,
    ground_event,
    plane_events,
)
from kickdyn.flight.flight_result import Flight, FlightStatus
from kickdyn.flight.forces import (
    MAX_SPEED,
    STILL_REYNOLDS,
    VACUUM,
    FlightEquations,
    ballistic,
    brakes,
    downward,
    fall_to_planes,
    is_ballistic,
    tolerances,
)
from kickdyn.flight.integrate import (
    Arc,
    Integration,
    StepGenerator,
    Tolerance,
    solve_one,
    trajectory,
)
from kickdyn.ground import Ground
from kickdyn.plane import Plane


@validation.check_arguments
def fly(
    state: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    plane: Plane | None = None,
    time_limit: float = 1000.0,
    max_step: float | None = None,
    ends: Sequence[Event] = (),
) -> Flight:
    r"""Return the flight of a ball from its launch to the first event that ends it.

    Without air, the flight has a closed form (Eqs. 24-25). With air, DOP853 integrates the
    equations of `FlightEquations`.

    Args:
        state: the ball at the launch, such as `Impact.ball_after`; its time is not used.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum.
        ground: the ground, where the flight ends. None ends it where the centre of the ball is back
            at the height of the launch.
        tol: tolerance of each step of the integration, 1e-13 to 1e-2, relative to the lengths and
            speeds of this flight. The errors of the steps add up; `Flight.error` estimates their
            sum.
        plane: a wall or a goal line, which ends the flight if the ball reaches it first. A ball
            that starts on it flies only if it moves away from it.
        time_limit: time after which the flight ends with the status `aloft` if the ball has not
            come down [s].
        max_step: longest step of the integration [s]; None sets no limit. A step may miss what a
            function of your own does between its 12 evaluations, such as a narrow peak of C_D.
        ends: further events that end the flight, each with a status of its own, its name.

    Raises:
        InvalidInput: an array of states, an end that is no terminal event or whose function is not
            a number on the way, a ball that starts inside the ground, beyond the plane or faster
            than light, a position beyond the range of float64, or a bad tolerance. A coefficient
            outside its range gives one of `Flight.warnings`.
        KickdynError: the integrator gave up.

    Example:
        >>> import kickdyn as kd
        >>> kick = kd.BallState(velocity=(20, 0, 10), spin=(0, -30, 0))  # with back spin
        >>> path = kd.fly(kick, kd.Ball(), kd.Air())
        >>> round(path.range, 2), round(path.height, 2), round(path.duration, 2)
        (42.21, 7.53, 2.91)
    """
    check_single(state, "fly")
    tol = validation.number("tol", tol, at_least=1e-13, at_most=1e-2)
    time_limit = validation.number("time limit", time_limit, above=0, unit="s")
    if max_step is not None:
        max_step = validation.number("max_step", max_step, above=0, unit="s")
    further = checked_ends(ends)
    return _fly(_Task(state, ball, air, ground, tol, plane, time_limit, max_step, further))


class _Task(NamedTuple):
    """The arguments of `fly`."""

    state: BallState
    ball: Ball
    air: Air | None
    ground: Ground | None
    tol: float
    plane: Plane | None
    time_limit: float
    max_step: float | None
    ends: tuple[Event, ...]


def _fly(task: _Task, **changes: Any) -> Flight:
    """Return the flight of `fly`; `Flight.error` takes a tolerance that `fly` refuses."""
    task = task._replace(**changes) if changes else task
    state, ball, air, ground, tol, plane, *_ = task
    events = ground_event(ball, ground), *plane_events(ball, plane), *task.ends
    ends = tuple(event.launched(state) for event in events)
    # for `Flight.error`, `Flight.arrival` and unpickling, which fly once more
    flown = partial(Flight, ball, air, ground, plane, tol, partial(_fly, task))
    if _has_closed_form(state, ball, air, ends):
        return _closed_form(flown, state, downward(ball, air), ends, task.time_limit)
    return _integrated(flown, task, ends)


def check_single(state: BallState, function: str) -> None:
    """Raise `InvalidInput` unless this is one launch; the message names the function for many."""
    if state.position.shape != (3,):
        shape = state.position.shape
        raise InvalidInput(
            f"launch has shape {shape}: {function} takes one, (3,); {function}_many takes many"
        )


def _has_closed_form(
    state: BallState, ball: Ball, air: Air | None, ends: tuple[Event, ...]
) -> bool:
    """Return whether only a downward weight acts, or the ball is too slow for any other force.

    All ends are then planes. Below the Reynolds number `STILL_REYNOLDS` an integrator would step to
    lengths that are no numbers.
    """
    if downward(ball, air) <= 0.0 or any(end.function is not distance_to_plane for end in ends):
        return False
    if air is None or is_ballistic(air, state.spin):
        return True
    if callable(air.wind) or air.wind.any() or brakes(air, state.spin):
        return False
    drop = ends[0].numbers[0]
    fastest = math.hypot(*state.velocity.tolist(), math.sqrt(2.0 * GRAVITY * drop))
    return 2.0 * ball.radius * air.density / air.viscosity * fastest < STILL_REYNOLDS


def _closed_form(
    flown: Callable[..., Flight],
    state: BallState,
    g: float,
    ends: tuple[Event, ...],
    time_limit: float,
) -> Flight:
    numbers = np.array([[number for end in ends for number in end.numbers]])
    nodes, which = fall_to_planes(state.velocity[None], numbers, g, time_limit)
    node, reached = nodes[0], (*ends, None)[which[0]]
    if not np.isfinite(node).all():
        raise InvalidInput(
            f"the ball flies for {node[0]:g} s: after that its position is beyond the range of "
            "float64"
        )
    return flown(
        _ball_at(state, 0.0, ballistic(state.velocity, g, np.zeros(1))[0]),
        _ball_at(state, float(node[8]), node[9:]),
        _ball_at(state, float(node[0]), node[1:8]),
        FlightStatus.ALOFT if reached is None else reached.name,
        "closed form",
        0,
        partial(ballistic, state.velocity, g),
    )


class FlownArc(NamedTuple):
    """An integrated flight: states are those of `FlightEquations`."""

    arc: Arc
    begin: Array  # states at the launch
    end: tuple[float, Array]  # time [s] and states; on the ground by definition
    apex: tuple[float, Array]  # time [s] and states at the highest point


def flight_tolerance(
    relative: float, absolute: tuple[float, float, float], max_step: float | None
) -> Tolerance:
    """Return the tolerance of a flight, with those of displacement, velocity and spin."""
    length, pace, share = absolute
    entries = np.array([length, length, length, pace, pace, pace, share])
    return Tolerance(relative, entries, max_step or math.inf)


def fly_arc(
    state: BallState,
    ball: Ball,
    air: Air,
    ends: Sequence[Event],
    time_limit: float,
    tolerance: Tolerance,
    *,
    keep_steps: bool = True,
) -> StepGenerator[FlownArc]:
    """Integrate a flight to the first of its ends, with the numbers of this launch; else raise."""
    equations = FlightEquations(state, ball, air)
    try:
        integration = Integration(equations.rates, [*ends, CREST], time_limit, tolerance)
        arc = yield from integration.run(equations.begin, keep_steps=keep_steps)
    except KickdynError as error:
        fault = equations.fault
        if fault is None:
            raise
        cause = f"the air's wind or a coefficient raised {type(fault).__name__}: {fault}"
        raise KickdynError(f"{error}; {cause}") from fault
    last = arc.end, arc.state.copy()
    if arc.reached is ends[0]:
        last[1][2] = -ends[0].numbers[0]  # by definition; else but for rounding
    nodes = (0.0, equations.begin), last, *arc.passed
    apex = max(nodes, key=lambda node: float(node[1][2]))
    return FlownArc(arc, equations.begin, last, apex)


def _integrated(flown: Callable[..., Flight], task: _Task, ends: tuple[Event, ...]) -> Flight:
    state, ball, tol, air = task.state, task.ball, task.tol, task.air or VACUUM
    speed = math.hypot(*state.velocity)
    if not speed <= MAX_SPEED:
        raise InvalidInput(
            f"launch speed is {speed:g} m/s: in air it must be at most {MAX_SPEED:g} m/s, the "
            "speed of light"
        )
    wind = _wind_speed(air, float(state.position[2]))
    relative, length, pace = tolerances(speed, ends[0].numbers[0], wind, ball, air, tol)
    tolerance = flight_tolerance(relative, (float(length), float(pace), tol), task.max_step)
    path = solve_one(fly_arc(state, ball, air, ends, task.time_limit, tolerance))
    spins, arc = bool(state.spin.any()), path.arc
    acting = {"drag": air.drag, "lift": spins and air.lift, "spin decay": spins and air.torque}
    effects = ", ".join(name for name, model in acting.items() if model and air.density > 0.0)
    effects = effects or "weight less buoyancy only"
    states = trajectory(arc, path.begin)
    return flown(
        _ball_at(state, 0.0, path.begin),
        _ball_at(state, *path.apex),
        _ball_at(state, *path.end),
        FlightStatus.ALOFT if arc.reached is None else arc.reached.name,
        f"DOP853, rtol {tol:g}, {effects}",
        arc.evaluations,
        lambda times: states(times).T,
    )


def _wind_speed(air: Air, height: float) -> float:
    try:
        speed = math.hypot(*air.wind_at(height))
    except Exception as fault:
        raise InvalidInput(
            f"the wind at the launch, {height:g} m high, raised {type(fault).__name__}: {fault}"
        ) from fault
    return validation.number("wind", speed, at_most=MAX_SPEED, unit="m/s")


def _ball_at(launch: BallState, time: float, moved: Array) -> BallState:
    vectors = launch.position + moved[:3], moved[3:6].copy(), moved[6] * launch.spin
    if math.hypot(*itertools.chain(*(vector.tolist() for vector in vectors))) < math.inf:
        return BallState.computed(*vectors, time)
    return BallState(*vectors, time)
