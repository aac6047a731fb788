"""Planning a launch: where the ball should come down, and when (Figs. 13-15)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kickdyn import checks
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.card import Card, Row
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.fly import fly
from kickdyn.flight.forces import GRAVITY
from kickdyn.flight.path import Flight

Method = Literal["newton", "learned"]

TOLERANCES = {"newton": (1e-9, 1e-9), "learned": (0.05, 0.005)}
"""Errors of distance [m] and time [s] that count as met; the learning loop's are about a line's
width in Fig. 15."""

MAX_ROUNDS = 200
"""Corrections after which a plan is given up; the paper's farthest goal takes about 25."""


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
class LaunchPlan(Card):
    """A launch, and how it was found.

    Attributes:
        status: `met`; or `not met`, where the rounds led nowhere: the plan is then the flight that
            came closest.
        method: `newton` or `learned`.
        flight: from the planned launch, flown a hundred times more exactly than it has to meet.
        best: errors of that flight.
        history: every flight tried, the nominal one of Eqs. (24)-(25) first.
    """

    status: Literal["met", "not met"]
    method: Method
    flight: Flight
    best: Round
    history: tuple[Round, ...]

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "speed", self.speed, "m/s"
        yield "angle", math.degrees(self.angle), "deg"
        yield "spin", self.launch.spin, "rad/s"
        yield "distance error", self.best.distance_error, "m"
        yield "time error", self.best.time_error, "s"
        yield "method", f"{self.method}, {self.iterations} corrections", ""

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
    command, solve (24)-(25) for the new command. `newton` solves for the launch velocity with the
    flight's derivatives.

    Args:
        distance: wished for [m], 1e-9 to 1e9.
        time: wished for [s], 1e-9 to 1e9.
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
    goal = np.array(
        [
            checks.number("distance", distance, at_least=1e-9, at_most=1e9, unit="m"),
            checks.number("time", time, at_least=1e-9, at_most=1e9, unit="s"),
        ]
    )
    accepted = checks.vector(
        "tolerances", TOLERANCES[method] if tolerances is None else tolerances, 2
    )
    if not (accepted > 0).all():
        raise InvalidInput(f"tolerances are {accepted.tolist()}: they must be above 0")
    turning = checks.vector("spin", spin, 3, unit="rad/s")
    if turning[0] or turning[2] or (air is not None and air.wind_at(0.0)[1]):
        raise InvalidInput(
            "spin or wind drives the ball out of the x-z plane: spin must be about y, "
            "wind without y component"
        )
    tol = min(max(float((accepted / goal).min()) / 100, 1e-13), 1e-9)

    def flown(velocity: Array) -> Flight:
        launch = BallState(velocity=(velocity[0], 0.0, velocity[1]), spin=turning)
        return fly(launch, ball, air, tol=tol, time_limit=100 * time)

    return _search(method, goal, accepted, flown)


def nominal(goal: Array) -> Array:
    """Return the launch velocity (x, z) for a (distance, time) in the vacuum, Eqs. (24)-(25)."""
    return np.array([goal[0] / goal[1], GRAVITY * goal[1] / 2])


def _search(method: Method, goal: Array, accepted: Array, flown: Fly) -> LaunchPlan:
    correct = {"newton": _newton, "learned": _learned}[method]
    velocity: Array | None = nominal(goal)
    history: list[Round] = []
    closest: tuple[float, Round, Flight] | None = None
    while velocity is not None and len(history) <= MAX_ROUNDS:
        flight = flown(velocity)
        error = goal - _reached(flight)
        vx, vz = velocity.tolist()
        this = Round(math.hypot(vx, vz), math.atan2(vz, vx), float(error[0]), float(error[1]))
        history.append(this)
        landed = flight.status == "landed"
        miss = float(np.abs(error / accepted).max()) if landed else math.inf
        if closest is None or miss < closest[0]:
            closest = miss, this, flight
        if miss <= 1.0 or not landed:
            break
        velocity = correct(velocity, error, flown)
    assert closest is not None
    miss, best, flight = closest
    status: Literal["met", "not met"] = "met" if miss <= 1.0 else "not met"
    return LaunchPlan(status, method, flight, best, tuple(history))


def _reached(flight: Flight) -> Array:
    return np.array([flight.landing.position[0] - flight.launch.position[0], flight.duration])


def _learned(velocity: Array, error: Array, flown: Fly) -> Array | None:
    """Correct the command that Eqs. (24)-(25) turned into this launch by the errors."""
    time = 2 * velocity[1] / GRAVITY
    command = np.array([velocity[0] * time, time]) + error
    return nominal(command) if command[1] > 0 else None


def _newton(velocity: Array, error: Array, flown: Fly) -> Array | None:
    """Take a Newton step, cut short while it leads below the horizontal or misses by more."""
    size = min(1e-5 * float(np.linalg.norm(velocity)), velocity[1] / 2)  # stays a launch upwards
    steps = size * np.eye(2)
    columns = [
        (_reached(flown(velocity + step)) - _reached(flown(velocity - step))) / (2 * size)
        for step in steps
    ]
    derivative = np.column_stack(columns)
    if not np.linalg.cond(derivative) < 1e12:  # nothing done to the launch changes both
        return None
    step = np.linalg.solve(derivative, error)
    goal = _reached(flown(velocity)) + error
    before = float(np.linalg.norm(error / goal))
    for halvings in range(20):
        tried = velocity + step * 0.5**halvings
        if tried[1] > 0:
            after = float(np.linalg.norm((goal - _reached(flown(tried))) / goal))
            if after < before:
                return np.asarray(tried)
    return None
