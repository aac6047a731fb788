"""Newton's method for launches: four or five unknowns, one flight a step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.planning.goal import Goal
from kickdyn.planning.shooting import ShootingProblem, Trajectory

MEETS = 1e-9
"""Errors that count as met [m, s, m/s]; farther than 1 km, a millionth of a millionth of it."""

MOST_STEPS = 40
HALVINGS = 12


@dataclass(frozen=True, eq=False)
class LaunchSolution:
    """Where Newton's method came to.

    Attributes:
        velocity: of the launch, shape `(3,)` [m/s].
        time: of the flight [s].
        size: of the spin along its axis, where that was sought [rad/s].
        errors: of the target (3 components), of the thing named beside it, and of `beside`.
        met: whether all are within `MEETS`.
        tried: launch velocities, the first guess first; empty for a root that the walk along the
            family found.
        shot: the flight from there; None where there is none.
    """

    velocity: Array
    time: float
    size: float
    errors: Array
    met: bool
    tried: tuple[Array, ...]
    shot: Trajectory | None

    def above_ground(self, goal: Goal) -> bool:
        """Return whether the flight stays above the ground, level with its lower end, all the way.

        A ball that lies on the ground does not start downwards.
        """
        if self.shot is None or (goal.lowest == 0.0 and self.velocity[2] < 0.0):
            return False
        end = float(self.shot.place(self.time)[0][2])
        return self.shot.lowest() >= min(0.0, end)


def rooted(velocity: Array, step: Array) -> Array:
    """Return a launch velocity, any shape `(n,)`, after a step of Newton's method.

    The step is taken in v / sqrt(|v|): drag bends what a launch does as its speed grows, and less
    so in the root of the speed. A goal of 50 m in 2 s then takes 3 steps and not 4.
    """
    speed = float(np.linalg.norm(velocity))
    if speed == 0.0:
        return np.asarray(velocity + step)
    way = velocity / speed
    root = velocity + step - 0.5 * way * (way @ step)  # over sqrt(speed), as is its length
    return np.asarray(root * float(np.linalg.norm(root)) / speed)


def meets(goal: Goal) -> float:
    """Return the largest error that counts as met."""
    return max(MEETS, 1e-12 * float(np.abs(goal.target).max()))


def newton(
    field: ShootingProblem,
    goal: Goal,
    velocity: Array,
    time: float,
    size: float = 0.0,
    enough: float | None = None,
) -> LaunchSolution:
    """Solve for a launch from a first guess.

    Steps are cut short while they lead nowhere better; where that does not help, `met` is False.
    Errors up to `enough` count as met, `meets(goal)` if not named.
    """
    enough = meets(goal) if enough is None else enough
    x = np.array([*velocity, time, size][: 5 if goal.beside else 4])
    scale = _scale(goal)
    errors, slope, shot = _residual(field, goal, x)
    tried = [x[:3]]
    while not np.abs(errors).max() <= enough and len(tried) <= MOST_STEPS:
        if not (np.isfinite(errors).all() and np.isfinite(slope).all()):
            break
        step = np.linalg.lstsq(slope / scale[:, None], -errors / scale, rcond=1e-14)[0]
        before = float(np.linalg.norm(errors / scale))
        for halving in range(HALVINGS):
            part: Array = np.asarray(step * 0.5**halving, dtype=np.float64)
            moved = np.append(rooted(x[:3], part[:3]), x[3:] + part[3:])
            if moved[3] <= 0.0:
                continue
            found = _residual(field, goal, moved)
            if float(np.linalg.norm(found[0] / scale)) < before:  # not where it is nan
                x, (errors, slope, shot) = moved, found
                break
        else:
            break
        tried.append(x[:3])
    met = bool(np.abs(errors).max() <= enough)
    size = float(x[4]) if len(x) == 5 else 0.0
    return LaunchSolution(x[:3], float(x[3]), size, errors, met, tuple(tried), shot)


def _scale(goal: Goal) -> Array:
    length = float(np.linalg.norm(goal.target))
    last = {"time": goal.time, "speed": goal.speed}.get(goal.kind) or length
    return np.array([length] * 3 + [last] + [length] * (goal.beside is not None))


def _residual(
    field: ShootingProblem, goal: Goal, x: Array
) -> tuple[Array, Array, Trajectory | None]:
    """Return errors, their derivatives by the unknowns, and the flight; nan where there is none."""
    n = len(x)
    shot = field.shoot(x[:3], float(x[3]), float(x[4]) if n == 5 else 0.0)
    if shot is None:
        return np.full(n, math.nan), np.full((n, n), math.nan), None
    errors, slope = np.zeros(n), np.zeros((n, n))
    launch = [0, 1, 2, *range(4, n)]
    where, going = shot.place(shot.time)
    errors[:3], slope[:3, 3] = where - goal.target, going
    slope[np.ix_([0, 1, 2], launch)] = shot.slope(shot.time)
    errors[3], slope[3, launch], slope[3, 3] = condition(goal, x[:3], shot)
    if goal.beside is not None:
        distance, sideways = goal.beside
        left = np.cross((0.0, 0.0, 1.0), goal.ahead)
        there, slope[4, launch] = shot.crossing(goal.ahead, distance, left)
        errors[4] = there - sideways
    return errors, slope, shot


def condition(goal: Goal, velocity: Array, shot: Trajectory) -> tuple[float, Array, float]:
    """Return the error of the thing named beside the target, and derivatives by launch and time."""
    width = shot.slope(0.0).shape[1]
    if goal.time is not None:
        return shot.time - goal.time, np.zeros(width), 1.0
    if goal.speed is not None:
        speed = math.hypot(*velocity)
        return speed - goal.speed, np.append(velocity / speed, np.zeros(width - 3)), 0.0
    if goal.over is not None:
        height, slope = shot.crossing(goal.ahead, goal.over[0], np.array([0.0, 0.0, 1.0]))
        return height - goal.over[1], slope, 0.0
    assert goal.apex is not None
    height, slope = shot.apex()
    return height - goal.apex, slope, 0.0
