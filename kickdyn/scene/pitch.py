"""What stands on a pitch between the ball and where it goes: a wall of players, and a goal."""

from dataclasses import dataclass
from typing import NamedTuple

from scipy.optimize import brentq

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course

MOUTH = (7.32, 2.44)
"""Width between the posts of a goal and height under its bar [m]: IFAB, Laws of the Game, Law 1."""

FRAME = 0.12
"""Largest width of its posts and its bar [m], ibid."""

MISSES = {
    "short": "does not reach the goal",
    "over": "goes over the bar",
    "beside": "passes beside the post",
    "bar": "hits the bar",
    "post": "hits the post",
}
"""What a ball does that does not enter the goal, by `Score.end`."""


class Passage(NamedTuple):
    """How a ball passes a wall [m].

    Attributes:
        above: from the top of the wall up to the lower edge of the ball.
        beside: from the edge of the wall outwards to the side of the ball.
        left: from the middle of the wall to the centre of the ball, positive to the left.
    """

    above: float
    beside: float
    left: float

    @property
    def is_clear(self) -> bool:
        """Whether the ball does not touch the wall."""
        return self.above > 0.0 or self.beside > 0.0

    def __str__(self) -> str:
        if self.above > 0.0:
            return f"The lower edge of the ball clears the wall by {self.above:.3g} m."
        if self.beside > 0.0:
            side = "left" if self.left > 0.0 else "right"
            return f"The ball passes {self.beside:.3g} m to the {side} of the wall."
        return f"The ball {self.hit}."

    @property
    def hit(self) -> str:
        """Where the ball hits the wall, as the end of a sentence."""
        return (
            f"hits the wall, {-self.above:.3g} m below its top and {-self.beside:.3g} m from "
            "its edge"
        )


@dataclass(frozen=True)
class Wall:
    """A wall of players across the line from the ball to its target, its middle on that line.

    It does not stop the ball: results say whether the ball hits it.

    Args:
        distance: from the centre of the ball at its start, along the ground [m], above 0.
        height: above the ground [m], above 0.
        width: [m], above 0; by default as wide as five players.
    """

    distance: float
    height: float
    width: float = 2.5

    def __post_init__(self) -> None:
        for name in ("distance", "height", "width"):
            value = validation.number(f"{name} of the wall", getattr(self, name), above=0, unit="m")
            self.__dict__[name] = value


def read_wall(text: str) -> Wall:
    """Return the wall that the text DISTANCE:HEIGHT or DISTANCE:HEIGHT:WIDTH stands for [m]."""
    values = text.split(":")
    try:
        distance, height, width = map(float, [*values, "2.5"] if len(values) == 2 else values)
    except ValueError:
        raise InvalidInput(
            f"wall is {validation.brief(text)}: it must be DISTANCE:HEIGHT or with :WIDTH [m], as "
            "9.15:1.9"
        ) from None
    return Wall(distance, height, width)


def check_before(wall: Wall, distance: float) -> None:
    """Raise `InvalidInput` for a wall that is not before a target so far away [m]."""
    if not wall.distance < distance:
        raise InvalidInput(
            f"wall is at {wall.distance:g} m: it must be between the ball and the target, "
            f"which is {distance:g} m away"
        )


def passage_on(
    path: Flight | Course, wall: Wall, ahead: Array, radius: float, start_height: float = 0.0
) -> Passage | None:
    """Return the passage of a ball by a wall on its path; None if the path ends before the wall.

    `ahead` is the horizontal unit vector from the start to the target, shape `(3,)`, `start_height`
    the height of the ball's lower edge above the ground at the start [m].
    """
    start = path.launch.position

    def beyond(time: float) -> float:
        return float(ahead @ (path.sample(time).position - start)) - wall.distance

    if beyond(path.duration) < 0.0:
        return None
    x, y, z = path.sample(float(brentq(beyond, 0.0, path.duration))).position - start
    left = float(ahead[0] * y - ahead[1] * x)
    above = float(z) + start_height - wall.height
    return Passage(above, abs(left) - wall.width / 2 - radius, left)


class Score(NamedTuple):
    """How a ball meets a goal.

    Attributes:
        end: `in` or `short`; `over` the bar, `beside` the post; or `bar` or `post`, which it hits.
        post: distance from the side of the ball to the nearer post [m]; below 0 beyond it.
        bar: distance from the upper edge of the ball up to the bar [m]; below 0 above it.
    """

    end: str
    post: float
    bar: float

    def __str__(self) -> str:
        if self.end == "in":
            return (
                f"The ball enters the goal, {self.post:.3g} m from the post and {self.bar:.3g} m "
                "under the bar."
            )
        return f"The ball {MISSES[self.end]}."


def score_at(left: float, up: float, radius: float, *, arrives: bool) -> Score:
    """Return the score of a ball at a goal, `left` of its middle and its lower edge `up` [m]."""
    post = MOUTH[0] / 2 - abs(left) - radius
    bar = MOUTH[1] - up - 2 * radius
    if not arrives:
        return Score("short", post, bar)
    if min(post, bar) >= 0.0:
        return Score("in", post, bar)
    missed = post if bar >= 0.0 else bar if post >= 0.0 else min(post, bar)
    clear = missed < -2 * radius - FRAME
    ends = ("post", "beside") if missed == post else ("bar", "over")
    return Score(ends[clear], post, bar)
