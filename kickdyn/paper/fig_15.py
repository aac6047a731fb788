"""Figs. 13-15: planning a launch by the simplest reading of the paper's learning loop, and ours."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.paper.assumptions import BALL, DEFAULT, Coefficients, warnings_of
from kickdyn.paper.item import Finding, Item, shape
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.launch import SPEED_LIMIT, Launch, plan_launch

NAME = "Fig. 13-15"
GOALS = ((30.0, 1.5, 3), (50.0, 2.0, 8), (100.0, 3.0, 25))
"""Distance [m], time [s], and the paper's number of rounds, which is the end of the plot's axis."""

DISTANCE_ACCURACY, TIME_ACCURACY = 0.05, 0.005
"""Errors [m], [s] at which the learning loop ends: about a line's width in Fig. 15."""


class Round(NamedTuple):
    """One flight on the way to a launch; errors are target less flight [m], [s]."""

    distance_error: float
    time_error: float
    flight: Flight

    @property
    def is_met(self) -> bool:
        """Whether both errors are small enough to end the learning loop."""
        distance_met = abs(self.distance_error) <= DISTANCE_ACCURACY
        return distance_met and abs(self.time_error) <= TIME_ACCURACY


def learn_launch(
    distance: float,
    time: float,
    ball: Ball,
    air: Air | None,
    *,
    kick: Callable[[Array], Flight] | None = None,
    rounds: int = 200,
) -> tuple[Round, ...]:
    """Return the flights of a learning loop like the paper's (Figs. 13-14).

    The paper prints no update rule. In the simplest reading, the errors of distance [m] and
    time [s] are added to the command, from which Eqs. (24)-(25) give the next launch, until
    both vanish. The loop also ends at a flight that does not land, a launch faster than sound,
    no time, or a number of rounds. `kick` flies a launch velocity; None flies it through the
    air.
    """

    def flown(velocity: Array) -> Flight:
        return fly(BallState(velocity=velocity), ball, air, time_limit=100 * time)

    command, flown_rounds = np.array([distance, time]), list[Round]()
    while len(flown_rounds) <= rounds and command[1] > 0.0:
        velocity = nominal_velocity(np.array([command[0], 0.0, 0.0]), float(command[1]))
        if math.hypot(*velocity) > SPEED_LIMIT:
            break
        path = (kick or flown)(velocity)
        flown_rounds.append(_round(path, distance, time))
        if path.status != "landed" or flown_rounds[-1].is_met:
            break
        command = command + np.array([flown_rounds[-1].distance_error, flown_rounds[-1].time_error])
    return tuple(flown_rounds)


def newton_rounds(launch: Launch) -> tuple[Round, ...]:
    """Return the flights from the velocities of Newton's method, over level ground."""
    goal = launch.goal
    assert goal.time is not None
    states = [BallState(velocity=velocity, spin=launch.spin) for velocity in launch.history]
    paths = [fly(state, launch.ball, launch.air, tol=1e-13) for state in states]
    return tuple(_round(path, goal.distance, goal.time) for path in paths)


def _round(path: Flight, distance: float, time: float) -> Round:
    return Round(distance - float(path.landing.position[0]), time - path.duration, path)


def items() -> list[Item]:
    """Return the rounds of the learning loop and the steps of the planner."""
    result, air = varying(DEFAULT), DEFAULT.air(lift=False)
    source = f"Newton on the flight's derivatives, from Eqs. (24)-(25), {DEFAULT.name}, no lift"
    for distance, time, _ in GOALS:
        launch = plan_launch(Goal(distance, time=time), BALL, air)
        last = newton_rounds(launch)[-1]
        why = (
            "kickdyn's planner (Newton's method) instead of the learning loop: launch at "
            f"{launch.speed:.4f} m/s, {math.degrees(launch.angle):.4f} deg, errors "
            f"{last.distance_error:.0e} m, {last.time_error:.0e} s"
        )
        verdict = Finding.OURS if launch.status == "met" else Finding.NOT_REACHABLE
        name, steps = f"{NAME} {distance:g} m, {time:g} s planner steps", launch.iterations
        notes = warnings_of(last.flight)
        result.append(Item(name, None, steps, "1", verdict, why, source, notes=notes))
    return result


def varying(choice: Coefficients) -> list[Item]:
    """Return the learning loop's rounds with a choice of coefficients; lift takes no part."""
    if choice.lift != DEFAULT.lift:
        return []
    air = choice.air(lift=False)
    histories = [learn_launch(distance, time, BALL, air) for distance, time, _ in GOALS]
    counts = [len(rounds) - 1 for rounds in histories]
    harder, result = counts == sorted(counts), list[Item]()
    source = (
        f"Figs. 13-14 in their simplest reading, command += error, from Eqs. (24)-(25), "
        f"{choice.name}, no lift; the paper prints no update rule"
    )
    for (distance, time, printed), rounds in zip(GOALS, histories, strict=True):
        first, last = rounds[0], rounds[-1]
        why = (
            f"the goal is {'met' if last.is_met else 'not met'} to within {DISTANCE_ACCURACY:g} m "
            f"and {TIME_ACCURACY:g} s, farther goals need {'more' if harder else 'not more'} "
            "rounds; the paper's number of rounds is the end of an axis of its figure; the errors "
            f"of the first flight are {first.distance_error:.2f} m and {first.time_error:.3f} s"
        )
        name = f"{NAME} {distance:g} m, {time:g} s learning loop rounds"
        verdict = shape(last.is_met and harder)
        count, notes = len(rounds) - 1, warnings_of(last.flight)
        result.append(Item(name, printed, count, "1", verdict, why, source, notes=notes))
    return result
