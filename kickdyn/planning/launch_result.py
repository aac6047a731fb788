"""What planning a launch answers: launches, and the flights from them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, format_value
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.ground import Ground
from kickdyn.plane import Plane
from kickdyn.planning.goal import Goal

ROUNDING = 1e-6
"""How deep in the ground a launch may come to its target [m], so that it does not end before."""


@dataclass(frozen=True, eq=False, repr=False)
class Launch(ReprMixin):
    """A launch that meets a goal.

    Attributes:
        goal: that it meets.
        velocity: shape `(3,)` [m/s, world axes].
        spin: shape `(3,)` [rad/s, world axes].
        time: of the flight to the target [s].
        errors: of the target (3 components), the thing named beside it, and `beside` [m, s, m/s].
        tried: launch velocities of Newton's method, the vacuum's answer first and `velocity` last;
            empty where the launch was found along the family of all launches to the target.
        ball, air: what flies through what.
    """

    goal: Goal
    velocity: Array
    spin: Array
    time: float
    errors: Array
    tried: tuple[Array, ...]
    ball: Ball
    air: Air | None

    def _rows(self) -> Iterable[Row]:
        yield "speed", self.speed, "m/s"
        yield "elevation", math.degrees(self.elevation), "deg"
        yield "azimuth", math.degrees(self.azimuth), "deg"
        yield "spin", self.spin, "rad/s"
        yield "time", self.time, "s"
        yield "largest error", float(abs(self.errors).max()), ""

    @property
    def steps(self) -> int:
        """Number of steps of Newton's method; -1 where the launch was not found by it."""
        return len(self.tried) - 1

    @property
    def speed(self) -> float:
        """Launch speed [m/s]."""
        return math.hypot(*self.velocity)

    @property
    def elevation(self) -> float:
        """Launch angle above the horizontal [rad]."""
        return math.atan2(self.velocity[2], math.hypot(self.velocity[0], self.velocity[1]))

    @property
    def azimuth(self) -> float:
        """Launch direction from x towards y [rad]."""
        return math.atan2(self.velocity[1], self.velocity[0])

    @property
    def state(self) -> BallState:
        """The ball at the launch, at the origin."""
        return BallState(velocity=self.velocity, spin=self.spin)

    def fly(self, start: ArrayLike = (0.0, 0.0, 0.0), tol: float = 1e-11) -> Flight:
        """Return the flight to the target, by `kd.fly`: to the plane there that faces the ball.

        Args:
            start: the ball's centre, shape `(3,)` [m, world frame].
            tol: relative tolerance.
        """
        centre = validation.vector("start", start, 3, unit="m")
        state = BallState(centre, self.velocity, self.spin)
        return to_target(state, self.goal, self.ball, self.air, self.time, tol)


@dataclass(frozen=True, eq=False, repr=False)
class Launches(ReprMixin):
    """What `plan_launches` found.

    Attributes:
        status: `met` or `unreachable`.
        goal: as wished for.
        solutions: every launch that meets it, by time of flight: a low arc before a high one.
        limit: what stands in the way of an unreachable goal: `speed limit`, `spin limit`, or
            `least speed`, `lowest way`, `highest way` to the target, or `ground`, where the way
            there leads through it; empty where it is met.
        nearest: a launch that meets the nearest goal there is, which is `nearest.goal`; None where
            the ground is in the way of all.
    """

    status: Literal["met", "unreachable"]
    goal: Goal
    solutions: tuple[Launch, ...]
    limit: str = ""
    nearest: Launch | None = None

    def _rows(self) -> Iterable[Row]:
        yield "status", self.said, ""
        for launch in self.solutions:
            spin = f", spin {format_value(launch.spin)} rad/s" if launch.spin.any() else ""
            yield f"in {launch.time:.4g} s", f"{format_value(launch.velocity)} m/s{spin}", ""

    @property
    def said(self) -> str:
        """A line that says what the answer is."""
        if self.status == "met":
            count = len(self.solutions)
            return "1 launch meets the goal" if count == 1 else f"{count} launches meet the goal"
        near = "nothing near is known" if self.nearest is None else f"nearest {_said(self.nearest)}"
        if self.limit == "ground":
            return f"out of reach, the ground is in the way: {near}"
        return f"out of reach by the {self.limit}: {near}"


def to_target(
    state: BallState,
    goal: Goal,
    ball: Ball,
    air: Air | None,
    time: float | None = None,
    tol: float = 1e-11,
    *,
    orientation: bool = False,
) -> Flight:
    """Fly to the vertical plane through a goal's target, or to the ground before it.

    A launch that meets the goal has its `time` to the target [s]: it may cross the plane before and
    be blown back, and it does not end on the ground by mere rounding.
    """
    plane = Plane(state.position + goal.target, -goal.ahead, "centre")
    floor = float(state.position[2]) + goal.lowest - ball.radius
    ground = Ground(floor if time is None else floor - ROUNDING)
    flown = partial(fly, state, ball, air, ground, tol, orientation=orientation)
    if time is None:
        return flown(plane=plane)
    path = flown(plane=plane, time_limit=2 * time)
    if path.status == "at-plane" and abs(path.duration - time) < 0.5 * time:
        return path
    return flown(time_limit=time)


def _said(near: Launch) -> str:
    value = getattr(near.goal, near.goal.kind)
    format_value = (
        f"{value[1]:.4g} m at {value[0]:.4g} m" if near.goal.kind == "over" else f"{value:.4g}"
    )
    rounding = 1e-9 * float(abs(near.goal.target).max())
    where = ", ".join(f"{part if abs(part) > rounding else 0:.4g}" for part in near.goal.target)
    if near.goal.beside is not None:
        at, left = near.goal.beside
        side = "left" if left >= 0.0 else "right"
        format_value += f", {abs(left):.4g} m {side} of the line at {at:.4g} m"
    return f"({where}) m, {near.goal.kind} {format_value}, at {near.speed:.4g} m/s"
