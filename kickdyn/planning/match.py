"""What a kick meets on a pitch: a wall of players, a goal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from kickdyn import checks
from kickdyn.errors import InvalidInput
from kickdyn.planning.kick_answer import KickPlan

OVER = 0.1
"""How far the ball's lower edge clears a wall where nothing else is asked for [m]."""

WIDTH = 2.5
"""Of a wall of five, half a metre each [m]."""

MOUTH = (7.32, 2.44)
"""Of a goal, between the posts and under the bar [m]: IFAB, Laws of the Game, Law 1."""


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
            checks.number(f"{name} of the wall", value, above=0, unit="m")
        return cls(*values)

    def passed(self, planned: KickPlan) -> str:
        """Return by how much the ball clears the wall, as a sentence.

        Raises:
            InvalidInput: it does not, though it meets its goal.
        """
        goal, path, radius = planned.goal, planned.path, planned.hit.struck.radius
        if not 0.0 < self.distance < goal.distance:
            raise InvalidInput(
                f"wall is at {self.distance:g} m: it must be between the ball and the target, "
                f"which is {goal.distance:g} m away"
            )
        start = path.launch.position

        def short(time: float) -> float:
            return float(goal.ahead @ (path.sample(time).position - start)) - self.distance

        if short(path.duration) < 0.0:
            return "The ball comes down before the wall."
        where = path.sample(float(brentq(short, 0.0, path.duration))).position - start
        aside = float(np.cross((0.0, 0.0, 1.0), goal.ahead) @ where)
        above, room = float(where[2]) - self.height, abs(aside) - self.width / 2 - radius
        if above > 0.0:
            return f"Its lower edge clears the wall by {above:.3g} m."
        if room > 0.0:
            side = "left" if aside > 0.0 else "right"
            return f"It passes {room:.3g} m {side} of the wall."
        if planned.status != "met":
            return "It hits the wall."
        raise InvalidInput(
            f"the ball hits the wall, {-above:.3g} m under its top and {-room:.3g} m inside its "
            f"edge: go over it (--over {self.distance:g}:{self.height + OVER:g}) or beside it "
            f"(--beside {self.distance:g}:{self.width / 2 + radius + OVER:.3g})"
        )


def scored(planned: KickPlan) -> str:
    """Return whether a kick ends in the goal straight ahead at the target's distance."""
    radius = planned.hit.struck.radius
    start, end = planned.path.launch.position, planned.path.sample(planned.path.duration).position
    _, left, up = end - start
    short = planned.goal.target[0] - (end - start)[0] > 1e-3
    beside = MOUTH[0] / 2 - abs(float(left)) - radius
    under = MOUTH[1] - float(up) - 2 * radius
    if not short and beside >= 0.0 and under >= 0.0 and up > -radius:
        return f"It goes in, {beside:.3g} m from the post and {under:.3g} m under the bar."
    if short or up <= -radius:
        return "It does not come to the goal."
    return "It goes past the goal."
