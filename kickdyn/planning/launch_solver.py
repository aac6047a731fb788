r"""Solving for a launch: Newton's method, and the family of all launches to a target.

One launch reaches a target for each time of flight. What a goal names beside the target picks
members out of this family. The launch speed has one minimum along it, so that a speed limit leaves
an interval of times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from kickdyn.core.gravity import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.shooting import ShootingProblem, Trajectory

ACCURACY = 1e-9
"""Largest error of a solution [m, s, m/s]; farther than 1 km, 1e-12 of the distance."""

COARSE_TOL = 1e-8
"""Relative tolerance of the flights on the walk along the family; `refine` makes them exact."""


@dataclass(frozen=True, eq=False)
class LaunchSolution:
    """The launch that Newton's method arrived at.

    Attributes:
        velocity: of the launch, shape `(3,)` [m/s, world frame].
        time: of the flight [s].
        spin_size: of the spin along its axis, where that is unknown, else 0 [rad/s].
        errors: of the target (3 components), of the condition beside it, and of `beside`.
        converged: whether all errors are small enough.
        history: launch velocities, the first guess first, shape `(k, 3)` [m/s].
        trajectory: the flight from there; None where there is none.
    """

    velocity: Array
    time: float
    spin_size: float
    errors: Array
    converged: bool
    history: Array
    trajectory: Trajectory | None

    @property
    def speed(self) -> float:
        """Launch speed [m/s]."""
        return math.hypot(*self.velocity)

    def condition_error(self, goal: Goal) -> float:
        """Return the error of the condition that a goal names beside its target."""
        assert self.trajectory is not None
        return _condition(goal, self.velocity, self.trajectory)[0]

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
    velocity: Array,
    time: float,
    spin_size: float = 0.0,
    accuracy: float | None = None,
) -> LaunchSolution:
    r"""Solve for a launch by Newton's method from a first guess.

    The unknowns are launch velocity :math:`v`, time :math:`t` and, for `beside`, the spin's size
    :math:`s`. They solve :math:`x(t; v, s) = x_{target}` together with the goal's condition. Each
    step integrates one flight with its derivatives, and is halved while it does not reduce the
    errors.

    Args:
        problem: ball, air and spin.
        goal: to be reached.
        velocity: first guess, shape `(3,)` [m/s].
        time: first guess [s].
        spin_size: first guess [rad/s].
        accuracy: largest error; `ACCURACY` when not named.
    """
    if accuracy is None:
        accuracy = max(ACCURACY, 1e-12 * float(np.abs(goal.target).max()))
    x = np.array([*velocity, time, spin_size][: 5 if goal.beside else 4])
    length = float(np.linalg.norm(goal.target))
    last = {"time": goal.time, "speed": goal.speed}.get(goal.kind) or length
    scale = np.array([length] * 3 + [last] + [length] * (len(x) - 4))  # of the errors
    errors, slope, trajectory = _residual(problem, goal, x)
    history = [x[:3]]
    while not np.abs(errors).max() <= accuracy and len(history) <= 40:
        if not (np.isfinite(errors).all() and np.isfinite(slope).all()):
            break
        step = np.linalg.lstsq(slope / scale[:, None], -errors / scale, rcond=1e-14)[0]
        before = float(np.linalg.norm(errors / scale))
        for halving in range(12):
            cut = np.asarray(step * 0.5**halving)
            moved = np.append(step_in_root(x[:3], cut[:3]), x[3:] + cut[3:])
            if moved[3] <= 0.0:
                continue
            found = _residual(problem, goal, moved)
            if float(np.linalg.norm(found[0] / scale)) < before:  # not where it is nan
                x, (errors, slope, trajectory) = moved, found
                break
        else:
            break
        history.append(x[:3])
    return LaunchSolution(
        velocity=x[:3],
        time=float(x[3]),
        spin_size=float(x[4]) if len(x) == 5 else 0.0,
        errors=errors,
        converged=bool(np.abs(errors).max() <= accuracy),
        history=np.array(history),
        trajectory=trajectory,
    )


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


def distinct(solutions: list[LaunchSolution]) -> list[LaunchSolution]:
    """Return solutions by time of flight, each once."""
    apart: list[LaunchSolution] = []
    for one in sorted(solutions, key=lambda one: one.time):
        if not apart or one.time > apart[-1].time * (1 + 1e-6):
            apart.append(one)
    return apart


def _residual(
    problem: ShootingProblem, goal: Goal, x: Array
) -> tuple[Array, Array, Trajectory | None]:
    """Return errors, their derivatives by the unknowns, and the flight; nan where there is none."""
    n = len(x)
    flown = problem.shoot(x[:3], float(x[3]), float(x[4]) if n == 5 else 0.0)
    if flown is None:
        return np.full(n, math.nan), np.full((n, n), math.nan), None
    errors, slope = np.zeros(n), np.zeros((n, n))
    launch = [0, 1, 2, *range(4, n)]
    position, velocity = flown.state(flown.time)
    errors[:3], slope[:3, 3] = position - goal.target, velocity
    slope[np.ix_([0, 1, 2], launch)] = flown.slope(flown.time)
    errors[3], slope[3, launch], slope[3, 3] = _condition(goal, x[:3], flown)
    if goal.beside is not None:
        distance, sideways = goal.beside
        passed, slope[4, launch] = flown.crossing(goal.ahead, distance, goal.left)
        errors[4] = passed - sideways
    return errors, slope, flown


def _condition(goal: Goal, velocity: Array, flown: Trajectory) -> tuple[float, Array, float]:
    """Return the error of the condition beside the target, and derivatives by launch and time."""
    width = flown.slope(0.0).shape[1]
    if goal.time is not None:
        return flown.time - goal.time, np.zeros(width), 1.0
    if goal.speed is not None:
        speed = math.hypot(*velocity)
        return speed - goal.speed, np.append(velocity / speed, np.zeros(width - 3)), 0.0
    if goal.over is not None:
        height, slope = flown.crossing(goal.ahead, goal.over[0], np.array([0.0, 0.0, 1.0]))
        return height - goal.over[1], slope, 0.0
    assert goal.apex is not None
    height, slope = flown.apex()
    return height - goal.apex, slope, 0.0


class LaunchFamily:
    """The launches to a goal's target, by time of flight.

    Args:
        problem: ball, air and spin.
        goal: every member meets its target and `beside`.
        speed_limit: of the launch [m/s].
    """

    def __init__(self, problem: ShootingProblem, goal: Goal, speed_limit: float) -> None:
        self.problem, self.goal, self.speed_limit = problem, goal, speed_limit
        self._coarse = ShootingProblem(
            problem.ball, problem.air, problem.spin, problem.seeks_spin, COARSE_TOL
        )
        self._found: dict[float, LaunchSolution | None] = {}

    def at(self, time: float) -> LaunchSolution | None:
        """Return the launch with a time of flight [s]; None where Newton's method finds none."""
        if time not in self._found:
            goal = Goal(self.goal.target, time=time, beside=self.goal.beside)
            velocity, spin_size = nominal_velocity(goal.target, time), 0.0
            known = [member for member in self._found.values() if member is not None]
            near = min(known, key=lambda one: abs(math.log(one.time / time)), default=None)
            if near is not None:
                velocity = velocity + near.velocity - nominal_velocity(goal.target, near.time)
                spin_size = near.spin_size
            accuracy = 100 * COARSE_TOL * goal.distance
            found = solve_launch(self._coarse, goal, velocity, time, spin_size, accuracy)
            self._found[time] = found if found.converged else None
        return self._found[time]

    def refine(self, member: LaunchSolution) -> LaunchSolution:
        """Return a member as exactly as `solve_launch` computes it."""
        goal = Goal(self.goal.target, time=member.time, beside=self.goal.beside)
        found = self._solve_near(goal, member)
        return found if found.converged else member

    def within_limit(self) -> list[LaunchSolution]:
        """Return members from the shortest to the longest time that the speed limit allows."""
        least = self._slowest()
        if least is None or least.speed > self.speed_limit:
            return []
        if self.goal.speed is not None and least.speed >= self.goal.speed:
            return [least]
        earlier, later = (self._walk(least, ratio) for ratio in (1 / 1.35, 1.35))
        return [*reversed(earlier), least, *later]

    def solutions_between(self, members: list[LaunchSolution]) -> list[LaunchSolution]:
        """Return the goal's solutions between members whose errors of its condition differ in sign.

        Newton's method starts from the member of the smaller error, and then from the other.
        """
        found = []
        for early, late in pairwise(members):
            errors = [one.condition_error(self.goal) for one in (early, late)]
            if not errors[0] * errors[1] <= 0.0:
                continue
            starts = [early, late] if abs(errors[0]) <= abs(errors[1]) else [late, early]
            for solution in (self._solve_near(self.goal, start) for start in starts):
                if solution.converged and early.time <= solution.time <= late.time:
                    found.append(solution)
                    break
        return found

    def above_ground(self, members: list[LaunchSolution]) -> list[LaunchSolution]:
        """Return members that are clear of the ground, with the last clear ones between them."""
        clear = [member.is_above_ground(self.goal) for member in members]
        found = [member for member, is_clear in zip(members, clear, strict=True) if is_clear]
        for (one, is_clear), (other, other_clear) in pairwise(zip(members, clear, strict=True)):
            if is_clear != other_clear:
                found.append(self._last_clear(*((one, other) if is_clear else (other, one))))
        return found

    def _slowest(self) -> LaunchSolution | None:
        """Return the member of least launch speed."""
        about = math.sqrt(2 * float(np.linalg.norm(self.goal.target)) / GRAVITY)  # in the vacuum

        def speed(log: float) -> float:
            member = self.at(about * math.exp(log))
            return math.inf if member is None else member.speed

        found = minimize_scalar(speed, bracket=(-0.3, 0.0), tol=1e-4, options={"maxiter": 40})
        return self.at(about * math.exp(float(found.x)))

    def _walk(self, least: LaunchSolution, ratio: float) -> list[LaunchSolution]:
        """Return members from the slowest one to the speed limit."""
        members, last = list[LaunchSolution](), least
        while abs(ratio - 1.0) > 1e-4 and len(members) < 100:
            member = self.at(last.time * ratio)
            if member is None:  # too far a step
                ratio = math.sqrt(ratio)
                continue
            if member.speed > self.speed_limit:
                return [*members, self._at_limit(last, member)]
            members.append(member)
            last = member
        return members

    def _at_limit(self, inside: LaunchSolution, outside: LaunchSolution) -> LaunchSolution:
        """Return the member at the speed limit."""

        def excess(time: float) -> float:
            member = self.at(time)
            return math.inf if member is None else member.speed / self.speed_limit - 1.0

        a, b = inside.time, outside.time
        if excess(a) * excess(b) >= 0:
            return inside
        return self.at(float(brentq(excess, a, b, xtol=1e-13 * a, rtol=1e-13))) or inside

    def _last_clear(self, clear: LaunchSolution, buried: LaunchSolution) -> LaunchSolution:
        """Return the last member that is clear of the ground, by bisection."""
        while abs(math.log(clear.time / buried.time)) > 1e-6:
            member = self.at(math.sqrt(clear.time * buried.time))
            if member is None:
                break
            member = self.refine(member)
            if member.is_above_ground(self.goal):
                clear = member
            else:
                buried = member
        return clear

    def _solve_near(self, goal: Goal, member: LaunchSolution) -> LaunchSolution:
        """Return what Newton's method arrives at from a member."""
        return solve_launch(self.problem, goal, member.velocity, member.time, member.spin_size)


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
