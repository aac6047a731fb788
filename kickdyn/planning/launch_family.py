"""Every launch that reaches a target: a family, one for each time of flight.

What is named beside the target picks its members out. The launch speed has one minimum along it, so
that a speed limit leaves an interval of times.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from kickdyn.core.validation import Array
from kickdyn.core.vectors import GRAVITY
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.launch_newton import LaunchSolution, condition, newton
from kickdyn.planning.shooting import ShootingProblem

STRIDE = 1.35
"""Ratio of neighbouring times of the walk along the family."""


EDGE = 1e-6
"""Share of the time to which the last launch is found that is clear of the ground."""

COARSE = 1e-8
"""Tolerance of the flights that look for a member; `refined` makes it exact."""


class Member(NamedTuple):
    """A launch of the family, the error of what is named beside the target, and if it is clear.

    It is clear where the ground is not in its way.
    """

    root: LaunchSolution
    speed: float
    error: float
    clear: bool


class Family:
    """The launches to a goal's target.

    Args:
        field: ball and air.
        goal: its target, and `beside`, hold for every member.
        limit: of the launch speed [m/s].
    """

    def __init__(self, field: ShootingProblem, goal: Goal, limit: float) -> None:
        self.field, self.goal, self.limit = field, goal, limit
        self._coarse = ShootingProblem(field.ball, field.air, field.spin, field.seeks_spin, COARSE)
        self._found: dict[float, Member | None] = {}

    def at(self, time: float) -> Member | None:
        """Return the launch with a time of flight [s]; None where Newton's method finds none."""
        if time not in self._found:
            near = [t for t, member in self._found.items() if member is not None]
            first = min(near, key=lambda t: abs(math.log(t / time)), default=None)
            self._found[time] = self._solved(time, first)
        return self._found[time]

    def _solved(self, time: float, near: float | None) -> Member | None:
        goal = Goal(self.goal.target, time=time, beside=self.goal.beside)
        velocity, size = nominal_velocity(goal.target, time), 0.0
        if near is not None:
            member = self._found[near]
            assert member is not None
            was = nominal_velocity(goal.target, near)
            velocity, size = member.root.velocity + velocity - was, member.root.size
        root = newton(self._coarse, goal, velocity, time, size, 100 * COARSE * goal.distance)
        return self._member(root)

    def refined(self, member: Member) -> Member:
        """Return a member as exactly as `newton` gives it."""
        root = member.root
        goal = Goal(self.goal.target, time=root.time, beside=self.goal.beside)
        found = newton(self.field, goal, root.velocity, root.time, root.size)
        return self._member(found) or member

    def _member(self, root: LaunchSolution) -> Member | None:
        if not root.met or root.shot is None:
            return None
        error = condition(self.goal, root.velocity, root.shot)[0]
        return Member(root, math.hypot(*root.velocity), error, root.above_ground(self.goal))

    def slowest(self) -> Member | None:
        """Return the member of least launch speed."""
        about = math.sqrt(2 * float(np.linalg.norm(self.goal.target)) / GRAVITY)  # in the vacuum

        def speed(log: float) -> float:
            member = self.at(about * math.exp(log))
            return math.inf if member is None else member.speed

        found = minimize_scalar(speed, bracket=(-0.3, 0.0), tol=1e-4, options={"maxiter": 40})
        return self.at(about * math.exp(float(found.x)))

    def within(self) -> list[Member]:
        """Return members from the shortest to the longest time that the speed limit allows."""
        least = self.slowest()
        if least is None or least.speed > self.limit:
            return []
        if self.goal.speed is not None and least.speed >= self.goal.speed:
            return [least]
        ends = [self._walk(least, ratio) for ratio in (1 / STRIDE, STRIDE)]
        return [*reversed(ends[0]), least, *ends[1]]

    def clear(self, members: list[Member]) -> list[Member]:
        """Return those that are clear of the ground, and the last ones that are, between them."""
        found = [member for member in members if member.clear]
        for one, other in pairwise(members):
            if one.clear != other.clear:
                found.append(self._last_clear(*((one, other) if one.clear else (other, one))))
        return found

    def _last_clear(self, clear: Member, buried: Member) -> Member:
        while abs(math.log(clear.root.time / buried.root.time)) > EDGE:
            member = self.at(math.sqrt(clear.root.time * buried.root.time))
            if member is None:
                break
            member = self.refined(member)
            clear, buried = (member, buried) if member.clear else (clear, member)
        return clear

    def _walk(self, least: Member, ratio: float) -> list[Member]:
        members, last = list[Member](), least
        while abs(ratio - 1.0) > 1e-4 and len(members) < 100:
            member = self.at(last.root.time * ratio)
            if member is None:  # too far a step
                ratio = math.sqrt(ratio)
                continue
            if member.speed > self.limit:
                members.append(self._at_limit(last, member))
                break
            members.append(member)
            last = member
        return members

    def _at_limit(self, inside: Member, outside: Member) -> Member:
        def excess(time: float) -> float:
            member = self.at(time)
            return math.inf if member is None else member.speed / self.limit - 1.0

        a, b = inside.root.time, outside.root.time
        if excess(a) * excess(b) >= 0:
            return inside
        time = float(brentq(excess, a, b, xtol=1e-13 * a, rtol=1e-13, maxiter=80))
        member = self.at(time)
        return inside if member is None else member


def farthest_point(
    field: ShootingProblem, target: Array, limit: float
) -> tuple[Array, Array, float]:
    """Return the farthest point on the line to a target that a launch at the speed limit comes to.

    Aimed at the target's side; also the launch velocity and the time of flight.
    """
    ahead = np.array([target[0], target[1], 0.0]) / math.hypot(target[0], target[1])
    up = np.array([0.0, 0.0, 1.0])
    slope = float(target[2] / (ahead @ target))
    time = 2.5 * limit / GRAVITY * (1.0 + abs(slope))

    def reached(angle: float) -> tuple[float, float, Array, Array]:
        velocity = limit * (math.cos(angle) * ahead + math.sin(angle) * up)
        shot = field.shoot(velocity, time)

        def above(at: float) -> float:
            assert shot is not None
            where = shot.place(at)[0]
            return float(where[2] - slope * (ahead @ where))

        if shot is None or above(time) >= 0.0:
            return 0.0, 0.0, np.zeros(3), velocity
        start = time
        while above(start) < 0.0 and start > 1e-6 * time:
            start *= 0.9
        when = float(brentq(above, start, min(start / 0.9, time)))
        where = shot.place(when)[0]
        return float(ahead @ where), when, where, velocity

    lowest = math.atan(slope)
    found = minimize_scalar(
        lambda angle: -reached(angle)[0], bounds=(lowest + 1e-3, math.pi / 2 - 1e-3),
        method="bounded", options={"xatol": 1e-5},
    )  # fmt: skip
    _, when, where, velocity = reached(float(found.x))
    return where, velocity, when
