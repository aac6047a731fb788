"""A ball that moves, and where a leg can meet it.

The ball's path before the kick is followed through the air, bounces and along the ground. Each
meeting is one time on this path.
"""

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground
from kickdyn.planning.goal import is_level
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.standing import (
    StandingRobot,
    foot_directions,
    is_floating,
    kicking_chain,
    rest_configuration,
    vertical_plane,
)

FASTEST_BALL = 100.0
"""Largest speed of a ball that is met [m/s]."""

LONGEST_WAIT, SHORTEST_COURSE = 10.0, 1e-6
"""Times after which a ball is no longer waited for, and for which it is followed at least [s]."""

SAMPLES, CANDIDATES = 400, 7
"""Numbers of times at which the path is compared with the reach of the leg, and of those in reach
for which a kick is sought."""

DRAWN_REACH, BEYOND_REACH = 200, 1.1
"""Number of postures from which the reach of a leg is estimated, and distance over this reach up to
which a kick is sought for a meeting that is chosen."""

BESIDE, IN_GROUND = 1e-6, 1e-3
"""Distance from the plane in which a foot moves up to which a ball is in it, and depth in the
ground up to which a ball lies on it [m]."""

FOLLOW_TOL = 1e-12
"""Relative tolerance of the ball's path before it is met."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class IncomingBall(ReprMixin):
    """A ball that moves before it is kicked.

    Args:
        state: where the ball is and how it moves at its time, at up to 100 m/s.
        ground: the ground with its surface. Without it, it is level turf: z = 0 for a robot on a
            floating base; for a leg on a fixed one, under a ball without vertical velocity, else
            under the foot of the straight leg, or under the ball or bodies that the kick does not
            move (the other foot of a robot), where these are lower.
        meet_at: when the ball is met, by the clock of `state.time` [s]; or where its centre then
            is, shape `(3,)` [m, world frame], a point of its path within 1 cm. None leaves it free.

    Raises:
        InvalidInput: several states, a ball that is faster or under its ground, or a time before
            the state.
    """

    state: BallState
    ground: Ground | None
    meet_at: float | Array | None

    def __init__(
        self, state: BallState, ground: Ground | None = None, meet_at: "ArrayLike | None" = None
    ) -> None:
        validation.check_type(BallState, state=state)
        validation.check_type(Ground, type(None), ground=ground)
        if np.ndim(state.time):
            raise InvalidInput("incoming has several states: it must be one BallState")
        speed, most = state.speed, FASTEST_BALL
        validation.number("speed of the incoming ball", speed, at_most=most, unit="m/s")
        place: float | Array | None = None
        if meet_at is not None:
            point = validation.floats("meet_at", meet_at, unit="s, of a place m")
            if point.shape not in ((), (3,)):
                raise InvalidInput(f"meet_at has shape {point.shape}: it must be a number or (3,)")
            place = point if point.shape else float(point)
            if isinstance(place, float) and place < state.time:
                raise InvalidInput(
                    f"meet_at is {place:g} s: it must be at least {state.time:g} s, the time of "
                    "the incoming ball"
                )
        vars(self).update(state=state, ground=ground, meet_at=place)

    def _rows(self) -> Iterable[Row]:
        yield "position", self.state.position, "m"
        yield "velocity", self.state.velocity, "m/s"
        yield "spin", self.state.spin, "rad/s"

    @validation.check_arguments
    def on_ground_of(self, leg: Leg, ball: Ball) -> "IncomingBall":
        """Return the same ball with its ground, which has a surface."""
        ground = self.ground
        lowest = float(self.state.position[2]) - ball.radius
        if ground is None:
            height = lowest
            if is_floating(leg):
                height = 0.0
            elif not is_level(self.state.velocity):
                height = min(_level_under(leg), lowest)
            ground = Ground(height, "turf")
        elif ground.surface is None:
            raise InvalidInput("the ground has no surface: name one, Ground(surface='turf')")
        if lowest < ground.height - IN_GROUND:
            raise InvalidInput(
                f"the incoming ball is {ground.height - lowest:.3g} m in the ground: its centre is "
                f"at z = {self.state.position[2]:.4g} m, and on the ground it is at "
                f"{ground.height + ball.radius:.4g} m"
            )
        return IncomingBall(self.state, ground, self.meet_at)

    @validation.check_arguments
    def course(self, ball: Ball, air: Air | None, longest: float = LONGEST_WAIT) -> Course:
        """Return the path of the ball if nobody kicks it, each part for a longest time [s]."""
        return follow(self.state, ball, air, self.ground, FOLLOW_TOL, time_limit=longest)


def _level_under(leg: Leg) -> float:
    """Return the height of the straight leg's foot, or of the lowest body beside the leg [m]."""
    model, level = leg.model, float(leg.posture(leg.configuration()).contact_point[2])
    limb = set(model.subtrees[model.supports[leg.contact_joint][1]])
    depths, frames = find_depths(leg, rest_configuration(leg), level), frames_by_name(model)
    beside = [
        depth for name, depth in depths.items()
        if model.frames[frames[name]].parentJoint not in limb
    ]  # fmt: skip
    return level - max(beside, default=0.0)


def state_at(incoming: IncomingBall, course: Course, wait: float) -> BallState:
    """Return the ball a while after it was seen, with the clock of `incoming`."""
    state = course.sample(wait)
    clock = float(incoming.state.time) + wait
    return BallState(state.position, state.velocity, state.spin, clock)


class Reach(NamedTuple):
    """The points at which the foot of a leg can be, roughly."""

    centre: Array  # about which the limb turns, shape `(3,)` [m]
    radius: float  # largest distance of the ball's centre from there [m]
    # horizontal normal of the plane in which the foot of a leg moves that is turned towards the
    # launch, shape `(3,)`; None of another leg
    across: Array | None
    beside: float  # distance of the plane from the vertical axis about which it is turned [m]


def reach_of(leg: Leg, ball: Ball) -> Reach:
    """Return the reach of a leg, by postures that are drawn with a fixed seed."""
    limb = StandingRobot(leg).leg if is_floating(leg) else leg
    chain = kicking_chain(limb, branches=True).leg
    draw = np.random.default_rng(0)
    lower, upper = np.maximum(chain.lower, -math.pi), np.minimum(chain.upper, math.pi)
    drawn = [chain.posture(draw.uniform(lower, upper)) for _ in range(DRAWN_REACH)]
    points = np.array([posture.contact_point for posture in drawn])
    model = kicking_chain(limb).leg.model
    centre = np.array(model.jointPlacements[1].translation)
    radius = float(np.linalg.norm(points - centre, axis=1).max()) + ball.radius
    normal = vertical_plane(foot_directions(drawn))
    return Reach(centre, radius, normal, 0.0 if normal is None else float(normal @ points[0]))


def waits_in_reach(
    incoming: IncomingBall,
    course: Course,
    reach: Reach,
    radius: float,
    changes: Callable[[Array], Array],
    escaping: Callable[[float], str],
) -> Array:
    """Return the times since the ball was seen at which a kick is tried, shape `(n,)` [s].

    Args:
        incoming: the ball.
        course: its path.
        reach: of the leg.
        radius: of the ball [m].
        changes: function of times, shape `(n,)` [s], that returns how a kick changes the ball's
            velocity, shape `(n, 3)` [m/s], which may be inexact between some of the times.
        escaping: function of a time [s] that returns how the ball escapes, to end a sentence.

    Raises:
        InvalidInput: the ball is never within reach, or only behind the leg, or not at `meet_at`.
    """
    times = _times_on_path(incoming, course, reach, radius)
    states = course.sample(times)
    offsets = np.asarray(states.position) - reach.centre
    distances = np.linalg.norm(offsets, axis=1)
    chosen = incoming.meet_at is not None
    reachable = distances <= (BEYOND_REACH if chosen else 1.0) * reach.radius
    if not reachable.any():
        nearest = int(np.argmin(distances))
        when = f"{times[nearest]:.3g} s after it was seen, {distances[nearest]:.3g} m from the hip"
        never = "is out of reach at meet_at: it is then, " if chosen else (
            "never comes within reach: it is nearest "
        )  # fmt: skip
        raise InvalidInput(f"the ball {never}{when}, and the leg reaches {reach.radius:.3g} m")
    within = np.flatnonzero(reachable)
    ahead, offsets = _facing(changes(times[within]), reach), offsets[within]
    behind = -np.einsum("ij,ij->i", ahead, offsets)
    inside = np.flatnonzero(behind <= radius)
    if not inside.size:
        least = int(np.argmin(behind))
        facing = " of a leg that faces along the change of the ball's velocity"
        facing = "" if reach.across is None else facing
        where = "behind the leg at meet_at" if chosen else "within reach only behind the leg"
        wait = float(times[within[least]])
        raise InvalidInput(
            f"the ball is {where}: it is {behind[least]:.3g} m behind the hip{facing}, "
            f"{wait:.3g} s after it was seen{escaping(wait)}"
        )
    tried = times[within[inside]]
    if tried.size <= CANDIDATES:
        return tried
    elapsed = np.cumsum(np.gradient(times)[within[inside]])  # without times out of reach
    parts = np.linspace(elapsed[0], elapsed[-1], CANDIDATES + 2)[1:-1]
    return np.asarray(np.interp(parts, elapsed, tried))


def _times_on_path(incoming: IncomingBall, course: Course, reach: Reach, radius: float) -> Array:
    """Return the times since the ball was seen that are compared with the reach [s].

    It is the only one if the ball has `meet_at`.
    """
    last = min(course.duration, LONGEST_WAIT)
    if isinstance(incoming.meet_at, float):
        wait = incoming.meet_at - float(incoming.state.time)
        if wait > last:
            rests = ", when the ball comes to rest" if course.status == "at-rest" else ""
            raise InvalidInput(
                f"meet_at is {incoming.meet_at:g} s: it must be at most "
                f"{float(incoming.state.time) + last:g} s{rests}"
            )
        return np.array([wait])
    times = np.linspace(0.0, last, SAMPLES if last > 0.0 else 1)
    places = np.asarray(course.sample(times).position)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    distances = np.linalg.norm(places - reach.centre, axis=1)
    reachable = np.minimum(distances[:-1], distances[1:]) <= reach.radius + steps
    far = np.flatnonzero(reachable & (steps > 2.0 * radius))
    if far.size:  # a fast ball goes no far way between times where it may be within reach
        times = np.union1d(times, np.linspace(times[far[0]], times[far[-1] + 1], SAMPLES))
    if incoming.meet_at is None:
        return times
    return np.array([_passing(course, times, np.asarray(incoming.meet_at))])


def _facing(changes: Array, reach: Reach) -> Array:
    """Return directions in which the leg faces balls, horizontal unit vectors, shape `(n, 3)`.

    It is x, or, of a leg that is turned, the direction of the change of velocity.
    """
    if reach.across is None:
        return np.broadcast_to([1.0, 0.0, 0.0], changes.shape)
    level = changes * np.array([1.0, 1.0, 0.0])
    return np.asarray(level / np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-300))


def _passing(course: Course, times: Array, point: Array) -> float:
    """Return when the ball is nearest to a point [s]; it must be within 1 cm of it."""

    def receding(t: float) -> float:
        """Return half the derivative of the squared distance from the point by time [m2/s]."""
        ball = course.sample(t)
        return float((ball.position - point) @ ball.velocity)

    nearest = int(np.argmin(np.linalg.norm(course.sample(times).position - point, axis=1)))
    wait = float(times[nearest])
    low, high = times[max(nearest - 1, 0)], times[min(nearest + 1, len(times) - 1)]
    if receding(low) < 0.0 < receding(high):
        wait = float(brentq(receding, low, high, xtol=1e-12))
    missed = math.dist(course.sample(wait).position, point)
    if missed > 0.01:
        raise InvalidInput(
            f"meet_at is {point.tolist()} m: the ball passes it at a distance of {missed:.3g} m, "
            f"after {wait:.3g} s; it must be within 0.01 m of the path"
        )
    return wait


def waits_in_plane(waits: Array, aside: Callable[[float], float]) -> Array:
    """Return the times [s] at which the ball is in the plane of a leg that is turned to the launch.

    `aside` is the distance of the ball beside the plane at one of the times within reach [m]; nan
    without a launch. If the ball is never in the plane, no time is returned.
    """
    gaps = np.array([aside(t) for t in waits.tolist()])
    roots = waits[np.abs(gaps) <= BESIDE].tolist()
    if len(roots) == len(waits) or np.isnan(gaps).all():
        return waits
    for (t, gap), (then, other) in pairwise(zip(waits.tolist(), gaps.tolist(), strict=True)):
        if gap * other < 0.0 and min(abs(gap), abs(other)) > BESIDE:
            with suppress(ValueError, KickdynError):
                roots.append(float(brentq(aside, t, then, xtol=1e-12)))
    return np.array(sorted(roots))
