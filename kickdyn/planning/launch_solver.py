r"""Solving for a launch: Newton's method, and the curve of all launches to a target.

A launch velocity and a time of flight are four unknowns, and a target has three coordinates. The
launches to it form curves, and what a goal names beside the target picks members out of them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, starmap
from typing import Any

import numpy as np
from scipy.optimize import brentq

from kickdyn.core.gravity import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.flight.derivatives import DifferentiableFlight
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.shooting import UP, ShootingProblem, apex, crossing, lowest

ACCURACY = 1e-11
"""Largest error of a solution, relative to the target's distance, the time or the speed."""

COARSE = 1e-8
"""Relative tolerance of the flights on the walk along a curve."""

SEEDS = (1.0, 0.3, 3.0)
"""Times of flight from which the walks start, over that of the slowest launch in the vacuum."""

FARTHEST_STEP = 0.7
"""Longest step of Newton's method, in parts of the launch speed and of the time: farther off, it
may end at a launch of thousands of metres per second."""

STEP = 0.5
"""Largest step of a walk, in parts of the launch speed and of the time."""

MOST_MEMBERS = 150
"""Length of a walk in either direction."""

Condition = Callable[[Array, DifferentiableFlight], tuple[float, Array]]
"""From unknowns and flight to the error of a condition, and its derivatives by the unknowns."""


@dataclass(frozen=True, eq=False)
class LaunchSolution:
    """The launch that Newton's method arrived at.

    Attributes:
        unknowns: launch velocity [m/s, world frame], time of flight [s] and, for `beside`, the size
            of the spin along its axis [rad/s]; shape `(4,)` or `(5,)`.
        errors: of the target (3 components), of the condition beside it, and of `beside`.
        history: launch velocities, the first guess first, shape `(k, 3)` [m/s].
        trajectory: the flight from there.
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
    def time(self) -> float:
        """Time of flight [s]."""
        return float(self.unknowns[3])

    @property
    def spin_size(self) -> float:
        """Size of the spin along its axis, where that is unknown, else 0 [rad/s]."""
        return float(self.unknowns[4]) if len(self.unknowns) == 5 else 0.0

    @property
    def speed(self) -> float:
        """Launch speed [m/s]."""
        return math.hypot(*self.velocity)

    def condition(self, goal: Goal) -> tuple[float, Array]:
        """Return the error of the condition beside the target, and its slopes by the unknowns."""
        return goal_condition(goal, self.unknowns, self.trajectory)

    def is_above_ground(self, goal: Goal) -> bool:
        """Return whether the flight stays above the ground, level with its lower end.

        A ball that lies on the ground does not start downwards.
        """
        if goal.lowest == 0.0 and self.velocity[2] < 0.0:
            return False
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

    The unknowns are launch velocity :math:`v`, time :math:`t` and, for `beside`, the spin's size
    :math:`s`. They solve :math:`x(t; v, s) = x_{target}` together with a condition. Each step
    integrates one flight with its derivatives, and is halved while it does not reduce the errors.
    Without a `condition`, it is the goal's; `accuracy` is the largest relative error.
    """
    length = float(np.linalg.norm(goal.target))
    last = {"time": goal.time, "speed": goal.speed}.get(goal.kind) or length
    x = np.array(start, dtype=float)
    scale = np.array([length] * 3 + [1.0 if condition else last] + [length] * (len(x) - 4))
    residual = partial(_residual, problem, goal, condition or partial(goal_condition, goal))
    errors, slope, trajectory = residual(x)
    history = [x[:3]]
    while not np.abs(errors / scale).max() <= accuracy and len(history) <= steps:
        if not (np.isfinite(errors).all() and np.isfinite(slope).all()):
            break
        sizes = problem.sizes(x)
        matrix = slope / scale[:, None] * sizes
        step = np.linalg.lstsq(matrix, -errors / scale, rcond=1e-14)[0]
        step *= sizes / max(1.0, float(np.linalg.norm(step)) / FARTHEST_STEP)
        before = float(np.linalg.norm(errors / scale))
        for halving in range(12):
            cut = np.asarray(step * 0.5**halving)
            moved = np.append(step_in_root(x[:3], cut[:3]), x[3:] + cut[3:])
            if moved[3] <= 0.0:
                continue
            found = residual(moved)
            if float(np.linalg.norm(found[0] / scale)) < before:  # not where it is nan
                x, (errors, slope, trajectory) = moved, found
                break
        else:
            break
        history.append(x[:3])
    if trajectory is None or not np.abs(errors / scale).max() <= accuracy:
        return None
    return LaunchSolution(x, errors, np.array(history), trajectory)


def step_in_root(velocity: Array, step: Array) -> Array:
    r"""Return a velocity after a Newton step that is taken in :math:`v / \sqrt{|v|}`.

    Drag bends what a launch does as its speed grows, and less so in the root of the speed: a goal
    of 50 m in 2 s takes 3 steps in place of 4. Shapes are `(n,)`.
    """
    speed = float(np.linalg.norm(velocity))
    direction = velocity / speed
    root = velocity + step - 0.5 * direction * (direction @ step)  # times sqrt(speed)
    return np.asarray(root * float(np.linalg.norm(root)) / speed)


def goal_condition(goal: Goal, x: Array, flown: DifferentiableFlight) -> tuple[float, Array]:
    """Return the error of a goal's condition, and its derivatives by the unknowns."""
    slope, launch = np.zeros(len(x)), [0, 1, 2, *range(4, len(x))]
    if goal.time is not None:
        slope[3] = 1.0
        return flown.end - goal.time, slope
    if goal.speed is not None:
        speed = math.hypot(*x[:3])
        slope[:3] = x[:3] / speed
        return speed - goal.speed, slope
    if goal.over is not None:
        wished = goal.over[1]
        value, by = crossing(flown, goal.ahead, goal.over[0], UP)
    else:
        assert goal.apex is not None
        wished = goal.apex
        value, by = apex(flown)
    slope[launch] = by
    return value - wished, slope


def distinct(solutions: list[LaunchSolution], problem: ShootingProblem) -> list[LaunchSolution]:
    """Return solutions by time of flight, each once: the first of those that are the same."""
    apart: list[LaunchSolution] = []
    for one in solutions:
        sizes = problem.sizes(one.unknowns)
        if all(np.abs((one.unknowns - it.unknowns) / sizes).max() > 1e-6 for it in apart):
            apart.append(one)
    return sorted(apart, key=lambda one: one.time)


def target_equations(goal: Goal, x: Array, flown: DifferentiableFlight) -> tuple[Array, Array]:
    """Return the errors of target and `beside`, and their derivatives, one row for each."""
    launch, rows = [0, 1, 2, *range(4, len(x))], len(x) - 1
    errors, slope = np.zeros(rows), np.zeros((rows, len(x)))
    end = flown.end
    errors[:3], slope[:3, 3] = flown.position(end) - goal.target, flown.velocity(end)
    slope[:3, launch] = flown.slopes(end)
    if goal.beside is not None:
        distance, sideways = goal.beside
        passed, slope[3, launch] = crossing(flown, goal.ahead, distance, goal.left)
        errors[3] = passed - sideways
    return errors, slope


def _residual(
    problem: ShootingProblem, goal: Goal, condition: Condition, x: Array
) -> tuple[Array, Array, DifferentiableFlight | None]:
    """Return errors, their derivatives by the unknowns, and the flight; nan where there is none."""
    n = len(x)
    flown = problem.shoot(x[:3], float(x[3]), float(x[4]) if n == 5 else 0.0)
    if flown is None:
        return np.full(n, math.nan), np.full((n, n), math.nan), None
    errors, slope = target_equations(goal, x, flown)
    error, row = condition(x, flown)
    return np.insert(errors, 3, error), np.insert(slope, 3, row, axis=0), flown


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
        self._coarse = problem.with_tolerance(COARSE)

    def curves(self, known: list[LaunchSolution]) -> list[list[LaunchSolution]]:
        """Return members in order along each curve, and those where the condition turns.

        The walks start from known members, too.
        """
        found = list[list[LaunchSolution]]()
        for seed in sorted([*known, *self._seeds()], key=lambda one: one.speed):
            beyond = bool(found) and not self.is_inside(seed)
            if beyond or any(
                self._is_between(pair, seed) for curve in found for pair in pairwise(curve)
            ):
                continue
            ahead = self._walk(seed, 1.0)
            closed = bool(ahead) and ahead[-1] is seed
            curve = [*reversed([] if closed else self._walk(seed, -1.0)), seed, *ahead]
            limit = self._goal(speed=self.speed_limit)
            for between in (
                partial(self._turn, limit),
                partial(self._solution, limit),
                partial(self._turn, self.goal),
            ):
                both = zip([None, *starmap(between, pairwise(curve))], curve, strict=True)
                curve = [one for pair in both for one in pair if one is not None]
            found.append(curve)
        return found

    def solutions(
        self, known: list[LaunchSolution], curves: list[list[LaunchSolution]]
    ) -> list[LaunchSolution]:
        """Return the goal's solutions within the limits by time: those known, and on curves."""
        pairs = [pair for curve in curves for pair in pairwise(curve)]
        found = [*known, *starmap(partial(self._solution, self.goal), pairs)]
        inside = [one for one in found if one is not None and self.is_inside(one)]
        return distinct(inside, self.problem)

    def is_inside(self, member: LaunchSolution) -> bool:
        """Return whether a member is within the limits, but for rounding."""
        slow = member.speed <= self.speed_limit * (1 + 1e-9)
        return slow and abs(member.spin_size) <= self.spin_limit

    def above_ground(self, curves: list[list[LaunchSolution]]) -> list[LaunchSolution]:
        """Return members within the limits that are clear of the ground, and the last such."""
        found = []
        for pair in (pair for curve in curves for pair in pairwise(curve)):
            inside = [member for member in pair if self.is_inside(member)]
            clear = [member for member in inside if member.is_above_ground(self.goal)]
            found += clear
            if len(inside) == 2 and len(clear) == 1:
                found.append(self._last_clear(*(pair if clear[0] is pair[0] else pair[::-1])))
        return found

    def refine(self, member: LaunchSolution) -> LaunchSolution:
        """Return a member as exactly as `solve_launch` computes it."""
        goal = self._goal(time=member.time)
        return solve_launch(self.problem, goal, member.unknowns) or member

    def _goal(self, **condition: Any) -> Goal:
        """Return the same target and `beside` with another condition."""
        return Goal(self.goal.target, **condition, beside=self.goal.beside)

    def _seeds(self) -> list[LaunchSolution]:
        """Return members near the vacuum's answers for the times `SEEDS`."""
        target, found = self.goal.target, list[LaunchSolution | None]()
        about = math.sqrt(2 * float(np.linalg.norm(target)) / GRAVITY)
        for time in (about * part for part in SEEDS):
            spin = [] if self.goal.beside is None else [0.0]
            start = np.array([*nominal_velocity(target, time), time, *spin])
            found.append(self._member_near(start, np.zeros_like(start), steps=20))
        return [one for one in found if one is not None]

    def _tangent(self, member: LaunchSolution) -> Array:
        """Return the direction of the curve, in `sizes` of the unknowns, as a unit vector."""
        problem, x = self._coarse, member.unknowns
        slope = target_equations(self.goal, x, member.trajectory)[1] * problem.sizes(x)
        return np.asarray(np.linalg.svd(slope)[2][-1])

    def _member_near(self, x: Array, across: Array, steps: int = 6) -> LaunchSolution | None:
        """Return the member where the curve crosses a plane through unknowns; None without one.

        With a plane of no direction, each step of Newton's method is the least to the curve.
        """
        if x[3] <= 0.0:
            return None

        def condition(y: Array, _: DifferentiableFlight) -> tuple[float, Array]:
            """Return the distance from a plane across the curve, and its slope."""
            return float(across @ (y - x)), across

        return solve_launch(
            self._coarse, self.goal, x, condition=condition, accuracy=100 * COARSE, steps=steps
        )

    def _between(self, a: LaunchSolution, b: LaunchSolution, part: float) -> LaunchSolution | None:
        """Return a member between two, by the part of the way from the first."""
        x, chord = a.unknowns, b.unknowns - a.unknowns
        return self._member_near(x + part * chord, chord / self._coarse.sizes(x) ** 2)

    def _root(
        self, value: Callable[[LaunchSolution], float], a: LaunchSolution, b: LaunchSolution
    ) -> LaunchSolution | None:
        """Return the member between two at which a function of members is 0; None without one."""

        def member(part: float) -> LaunchSolution | None:
            """Return the member at a part of the way from a to b."""
            return {0.0: a, 1.0: b}.get(part) or self._between(a, b, part)

        def at(part: float) -> float:
            """Return the value at a part of the way; nan where there is no member."""
            found = member(part)
            return math.nan if found is None else value(found)

        if not value(a) * value(b) <= 0.0:
            return None
        try:
            return member(float(brentq(at, 0.0, 1.0, xtol=1e-6)))
        except ValueError:  # of nan: the curve leaves its chord
            return None

    def _is_between(self, pair: tuple[LaunchSolution, LaunchSolution], one: LaunchSolution) -> bool:
        """Return whether a member lies on the curve between two neighbours."""
        sizes = self._coarse.sizes(pair[0].unknowns)
        chord, off = ((it.unknowns - pair[0].unknowns) / sizes for it in (pair[1], one))
        length = float(np.linalg.norm(chord))
        along = float(off @ chord) / max(length, 1e-300)
        aside = math.sqrt(max(float(off @ off) - along * along, 0.0))
        return -1e-6 * length <= along <= (1 + 1e-6) * length and aside <= 0.3 * length

    def _walk(self, start: LaunchSolution, sign: float) -> list[LaunchSolution]:
        """Return members from one in a direction along its curve, to beyond a limit or round."""
        members, at, size = list[LaunchSolution](), start, 0.5 * STEP
        direction = sign * self._tangent(start)
        while len(members) < MOST_MEMBERS and size > 1e-4:
            sizes = self._coarse.sizes(at.unknowns)
            there = at.unknowns + size * sizes * direction
            found = self._member_near(there, direction / sizes)
            ahead = np.zeros_like(direction) if found is None else self._tangent(found)
            ahead = ahead * math.copysign(1.0, float(ahead @ direction))
            turn = float(ahead @ direction)
            if found is None or turn < 0.9:
                size *= 0.5
                continue
            if len(members) > 2 and self._is_between((at, found), start):
                return [*members, start]
            members.append(found)
            too_fast = found.speed > max(self.speed_limit, at.speed)
            if too_fast or abs(found.spin_size) > max(self.spin_limit, abs(at.spin_size)):
                break
            at, direction = found, ahead
            size = min(1.5 * size, STEP) if turn > 0.97 else size
        return members

    def _turn(self, goal: Goal, a: LaunchSolution, b: LaunchSolution) -> LaunchSolution | None:
        """Return the member between two to which a condition's error falls, and then rises."""
        chord = b.unknowns - a.unknowns

        def rate(member: LaunchSolution) -> float:
            """Return how fast the condition changes along the curve."""
            sizes, slope = self._coarse.sizes(member.unknowns), member.condition(goal)[1]
            tangent = self._tangent(member)
            ahead = math.copysign(1.0, float(tangent @ (chord / sizes)))
            return float(slope @ (sizes * tangent)) * ahead

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
            if member.is_above_ground(self.goal):
                clear = member
            else:
                buried = member
        return clear
