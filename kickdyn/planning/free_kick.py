"""What a kick meets on a pitch: a wall of players, a goal."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick_plan import KickPlan

OVER = 0.1
"""How far the ball's lower edge clears a wall where nothing else is asked for [m]."""

WIDTH = 2.5
"""Of a wall of five, half a metre each [m]."""

MOUTH = (7.32, 2.44)
"""Of a goal, between the posts and under the bar [m]: IFAB, Laws of the Game, Law 1."""

FRAME = 0.12
"""Width of its posts and its bar, at most, there [m]."""


class Wall(NamedTuple):
    """A wall across the line to the target, its middle on it; all in m, heights from the ground."""

    distance: float
    height: float
    width: float = WIDTH

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
        for name, value in zip(("distance", "height", "width"), values, strict=False):
            validation.number(f"{name} of the wall", value, above=0, unit="m")
        return cls(*values)

    def check_before(self, distance: float) -> None:
        """Raise `InvalidInput` for a wall that is not before a target so far away [m]."""
        if not self.distance < distance:
            raise InvalidInput(
                f"wall is at {self.distance:g} m: it must be between the ball and the target, "
                f"which is {distance:g} m away"
            )

    def clearance(self, planned: KickPlan) -> tuple[float, float, float] | None:
        """Return how the ball passes the wall [m]; None where it comes down before.

        By how much its lower edge is above the wall, and its side beside it, both below 0 where it
        is not, and where its centre is to the left of the wall's middle.
        """
        goal, path, radius = planned.goal, planned.path, planned.hit.ball.radius
        start = path.launch.position

        def short(time: float) -> float:
            return float(goal.ahead @ (path.sample(time).position - start)) - self.distance

        if short(path.duration) < 0.0:
            return None
        where = path.sample(float(brentq(short, 0.0, path.duration))).position - start
        aside = float(np.cross((0.0, 0.0, 1.0), goal.ahead) @ where)
        return float(where[2]) - self.height, abs(aside) - self.width / 2 - radius, aside

    def passed(self, planned: KickPlan, kick: Callable[[Goal], KickPlan]) -> str:
        """Return by how much the ball clears the wall, as a sentence.

        Args:
            planned: the kick.
            kick: plans another, to see what would clear the wall where this does not.

        Raises:
            InvalidInput: it does not.
        """
        self.check_before(planned.goal.distance)
        clear = self.clearance(planned)
        if clear is None:
            return "The ball comes down before the wall."
        above, room, aside = clear
        if above > 0.0:
            return f"Its lower edge clears the wall by {above:.3g} m."
        if room > 0.0:
            side = "left" if aside > 0.0 else "right"
            return f"It passes {room:.3g} m {side} of the wall."
        weak = "" if planned.status == "met" else "the kick is beyond the leg's limits, and "
        raise InvalidInput(
            f"{weak}the ball hits the wall, {-above:.3g} m under its top and {-room:.3g} m inside "
            f"its edge: {self._way_round(planned, aside, kick)}"
        )

    def _way_round(self, planned: KickPlan, aside: float, kick: Callable[[Goal], KickPlan]) -> str:
        """Return which of a higher and a curved kick to the same target the leg has."""
        if isinstance(planned.path, Course):
            return "along the ground there is no way round it"
        goal, radius = planned.goal, planned.hit.ball.radius
        over = (self.distance, round(self.height + OVER, 6))
        room = math.ceil(1e3 * (self.width / 2 + radius + OVER)) / 1e3
        beside = (self.distance, -room if aside < -1e-6 else room)
        named = {goal.kind: getattr(goal, goal.kind)}
        option = {"speed": "--launch-speed"}.get(goal.kind, f"--{goal.kind}")
        instead = "" if goal.kind == "over" else f" in place of {option}"
        ways = {
            f"over it (--over {over[0]:g}:{over[1]:g}{instead})": {"over": over},
            f"beside it (--beside {beside[0]:g}:{beside[1]:g})": {**named, "beside": beside},
        }
        can = list[str]()
        for said, wish in ways.items():
            with suppress(InvalidInput):
                if kick(Goal(goal.target, **wish)).status == "met":
                    can.append(said)
        if not can:
            return f"{planned.leg.name} has no kick over or beside it either"
        return f"go {' or '.join(can)}"


MISSES = {
    "short": "does not come to the goal",
    "over": "goes over the bar",
    "beside": "goes beside the post",
    "bar": "hits the bar",
    "post": "hits the post",
}
"""What is said of a ball that does not go in, by its end."""


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


def score(planned: KickPlan) -> Score:
    """Return how a kick meets the goal."""
    radius = planned.hit.ball.radius
    start, end = planned.path.launch.position, planned.path.sample(planned.path.duration).position
    _, left, up = end - start
    short = planned.goal.target[0] - (end - start)[0] > 1e-3 or up <= -radius
    post = MOUTH[0] / 2 - abs(float(left)) - radius
    bar = MOUTH[1] - float(up) - 2 * radius
    missed = post if bar >= 0.0 else bar if post >= 0.0 else min(post, bar)
    clear = missed < -2 * radius - FRAME
    aside = missed == post
    out = ("beside" if aside else "over") if clear else "post" if aside else "bar"
    return Score("short" if short else "in" if min(post, bar) >= 0.0 else out, post, bar)


def scored(planned: KickPlan) -> str:
    """Return whether a kick ends in the goal straight ahead at the target's distance."""
    found = score(planned)
    if found.end == "in":
        return f"It goes in, {found.post:.3g} m from the post and {found.bar:.3g} m under the bar."
    return f"It {MISSES[found.end]}."
