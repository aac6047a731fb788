"""Planning a pass along the ground, where the ball may bounce, slide and roll."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane
from kickdyn.planning.goal import (
    REASONS,
    Goal,
    LaunchLimit,
    PlannedLaunch,
    PlanStatus,
    meet_receiver,
)

ACCURACY = 1e-6
"""Largest error of time [s] and place [m]; a bounce makes less of them smooth."""

UNREACHED_DELAY = 1e6
"""Delay of a ball that does not come to the target [s]."""


@dataclass(frozen=True, eq=False, repr=False)
class Pass(PlannedLaunch):
    """A launch that brings the ball to a target along the ground.

    Where the status is `unreachable`, the `limit` is `speed-limit`, `rolling` or `bounce`.

    Attributes:
        course: motion of the ball to the plane through the target that faces the ball.
        aside: distance to the left of the target at which the ball passes it [m].
    """

    course: Course
    aside: float

    def _rows(self) -> Iterable[Row]:
        yield "status", f"{self.status}: {self.limit}" if self.limit else self.status, ""
        yield "launch", self.velocity, "m/s"
        yield "time", self.time, "s"
        yield "aside", self.aside, "m"
        yield "bounces", len(self.course.bounces), ""
        yield from warned(self.course.warnings)

    @property
    def iterations(self) -> int:
        """0, because Brent's method finds the launch."""
        return 0

    @property
    def summary(self) -> str:
        """A line that says whether the goal is met, and if not, why."""
        if self.limit is None:
            return f"the pass takes {self.time:.4g} s"
        reason = REASONS[self.limit].format(speed=self.speed)
        if self.course.status == "at-plane":
            return f"{reason}; the nearest is {self.time:.4g} s"
        return f"{reason}; the farthest is {self.course.distance:.4g} m"


@validation.check_arguments
def plan_pass(
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    surface: str | Surface = "turf",
    angle: float = 0.0,
    speed_limit: float = 40.0,
) -> Pass:
    r"""Find launch speed and direction that bring a ball on the ground to a place in a time.

    The speed is the root of :math:`t(v) - t_{goal}`, by Brent's method over courses that
    `kickdyn.follow` computes; the direction is turned by the angle at which the ball passes aside.

    Args:
        goal: a goal with a `time` or a `speed` and a target as high as the ball lies, without
            `beside`; its arc does not count.
        ball: the ball, which lies on the ground at the start.
        air: the air; None is the vacuum.
        surface: surface of the ground, by name or as a `Surface`.
        angle: angle of the launch above the ground, 0 to 1.2 [rad].
        speed_limit: largest speed of the launch, at most 100 [m/s].

    Raises:
        InvalidInput: a value out of range, a goal with `apex`, `over` or `beside`, one at another
            height, or an unknown surface.

    Example:
        >>> import kickdyn as kd
        >>> plan = kd.plan_pass(kd.Goal(20, time=2), kd.Ball(), kd.Air())
        >>> str(plan.status), round(float(plan.velocity[0]), 2)
        ('met', 15.06)
    """
    if goal.kind not in ("time", "speed") or not goal.is_level or goal.beside is not None:
        named = ", ".join(f"{name} {value} {unit}" for name, value, unit in goal.named_values())
        raise InvalidInput(
            f"a goal with {named} is not valid for a pass: it must have a time or a speed, a "
            "target as high as the ball and no beside"
        )
    angle = validation.number("angle", angle, at_least=0, at_most=1.2, unit="rad")
    limit = validation.number("speed limit", speed_limit, above=0, at_most=100, unit="m/s")
    if goal.receiver_velocity.any():
        again = partial(plan_pass, surface=surface, angle=angle, speed_limit=limit)
        return meet_receiver(goal, lambda at_rest: again(at_rest, ball, air))
    ground = Ground(surface=surface)
    start = np.array([0.0, 0.0, ball.radius])
    plane = Plane(start + goal.target, -goal.ahead, "centre")
    duration = goal.time

    def play(speed: float, turn: float) -> tuple[Array, Course]:
        level = math.cos(turn) * goal.ahead + math.sin(turn) * goal.left
        velocity = speed * (math.cos(angle) * level + np.array([0, 0, math.sin(angle)]))
        state = BallState(start, velocity, goal.spin)
        return velocity, follow(state, ball, air, ground, plane=plane)

    def delay(turn: float, speed: float) -> float:
        course = play(speed, turn)[1]
        reached = course.status == "at-plane"
        return course.duration - (duration or 0.0) if reached else UNREACHED_DELAY

    turn = 0.0
    for _ in range(8):  # the course bends little: the aim is turned by the error
        if goal.speed is None:
            speed, obstacle = _solve_speed(partial(delay, turn), limit)
        else:
            speed, obstacle = min(goal.speed, limit), None
        velocity, course = play(speed, turn)
        lateral_miss = float(goal.left @ course.rest.position)  # the target lies on the line
        if abs(lateral_miss) <= ACCURACY:
            break
        turn -= math.atan2(lateral_miss, goal.distance)
    on_time = course.status == "at-plane"
    if duration is not None:
        on_time = on_time and abs(course.duration - duration) <= ACCURACY
    elif not on_time:
        obstacle = LaunchLimit.LEAST_SPEED
    elif speed != goal.speed:
        on_time, obstacle = False, LaunchLimit.SPEED
    if on_time and abs(lateral_miss) <= ACCURACY:
        status, obstacle = PlanStatus.MET, None
    else:
        status, obstacle = PlanStatus.UNREACHABLE, obstacle or LaunchLimit.BOUNCE
    return Pass(
        status, goal, obstacle, velocity, goal.spin, ball, air, course.duration, course,
        lateral_miss,
    )  # fmt: skip


def _solve_speed(delay: Callable[[float], float], limit: float) -> tuple[float, LaunchLimit | None]:
    if delay(limit) > 0.0:
        return limit, LaunchLimit.SPEED
    slow = 1e-3 * limit
    if delay(slow) <= 0.0:
        return slow, LaunchLimit.ROLLING
    speed = float(brentq(delay, slow, limit, xtol=1e-13 * limit, rtol=1e-13))
    slightly_slower_stops = delay(speed * (1 - 1e-12)) == UNREACHED_DELAY
    return speed * (1 + 1e-12), LaunchLimit.ROLLING if slightly_slower_stops else None
