r"""A meeting with a ball that moves, and how exact perception and timing must be for it.

The foot's velocity and normal follow from the launch as for a ball at rest, with the impulse
:math:`p = m (v_b - v_0)` and with the velocity of the ball's surface added to the foot's.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.flight.derivatives import fly_with_slopes
from kickdyn.flight.follow import Course
from kickdyn.ground import Ground
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.plane import Plane
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import SHORTEST_COURSE, IncomingBall

TIME_BEYOND = 1e-3
"""Time after the meeting for which the ball is followed, in derivatives of the landing [s]."""

INCREMENT = 1e-5
"""Of time [s], velocity [m/s] and place [m], in derivatives of the landing."""

ACCURACY, LARGEST_ERROR = 0.1, 10.0
"""Distance at the target for which the exactness of timing and perception is stated [m], and error
of time [s], velocity [m/s] or place [m] from which on it counts as without effect."""


class LandingSlopes(NamedTuple):
    """Derivatives of where the ball meets the plane of the target, shapes `(3,)` and `(3, 3)`.

    Attributes:
        time: by the time of the foot's motion, at a ball that comes as planned [m/s].
        velocity: by the velocity of the ball at the time of `incoming` [s].
        place: by its position then.
    """

    time: Array
    velocity: Array
    place: Array

    @property
    def tolerances(self) -> tuple[float, float, float]:
        """Errors of time [s], velocity [m/s] and place [m] that each move the landing by 10 cm.

        One above `LARGEST_ERROR` is infinite, such as of the time in which a ball at rest is met.
        """
        time, velocity, place = (error_that_matters(slope) for slope in self)
        return time, velocity, place


def error_that_matters(slope: Array) -> float:
    """Return the error that moves the landing by 10 cm, from derivatives of the landing by it."""
    size = float(np.linalg.norm(slope, 2))
    return ACCURACY / size if size > ACCURACY / LARGEST_ERROR else math.inf


class Arrival(NamedTuple):
    """The path of a ball before it is kicked, and the time for which it takes it [s]."""

    course: Course
    wait: float

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at times from the kick, 0 or before: `-wait` at least."""
        return self.course.sample(np.clip(np.asarray(t) + self.wait, 0.0, self.course.duration))


@dataclass(frozen=True, eq=False, repr=False)
class Meeting(ReprMixin):
    """A time at which a moving ball can be met, and the kick that is planned for it.

    Attributes:
        ball: the ball just before the contact; its time is by the clock of `incoming`.
        incoming: the ball as it was seen, with its ground.
        goal: the goal, seen from where the ball is met; of a trap, the motion that is wished.
        air: the air; None is the vacuum.
        impact: the kick; None if there is none.
        share: share of the change of velocity that is reached; 0 without a kick.
        speed_use: largest joint speed over its limit; nan without a kick.
        reason: why there is no kick, or which bodies collide in it, where another one is preferred.
    """

    ball: BallState
    incoming: IncomingBall
    goal: Goal | BallState
    air: Air | None
    impact: Impact | None = None
    share: float = 0.0
    speed_use: float = math.nan
    reason: str = ""

    def _rows(self) -> Iterable[Row]:
        yield "time", self.time, "s"
        yield "place", self.ball.position, "m"
        if self.impact is None:
            yield "no kick", self.reason, ""
        else:
            yield "share of the change of velocity", self.share, ""
            yield "share of the speed limit", self.speed_use, ""

    @property
    def time(self) -> float:
        """When the ball is met, by the clock of `incoming` [s]."""
        return float(self.ball.time)

    @property
    def wait(self) -> float:
        """Time from `incoming` to the meeting [s]."""
        return self.time - float(self.incoming.state.time)

    @property
    def ground(self) -> Ground:
        """The ground on which the ball came."""
        assert self.incoming.ground is not None
        return self.incoming.ground

    @cached_property
    def landing_slopes(self) -> LandingSlopes | None:
        r"""Derivatives of the landing by timing and perception, of a flight; None without a kick.

        The contact point of the foot moves on at its velocity w, and the ball as it comes. They
        touch where their distance is the radius, so that an error :math:`\delta x` of the ball's
        place turns the normal n: with :math:`u = v_0 - w`,

        .. math:: \delta n = \frac1r \Bigl(I - \frac{u\, n^T}{n \cdot u}\Bigr)\, \delta x .

        The impact with this normal gives the launch of the flight that is differentiated.
        """
        if self.impact is None or self.share < 1.0 or not isinstance(self.goal, Goal):
            return None
        incoming, impact, air = self.incoming, self.impact, self.air
        ball, contact, seen = impact.ball, impact.contact, incoming.state
        wait = self.wait
        lies = float(seen.position[2]) - ball.radius - self.ground.height < 1e-6
        vertical = 0.0 if lies else 1.0
        free = np.array([1.0, 1.0, 1.0, vertical, 1.0, 1.0, vertical])
        foot, velocity = impact.posture.contact_point, impact.foot_velocity

        def launch(change: Array) -> tuple[BallState, Air | None]:
            change = free * change  # a ball stays on the ground on which it rolls
            place, moves = seen.position + change[4:], seen.velocity + change[1:4]
            state = BallState(place, moves, seen.spin, seen.time)
            course = replace(incoming, state=state).course(ball, air, wait + TIME_BEYOND)

            def path(t: float) -> BallState:
                """Return the ball, straight on beyond the ends of its path."""
                inside = min(max(t, 0.0), course.duration)
                ball = course.sample(inside)
                place = ball.position + (t - inside) * ball.velocity
                return BallState(place, ball.velocity, ball.spin)

            def gap(t: float) -> float:
                apart = path(t).position - foot - velocity * (t - wait - change[0])
                return math.hypot(*apart) - ball.radius

            width = 4e-4 + 4.0 * float(np.abs(change).max()) * (1.0 + wait)
            t = float(brentq(gap, wait - width, wait + width, xtol=1e-15, rtol=1e-14))
            before = path(t)
            normal = before.position - foot - velocity * (t - wait - change[0])
            hit = strike(
                impact.posture, impact.v_before, ball, replace(contact, normal=normal),
                ball_velocity=before.velocity, ball_spin=before.spin,
            )  # fmt: skip
            after = hit.ball_after
            return BallState(before.position, after.velocity, after.spin), air

        plane = Plane(self.ball.position + self.goal.target, -self.goal.ahead, "centre")
        steps = np.full(7, INCREMENT)
        flight = fly_with_slopes(launch, np.zeros(7), steps, ball, plane, central=True)
        slopes, _ = flight.slopes_at_plane(plane.normal, flight.end)
        return LandingSlopes(slopes[:, 0], slopes[:, 1:4], slopes[:, 4:])


def arrival_of(meeting: Meeting, ball: Ball) -> Arrival:
    """Return the path of the ball from where it was seen to where it is met."""
    wait = meeting.wait
    return Arrival(meeting.incoming.course(ball, meeting.air, max(wait, SHORTEST_COURSE)), wait)


COLOURS = "tab:blue", "tab:orange"
"""Of speed use and of tolerances."""


@styled()
def meeting_figure(plan: Any) -> Any:
    """Draw speed use and tolerance of timing by meetings of a `KickPlan`, and errors of 10 cm."""
    from matplotlib.figure import Figure

    kicks = [meeting for meeting in plan.meetings if meeting.impact is not None]
    times = [meeting.time for meeting in kicks]
    slopes = [meeting.landing_slopes for meeting in kicks]
    exact = [math.nan if slope is None else 1e3 * slope.tolerances[0] for slope in slopes]
    slope, goal = plan.meeting.landing_slopes, plan.goal
    figure = Figure(figsize=(9.0, 4.0))
    left, right = figure.subplots(1, 2)
    left.axvline(plan.meeting.time, color="0.6", linewidth=1, linestyle=":")
    left.set_xlabel("time of the meeting [s], dotted: planned")
    uses = [100 * meeting.speed_use for meeting in kicks]
    drawn = [(left, uses, COLOURS[0], "speed, % of its limit")]
    if slope is not None:
        label = "foot late for 10 cm at the target [ms]"
        drawn.append((left.twinx(), exact, COLOURS[1], label))
    for axes, values, colour, label in drawn:
        axes.plot(times, values, "o-", color=colour)
        axes.set_ylabel(label, color=colour)
        axes.set_ylim(0.0, 1.1 * max([0.1, *(value for value in values if math.isfinite(value))]))
        axes.grid(visible=axes is left)
    if slope is None or not isinstance(goal, Goal):  # of a trap, a pass or half a kick
        right.remove()
        return figure
    turn = np.linspace(0.0, 2.0 * math.pi, 100)
    right.plot(10 * np.cos(turn), 10 * np.sin(turn), color="0.6")
    errors = _errors(plan.meeting.ball.velocity, goal.ahead, slope)
    for number, (name, derivative, size) in enumerate(errors):
        end = 100 * size * np.array([-(goal.left @ derivative), derivative[2]])
        right.plot([0.0, end[0]], [0.0, end[1]], "-o", linewidth=6.0 - 1.5 * number, label=name)
    right.set_aspect("equal", adjustable="datalim")
    right.set_xlabel("to the right of the target [cm]")
    right.set_ylabel("above it [cm]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _errors(
    velocity: Array, to_target: Array, slopes: LandingSlopes
) -> Iterator[tuple[str, Array, float]]:
    """Yield errors that move the landing by 10 cm: name, slope and size.

    The ball's `velocity` is ahead, or of a ball at rest, the direction to the target.
    """
    ahead = velocity / np.linalg.norm(velocity) if velocity.any() else to_target
    left = np.array([-ahead[1], ahead[0], 0.0])
    for derivative, factor, text in (
        (slopes.time, 1e3, "foot {:.2g} ms late"),
        (slopes.place @ ahead, 1e3, "ball {:.2g} mm ahead of where it was seen"),
        (slopes.place @ left, 1e3, "ball {:.2g} mm to the left of there"),
        (slopes.velocity @ ahead, 1e3, "ball {:.3g} mm/s faster than seen"),
    ):
        size = error_that_matters(derivative)
        if math.isfinite(size):
            yield text.format(factor * size), derivative, size
