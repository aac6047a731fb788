r"""Solving for a launch: Newton's method, and the curve of all launches to a target.

A launch velocity and a time of flight are four unknowns, and a target has three coordinates. The
launches to it form curves, and what a goal names beside the target picks members out of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from kickdyn.core.gravity import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.shooting import ShootingProblem, Trajectory

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

Condition = Callable[[Array, Trajectory], tuple[float, Array]]
"""From unknowns and flight to the error of a condition, and its derivatives by the unknowns."""


@dataclass(frozen=True, eq=False)
class LaunchSolution:
    """The launch that Newton's method arrived at.

    Attributes:
        unknowns: launch velocity [m/s, world frame], time of flight [s] and, for `beside`, the size
            of the spin along its axis [rad/s]; shape `(4,)` or `(5,)`.
        errors: of the target (3 components), of the condition beside it, and of `beside`.
        converged: whether all errors are small enough.
        history: launch velocities, the first guess first, shape `(k, 3)` [m/s].
        trajectory: the flight from there; None where there is none.
    """

    unknowns: Array
    errors: Array
    converged: bool
    history: Array
    trajectory: Trajectory | None

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

    def is_within(self, speed_limit: float, spin_limit: float) -> bool:
        """Return whether speed [m/s] and spin [rad/s] keep their limits, but for rounding."""
        return self.speed <= speed_limit * (1 + 1e-9) and abs(self.spin_size) <= spin_limit

    def condition(self, goal: Goal) -> tuple[float, Array]:
        """Return the error of the condition beside the target, and its slopes by the unknowns."""
        assert self.trajectory is not None
        return goal_condition(goal, self.unknowns, self.trajectory)

    def is_above_ground(self, goal: Goal) -> bool:
        """Return whether the flight stays above the ground, level with its lower end.

        A ball that lies on the ground does not start downwards.
        """
        if self.trajectory is None or (goal.lowest == 0.0 and self.velocity[2] < 0.0):
            return False
        end = float(self.trajectory.state(self.time)[0][2])
        return self.trajectory.lowest() >= min(0.0, end)


def solve_launch(
    problem: ShootingProblem,
    goal: Goal,
    start: Array,
    *,
    condition: Condition | None = None,
    accuracy: float = ACCURACY,
    steps: int = 40,
) -> LaunchSolution:
    r"""Solve for a launch by Newton's method from a first guess.

    The unknowns are launch velocity :math:`v`, time :math:`t` and, for `beside`, the spin's size
    :math:`s`. They solve :math:`x(t; v, s) = x_{target}` together with a condition. Each step
    integrates one flight with its derivatives, and is halved while it does not reduce the errors.

    Args:
        problem: ball, air and spin.
        goal: to be reached.
        start: first guess of the unknowns, see `LaunchSolution`.
        condition: beside the target, without a unit; the goal's when not named.
        accuracy: largest relative error.
        steps: of Newton's method, at most.
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
    converged = bool(np.abs(errors / scale).max() <= accuracy)
    return LaunchSolution(x, errors, converged, np.array(history), trajectory)


def step_in_root(velocity: Array, step: Array) -> Array:
    r"""Return a velocity after a Newton step that is taken in :math:`v / \sqrt{|v|}`.

    Drag bends what a launch does as its speed grows, and less so in the root of the speed: a goal
    of 50 m in 2 s takes 3 steps in place of 4. Shapes are `(n,)`.
    """
    speed = float(np.linalg.norm(velocity))
    if speed == 0.0:
        return np.asarray(velocity + step)
    direction = velocity / speed
    root = velocity + step - 0.5 * direction * (direction @ step)  # times sqrt(speed)
    return np.asarray(root * float(np.linalg.norm(root)) / speed)


def goal_condition(goal: Goal, x: Array, flown: Trajectory) -> tuple[float, Array]:
    """Return the error of a goal's condition, and its derivatives by the unknowns."""
    slope, launch = np.zeros(len(x)), [0, 1, 2, *range(4, len(x))]
    if goal.time is not None:
        slope[3] = 1.0
        return flown.time - goal.time, slope
    if goal.speed is not None:
        speed = math.hypot(*x[:3])
        slope[:3] = x[:3] / speed
        return speed - goal.speed, slope
    if goal.over is not None:
        wished = goal.over[1]
        value, by = flown.crossing(goal.ahead, goal.over[0], np.array([0.0, 0.0, 1.0]))
    else:
        assert goal.apex is not None
        wished = goal.apex
        value, by = flown.apex()
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


def target_equations(goal: Goal, x: Array, flown: Trajectory) -> tuple[Array, Array]:
    """Return the errors of target and `beside`, and their derivatives, one row for each."""
    launch, rows = [0, 1, 2, *range(4, len(x))], len(x) - 1
    errors, slope = np.zeros(rows), np.zeros((rows, len(x)))
    position, velocity = flown.state(flown.time)
    errors[:3], slope[:3, 3] = position - goal.target, velocity
    slope[:3, launch] = flown.slope(flown.time)
    if goal.beside is not None:
        distance, sideways = goal.beside
        passed, slope[3, launch] = flown.crossing(goal.ahead, distance, goal.left)
        errors[3] = passed - sideways
    return errors, slope


def _residual(
    problem: ShootingProblem, goal: Goal, condition: Condition, x: Array
) -> tuple[Array, Array, Trajectory | None]:
    """Return errors, their derivatives by the unknowns, and the flight; nan where there is none."""
    n = len(x)
    flown = problem.shoot(x[:3], float(x[3]), float(x[4]) if n == 5 else 0.0)
    if flown is None:
        return np.full(n, math.nan), np.full((n, n), math.nan), None
    errors, slope = target_equations(goal, x, flown)
    error, row = condition(x, flown)
    return np.insert(errors, 3, error), np.insert(slope, 3, row, axis=0), flown


class LaunchFamily:
    r"""The launches to a goal's target, and `beside`, within limits of speed and spin.

    They are curves in the space of the unknowns :math:`y`. A walk along one of them steps in the
    direction :math:`\tau` of its tangent, and Newton's method returns to it across that direction,
    :math:`\tau \cdot (y - y_0) = 0` (pseudo-arclength continuation: Keller 1977), so that a curve
    may turn back in time, speed or spin. Walks start from the launches that Newton's method finds
    from a few answers of the vacuum, the time of flight being free: a curve to which none of these
    leads is not found.

    Args:
        problem: ball, air and spin.
        goal: every member meets its target and `beside`.
        speed_limit: of the launch [m/s].
        spin_limit: of the spin that `beside` seeks [rad/s].
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
            beyond = bool(found) and not self._is_inside(seed)
            if beyond or any(
                self._is_between(pair, seed) for curve in found for pair in pairwise(curve)
            ):
                continue
            ahead = self._walk(seed, 1.0)
            closed = bool(ahead) and ahead[-1] is seed
            curve = [*reversed([] if closed else self._walk(seed, -1.0)), seed, *ahead]
            for goal in (self._goal(speed=self.speed_limit), self.goal):
                turns = [self._turn(goal, *pair) for pair in pairwise(curve)]
                both = zip([None, *turns], curve, strict=True)
                curve = [one for pair in both for one in pair if one is not None]
            found.append(curve)
        return found

    def solutions(self, curves: list[list[LaunchSolution]]) -> list[LaunchSolution]:
        """Return the goal's solutions between members whose errors of its condition differ in sign.

        Those beyond the limits are left out.
        """
        pairs = [pair for curve in curves for pair in pairwise(curve)]
        found = [
            self._solution(*pair)
            for pair in pairs
            if self._error(pair[0]) * self._error(pair[1]) <= 0.0
        ]
        inside = [one for one in found if one is not None and self._is_inside(one)]
        return distinct(inside, self.problem)

    def within_limits(self, curves: list[list[LaunchSolution]]) -> list[list[LaunchSolution]]:
        """Return the parts of curves within the limits, with members at the speed limit."""
        parts = list[list[LaunchSolution]]()
        for curve in curves:
            part = [member for member in curve[:1] if self._is_inside(member)]
            for pair in pairwise(curve):
                inside = [self._is_inside(member) for member in pair]
                if inside[0] != inside[1]:
                    part += self._at_limit(pair)
                if inside[1]:
                    part.append(pair[1])
                elif part:
                    parts.append(part)
                    part = []
            parts += [part] if part else []
        return parts

    def above_ground(self, parts: list[list[LaunchSolution]]) -> list[LaunchSolution]:
        """Return members that are clear of the ground, with the last clear ones between them."""
        found = []
        for part in parts:
            clear = [member.is_above_ground(self.goal) for member in part]
            found += [member for member, is_clear in zip(part, clear, strict=True) if is_clear]
            for pair, both in zip(pairwise(part), pairwise(clear), strict=True):
                if both[0] != both[1]:
                    found += self._last_clear(*(pair if both[0] else reversed(pair)))
        return found

    def refine(self, member: LaunchSolution) -> LaunchSolution:
        """Return a member as exactly as `solve_launch` computes it."""
        found = solve_launch(self.problem, self._goal(time=member.time), member.unknowns)
        return found if found.converged else member

    def _goal(self, **condition: Any) -> Goal:
        """Return the same target and `beside` with another condition."""
        return Goal(self.goal.target, **condition, beside=self.goal.beside)

    def _is_inside(self, member: LaunchSolution) -> bool:
        """Return whether a member is within the limits."""
        return member.is_within(self.speed_limit, self.spin_limit)

    def _error(self, member: LaunchSolution) -> float:
        """Return the error of the goal's condition."""
        return member.condition(self.goal)[0]

    def _seeds(self) -> list[LaunchSolution]:
        """Return members near the vacuum's answers for the times `SEEDS`."""
        target, found = self.goal.target, list[LaunchSolution]()
        about = math.sqrt(2 * float(np.linalg.norm(target)) / GRAVITY)
        for time in (about * part for part in SEEDS):
            spin = [] if self.goal.beside is None else [0.0]
            start = np.array([*nominal_velocity(target, time), time, *spin])
            found.append(self._solve(start, None, steps=20))
        return [one for one in found if one.converged]

    def _tangent(self, member: LaunchSolution) -> Array:
        """Return the direction of the curve, in `sizes` of the unknowns, as a unit vector."""
        problem, x = self._coarse, member.unknowns
        assert member.trajectory is not None
        slope = target_equations(self.goal, x, member.trajectory)[1] * problem.sizes(x)
        return np.asarray(np.linalg.svd(slope)[2][-1])

    def _member_near(
        self, x: Array, across: Array, *, exact: bool = False
    ) -> LaunchSolution | None:
        """Return the member where the curve crosses a plane through unknowns; None without one."""
        if x[3] <= 0.0:
            return None
        found = self._solve(x, across, exact=exact)
        return found if found.converged else None

    def _solve(
        self, x: Array, across: Array | None, *, exact: bool = False, steps: int = 6
    ) -> LaunchSolution:
        """Return what Newton's method finds from unknowns, in a plane `across` the curve.

        Without a plane, each of its steps is the least one that leads to the curve.
        """
        normal = np.zeros_like(x) if across is None else across

        def condition(y: Array, _: Trajectory) -> tuple[float, Array]:
            return float(normal @ (y - x)), normal

        problem, accuracy = (self.problem, ACCURACY) if exact else (self._coarse, 100 * COARSE)
        return solve_launch(
            problem, self.goal, x, condition=condition, accuracy=accuracy, steps=steps
        )

    def _between(
        self,
        a: LaunchSolution,
        b: LaunchSolution,
        part: float,
        *,
        exact: bool = False,
    ) -> LaunchSolution | None:
        """Return a member between two, by the part of the way from the first."""
        x, chord = a.unknowns, b.unknowns - a.unknowns
        sizes = self._coarse.sizes(x)
        return self._member_near(x + part * chord, chord / sizes**2, exact=exact)

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
        """Return the member between two at which the size of a condition's error is least.

        None where it is at one of them. Where the error changes its sign on the way, a member
        beyond that is returned.
        """
        best = None
        for _ in range(8):
            (at_a, by_a), (at_b, by_b) = a.condition(goal), b.condition(goal)
            chord = b.unknowns - a.unknowns
            rates = [at_a * self._rate(a, by_a, chord), at_b * self._rate(b, by_b, chord)]
            if not (at_a * at_b > 0.0 and rates[0] < 0.0 < rates[1]):
                break
            part = rates[0] / (rates[0] - rates[1])
            found = self._between(a, b, min(max(part, 0.1), 0.9))
            if found is None:
                break
            best = found
            error, by = found.condition(goal)
            if error * self._rate(found, by, chord) < 0.0:
                a = found
            else:
                b = found
        return best

    def _rate(self, member: LaunchSolution, slope: Array, chord: Array) -> float:
        """Return how fast the error of the condition changes along the curve, towards `chord`."""
        sizes = self._coarse.sizes(member.unknowns)
        tangent = self._tangent(member)
        return float(slope @ (sizes * tangent)) * math.copysign(
            1.0, float(tangent @ (chord / sizes))
        )

    def _solution(
        self, a: LaunchSolution, b: LaunchSolution, halvings: int = 12
    ) -> LaunchSolution | None:
        """Return the solution between two members whose errors differ in sign.

        Newton's method starts from the member of the smaller error, then from the other, and then
        between closer members.
        """
        for start in sorted((a, b), key=lambda one: abs(self._error(one))):
            found = solve_launch(self.problem, self.goal, start.unknowns, steps=12)
            if found.converged and self._is_between((a, b), found):
                return found
        middle = self._between(a, b, 0.5) if halvings else None
        if middle is None:
            return None
        left = self._error(a) * self._error(middle) <= 0.0
        return self._solution(*((a, middle) if left else (middle, b)), halvings - 1)

    def _at_limit(self, pair: tuple[LaunchSolution, LaunchSolution]) -> list[LaunchSolution]:
        """Return the member at the speed limit between two, if there is one."""
        goal = self._goal(speed=self.speed_limit)
        found = [solve_launch(self.problem, goal, one.unknowns) for one in pair]
        return [
            one
            for one in found
            if one.converged and self._is_between(pair, one) and self._is_inside(one)
        ][:1]

    def _last_clear(self, clear: LaunchSolution, buried: LaunchSolution) -> list[LaunchSolution]:
        """Return the last member that is clear of the ground, by bisection."""
        for _ in range(24):
            member = self._between(clear, buried, 0.5, exact=True)
            if member is None:
                break
            if member.is_above_ground(self.goal):
                clear = member
            else:
                buried = member
        return [clear]


def farthest_launch(problem: ShootingProblem, target: Array, speed: float) -> tuple[Goal, Array]:
    """Return the farthest point on the line to a target that a launch speed reaches, as a goal.

    The launch is aimed at the target's side. Also returns its velocity, shape `(3,)` [m/s].
    """
    ahead = np.array([target[0], target[1], 0.0]) / math.hypot(target[0], target[1])
    up = np.array([0.0, 0.0, 1.0])
    slope = float(target[2] / (ahead @ target))
    time = 2.5 * speed / GRAVITY * (1.0 + abs(slope))

    def reach(angle: float) -> tuple[float, float, Array, Array]:
        """Return distance, time and position where the flight crosses the line, and its launch."""
        velocity = speed * (math.cos(angle) * ahead + math.sin(angle) * up)
        flown = problem.shoot(velocity, time)

        def above(at: float) -> float:
            assert flown is not None
            position = flown.state(at)[0]
            return float(position[2] - slope * (ahead @ position))

        if flown is None or above(time) >= 0.0:
            return 0.0, 0.0, np.zeros(3), velocity
        start = time
        while above(start) < 0.0 and start > 1e-6 * time:
            start *= 0.9
        when = float(brentq(above, start, min(start / 0.9, time)))
        position = flown.state(when)[0]
        return float(ahead @ position), when, position, velocity

    found = minimize_scalar(
        lambda angle: -reach(angle)[0],
        bounds=(math.atan(slope) + 1e-3, math.pi / 2 - 1e-3),
        method="bounded",
        options={"xatol": 1e-5},
    )
    _, when, position, velocity = reach(float(found.x))
    return Goal(position, time=when), velocity
