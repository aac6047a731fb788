"""The goal of a kick: a target, and one condition on the flight to it."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeVar

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.representation import ReprMixin, Row, format_value, freeze_arrays
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput

CONDITIONS = {"time": "s", "apex": "m", "speed": "m/s", "over": "m"}
"""Conditions on the flight, of which a goal has one, with their units."""

UP = np.array([0.0, 0.0, 1.0])

FARTHEST = 1e4
"""Largest distance of a target [m]: air and gravity are the same all the way."""


MOST_MEETINGS, SAME_TIME, LONGEST_MEETING = 40, 1e-10, 1e3
"""Of the search for the time at which the ball meets a receiver: largest number of launches,
relative change of the time at which it ends, and longest time [s]."""


class PlanStatus(StrEnum):
    """Whether a plan can be carried out; one with several faults has the last one's status."""

    MET = "met"
    COLLIDES = "collides"
    """A body is inside the ball or another body, or under the ground."""
    SUPPORT_MOVES = "support-moves"
    """The foot that a robot stands on slips, tips or lifts off."""
    BEYOND_LIMITS = "beyond-limits"
    """The leg is not fast or strong enough: the plan is the kick of the largest share of it,
    or one whose motion does not keep a limit."""
    UNREACHABLE = "unreachable"
    """No launch meets it: the plan is the nearest there is."""


class LaunchLimit(StrEnum):
    """Reasons why no launch or pass meets a goal, see `REASONS`."""

    SPEED = "speed-limit"
    SPIN = "spin-limit"
    LEAST_SPEED = "least-speed"
    LOWEST_PATH = "lowest-path"
    HIGHEST_PATH = "highest-path"
    GROUND = "ground"
    ROLLING = "rolling"
    BOUNCE = "bounce"
    SEARCH = "search"


REASONS = {
    LaunchLimit.SPEED: "the ball would have to start faster than {speed:.4g} m/s",
    LaunchLimit.SPIN: "the ball would have to spin faster than {spin:.4g} rad/s",
    LaunchLimit.LEAST_SPEED: "a slower ball does not reach the target",
    LaunchLimit.LOWEST_PATH: "no flight to the target stays that low",
    LaunchLimit.HIGHEST_PATH: "no flight to the target at up to {speed:.4g} m/s gets that high",
    LaunchLimit.GROUND: "the flight would lead through the ground",
    LaunchLimit.ROLLING: "a slower ball stops before the target",
    LaunchLimit.SEARCH: "Newton's method finds no launch, though no limit is in the way",
    LaunchLimit.BOUNCE: "the place where the ball bounces jumps as its speed changes",
}
"""Why no launch within limits meets a goal, as the end of a sentence."""


class LaunchArc(StrEnum):
    """Which of two launches that meet a goal."""

    LOW = "low"
    HIGH = "high"


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Goal(ReprMixin):
    """A target, and one condition on the flight to it.

    There is a launch to the target for each time of flight; the condition selects among them. The
    ground is level, under the ball at its start, or under the target where that is lower.

    Args:
        target: position of the ball's centre at the target, from where it starts: a distance along
            x at the height of the launch [m], or a point, shape `(3,)` [m, world axes].
        time: time of the flight to the target, 1e-6 to 1000 [s].
        apex: largest height of the flight above the launch [m], reached before the target.
        speed: speed of the launch [m/s]; both a low and a high arc may have it.
        over: `(distance, height)` of a point of the flight, such as over a wall or under a bar:
            horizontal distance from the launch, along the line to the target, and the centre's
            height above the launch [m].
        beside: `(distance, left)` of a point of the flight seen from above, left of the line to the
            target [m]. It asks for spin, and comes on top of the others.
        spin: spin of the launch, shape `(3,)` [rad/s, world frame]. With `beside` it gives the axis
            only, and the size is sought.
        arc: `low` or `high`, where two launches meet the goal.
        receiver_velocity: velocity of a receiver who is at the target as the ball starts, at most
            100 m/s, shape `(3,)` [m/s]. The target is where ball and receiver meet.

    Raises:
        InvalidInput: a value out of range, none or two of time, apex, speed and over, a target
            straight above or below, or a point of the flight that is not before the target.
    """

    target: Array
    time: float | None
    apex: float | None
    speed: float | None
    over: tuple[float, float] | None
    beside: tuple[float, float] | None
    spin: Array
    arc: LaunchArc
    receiver_velocity: Array

    def __init__(
        self,
        target: ArrayLike,
        *,
        time: float | None = None,
        apex: float | None = None,
        speed: float | None = None,
        over: tuple[float, float] | None = None,
        beside: tuple[float, float] | None = None,
        spin: ArrayLike = (0.0, 0.0, 0.0),
        arc: str = LaunchArc.LOW,
        receiver_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        point = validation.floats("target", target, unit="m")
        if point.ndim == 0:
            point = np.array([validation.number("distance", target, above=0, unit="m"), 0.0, 0.0])
        if point.shape != (3,):
            raise InvalidInput(f"target has shape {point.shape}: it must be a distance or (3,)")
        level, size = math.hypot(point[0], point[1]), math.hypot(*point)
        if not size <= FARTHEST:
            raise InvalidInput(f"target is {size:g} m away: at most {FARTHEST:g} m")
        if not level >= max(1e-3 * size, 1e-6):
            where = "straight above or below the ball"
            raise InvalidInput(f"target is {point.tolist()}: it must not be {where}")
        named = {"time": time, "apex": apex, "speed": speed, "over": over}
        chosen = [name for name, value in named.items() if value is not None]
        if len(chosen) != 1:
            verb = "are" if chosen else "is"
            raise InvalidInput(
                f"{' and '.join(chosen) or 'nothing'} {verb} given in addition to the target: give "
                "one of time, apex, speed, over"
            )
        if time is not None:
            time = validation.number("time", time, at_least=1e-6, at_most=1e3, unit="s")
        if apex is not None:
            apex = validation.number("apex", apex, above=0, at_most=1e6, unit="m")
        if speed is not None:
            speed = validation.number("speed", speed, above=0, at_most=1e6, unit="m/s")
        running = validation.vector("receiver velocity", receiver_velocity, 3, unit="m/s")
        validation.number("speed of the receiver", math.hypot(*running), at_most=100, unit="m/s")
        vars(self).update(
            receiver_velocity=validation.read_only(running),
            target=validation.read_only(point),
            time=time,
            apex=apex,
            speed=speed,
            over=_checked_point("over", over, level),
            beside=_checked_point("beside", beside, level),
            spin=validation.read_only(validation.vector("spin", spin, 3, unit="rad/s")),
            arc=validation.choice("arc", arc, LaunchArc),
        )

    def __repr__(self) -> str:
        named = (f"{name}={value} {unit}".rstrip() for name, value, unit in self.named_values())
        return f"Goal({', '.join(named)})"

    def _rows(self) -> Iterable[Row]:
        yield from self.named_values()
        yield "distance", self.distance, "m"

    def named_values(self) -> Iterable[tuple[str, str, str]]:
        """Return name, value and unit of everything that is given."""
        units = {"target": "m", **CONDITIONS, "beside": "m"}
        for name, unit in units.items():
            value = getattr(self, name)
            if value is not None:
                value = np.array(value) if isinstance(value, tuple) else value
                yield name, format_value(value), unit
        if self.spin.any():
            yield "spin", format_value(self.spin), "rad/s"
        if self.arc != LaunchArc.LOW:
            yield "arc", self.arc, ""
        if self.receiver_velocity.any():
            yield "receiver_velocity", format_value(self.receiver_velocity), "m/s"

    def at(self, time: float) -> "Goal":
        """Return the goal of meeting the receiver at a time [s], a target at rest."""
        time = validation.number("time", time, unit="s")
        target = self.target + time * self.receiver_velocity
        return replace(self, target=target, receiver_velocity=np.zeros(3))

    def seen_from(self, moved: Array, delay: float) -> "Goal":
        """Return the same goal for a ball that starts elsewhere and later.

        The start is moved by a displacement, shape `(3,)` [m]; the delay [s] counts for a receiver
        who runs.
        """
        moved = validation.vector("moved", moved, 3, unit="m")
        delay = validation.number("delay", delay, unit="s")
        ahead, left, up = (float(moved @ axis) for axis in (self.ahead, self.left, UP))
        over, beside = self.over, self.beside
        return replace(
            self,
            target=self.target - moved + delay * self.receiver_velocity,
            apex=None if self.apex is None else self.apex - up,
            over=None if over is None else (over[0] - ahead, over[1] - up),
            beside=None if beside is None else (beside[0] - ahead, beside[1] - left),
        )

    @property
    def distance(self) -> float:
        """Horizontal distance to the target [m]."""
        return math.hypot(self.target[0], self.target[1])

    @property
    def ahead(self) -> Array:
        """Horizontal unit vector to the target, shape `(3,)`."""
        return np.array([self.target[0], self.target[1], 0.0]) / self.distance

    @property
    def left(self) -> Array:
        """Horizontal unit vector across, to the left of `ahead`, shape `(3,)`."""
        return np.array([-self.target[1], self.target[0], 0.0]) / self.distance

    @property
    def lowest(self) -> float:
        """Height above the launch at which the ball touches the ground [m], 0 or less."""
        return min(0.0, float(self.target[2]))

    @property
    def is_level(self) -> bool:
        """Whether the target, and a receiver, stay as high as the ball, but for rounding."""
        return is_level(self.target) and is_level(self.receiver_velocity)

    @property
    def kind(self) -> str:
        """Name of the condition: `time`, `apex`, `speed` or `over`."""
        return next(name for name in CONDITIONS if getattr(self, name) is not None)

    def nominal_times(self) -> list[float]:
        """Return the times of flight [s] that meet the goal in the vacuum, from Eqs. (24)-(25)."""
        rise, g, square = float(self.target[2]), GRAVITY, float(self.target @ self.target)
        if self.time is not None:
            return [self.time]
        if self.apex is not None:
            if self.apex < max(rise, 0.0):
                return []
            return [(math.sqrt(2 * g * self.apex) + math.sqrt(2 * g * (self.apex - rise))) / g]
        if self.over is not None:
            part = self.over[0] / self.distance
            squared_time = 2 * (self.over[1] - part * rise) / (g * part * (1 - part))
            return [math.sqrt(squared_time)] if squared_time > 0 else []
        assert self.speed is not None
        half = (self.speed**2 - g * rise) / 2
        root = half * half - (g / 2) ** 2 * square
        if root < 0 or half <= 0:
            return []
        high = half + math.sqrt(root)
        return [math.sqrt(square / high), math.sqrt(high / (g * g / 4))]


@dataclass(frozen=True, eq=False, repr=False)
class PlannedLaunch(ReprMixin):
    """A launch from the origin towards a goal: into the air or along the ground.

    Attributes:
        status: `met`; or `unreachable`, and this is the nearest launch there is.
        goal: the goal that was asked for; for a receiver who runs, the target where he is met.
        limit: reason why the goal is unreachable, see `LaunchLimit`; None if it is met.
        velocity: velocity of the launch, shape `(3,)` [m/s, world frame].
        spin: spin of the launch, shape `(3,)` [rad/s, world frame].
        ball: the ball.
        air: the air; None is the vacuum.
        time: time to the target, or until a ball that rolls comes to rest before it [s].
    """

    status: PlanStatus
    goal: Goal
    limit: LaunchLimit | None
    velocity: Array
    spin: Array
    ball: Ball
    air: Air | None
    time: float

    def __post_init__(self) -> None:
        freeze_arrays(vars(self))

    @property
    def speed(self) -> float:
        """Launch speed [m/s]."""
        return math.hypot(*self.velocity)

    @property
    def angle(self) -> float:
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


Planned = TypeVar("Planned", bound=PlannedLaunch)


def meet_receiver(goal: Goal, plan: Callable[[Goal], Planned]) -> Planned:
    """Return the launch towards a receiver who runs, by the secant method on the time of meeting.

    `plan` returns the launch that meets a target at rest.

    Raises:
        InvalidInput: the ball does not catch up with the receiver.
    """
    if goal.time is not None:
        return plan(goal.at(goal.time))
    times, delays = [0.0], []
    for _ in range(MOST_MEETINGS):
        launch = plan(goal.at(times[-1]))
        if launch.limit is not None:
            return launch
        delays.append(launch.time - times[-1])
        if abs(delays[-1]) <= SAME_TIME * launch.time:
            return launch
        step = delays[-1]
        if len(delays) > 1 and delays[-1] != delays[-2]:
            step *= (times[-1] - times[-2]) / (delays[-2] - delays[-1])
        times.append(times[-1] + step)
        if not 0.0 <= times[-1] <= LONGEST_MEETING:
            break
    raise InvalidInput(
        f"the ball does not meet a receiver who runs at {math.hypot(*goal.receiver_velocity):g} "
        f"m/s within {LONGEST_MEETING:g} s: give another velocity or condition"
    )


def is_level(vector: Array) -> bool:
    """Return whether a vector is horizontal, but for rounding."""
    return abs(float(vector[2])) <= 1e-12 * float(np.linalg.norm(vector))


def nominal_velocity(target: Array, time: float) -> Array:
    r"""Return the launch velocity in the vacuum, :math:`v = x / t + \tfrac12 g t\, e_z` [m/s]."""
    return np.asarray(target / time + np.array([0.0, 0.0, GRAVITY * time / 2]))


def _checked_point(name: str, value: object, level: float) -> tuple[float, float] | None:
    if value is None:
        return None
    pair = validation.vector(name, value, 2, unit="m")  # type: ignore[arg-type]
    if not 0 < pair[0] < level:
        raise InvalidInput(
            f"{name} is at {pair[0]:g} m: it must be between the ball and the target, which is "
            f"{level:g} m away"
        )
    return float(pair[0]), float(pair[1])
