"""The launches to a target: branches along the time of flight, and what a goal selects of them."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.launch_solver import (
    LaunchSolution,
    ShootingProblem,
    distinct,
    solve_launch,
    target_equations,
)

COARSE_TOL = 1e-8
"""Relative tolerance of the flights on the walk along a branch."""

FIRST_TIMES = (1.0, 0.8, 1.25, 0.5, 2.0, 0.3, 3.0)
"""Times of flight at which branches are sought, over the time of the slowest launch in vacuum."""

SHORTEST_TIME, LONGEST_TIME = 1e-6, 1e3
"""Times of flight that a `Goal` may have [s]."""

LONGEST_STEP, FIRST_STEP, SHORTEST_STEP = 0.4, 0.05, 5e-3
"""Largest, first and smallest step along a branch, in the logarithm of the time. A second solution
may be near the one from which a branch starts."""


class LaunchFamily:
    """The launches to a goal's target, and `beside`, within limits of speed and spin [m/s, rad/s].

    There is a launch for each time of flight, which Newton's method finds from a neighbour
    in time: a branch. It ends beyond a limit, or where no longer or shorter flight comes to the
    target. Branches start from the launches that Newton's method finds from those in the vacuum:
    one to which none of these leads is not found.
    """

    def __init__(
        self, problem: ShootingProblem, goal: Goal, speed_limit: float, spin_limit: float
    ) -> None:
        self.problem, self.goal = problem, goal
        self.speed_limit, self.spin_limit = speed_limit, spin_limit
        self._coarse = replace(problem, tol=COARSE_TOL)

    @cached_property
    def direct(self) -> list[LaunchSolution]:
        """The goal's solutions to which Newton's method comes from the vacuum's solutions, by time.

        They may be beyond the limits.
        """
        solutions, goal = list[LaunchSolution](), self.goal
        for time in goal.nominal_times():
            solution = solve_launch(self.problem, goal, self._nominal(time))
            if solution is None:
                continue
            falls = solution.trajectory.velocity(solution.time)[2] <= 1e-9 * solution.speed
            if goal.apex is None or falls:
                solutions.append(solution)
        return distinct(solutions, self.problem)

    @cached_property
    def branches(self) -> list[list[LaunchSolution]]:
        """Members by time on each branch, and those where the condition turns."""

        def is_between(a: LaunchSolution, b: LaunchSolution, member: LaunchSolution) -> bool:
            chord = b.unknowns - a.unknowns
            fraction = (member.time - a.time) / (b.time - a.time)
            deviation = np.abs(member.unknowns - a.unknowns - fraction * chord).max()
            return bool(-1e-6 <= fraction <= 1 + 1e-6 and deviation <= 0.3 * np.abs(chord).max())

        branches = list[list[LaunchSolution]]()
        for start in self.direct:
            if not any(is_between(*pair, start) for pair in _pairs(branches)):
                branches.append(self._branch(start))
        slowest = math.sqrt(2 * float(np.linalg.norm(self.goal.target)) / GRAVITY)
        for time in (slowest * fraction for fraction in FIRST_TIMES):
            if not any(branch[0].time <= time <= branch[-1].time for branch in branches):
                member = self._member(self._nominal(time), steps=20)
                if member is not None and (self.is_inside(member) or not branches):
                    branches.append(self._branch(member))
        return branches

    @cached_property
    def solutions(self) -> list[LaunchSolution]:
        """The goal's solutions within the limits, by time: direct ones, and those on branches."""
        between = (self._solution(self.goal, *pair) for pair in _pairs(self.branches))
        solutions = [*self.direct, *between]
        inside = [member for member in solutions if member is not None and self.is_inside(member)]
        return distinct(inside, self.problem)

    def is_inside(self, member: LaunchSolution) -> bool:
        """Return whether a member is within the limits, but for rounding."""
        is_slow = member.speed <= self.speed_limit * (1 + 1e-9)
        return is_slow and abs(member.spin_size) <= self.spin_limit

    def above_ground(self) -> list[LaunchSolution]:
        """Return members within the limits that are clear of the ground, and the last such."""
        members = []
        for pair in _pairs(self.branches):
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

    def _nominal(self, time: float) -> Array:
        """Return the unknowns of the vacuum's launch to the target, without spin."""
        spin = [] if self.goal.beside is None else [0.0]
        return np.array([*nominal_velocity(self.goal.target, time), *spin, time])

    def _with_condition(self, **condition: Any) -> Goal:
        return Goal(self.goal.target, **condition, beside=self.goal.beside)

    def _member(self, guess: Array, steps: int) -> LaunchSolution | None:
        """Return the member with the time of a guess; None without one."""
        time = float(guess[-1])
        if not SHORTEST_TIME <= time <= LONGEST_TIME:
            return None
        goal = self._with_condition(time=time)
        return solve_launch(self._coarse, goal, guess, accuracy=100 * COARSE_TOL, steps=steps)

    def _branch(self, start: LaunchSolution) -> list[LaunchSolution]:
        """Return the members of the branch of a launch, and those where a condition turns."""
        branch = [*reversed(self._walk(start, -1.0)), start, *self._walk(start, 1.0)]
        limit = self._with_condition(speed=self.speed_limit)
        for find in (
            partial(self._turning, limit),
            partial(self._solution, limit),
            partial(self._turning, self.goal),
        ):
            between = [
                member
                for a, b in pairwise(branch)
                if (member := find(a, b)) and a.time < member.time < b.time
            ]
            branch = sorted([*branch, *between], key=lambda member: member.time)
        return branch

    def _walk(self, start: LaunchSolution, sign: float) -> list[LaunchSolution]:
        """Return members from one towards longer or shorter times, to beyond a limit."""
        members, member, step = list[LaunchSolution](), start, FIRST_STEP
        while step > SHORTEST_STEP:
            change = member.time * math.expm1(sign * step)
            following = self._member(member.unknowns + change * self._rates(member), steps=6)
            if following is None:
                step *= 0.5
                continue
            members.append(following)
            is_too_fast = following.speed > max(self.speed_limit, member.speed)
            most_spin = max(self.spin_limit, abs(member.spin_size))
            if is_too_fast or abs(following.spin_size) > most_spin:
                break
            member, step = following, min(2.0 * step, LONGEST_STEP)
        return members

    def _rates(self, member: LaunchSolution) -> Array:
        """Return the derivatives of the unknowns by the time of flight along the branch."""
        _, slopes = target_equations(self.goal, member.unknowns, member.trajectory)
        sizes = self._coarse.sizes(member.unknowns)[:-1]
        rates = np.linalg.lstsq(slopes[:, :-1] * sizes, -slopes[:, -1], rcond=1e-14)[0]
        return np.append(sizes * rates, 1.0)

    def _between(self, a: LaunchSolution, b: LaunchSolution, share: float) -> LaunchSolution | None:
        return self._member(a.unknowns + share * (b.unknowns - a.unknowns), steps=12)

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
        except ValueError:  # of nan: there is no member
            return None

    def _turning(self, goal: Goal, a: LaunchSolution, b: LaunchSolution) -> LaunchSolution | None:
        """Return the member between two to which a condition's error falls, and then rises."""

        def rate(member: LaunchSolution) -> float:
            return float(member.condition(goal)[1] @ self._rates(member))

        falls, rises = (member.condition(goal)[0] * rate(member) for member in (a, b))
        return self._root(rate, a, b) if falls < 0.0 < rises else None

    def _solution(self, goal: Goal, a: LaunchSolution, b: LaunchSolution) -> LaunchSolution | None:
        start = self._root(lambda member: member.condition(goal)[0], a, b)
        return start and solve_launch(self.problem, goal, start.unknowns, steps=12)

    def _last_clear(self, clear: LaunchSolution, buried: LaunchSolution) -> LaunchSolution:
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


def _pairs(branches: list[list[LaunchSolution]]) -> list[tuple[LaunchSolution, LaunchSolution]]:
    return [pair for branch in branches for pair in pairwise(branch)]
