"""What a kick meets on a pitch: a wall of players, a goal."""

from __future__ import annotations

import math
from typing import NamedTuple

from scipy.optimize import brentq

from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course
from kickdyn.planning.goal import PlanStatus
from kickdyn.planning.kick import KickPlan

OVER = 0.1
"""Clearance of the ball's lower edge over a wall where nothing else is asked for [m]."""

MOUTH = (7.32, 2.44)
"""Width between the posts of a goal and height under its bar [m]: IFAB, Laws of the Game, Law 1."""

FRAME = 0.12
"""Largest width of its posts and its bar [m], ibid."""

ENDS = {
    "short": "does not come to the goal",
    "over": "goes over the bar",
    "beside": "goes beside the post",
    "bar": "hits the bar",
    "post": "hits the post",
}
"""Sentences for the ends of a ball that does not go in."""


class Wall(NamedTuple):
    """A wall across the line to the target, its middle on it; all in m, heights from the ground."""

    distance: float
    height: float
    width: float = 2.5  # of five players

    @classmethod
    def read(cls, text: str) -> Wall:
        """Return the wall that DISTANCE:HEIGHT or DISTANCE:HEIGHT:WIDTH stands for."""
        parts = text.split(":")
        if len(parts) not in (2, 3):
            raise InvalidInput(f"wall is {text!r}: it must be DISTANCE:HEIGHT or with :WIDTH [m]")
        try:
            values = [float(part) for part in parts]
        except ValueError:
            raise InvalidInput(f"wall is {text!r}: it must be numbers, as 9.15:1.9") from None
        for name, value in zip(cls._fields, values, strict=False):
            validation.number(f"{name} of the wall", value, above=0, unit="m")
        return cls(*values)

    def check_before(self, distance: float) -> None:
        """Raise `InvalidInput` for a wall that is not before a target so far away [m]."""
        if not self.distance < distance:
            raise InvalidInput(
                f"wall is at {self.distance:g} m: it must be between the ball and the target, "
                f"which is {distance:g} m away"
            )

    def clearance(self, plan: KickPlan) -> tuple[float, float, float] | None:
        """Return how the ball passes the wall [m]; None where it comes down before.

        How far its lower edge is above the wall and its side beside it, both below 0 where it is
        not, and how far its centre is to the left of the wall's middle.
        """
        goal, path, radius = plan.goal, plan.path, plan.impact.ball.radius
        start = path.launch.position

        def beyond(time: float) -> float:
            return float(goal.ahead @ (path.sample(time).position - start)) - self.distance

        if beyond(path.duration) < 0.0:
            return None
        passed = path.sample(float(brentq(beyond, 0.0, path.duration))).position - start
        left = float(goal.left @ passed)
        return float(passed[2]) - self.height, abs(left) - self.width / 2 - radius, left

    def describe_passage(self, plan: KickPlan) -> str:
        """Return by how much the ball clears the wall, as a sentence.

        Raises:
            InvalidInput: it does not; with the options of `kickdyn plan` that ask for more.
        """
        self.check_before(plan.goal.distance)
        clear = self.clearance(plan)
        if clear is None:
            return "The ball comes down before the wall."
        above, beside, left = clear
        if above > 0.0:
            return f"Its lower edge clears the wall by {above:.3g} m."
        if beside > 0.0:
            side = "left" if left > 0.0 else "right"
            return f"It passes {beside:.3g} m {side} of the wall."
        met = plan.status == PlanStatus.MET
        weak = "" if met else "the kick is beyond the leg's limits, and "
        message = (
            f"{weak}the ball hits the wall, {-above:.3g} m under its top and {-beside:.3g} m "
            "inside its edge"
        )
        if not isinstance(plan.path, Course):
            kind = {"speed": "launch-speed"}.get(plan.goal.kind, plan.goal.kind)
            instead = "" if kind == "over" else f" in place of --{kind}"
            edge = math.ceil(1e3 * (self.width / 2 + plan.impact.ball.radius + OVER)) / 1e3
            message += (
                f": ask for --over {self.distance:g}:{self.height + OVER:g}{instead}, or "
                f"for --beside {self.distance:g}:{math.copysign(edge, left + 1e-6):g}"
            )
        raise InvalidInput(message)


class Score(NamedTuple):
    """How a kick meets the goal straight ahead at the target's distance.

    Attributes:
        end: `in` or `short`; `over` the bar, `beside` the post; or `bar` or `post`, which it hits.
        post: from the ball's side to the nearer post [m]; below 0 beyond it.
        bar: from its upper edge up to the bar [m], likewise.
    """

    end: str
    post: float
    bar: float

    def __str__(self) -> str:
        """Say in a sentence whether the ball goes in."""
        if self.end == "in":
            return (
                f"It goes in, {self.post:.3g} m from the post and {self.bar:.3g} m under the bar."
            )
        return f"It {ENDS[self.end]}."


def score(plan: KickPlan) -> Score:
    """Return how a kick meets the goal."""
    radius, path = plan.impact.ball.radius, plan.path
    moved = path.sample(path.duration).position - path.launch.position
    ahead, left, up = moved.tolist()
    post = MOUTH[0] / 2 - abs(left) - radius
    bar = MOUTH[1] - up - 2 * radius
    if plan.goal.target[0] - ahead > 1e-3 or up <= -radius:
        return Score("short", post, bar)
    if min(post, bar) >= 0.0:
        return Score("in", post, bar)
    missed = post if bar >= 0.0 else bar if post >= 0.0 else min(post, bar)
    clear = missed < -2 * radius - FRAME
    ends = ("post", "beside") if missed == post else ("bar", "over")
    return Score(ends[clear], post, bar)
