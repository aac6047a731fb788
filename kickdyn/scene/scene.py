"""The scene: everything that one kick consists of; what it does not name is not modelled."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.ground import Ground
from kickdyn.impact.collide import checked_stiffness, takes_inflated_force
from kickdyn.impact.force_model import CONTACT_TIME, LONGEST_CONTACT
from kickdyn.impact.laws import find_law
from kickdyn.impact.sensitivity import UNITS
from kickdyn.plane import Plane
from kickdyn.restitution import least_restitution
from kickdyn.robot.leg import Leg, Posture
from kickdyn.scene.pitch import Wall, check_before

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
        self.__dict__.update(
            posture=posture.with_contact_offset(contact.offset),
            v=validation.read_only(validation.vector("v", v, posture.leg.nv)),
            ball=ball,
            contact=contact,
            law=law,
            incoming=BallState() if incoming is None else incoming,
            air=air,
            ground=ground,
            plane=plane,
            wall=wall,
            uncertainty=_checked_uncertainty(uncertainty),
            name=name,
        )
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
        if not isinstance(self.law, Compliance):
            yield "law", self.law, ""
        elif takes_inflated_force(self.contact, **self.law.options):
            yield "contact force", "of an inflated ball", ""
        elif isinstance(self.law.stiffness, str):
            yield "stiffness", f"from the pressure, {self.ball.stiffness:.4g}", "N/m"
        elif self.law.stiffness is not None:
            yield "stiffness", self.law.stiffness, "N/m^1.5"
        else:
            yield "contact time", 1e3 * (self.law.contact_time or CONTACT_TIME), "ms"
        if self.air is not None:
            acting = [name for name in ("drag", "lift", "torque") if getattr(self.air, name)]
            yield "air", ", ".join([f"{self.air.density:.4g} kg/m3", *acting]), ""
        for name in ("ground", "plane", "wall"):
            value = getattr(self, name)
            if value is not None:
                kind = type(value).__name__
                yield name, repr(value).removeprefix(f"{kind}(").removesuffix(")"), ""


def _checked_uncertainty(value: Mapping[str, float] | None) -> dict[str, float]:
    checked = validation.mapping("uncertainty", value)
    for name, deviation in checked.items():
        if name not in UNITS:
            choices = ", ".join(UNITS)
            raise InvalidInput(
                f"uncertainty of {validation.brief(name)} is unknown: choose {choices}"
            )
        validation.floats(f"uncertainty of {name}", deviation)
    return checked
