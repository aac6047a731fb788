"""The scene: everything that one kick consists of; what it does not name is not modelled.

On a pitch, a wall of players and a goal may be between the ball and where it goes.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.ground import Ground
from kickdyn.impact.collide import checked_stiffness, takes_inflated_force
from kickdyn.impact.force_model import CONTACT_TIME, LONGEST_CONTACT
from kickdyn.impact.laws import find_law
from kickdyn.impact.sensitivity import UNITS
from kickdyn.plane import Plane
from kickdyn.restitution import least_restitution
from kickdyn.robot.leg import Leg, Posture

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

    @property
    def hit(self) -> str:
        """Where the ball hits the wall, as the end of a sentence."""
        below, inside = -self.above, -self.beside
        return f"hits the wall, {below:.3g} m below its top and {inside:.3g} m from its edge"

    def __str__(self) -> str:
        if self.above > 0.0:
            return f"The lower edge of the ball clears the wall by {self.above:.3g} m."
        if self.beside > 0.0:
            side = "left" if self.left > 0.0 else "right"
            return f"The ball passes {self.beside:.3g} m to the {side} of the wall."
        return f"The ball {self.hit}."


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
    """Return how a ball passes a wall, or None if its path ends before it.

    `ahead` is horizontal, to the target; the ball's lower edge starts at `start_height` [m].
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


LEAST_RESTITUTION = 0.01
"""The least restitution of a contact that takes time."""


@dataclass(frozen=True)
class Compliance:
    """Compliance of a contact that takes time, as for `collide`, in place of an impact law.

    Args:
        contact_time: duration of the contact for which the stiffness is chosen, above 0 [s]; None
            is the default of `collide`.
        stiffness: stiffness in place of `contact_time`: a number [N/m^1.5], `"pressure"` or
            `"inflated"`.
    """

    contact_time: float | None = None
    stiffness: float | str | None = None

    def __post_init__(self) -> None:
        if self.contact_time is not None:
            self.__dict__["contact_time"] = validation.number(
                "contact time", self.contact_time, above=0, at_most=LONGEST_CONTACT, unit="s"
            )
        self.__dict__["stiffness"] = checked_stiffness(self.contact_time, self.stiffness)

    @property
    def options(self) -> dict[str, Any]:
        """The values as keyword arguments of `collide`."""
        return dict(self.__dict__)


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene(ReprMixin):
    """One kick, from the posture of the leg to the end of the ball's path.

    Args:
        posture: the posture of the leg, with its rotors, supports and loops.
        v: joint velocity just before the contact, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal`.
        contact: normal, restitution (a number, a table over the speed of approach or a model),
            friction and offset of the contact.
        law: impact law of an instantaneous contact, as for `strike`: `newton`, `stronge` or
            `paper`; or the `Compliance` of a contact that takes time, which has no impact law and
            whose restitution must be at least 0.01.
        incoming: the ball before the contact: velocity and spin count. None is a ball at rest.
        air: the air; None is the vacuum.
        ground: the ground, where the flight ends. None ends it at the height of the launch. On a
            ground with a surface, the ball is followed to rest.
        plane: a wall or a goal line, which ends the path if the ball reaches it first.
        wall: a wall of players on the line from the ball to the `point` of the plane. The ball
            flies on where it hits this wall.
        uncertainty: standard deviations by the name of a source, in the units of
            `Impact.uncertainty`; None means that none is known.
        name: name of the scene.

    Raises:
        InvalidInput: a wrong type or shape, an entry that is not finite, or an invalid posture.
    """

    posture: Posture
    v: Array
    ball: Ball
    contact: Contact
    law: str | Compliance
    incoming: BallState
    air: Air | None
    ground: Ground | None
    plane: Plane | None
    wall: Wall | None
    uncertainty: Mapping[str, float]
    name: str

    @validation.check_arguments
    def __init__(
        self,
        posture: Posture,
        v: ArrayLike,
        ball: Ball,
        contact: Contact,
        law: str | Compliance = "newton",
        *,
        incoming: BallState | None = None,
        air: Air | None = None,
        ground: Ground | None = None,
        plane: Plane | None = None,
        wall: Wall | None = None,
        uncertainty: Mapping[str, float] | None = None,
        name: str = "scene",
    ) -> None:
        ball.check_movable("a scene")
        contact.check_normal()
        contact = contact.for_ball(ball)
        if contact.offset is None and posture.contact_offset is not None:
            contact = replace(contact, offset=posture.contact_offset)
        if isinstance(law, Compliance):
            takes_inflated_force(contact, **law.options)
            if isinstance(law.stiffness, str):
                _ = ball.stiffness  # raises where the pressure is unknown
            least = least_restitution(contact.restitution)
            if least < LEAST_RESTITUTION:
                raise InvalidInput(
                    f"restitution is {least:g}: in a contact that takes time it must be at least "
                    f"{LEAST_RESTITUTION:g}"
                )
        else:
            law = find_law(law, "law").name
        deviations = validation.mapping("uncertainty", uncertainty)
        for source, deviation in deviations.items():
            if source not in UNITS:
                shown, choices = validation.brief(source), ", ".join(UNITS)
                raise InvalidInput(f"uncertainty of {shown} is unknown: choose {choices}")
            validation.floats(f"uncertainty of {source}", deviation)
        self.__dict__.update(
            posture=posture.with_contact_offset(contact.offset),
            v=validation.read_only(validation.vector("v", v, posture.leg.nv)),
            ball=ball, contact=contact, law=law, incoming=incoming or BallState(),
            air=air, ground=ground, plane=plane, wall=wall, uncertainty=deviations, name=name,
        )  # fmt: skip
        if self.incoming.velocity.shape != (3,):
            shape = self.incoming.velocity.shape
            raise InvalidInput(f"incoming has velocities of shape {shape}: it must be one, (3,)")
        if wall is not None:
            check_before(wall, math.hypot(*self._to_target()))

    def replace(self, **changes: Any) -> "Scene":
        """Return the scene with some of its arguments changed."""
        return Scene(**{**self.__dict__, **changes})

    @validation.check_arguments
    def with_leg(self, leg: Leg) -> "Scene":
        """Return the scene with another leg in the same configuration."""
        return self.replace(posture=leg.posture(self.q))

    @property
    def leg(self) -> Leg:
        """The leg, with the frame that strikes the ball."""
        return self.posture.leg

    @property
    def q(self) -> Array:
        """The configuration, shape `(nq,)` [rad; m for prismatic joints]."""
        return self.posture.q

    @property
    def is_compliant(self) -> bool:
        """Whether the contact has a finite duration."""
        return isinstance(self.law, Compliance)

    @property
    def is_followed(self) -> bool:
        """Whether the ball is followed to rest, on a ground with a surface."""
        return self.ground is not None and self.ground.surface is not None

    def as_instant(self) -> "Scene":
        """Return the scene with an instantaneous contact."""
        return self.replace(law="newton")

    @property
    def _impact_arguments(self) -> dict[str, Any]:
        """The bodies and the contact, as keyword arguments of `strike` and `collide`."""
        ball = {"ball_velocity": self.incoming.velocity, "ball_spin": self.incoming.spin}
        return {name: getattr(self, name) for name in ("posture", "v", "ball", "contact")} | ball

    @property
    def ball_position(self) -> Array:
        """Centre of the ball as it is struck, shape `(3,)` [m, world frame]."""
        return np.asarray(self.posture.contact_point + self.ball.radius * self.contact.normal)

    def _to_target(self) -> tuple[float, float]:
        """Return the way along the ground from the ball to the point of the plane [m]."""
        if self.plane is None:
            raise InvalidInput(
                "wall is given without a plane: it stands on the line from the ball to the plane's "
                "point"
            )
        x, y, _ = self.plane.point - self.ball_position
        return float(x), float(y)

    @property
    def ahead(self) -> Array:
        """Horizontal unit vector from the ball to the point of the plane, shape `(3,)`."""
        return validation.direction("direction to the plane", (*self._to_target(), 0.0))

    def _rows(self) -> Iterable[Row]:
        yield "name", self.name, ""
        yield "leg", self.leg.name, ""
        yield "contact point", self.posture.contact_point, "m"
        yield "foot speed", float(np.linalg.norm(self.posture.point_velocity(self.v))), "m/s"
        yield "ball", f"{self.ball.mass:.4g} kg, radius {self.ball.radius:.4g} m", ""
        if self.incoming.velocity.any():
            yield "ball's velocity", self.incoming.velocity, "m/s"
        if self.incoming.spin.any():
            yield "ball's spin", self.incoming.spin, "rad/s"
        yield "contact", repr(self.contact).removeprefix("Contact(").removesuffix(")"), ""
        law = self.law
        if not isinstance(law, Compliance):
            yield "law", law, ""
        elif takes_inflated_force(self.contact, **law.options):
            yield "contact force", "of an inflated ball", ""
        elif isinstance(law.stiffness, str):
            yield "stiffness", f"from the pressure, {self.ball.stiffness:.4g}", "N/m"
        elif law.stiffness is not None:
            yield "stiffness", law.stiffness, "N/m^1.5"
        else:
            yield "contact time", 1e3 * (law.contact_time or CONTACT_TIME), "ms"
        if self.air is not None:
            acting = [name for name in ("drag", "lift", "torque") if getattr(self.air, name)]
            yield "air", ", ".join([f"{self.air.density:.4g} kg/m3", *acting]), ""
        for name in ("ground", "plane", "wall"):
            value = getattr(self, name)
            if value is not None:
                kind = type(value).__name__
                yield name, repr(value).removeprefix(f"{kind}(").removesuffix(")"), ""
