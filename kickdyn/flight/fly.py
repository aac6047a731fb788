"""The flight of a ball, from launch to landing."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.gravity import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.equations import MAX_SPEED, FlightEquations, tolerances
from kickdyn.flight.flight_result import Flight, FlightStatus, warning_of
from kickdyn.flight.forces import (
    STILL,
    ballistic,
    brakes,
    downward,
    is_ballistic,
    time_to_fall,
)
from kickdyn.flight.integrate import Event, FlightArc, fly_until, joined
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
) -> Flight:
    r"""Return the flight of a ball from its launch to the ground, or to a plane before.

    Without air, the flight has a closed form (Eqs. 24-25). With air, DOP853 integrates the
    equations of `FlightEquations` to the landing; the apex is computed when it is first read.

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
        max_step: longest step of the integration [s]; None sets no limit. A step does not see what
            a function of your own does between its 12 evaluations, such as a narrow peak of C_D;
            `Flight.error` does.

    Raises:
        InvalidInput: an array of states, a ball that starts inside the ground, beyond the plane or
            faster than light, a position beyond the range of float64, a bad tolerance, or a
            coefficient outside its range whose model refuses that; others give one of
            `Flight.warnings`.
        KickdynError: the integrator gave up.

    Example:
        >>> import kickdyn as kd
        >>> kick = kd.BallState(velocity=(20, 0, 10), spin=(0, -30, 0))  # with back spin
        >>> path = kd.fly(kick, kd.Ball(), kd.Air())
        >>> round(path.range, 2), round(path.height, 2), round(path.duration, 2)
        (42.21, 7.53, 2.91)
    """
    check_single(state)
    tol = validation.number("tol", tol, at_least=1e-13, at_most=1e-2)
    time_limit = validation.number("time limit", time_limit, above=0, unit="s")
    if max_step is not None:
        max_step = validation.number("max_step", max_step, above=0, unit="s")
    return _fly(state, ball, air, ground, tol, plane, time_limit, max_step)


def _fly(
    state: BallState,
    ball: Ball,
    air: Air | None,
    ground: Ground | None,
    tol: float,
    plane: Plane | None,
    time_limit: float,
    max_step: float | None,
) -> Flight:
    """Return what `fly` does; `Flight.error` asks for tolerances here that `fly` refuses."""
    drop, wall = float(drops(state.position, ball, ground)), wall_of(plane, ball, state)
    limits = _Limits(drop, wall, time_limit, math.inf if max_step is None else max_step)
    # for `Flight.error`, `Flight.arrival` and unpickling, which fly once more
    again = partial(_fly, state, ball, air, ground, tol=tol, plane=plane, time_limit=time_limit,
                    max_step=max_step)  # fmt: skip
    flown = partial(Flight, ball, air, ground, plane, tol, again)
    if air is None or _has_closed_form(state, ball, air, drop):
        path = _closed_form(flown, state, downward(ball, air), limits)
    else:
        path = _integrated(flown, state, ball, air, limits, tol)
    _refuse_outside(path)
    return path


class _Limits(NamedTuple):
    """Where a flight ends: so far down [m], at a wall (normal and gap [m]), or after a time [s].

    And the longest step of its integration [s].
    """

    drop: float
    wall: tuple[Array, float] | None
    time_limit: float
    longest_step: float


def check_single(state: BallState) -> None:
    """Raise `InvalidInput` unless this is one launch."""
    if state.position.shape != (3,):
        shape = state.position.shape
        raise InvalidInput(f"launch has shape {shape}: fly takes one, (3,); fly_many takes many")


def wall_of(plane: Plane | None, ball: Ball, state: BallState) -> tuple[Array, float] | None:
    """Return a plane's normal and how far the ball still is from reaching it [m]."""
    return None if plane is None else (plane.normal, plane.gap(ball, state.position))


def drops(position: Array, ball: Ball, ground: Ground | None) -> Array:
    """Return how far below its launch each flight ends [m], shape `()` or `(n,)`.

    Positions of the ball's centre at the launch have shape `(3,)` or `(n, 3)` [m, world frame]; one
    inside the ground raises `InvalidInput`.
    """
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


def _has_closed_form(state: BallState, ball: Ball, air: Air, drop: float) -> bool:
    """Return whether only a downward weight acts, or the ball is too slow for any other force.

    Below the Reynolds number `STILL` an integrator would step to lengths that are no numbers.
    """
    if downward(ball, air) <= 0.0:
        return False
    if is_ballistic(air, state.spin):
        return True
    if callable(air.wind) or air.wind.any() or brakes(air, state.spin):
        return False
    fastest = math.hypot(*state.velocity.tolist(), math.sqrt(2.0 * GRAVITY * drop))
    return 2.0 * ball.radius * air.density / air.viscosity * fastest < STILL


def _closed_form(flown: Callable[..., Flight], state: BallState, g: float, ends: _Limits) -> Flight:
    """Return the flight of a ball that only its weight acts on."""
    rise = float(state.velocity[2])
    fall, reach = time_to_fall(rise, ends.drop, g), math.inf
    if ends.wall is not None:
        normal, gap = ends.wall
        reach = time_to_fall(float(normal @ state.velocity), gap, g * float(normal[2]))
    end = min(fall, reach, ends.time_limit)
    status = FlightStatus.AT_PLANE if end == reach else FlightStatus.ALOFT
    top = min(max(rise / g, 0.0), end)
    with np.errstate(over="ignore", invalid="ignore"):
        start, apex, last = ballistic(state.velocity, g, np.array([0.0, top, end]))
    if not np.isfinite(last).all():
        raise InvalidInput(
            f"the ball flies for {end:g} s: after that its position is beyond the range of float64"
        )
    if end == fall:
        status = FlightStatus.LANDED
        last[2] = -ends.drop  # by definition; the formula says so but for rounding
    nodes = _at(state, 0.0, start), lambda: _at(state, top, apex), _at(state, end, last)
    return flown(*nodes, status, "closed form", 0, partial(ballistic, state.velocity, g))


def _integrated(
    flown: Callable[..., Flight], state: BallState, ball: Ball, air: Air, ends: _Limits, tol: float
) -> Flight:
    """Return the flight of a ball through the air, integrated to its end."""
    speed = math.hypot(*state.velocity)
    if not speed <= MAX_SPEED:
        raise InvalidInput(
            f"launch speed is {speed:g} m/s: in air it must be at most {MAX_SPEED:g} m/s, that of "
            "light"
        )
    equations = FlightEquations(state, ball, air)
    wind = _wind_speed(air, float(state.position[2]))
    # The integrator bounds the root mean square over seven states; those that do not change must
    # not relax it.
    tight = tol * math.sqrt(equations.count_changing() / 7)
    rtol, near, slow = tolerances(state.velocity, ends.drop, wind, ball, air, tight)
    atol = np.array([*3 * [near], *3 * [slow], tight])
    try:
        arc, status = _arc(equations, ends, rtol, atol)
    except KickdynError as error:
        cause = equations.describe_fault()
        if not cause:
            raise
        raise KickdynError(f"{error}; {cause}") from equations.fault
    end, last = (0.0, equations.begin) if arc is None else (arc.end, arc.state.copy())
    if status is FlightStatus.LANDED:
        last[2] = -ends.drop  # by definition; the root says so but for rounding

    def apex() -> BallState:
        """Return the ball at the highest of launch, crests and landing."""
        crests = [] if arc is None else [crest() for crest in arc.crests]
        nodes = (0.0, equations.begin), (end, last), *(node for node in crests if node[0] <= end)
        return _at(state, *max(nodes, key=lambda node: float(node[1][2])))

    spins = bool(state.spin.any())
    acting = {"drag": air.drag, "lift": spins and air.lift, "spin decay": spins and air.torque}
    effects = ", ".join(name for name, model in acting.items() if model) or "buoyancy only"
    trajectory = joined([] if arc is None else [arc], equations.begin)
    return flown(
        _at(state, 0.0, equations.begin),
        apex,
        _at(state, end, last),
        status,
        f"DOP853, rtol {tol:g}, {effects}",
        0 if arc is None else arc.evaluations,
        lambda t: trajectory(t).T,
    )


def _arc(
    equations: FlightEquations, ends: _Limits, rtol: float, atol: Array
) -> tuple[FlightArc | None, FlightStatus]:
    """Return the solution up to its end, None where it ends at once, and which end it is."""
    begin = equations.begin
    floor = Event(lambda states: ends.drop + float(states[2]), lambda states: float(states[5]))
    walls = [] if ends.wall is None else [_reaching(*ends.wall)]
    rates = np.array(equations.rates(0.0, begin))
    rises = begin[5] > 0.0 or (begin[5] == 0.0 and rates[5] > 0.0)
    if ends.drop == 0.0 and not rises:
        return None, FlightStatus.LANDED
    if any(_passes(wall, begin, rates) for wall in walls):
        return None, FlightStatus.AT_PLANE
    limits = ends.time_limit, rtol, atol, ends.longest_step
    arc = fly_until([floor, *walls], 5, equations.rates, (0.0, begin), *limits)
    if arc.reached is None:
        return arc, FlightStatus.ALOFT
    return arc, FlightStatus.LANDED if arc.reached is floor else FlightStatus.AT_PLANE


def _reaching(normal: Array, gap: float) -> Event:
    """Return the event of having moved by `gap` against a normal."""
    return Event(
        lambda states: gap + float(normal @ states[:3]), lambda states: float(normal @ states[3:6])
    )


def _passes(wall: Event, begin: Array, rates: Array) -> bool:
    """Return whether a ball that starts on a plane goes through it rather than away."""
    assert wall.rate is not None
    across, pull = wall.rate(begin), wall.rate(rates)
    return wall.value(begin) <= 0.0 and (across < 0.0 or (across == 0.0 and pull < 0.0))


def _wind_speed(air: Air, height: float) -> float:
    """Return the speed of the wind at a height [m/s], or raise `InvalidInput` where it has none."""
    try:
        speed = math.hypot(*air.wind_at(height))
    except Exception as fault:
        raise InvalidInput(
            f"the wind at the launch, {height:g} m high, raised {type(fault).__name__}: {fault}"
        ) from fault
    return validation.number("wind", speed, at_most=MAX_SPEED, unit="m/s")


def _at(launch: BallState, time: float, moved: Array) -> BallState:
    """Return the ball at a time, from what changed since the launch."""
    parts = launch.position + moved[:3], moved[3:6].copy(), moved[6] * launch.spin
    if all(np.isfinite(part).all() for part in parts):
        return BallState.computed(*parts, time)
    return BallState(*parts, time)


def _refuse_outside(path: Flight) -> None:
    """Raise `InvalidInput` where a flight leaves the range of a model that refuses that."""
    models = () if path.air is None else (path.air.drag, path.air.lift)
    if any(getattr(model, "refuses", False) for model in models):
        for model, share, limits in path.outside():
            if share > 0 and model.refuses:
                warning = warning_of(model, share, limits)
                raise InvalidInput(f"the flight leaves a coefficient's range: {warning}")
