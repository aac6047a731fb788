"""A ball played along the ground: bounces, slides and rolls on the way are allowed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground
from kickdyn.plane import Plane

MEETS = 1e-6
"""Error of the time that counts as met [s]; a bounce makes less of it smooth."""

SLOWEST = 1e-3
"""Least launch speed that is tried, over the limit."""


@dataclass(frozen=True, eq=False, repr=False)
class Pass(ReprMixin):
    """A launch that brings the ball to a place along the ground.

    Attributes:
        status: `met`; or `unreachable`, and this is the nearest there is.
        limit: what stands in the way: `speed limit`, or `rolling`, where a ball so slow would stop
            before, or `bounce`, whose place jumps as the speed changes; empty where it is met.
        velocity: of the launch, shape `(3,)` [m/s].
        course: to the plane through the target that faces the ball.
        time: when it comes there [s].
        aside: how far beside the target it passes, to the left [m].
    """

    status: Literal["met", "unreachable"]
    limit: str
    velocity: Array
    course: Course
    time: float
    aside: float

    def _rows(self) -> Iterable[Row]:
        yield "status", f"{self.status}: {self.limit}" if self.limit else self.status, ""
        yield "launch", self.velocity, "m/s"
        yield "time", self.time, "s"
        yield "aside", self.aside, "m"
        yield "bounces", len(self.course.bounces), ""

    def _picture(self) -> str:
        return self.course._picture()

    @property
    def said(self) -> str:
        """What stands in the way, in words; empty where it is met."""
        words = {
            "speed limit": "the ball would have to be faster than the speed limit",
            "rolling": "a ball so slow would stop before",
            "bounce": "where it bounces changes at a jump there",
        }
        if not self.limit:
            return ""
        there = self.course.status == "at-plane"
        near = (
            f"{self.time:.4g} s is nearest"
            if there
            else f"{self.course.distance:.4g} m is farthest"
        )
        return f"{words[self.limit]}: {near}"


def plan_pass(
    target: ArrayLike,
    time: float,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    *,
    elevation: float = 0.0,
    spin: ArrayLike = (0.0, 0.0, 0.0),
    speed_limit: float = 40.0,
) -> Pass:
    """Find launch speed and direction that bring a ball on the ground to a place in a time.

    Args:
        target: distance along x, or x and y, from the ball [m].
        time: wished for [s].
        ball: a thin shell, which lies on the ground at the start.
        air: None is the vacuum.
        ground: with a surface; turf when not named.
        elevation: of the launch above the ground, 0 to 1.2 [rad].
        spin: of the launch, shape `(3,)` [rad/s].
        speed_limit: of the launch, at most 100 [m/s].

    Raises:
        InvalidInput: a value out of range, or a ground without surface.
    """
    place = validation.floats("target", target, unit="m")
    place = np.append(place, 0.0) if place.ndim == 0 else place
    if place.shape != (2,) or not math.hypot(*place) > 0:
        raise InvalidInput(f"target is {target!r}: it must be a distance or (x, y), not at 0")
    wished = validation.number("time", time, above=0, unit="s")
    angle = validation.number("elevation", elevation, at_least=0, at_most=1.2, unit="rad")
    limit = validation.number("speed limit", speed_limit, above=0, at_most=100, unit="m/s")
    ground = Ground(surface="turf") if ground is None else ground
    start = np.array([0.0, 0.0, ground.height + ball.radius])
    ahead = np.array([*place, 0.0]) / math.hypot(*place)
    left = np.array([-ahead[1], ahead[0], 0.0])
    goal_line = Plane(start + np.array([*place, 0.0]), -ahead, "centre")

    def played(speed: float, turn: float) -> tuple[Array, Course]:
        level = math.cos(turn) * ahead + math.sin(turn) * left
        velocity = speed * (math.cos(angle) * level + np.array([0, 0, math.sin(angle)]))
        state = BallState(start, velocity, spin)
        return velocity, follow(state, ball, air, ground, plane=goal_line)

    def late(turn: float, speed: float) -> float:
        _, course = played(speed, turn)
        return course.duration - wished if course.status == "at-plane" else math.inf

    turn, speed, hinder = 0.0, limit, ""
    for _ in range(8):  # the way bends little: the aim is turned by what it misses
        speed, hinder = _speed(partial(late, turn), limit)
        velocity, course = played(speed, turn)
        aside = float(left @ (course.rest.position - goal_line.point))
        if abs(aside) <= MEETS:
            break
        turn -= math.atan2(aside, math.hypot(*place))
    error = course.duration - wished
    met = course.status == "at-plane" and abs(error) <= MEETS and abs(aside) <= MEETS
    return Pass(
        "met" if met else "unreachable",
        "" if met else hinder or "bounce",
        velocity,
        course,
        course.duration,
        aside,
    )


def _speed(late: Callable[[float], float], limit: float) -> tuple[float, str]:
    """Return the speed that is in time, or the nearest and what hinders."""
    if late(limit) > 0.0:
        return limit, "speed limit"
    slow, fast = SLOWEST * limit, limit
    if late(slow) <= 0.0:
        return slow, "rolling"
    while late(slow) == math.inf and fast - slow > 1e-12 * limit:
        middle = 0.5 * (slow + fast)
        if late(middle) <= 0.0:
            fast = middle
        else:
            slow = middle
    if late(slow) == math.inf:  # it would have to be slower than the slowest that comes there
        return fast, "rolling"
    return float(brentq(late, slow, fast, xtol=1e-13 * limit, rtol=1e-13)), ""
