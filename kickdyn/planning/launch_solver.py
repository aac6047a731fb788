r"""Solving for a launch by shooting: Newton's method, and the branches of all launches to a target.

A launch velocity and a time of flight are four unknowns, and a target has three coordinates. The
launches to it form curves, and what a goal names beside the target selects members of them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.derivatives import INCREMENT, DifferentiableFlight, fly_with_slopes
from kickdyn.planning.goal import Goal

INTERVALS = 64
"""Intervals of a flight in each of which it may turn once from up to down, or from down to up."""

UP = np.array([0.0, 0.0, 1.0])
"""Unit vector upwards [world frame]."""

ACCURACY = 1e-11
"""Largest error of a solution, relative to the target's distance, the time or the speed."""

ACROSS_SHARE = 1e-9
"""Share of a spin along the impulse up to which the spin is across it."""

NEAR_SOLUTION = 1e-4
"""Error, relative as `ACCURACY`, from which one step with exact derivatives leads to a solution."""

LONGEST_NEWTON_STEP = 0.7
"""Longest step of Newton's method, as a fraction of the launch speed and of the time: a longer one
may end at a launch of thousands of metres per second."""


@dataclass(frozen=True, eq=False)
class ShootingProblem:
    """A ball in the air to be shot from the origin.

    The unknowns are the launch velocity [m/s, world frame], the size of the spin along its axis
    where it is sought [rad/s], and the time of flight [s]; shape `(4,)` or `(5,)`.
    """

    ball: Ball  # the ball
    air: Air | None  # the air; None is the vacuum
    spin: Array  # the spin, shape `(3,)` [rad/s]; with `seeks_spin` its axis, a unit vector
    seeks_spin: bool = False  # whether the size of the spin is an unknown
    # the ball before it is struck, which keeps its spin along the impulse; None if the spin is as
    # given
    struck: BallState | None = None
    tol: float = 1e-12  # tolerance of the integration, relative to the flight's length and speed

    def sizes(self, unknowns: Array) -> Array:
        """Return scales of the unknowns."""
        time = float(unknowns[-1])
        speed = max(math.hypot(*unknowns[:3]), 0.1 * GRAVITY * time)
        spin = [0.1 * speed / self.ball.radius] if self.seeks_spin else []
        return np.array([speed, speed, speed, *spin, time])

    def spin_of(self, launch: Array) -> Array:
        """Return the spin of the unknowns without the time, shape `(3,)` [rad/s].

        A spin across the impulse keeps nothing along it but rounding, which is left out: some
        models of lift have an infinite slope at 0.
        """
        spin = self.spin * launch[-1] if self.seeks_spin else self.spin
        if self.struck is None:
            return np.array(spin)
        change = launch[:3] - self.struck.velocity
        along = change / (float(np.linalg.norm(change)) or 1.0)
        axial = float((self.struck.spin - spin) @ along)
        if abs(axial) < ACROSS_SHARE * float(np.linalg.norm(self.struck.spin)):
            axial = 0.0
        return np.asarray(spin + axial * along)

    def shoot(self, launch: Array, time: float, slopes: bool = True) -> DifferentiableFlight | None:
        """Fly the unknowns without the time for a time [s]; None if that fails."""
        increments = INCREMENT * self.sizes(np.append(launch, time))[:-1]
        if not slopes:
            increments = increments[:0]

        def start(values: Array) -> tuple[BallState, Air | None]:
            velocity, spin = values[:3].copy(), self.spin_of(values)
            return BallState.computed(np.zeros(3), velocity, spin), self.air

        try:
            return fly_with_slopes(start, launch, increments, self.ball, time, self.tol)
        except KickdynError:
            return None


def apex(flight: DifferentiableFlight) -> tuple[float, Array]:
    """Return the greatest height of a flight [m, from the launch], and its derivatives."""
    time = _extreme_time(flight, 1.0)
    return float(flight.position(time)[2]), flight.slopes(time)[2]


def lowest(flight: DifferentiableFlight) -> float:
    """Return the least height of a flight, ends included [m, from the launch]."""
    return float(flight.position(_extreme_time(flight, -1.0))[2])


def crossing(
    flight: DifferentiableFlight, ahead: Array, distance: float, along: Array
) -> tuple[float, Array]:
    """Return the position along a unit vector at a distance ahead [m], and its derivatives.

    They are nan where the flight does not come so far.
    """
    time = crossing_time(flight, ahead, distance)
    if time is None:
        return math.nan, np.full(len(flight.increments), math.nan)
    slopes, _ = flight.slopes_at_plane(ahead, time)
    return float(along @ flight.position(time)), along @ slopes


def crossing_time(
    flight: DifferentiableFlight, direction: Array, distance: float, begin: float = 0.0
) -> float | None:
    """Return when, from `begin` on, a displacement rises through a distance [s]; None if never."""

    def beyond(time: float) -> float:
        return float(direction @ flight.position(time)) - distance

    return _root(beyond, begin, flight.end)


def _extreme_time(flight: DifferentiableFlight, sign: float) -> float:
    """Return when the height times a sign is greatest [s]: at an end or where it turns."""
    times = np.linspace(0.0, flight.end, INTERVALS + 1)
    sinking = -sign * flight.states(times)[:, 5]
    candidates = [0.0, flight.end]
    for k in np.flatnonzero((sinking[:-1] < 0.0) & (sinking[1:] >= 0.0)):
        turn = _root(lambda time: -sign * float(flight.velocity(time)[2]), times[k], times[k + 1])
        candidates += [] if turn is None else [turn]
    return max(candidates, key=lambda time: sign * float(flight.position(time)[2]))


def _root(value: Callable[[float], float], begin: float, end: float) -> float | None:
    """Return the time at which a value rises through zero [s]; None if it does not."""
    if not value(begin) < 0.0 <= value(end):
        return None
    return float(brentq(value, begin, end, xtol=1e-15 * end))


@dataclass(frozen=True, eq=False)
class LaunchSolution:
    """The launch at which Newton's method arrived."""

    unknowns: Array  # those of the `ShootingProblem`
    errors: Array  # of the target (3 components), of the condition beside it, and of `beside`
    history: Array  # launch velocities, the first guess first, shape `(k, 3)` [m/s]
    # the flight with its derivatives by launch velocity and spin size
    trajectory: DifferentiableFlight
    slopes: Array  # derivatives of the errors by the unknowns, a square matrix

    @property
    def velocity(self) -> Array:
        """Launch velocity, shape `(3,)` [m/s, world frame]."""
        return self.unknowns[:3]

    @property
    def spin_size(self) -> float:
        """Size of the spin along its axis, where that is unknown, else 0 [rad/s]."""
        return float(self.unknowns[3]) if len(self.unknowns) == 5 else 0.0

    @property
    def time(self) -> float:
        """Time of flight [s]."""
        return float(self.unknowns[-1])

    @property
    def speed(self) -> float:
        """Launch speed [m/s]."""
        return math.hypot(*self.velocity)

    def condition(self, goal: Goal) -> tuple[float, Array]:
        """Return the error of the condition beside the target, and its slopes by the unknowns."""
        return goal_condition(goal, self.unknowns, self.trajectory)

    @property
    def is_above_ground(self) -> bool:
        """Return whether the flight stays above the ground, level with its lower end."""
        end = float(self.trajectory.position(self.time)[2])
        return lowest(self.trajectory) >= min(0.0, end)


def solve_launch(
    problem: ShootingProblem,
    goal: Goal,
    start: Array,
    *,
    accuracy: float = ACCURACY,
    steps: int = 40,
    last_slopes: bool = True,
) -> LaunchSolution | None:
    r"""Solve for a launch by Newton's method from a first guess; None if it fails.

    The launch :math:`(v, s)` and the time :math:`t` solve :math:`x(t; v, s) = x_{target}` together
    with the goal's condition, to a relative error of `accuracy`. Each step integrates one flight
    with its derivatives, and is halved while it does not reduce the errors.

    Without `last_slopes`, which goals of a time or a speed allow, a step from near the solution
    integrates a flight without derivatives: the solution keeps the `slopes` of the step before,
    and its trajectory has none.
    """
    length = float(np.linalg.norm(goal.target))
    size = {"time": goal.time, "speed": goal.speed}.get(goal.kind) or length
    x = np.array(start, dtype=float)
    scale = np.array([length] * 3 + [size] + [length] * (len(x) - 4))
    residual = partial(_residual, problem, goal)
    errors, slopes, flight = residual(x)
    history = [x[:3]]
    while not np.abs(errors / scale).max() <= accuracy and len(history) <= steps:
        if not (np.isfinite(errors).all() and np.isfinite(slopes).all()):
            break
        sizes = problem.sizes(x)
        step = np.linalg.lstsq(slopes / scale[:, None] * sizes, -errors / scale, rcond=1e-14)[0]
        step *= sizes / max(1.0, float(np.linalg.norm(step)) / LONGEST_NEWTON_STEP)
        norm = float(np.linalg.norm(errors / scale))
        for halvings in range(12):
            shorter = np.asarray(step * 0.5**halvings)
            # The step is taken in v / sqrt(|v|): drag makes the flight a curved function of the
            # launch speed, and less so of its root.
            speed = float(np.linalg.norm(x[:3]))
            along = x[:3] / speed
            root = x[:3] + shorter[:3] - 0.5 * along * (along @ shorter[:3])  # times sqrt(speed)
            velocity = root * float(np.linalg.norm(root)) / speed
            trial = np.append(velocity, x[3:] + shorter[3:])
            if trial[-1] <= 0.0:
                continue
            known_slopes = slopes if norm < NEAR_SOLUTION and not last_slopes else None
            evaluation = residual(trial, known_slopes)
            if float(np.linalg.norm(evaluation[0] / scale)) < norm:  # not where it is nan
                x, (errors, slopes, flight) = trial, evaluation
                break
        else:
            break
        history.append(x[:3])
    if flight is None or not np.abs(errors / scale).max() <= accuracy:
        return None
    return LaunchSolution(x, errors, np.array(history), flight, slopes)


def goal_condition(goal: Goal, x: Array, flight: DifferentiableFlight) -> tuple[float, Array]:
    """Return the error of a goal's condition, and its derivatives by the unknowns."""
    slopes = np.zeros(len(x))
    if goal.time is not None:
        slopes[-1] = 1.0
        return flight.end - goal.time, slopes
    if goal.speed is not None:
        speed = math.hypot(*x[:3])
        slopes[:3] = x[:3] / speed
        return speed - goal.speed, slopes
    if goal.over is not None:
        distance, wanted = goal.over
        height, slopes[:-1] = crossing(flight, goal.ahead, distance, UP)
    else:
        assert goal.apex is not None
        wanted = goal.apex
        height, slopes[:-1] = apex(flight)
    return height - wanted, slopes


def distinct(solutions: list[LaunchSolution], problem: ShootingProblem) -> list[LaunchSolution]:
    """Return solutions by time of flight, without repetitions of the same one."""
    unique: list[LaunchSolution] = []
    for solution in solutions:
        sizes = problem.sizes(solution.unknowns)
        if all(np.abs((solution.unknowns - k.unknowns) / sizes).max() > 1e-6 for k in unique):
            unique.append(solution)
    return sorted(unique, key=lambda solution: solution.time)


def target_equations(goal: Goal, x: Array, flight: DifferentiableFlight) -> tuple[Array, Array]:
    """Return the errors of target and `beside`, and their derivatives, one row for each."""
    rows = len(x) - 1
    errors, slopes = np.zeros(rows), np.zeros((rows, len(x)))
    errors[:3] = flight.position(flight.end) - goal.target
    slopes[:3, :-1] = flight.slopes(flight.end)
    slopes[:3, -1] = flight.velocity(flight.end)
    if goal.beside is not None:
        distance, sideways = goal.beside
        passed, slopes[3, :-1] = crossing(flight, goal.ahead, distance, goal.left)
        errors[3] = passed - sideways
    return errors, slopes


def _residual(
    problem: ShootingProblem, goal: Goal, x: Array, slopes: Array | None = None
) -> tuple[Array, Array, DifferentiableFlight | None]:
    """Return errors, their derivatives by the unknowns, and the flight; nan where there is none.

    With known `slopes`, these are returned, and the flight has no derivatives.
    """
    n = len(x)
    flight = problem.shoot(x[:-1], float(x[-1]), slopes is None)
    if flight is None:
        return np.full(n, math.nan), np.full((n, n), math.nan), None
    if slopes is not None:
        missed = flight.position(flight.end) - goal.target
        return np.append(missed, goal_condition(goal, x, flight)[0]), slopes, flight
    errors, slopes = target_equations(goal, x, flight)
    error, row = goal_condition(goal, x, flight)
    return np.insert(errors, 3, error), np.insert(slopes, 3, row, axis=0), flight
