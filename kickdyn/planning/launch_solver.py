r"""Solving for a launch by shooting: Newton's method, and the curves of all launches to a target.

A launch velocity and a time of flight are four unknowns, and a target has three coordinates. The
launches to it form curves, and what a goal names beside the target picks members out of them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.derivatives import INCREMENT, DifferentiableFlight, fly_with_slopes
from kickdyn.planning.goal import Goal, nominal_velocity

INTERVALS = 64
"""Intervals of a flight in each of which it may turn once from up to down, or from down to up."""

UP = np.array([0.0, 0.0, 1.0])
"""Unit vector upwards [world frame]."""

ACCURACY = 1e-11
"""Largest error of a solution, relative to the target's distance, the time or the speed."""

COARSE_TOL = 1e-8
"""Relative tolerance of the flights on the walk along a curve."""

FIRST_TIMES = (1.0, 0.3, 3.0)
"""Times of flight from which the walks start, over the time of the slowest launch in the vacuum."""

LONGEST_NEWTON_STEP = 0.7
"""Longest step of Newton's method, as a fraction of the launch speed and of the time: a longer one
may end at a launch of thousands of metres per second."""

LONGEST_STEP, SHORTEST_STEP = 0.5, 1e-4
"""Largest and smallest step of a walk, as fractions of the launch speed and of the time."""

LEAST_COSINE, SMALL_TURN_COSINE = 0.9, 0.97
"""Cosine of the angle between the tangents at both ends of a step: below the first the step is
halved, above the second the next one is longer."""

MOST_MEMBERS = 150
"""Length of a walk in either direction."""

Condition = Callable[[Array, DifferentiableFlight], tuple[float, Array]]
"""From unknowns and flight to the error of a condition, and its derivatives by the unknowns."""


@dataclass(frozen=True, eq=False)
class ShootingProblem:
    """A ball in the air to be shot from the origin.

    The unknowns are the launch velocity [m/s, world frame], the size of the spin along its axis
    where it is sought [rad/s], and the time of flight [s]; shape `(4,)` or `(5,)`.

    Attributes:
        ball: the ball.
        air: the air; None is the vacuum.
        spin: the spin, shape `(3,)` [rad/s]; with `seeks_spin` its axis, a unit vector.
        seeks_spin: whether the size of the spin is an unknown.
        tol: tolerance of the integration, relative to the flight's length and speed.
    """

    ball: Ball
    air: Air | None
    spin: Array
    seeks_spin: bool = False
    tol: float = 1e-12

    def sizes(self, unknowns: Array) -> Array:
        """Return scales of the unknowns."""
        time = float(unknowns[-1])
        speed = max(math.hypot(*unknowns[:3]), 0.1 * GRAVITY * time)
        spin = [0.1 * speed / self.ball.radius] if self.seeks_spin else []
        return np.array([speed, speed, speed, *spin, time])

    def spin_of(self, size: float) -> Array:
        """Return the spin, shape `(3,)` [rad/s]."""
        return self.spin * size if self.seeks_spin else self.spin

    def shoot(self, launch: Array, time: float) -> DifferentiableFlight | None:
        """Fly for a time [s]; None where that fails.

        The launch is the unknowns without the time; the derivatives are by these.
        """
        increments = INCREMENT * self.sizes(np.append(launch, time))[:-1]

        def start(values: Array) -> tuple[BallState, Air | None]:
            spin = np.array(self.spin_of(float(values[-1])))
            return BallState.computed(np.zeros(3), values[:3].copy(), spin), self.air

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
    """Return when the displacement along a direction rises through a distance [s].

    It is sought from `begin` [s] on; None where it does not so between there and the end.
    """

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
    """Return the time at which a value rises through zero [s]; None where it does not."""
    if not value(begin) < 0.0 <= value(end):
        return None
    return float(brentq(value, begin, end, xtol=1e-15 * end))


@dataclass(frozen=True, eq=False)
class LaunchSolution:
    """The launch at which Newton's method arrived.

    Attributes:
        unknowns: as of `ShootingProblem`.
        errors: of the target (3 components), of the condition beside it, and of `beside`.
        history: launch velocities, the first guess first, shape `(k, 3)` [m/s].
        trajectory: the flight with its derivatives by launch velocity and spin size.
    """

    unknowns: Array
    errors: Array
    history: Array
    trajectory: DifferentiableFlight

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
    condition: Condition | None = None,
    accuracy: float = ACCURACY,
    steps: int = 40,
) -> LaunchSolution | None:
    r"""Solve for a launch by Newton's method from a first guess; None where it fails.

    The launch :math:`(v, s)` and the time :math:`t` solve :math:`x(t; v, s) = x_{target}` together
    with a condition. Each step integrates one flight with its derivatives, and is halved while it
    does not reduce the errors. Without a `condition`, it is the goal's; `accuracy` is the largest
    relative error.
    """
    length = float(np.linalg.norm(goal.target))
    size = {"time": goal.time, "speed": goal.speed}.get(goal.kind) or length
    x = np.array(start, dtype=float)
    scale = np.array([length] * 3 + [1.0 if condition else size] + [length] * (len(x) - 4))
    residual = partial(_residual, problem, goal, condition or partial(goal_condition, goal))
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
            moved = np.append(step_in_root(x[:3], shorter[:3]), x[3:] + shorter[3:])
            if moved[-1] <= 0.0:
                continue
            evaluation = residual(moved)
            if float(np.linalg.norm(evaluation[0] / scale)) < norm:  # not where it is nan
                x, (errors, slopes, flight) = moved, evaluation
                break
        else:
            break
        history.append(x[:3])
    if flight is None or not np.abs(errors / scale).max() <= accuracy:
        return None
    return LaunchSolution(x, errors, np.array(history), flight)


def step_in_root(velocity: Array, step: Array) -> Array:
    r"""Return a velocity after a Newton step that is taken in :math:`v / \sqrt{|v|}`.

    Drag makes the flight a curved function of the launch speed, and less so of its root: a goal of
    50 m in 2 s takes 3 steps in place of 4. Shapes are `(n,)`.
    """
    speed = float(np.linalg.norm(velocity))
    direction = velocity / speed
    root = velocity + step - 0.5 * direction * (direction @ step)  # times sqrt(speed)
    return np.asarray(root * float(np.linalg.norm(root)) / speed)


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
    kept: list[LaunchSolution] = []
    for solution in solutions:
        sizes = problem.sizes(solution.unknowns)
        if all(np.abs((solution.unknowns - k.unknowns) / sizes).max() > 1e-6 for k in kept):
            kept.append(solution)
    return sorted(kept, key=lambda solution: solution.time)


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
    problem: ShootingProblem, goal: Goal, condition: Condition, x: Array
) -> tuple[Array, Array, DifferentiableFlight | None]:
    """Return errors, their derivatives by the unknowns, and the flight; nan where there is none."""
    n = len(x)
    flight = problem.shoot(x[:-1], float(x[-1]))
    if flight is None:
        return np.full(n, math.nan), np.full((n, n), math.nan), None
    errors, slopes = target_equations(goal, x, flight)
    error, row = condition(x, flight)
    return np.insert(errors, 3, error), np.insert(slopes, 3, row, axis=0), flight


class LaunchFamily:
    r"""The launches to a goal's target, and `beside`, within limits of speed and spin [m/s, rad/s].

    They are curves in the space of the unknowns :math:`y`. A walk along one of them steps in the
    direction :math:`\tau` of its tangent, and Newton's method returns to it across that direction,
    :math:`\tau \cdot (y - y_0) = 0` (pseudo-arclength continuation: Keller 1977), so that a curve
    may turn back in time, speed or spin. Walks start from the launches that Newton's method finds
    from a few answers of the vacuum, the time of flight being free: a curve to which none of these
    leads is not found.
    """

    def __init__(
        self, problem: ShootingProblem, goal: Goal, speed_limit: float, spin_limit: float
    ) -> None:
        self.problem, self.goal = problem, goal
        self.speed_limit, self.spin_limit = speed_limit, spin_limit
        self._coarse = replace(problem, tol=COARSE_TOL)

    def curves(self, known: list[LaunchSolution]) -> list[list[LaunchSolution]]:
        """Return members in order along each curve, and those where the condition turns."""
        curves = list[list[LaunchSolution]]()
        for start in sorted([*known, *self._first_members()], key=lambda member: member.speed):
            is_beyond = bool(curves) and not self.is_inside(start)
            if is_beyond or any(self._is_between(pair, start) for pair in _pairs(curves)):
                continue
            ahead = self._walk(start, 1.0)
            is_closed = bool(ahead) and ahead[-1] is start
            back = [] if is_closed else self._walk(start, -1.0)
            curve = [*reversed(back), start, *ahead]
            limit = self._with_condition(speed=self.speed_limit)
            for between in (
                partial(self._turning_point, limit),
                partial(self._solution, limit),
                partial(self._turning_point, self.goal),
            ):
                curve = _with_members_between(curve, between)
            curves.append(curve)
        return curves

    def solutions(
        self, known: list[LaunchSolution], curves: list[list[LaunchSolution]]
    ) -> list[LaunchSolution]:
        """Return the goal's solutions within the limits by time: those known, and on curves."""
        solutions = [*known, *(self._solution(self.goal, *pair) for pair in _pairs(curves))]
        inside = [member for member in solutions if member is not None and self.is_inside(member)]
        return distinct(inside, self.problem)

    def is_inside(self, member: LaunchSolution) -> bool:
        """Return whether a member is within the limits, but for rounding."""
        is_slow = member.speed <= self.speed_limit * (1 + 1e-9)
        return is_slow and abs(member.spin_size) <= self.spin_limit

    def above_ground(self, curves: list[list[LaunchSolution]]) -> list[LaunchSolution]:
        """Return members within the limits that are clear of the ground, and the last such."""
        members = []
        for pair in _pairs(curves):
            inside = [member for member in pair if self.is_inside(member)]
            clear = [member for member in inside if member.is_above_ground]
            buried = [member for member in inside if member not in clear]
            members += clear
            if clear and buried:
                members.append(self._last_clear(clear[0], buried[0]))
        return members

    def refine(self, member: LaunchSolution) -> LaunchSolution:
        """Return a member as exactly as `solve_launch` computes it."""
        goal = self._with_condition(time=member.time)
        return solve_launch(self.problem, goal, member.unknowns) or member

    def _with_condition(self, **condition: Any) -> Goal:
        return Goal(self.goal.target, **condition, beside=self.goal.beside)

    def _first_members(self) -> list[LaunchSolution]:
        target = self.goal.target
        slowest = math.sqrt(2 * float(np.linalg.norm(target)) / GRAVITY)
        spin = [] if self.goal.beside is None else [0.0]
        members = []
        for time in (slowest * fraction for fraction in FIRST_TIMES):
            start = np.array([*nominal_velocity(target, time), *spin, time])
            members.append(self._member_near(start, np.zeros_like(start), steps=20))
        return [member for member in members if member is not None]

    def _tangent(self, member: LaunchSolution) -> Array:
        """Return the direction of the curve, in `sizes` of the unknowns, as a unit vector."""
        _, slopes = target_equations(self.goal, member.unknowns, member.trajectory)
        return np.asarray(np.linalg.svd(slopes * self._coarse.sizes(member.unknowns))[2][-1])

    def _member_near(self, x: Array, normal: Array, steps: int = 6) -> LaunchSolution | None:
        """Return the member where the curve crosses a plane through unknowns; None without one.

        With a normal of zeros, each step of Newton's method is the least to the curve.
        """
        if x[-1] <= 0.0:
            return None
        return solve_launch(
            self._coarse,
            self.goal,
            x,
            condition=lambda y, _: (float(normal @ (y - x)), normal),
            accuracy=100 * COARSE_TOL,
            steps=steps,
        )

    def _between(
        self, a: LaunchSolution, b: LaunchSolution, fraction: float
    ) -> LaunchSolution | None:
        x, chord = a.unknowns, b.unknowns - a.unknowns
        return self._member_near(x + fraction * chord, chord / self._coarse.sizes(x) ** 2)

    def _root(
        self, value: Callable[[LaunchSolution], float], a: LaunchSolution, b: LaunchSolution
    ) -> LaunchSolution | None:
        """Return the member between two at which a function of members is 0; None without one."""
        if not value(a) * value(b) <= 0.0:
            return None

        def member(fraction: float) -> LaunchSolution | None:
            return {0.0: a, 1.0: b}.get(fraction) or self._between(a, b, fraction)

        def value_at(fraction: float) -> float:
            between = member(fraction)
            return math.nan if between is None else value(between)

        try:
            return member(float(brentq(value_at, 0.0, 1.0, xtol=1e-6)))
        except ValueError:  # of nan: the curve leaves its chord
            return None

    def _is_between(
        self, pair: tuple[LaunchSolution, LaunchSolution], member: LaunchSolution
    ) -> bool:
        """Return whether a member lies on the curve between two neighbours."""
        origin = pair[0].unknowns
        sizes = self._coarse.sizes(origin)
        chord, offset = (pair[1].unknowns - origin) / sizes, (member.unknowns - origin) / sizes
        length = float(np.linalg.norm(chord))
        along = float(offset @ chord) / max(length, 1e-300)
        aside = math.sqrt(max(float(offset @ offset) - along * along, 0.0))
        return -1e-6 * length <= along <= (1 + 1e-6) * length and aside <= 0.3 * length

    def _walk(self, start: LaunchSolution, sign: float) -> list[LaunchSolution]:
        """Return members from one in a direction along its curve, to beyond a limit or round."""
        members, member, step = list[LaunchSolution](), start, 0.5 * LONGEST_STEP
        tangent = sign * self._tangent(start)
        while len(members) < MOST_MEMBERS and step > SHORTEST_STEP:
            sizes = self._coarse.sizes(member.unknowns)
            predicted = member.unknowns + step * sizes * tangent
            following = self._member_near(predicted, tangent / sizes)
            if following is None:
                step *= 0.5
                continue
            next_tangent = self._tangent(following)
            cosine = float(next_tangent @ tangent)
            next_tangent *= math.copysign(1.0, cosine)
            if abs(cosine) < LEAST_COSINE:
                step *= 0.5
                continue
            if len(members) > 2 and self._is_between((member, following), start):
                return [*members, start]
            members.append(following)
            is_too_fast = following.speed > max(self.speed_limit, member.speed)
            most_spin = max(self.spin_limit, abs(member.spin_size))
            if is_too_fast or abs(following.spin_size) > most_spin:
                break
            member, tangent = following, next_tangent
            step = min(1.5 * step, LONGEST_STEP) if abs(cosine) > SMALL_TURN_COSINE else step
        return members

    def _turning_point(
        self, goal: Goal, a: LaunchSolution, b: LaunchSolution
    ) -> LaunchSolution | None:
        """Return the member between two to which a condition's error falls, and then rises."""
        chord = b.unknowns - a.unknowns

        def rate(member: LaunchSolution) -> float:
            sizes, (_, slopes) = self._coarse.sizes(member.unknowns), member.condition(goal)
            tangent = self._tangent(member)
            sign = math.copysign(1.0, float(tangent @ (chord / sizes)))
            return float(slopes @ (sizes * tangent)) * sign

        falls, rises = (member.condition(goal)[0] * rate(member) for member in (a, b))
        return self._root(rate, a, b) if falls < 0.0 < rises else None

    def _solution(self, goal: Goal, a: LaunchSolution, b: LaunchSolution) -> LaunchSolution | None:
        """Return the solution for a goal between two members whose errors differ in sign."""
        start = self._root(lambda member: member.condition(goal)[0], a, b)
        return start and solve_launch(self.problem, goal, start.unknowns, steps=12)

    def _last_clear(self, clear: LaunchSolution, buried: LaunchSolution) -> LaunchSolution:
        """Return the last member that is clear of the ground, by bisection."""
        for _ in range(24):
            middle = self._between(clear, buried, 0.5)
            if middle is None:
                break
            member = self.refine(middle)
            if member.is_above_ground:
                clear = member
            else:
                buried = member
        return clear


def _pairs(curves: list[list[LaunchSolution]]) -> list[tuple[LaunchSolution, LaunchSolution]]:
    return [pair for curve in curves for pair in pairwise(curve)]


def _with_members_between(
    curve: list[LaunchSolution],
    between: Callable[[LaunchSolution, LaunchSolution], LaunchSolution | None],
) -> list[LaunchSolution]:
    """Return a curve with the members that a function finds between neighbours."""
    extended = curve[:1]
    for a, b in pairwise(curve):
        member = between(a, b)
        extended += [b] if member is None else [member, b]
    return extended
