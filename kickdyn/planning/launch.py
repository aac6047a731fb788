"""Planning one launch over level ground: a distance and a time, round by round (Figs. 13-15)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.planning.goal import FARTHEST, Goal, nominal_velocity
from kickdyn.planning.launch_family_solver import SPEED_LIMIT, plan_launches
from kickdyn.planning.launch_result import Launches

Method = Literal["newton", "learned"]

TOLERANCES = {"newton": (1e-7, 1e-8), "learned": (0.05, 0.005)}
"""Errors of distance [m] and time [s] that count as met: those that two integrations of one flight
may differ by where a coefficient bends sharply, and about a line's width in Fig. 15."""

MAX_ROUNDS = 200
"""Corrections after which the learning loop is given up; the paper's farthest goal takes about 25.
"""


@dataclass(frozen=True)
class Round:
    """One flight on the way to a plan.

    Attributes:
        speed: of the launch [m/s].
        angle: of the launch above the horizontal [rad].
        distance_error: wished less reached [m].
        time_error: wished less reached [s].
    """

    speed: float
    angle: float
    distance_error: float
    time_error: float


@dataclass(frozen=True, eq=False, repr=False)
class LaunchPlan(ReprMixin):
    """A launch, and how it was found.

    Attributes:
        status: `met` or `not met`.
        limit: what stands in the way of a goal that is not met: `speed limit` or `ground`, as in
            `Launches`, and the plan is then the nearest launch; of the learning loop `speed limit`,
            `aloft`, a flight that did not land, `time`, a command of none, or `rounds`, too many,
            and the plan is then the flight that came closest; or `tolerances`, finer than flights
            are computed. Empty where it is met.
        method: `newton` or `learned`.
        flight: from the planned launch, flown a hundred times more exactly than it has to meet.
        best: errors of that flight.
        history: every flight tried, the nominal one of Eqs. (24)-(25) first; only the nearest where
            Newton's method meets nothing.
    """

    status: Literal["met", "not met"]
    limit: str
    method: Method
    flight: Flight
    best: Round
    history: tuple[Round, ...]

    def _rows(self) -> Iterable[Row]:
        yield "status", f"{self.status}: {self.limit}" if self.limit else self.status, ""
        yield "speed", self.speed, "m/s"
        yield "angle", math.degrees(self.angle), "deg"
        yield "spin", self.launch.spin, "rad/s"
        yield "distance error", self.best.distance_error, "m"
        yield "time error", self.best.time_error, "s"
        yield "method", f"{self.method}, {self.iterations} corrections", ""
        for line in self.flight.warnings:
            yield "warning", line, ""

    def _picture(self) -> str:
        return self.flight._picture()

    @property
    def launch(self) -> BallState:
        """The ball's state to start with."""
        return self.flight.launch

    @property
    def speed(self) -> float:
        """Launch speed [m/s]."""
        return self.best.speed

    @property
    def angle(self) -> float:
        """Launch angle above the horizontal [rad]."""
        return self.best.angle

    @property
    def iterations(self) -> int:
        """Number of corrections after the nominal launch."""
        return len(self.history) - 1


Fly = Callable[[Array], Flight]


def plan_launch(
    distance: float,
    time: float,
    ball: Ball,
    air: Air | None = None,
    method: Method = "newton",
    *,
    spin: ArrayLike = (0.0, 0.0, 0.0),
    tolerances: tuple[float, float] | None = None,
) -> LaunchPlan:
    """Find the launch in the x-z plane that brings the ball down at a distance, after a time.

    "Down" is back at the height of the launch. Both methods start from the vacuum's answer, Eqs.
    (24)-(25). `learned` is the paper's loop: fly, add the errors of distance and time to the
    command, solve (24)-(25) for the new command. `newton` is `plan_launches`, which also plans in
    space; here its steps are flown, one by one. Neither is faster than sound.

    Args:
        distance: wished for [m], 1e-6 to 1e4.
        time: wished for [s], 1e-6 to 1e6.
        ball: mass and radius.
        air: None is the vacuum.
        method: `newton` or `learned`.
        spin: of the ball, about y, shape `(3,)` [rad/s, world frame].
        tolerances: errors of distance [m] and time [s] that count as met; those of `TOLERANCES`
            when not named.

    Raises:
        InvalidInput: a distance or time out of range, a tolerance not above 0, spin or wind that
            drives the ball out of the plane, or an unknown method.
    """
    if method not in TOLERANCES:
        raise InvalidInput(f"planning method {method!r} is unknown: choose {', '.join(TOLERANCES)}")
    distance = validation.number("distance", distance, at_least=1e-6, at_most=FARTHEST, unit="m")
    time = validation.number("time", time, at_least=1e-6, at_most=1e6, unit="s")
    goal = np.array([distance, time])
    accepted = validation.vector(
        "tolerances", TOLERANCES[method] if tolerances is None else tolerances, 2
    )
    if not (accepted > 0).all():
        raise InvalidInput(f"tolerances are {accepted.tolist()}: they must be above 0")
    turning = validation.vector("spin", spin, 3, unit="rad/s")
    if turning[0] or turning[2] or (air is not None and air.wind_at(0.0)[1]):
        raise InvalidInput(
            "spin or wind drives the ball out of the x-z plane: spin must be about y, "
            "wind without y component"
        )
    tol = 1e-13 if method == "newton" else 1e-9

    def flown(velocity: Array) -> Flight:
        launch = BallState(velocity=velocity, spin=turning)
        return fly(launch, ball, air, tol=tol, time_limit=100 * time)

    if method == "newton":
        found = plan_launches(Goal(distance, time=time), ball, air, spin=turning)
        flights, limit = [flown(velocity) for velocity in _steps(found)], found.limit
    else:
        flights, limit = _learned(goal, accepted, flown)
    misses = [_miss(goal, accepted, flight) for flight in flights]
    last = len(flights) - 1
    chosen = last if method == "newton" else int(np.argmin(misses))
    met = misses[chosen] <= 1.0
    history = tuple(_round(goal, flight) for flight in flights)
    return LaunchPlan(
        "met" if met else "not met",
        "" if met else limit or "tolerances",
        method,
        flights[chosen],
        history[chosen],
        history,
    )


def _steps(found: Launches) -> list[Array]:
    """Return the launch velocities from the nominal launch to the answer."""
    nominal = nominal_velocity(found.goal.target, found.goal.nominal_times()[0])
    if found.solutions:
        launch = found.solutions[0]
        return list(launch.tried) or [nominal, launch.velocity]
    return [nominal if found.nearest is None else found.nearest.velocity]


def _learned(goal: Array, accepted: Array, flown: Fly) -> tuple[list[Flight], str]:
    """Correct the command that Eqs. (24)-(25) turn into a launch by its errors, until they vanish.

    Returns:
        The flights, and what ended them where that was not the goal.
    """
    command, flights = goal, list[Flight]()
    while len(flights) <= MAX_ROUNDS:
        if command[1] <= 0.0:
            return flights, "time"
        velocity = nominal_velocity(np.array([command[0], 0.0, 0.0]), float(command[1]))
        speed = math.hypot(*velocity)
        flights.append(flown(velocity * min(1.0, SPEED_LIMIT / speed)))
        if speed > SPEED_LIMIT:
            return flights, "speed limit"
        if flights[-1].status != "landed":
            return flights, "aloft"
        if _miss(goal, accepted, flights[-1]) <= 1.0:
            return flights, ""
        command = command + _error(goal, flights[-1])
    return flights, "rounds"


def _error(goal: Array, flight: Flight) -> Array:
    return np.asarray(goal - np.array([flight.landing.position[0], flight.duration]))


def _miss(goal: Array, accepted: Array, flight: Flight) -> float:
    """Return the larger error over what is accepted; inf where the ball does not land."""
    if flight.status != "landed":
        return math.inf
    return float(np.abs(_error(goal, flight) / accepted).max())


def _round(goal: Array, flight: Flight) -> Round:
    error, launch = _error(goal, flight).tolist(), flight.launch
    return Round(float(launch.speed), float(launch.elevation), *error)
