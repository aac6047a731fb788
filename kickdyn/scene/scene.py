"""The scene: everything that one kick consists of; what it does not name is not modelled."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.ground import Ground
from kickdyn.impact.collide import checked_stiffness
from kickdyn.impact.force_model import Dissipation
from kickdyn.impact.laws import find_law
from kickdyn.impact.sensitivity import UNITS
from kickdyn.plane import Plane
from kickdyn.restitution import Restitution, least_restitution
from kickdyn.robot.leg import Leg, Posture
from kickdyn.scene.pitch import Wall, check_before

LEAST_RESTITUTION = 0.01
"""The least restitution of a contact that takes time."""


class FlightEnvironment(NamedTuple):
    """What flies, what it flies through, and what ends the flight.

    Attributes:
        ball: what flies.
        air: None is the vacuum.
        ground: as for `follow` where it has a surface, else as for `fly`.
        plane: as for `fly`.
    """

    ball: Ball
    air: Air | None
    ground: Ground | None
    plane: Plane | None


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene(ReprMixin):
    """One kick, from the posture of the leg to the end of the ball's path.

    Args:
        leg: the leg, with the frame that strikes the ball, its rotors, supports and loops.
        q: configuration, shape `(nq,)` [rad; m for prismatic joints].
        v: joint velocity just before the contact, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal`.
        contact: normal, restitution (a number, a table over the speed of approach or a model),
            friction and offset of the contact.
        law: impact law, as for `strike`: `newton`, `stronge` or `paper`.
        contact_time: duration of a compliant contact, as for `collide` [s]. Without it and without
            `stiffness`, the contact is an instant. A compliant contact has no impact law, and its
            restitution must be at least 0.01.
        stiffness: stiffness of a compliant contact, in place of `contact_time`: `"pressure"` or a
            number [N/m^1.5], as for `collide`.
        dissipation: dissipation of a compliant contact, as for `collide`.
        ball_velocity: velocity of the centre of the ball before the contact, shape `(3,)`
            [m/s, world frame].
        ball_spin: angular velocity of the ball before the contact, shape `(3,)`
            [rad/s, world frame].
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

    leg: Leg
    q: Array
    v: Array
    ball: Ball
    contact: Contact
    law: str
    contact_time: float | None
    stiffness: float | str | None
    dissipation: Dissipation
    ball_velocity: Array
    ball_spin: Array
    air: Air | None
    ground: Ground | None
    plane: Plane | None
    wall: Wall | None
    uncertainty: Mapping[str, float]
    name: str
    posture: Posture = field(repr=False)

    @validation.check_arguments
    def __init__(
        self,
        leg: Leg,
        q: ArrayLike,
        v: ArrayLike,
        ball: Ball,
        contact: Contact,
        *,
        law: str = "newton",
        contact_time: float | None = None,
        stiffness: float | Literal["pressure"] | None = None,
        dissipation: str = Dissipation.WALTON_BRAUN,
        ball_velocity: ArrayLike = (0.0, 0.0, 0.0),
        ball_spin: ArrayLike = (0.0, 0.0, 0.0),
        air: Air | None = None,
        ground: Ground | None = None,
        plane: Plane | None = None,
        wall: Wall | None = None,
        uncertainty: Mapping[str, float] | None = None,
        name: str = "scene",
    ) -> None:
        ball.check_movable("a scene")
        impact_law = find_law(law, "law").name
        given = checked_stiffness(ball, contact_time, stiffness)
        if contact_time is not None:
            contact_time = validation.number("contact time", contact_time, above=0, unit="s")
        if contact_time is not None or given is not None:
            faults = compliant_contact_faults(impact_law, contact.restitution)
            if faults:
                raise InvalidInput(faults[0])
        posture = leg.posture(q)
        arrays = {
            "q": posture.q,
            "v": validation.vector("v", v, leg.nv),
            "ball_velocity": validation.vector("ball velocity", ball_velocity, 3, unit="m/s"),
            "ball_spin": validation.vector("ball spin", ball_spin, 3, unit="rad/s"),
        }
        for array in arrays.values():
            array.setflags(write=False)
        self.__dict__.update(
            leg=leg,
            ball=ball,
            contact=contact,
            law=impact_law,
            contact_time=contact_time,
            stiffness=given,
            dissipation=validation.choice("dissipation", dissipation, Dissipation),
            air=air,
            ground=ground,
            plane=plane,
            wall=wall,
            uncertainty=_checked_uncertainty(uncertainty),
            name=name,
            posture=posture.with_contact_offset(contact.offset),
            **arrays,
        )
        if wall is not None:
            check_before(wall, math.hypot(*self._to_target()))

    def replace(self, **changes: Any) -> "Scene":
        """Return the scene with some of its arguments changed.

        Raises:
            InvalidInput: as for `Scene`.
        """
        arguments = {name: value for name, value in self.__dict__.items() if name != "posture"}
        return Scene(**{**arguments, **changes})

    @property
    def is_compliant(self) -> bool:
        """Whether the contact has a finite duration."""
        return self.contact_time is not None or self.stiffness is not None

    def as_instant(self) -> "Scene":
        """Return the scene with an instantaneous contact."""
        return self.replace(contact_time=None, stiffness=None)

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
        """Horizontal unit vector from the ball to the point of the plane, shape `(3,)`.

        Raises:
            InvalidInput: the scene has no plane, or its point is above or below the ball.
        """
        return validation.direction("direction to the plane", (*self._to_target(), 0.0))

    @property
    def environment(self) -> FlightEnvironment:
        """The ball, the air and what ends the path, as data for the flight."""
        return FlightEnvironment(self.ball, self.air, self.ground, self.plane)

    @property
    def notes(self) -> tuple[str, ...]:
        """A line for each joint outside its range: the kick is computed all the same."""
        lines = []
        for joint, (value, unit) in self.leg.display_values(self.q).items():
            low, high = self.leg.joint_range(joint)
            continuous = math.isinf(high) or (low, high) == (-math.pi, math.pi)
            if unit == "deg":
                low, high = math.degrees(low), math.degrees(high)
            if not (continuous or low - 1e-6 <= value <= high + 1e-6):  # digits of the posture
                lines.append(
                    f"{joint} is at {value:.4g} {unit}, outside its range, {low:.4g} to {high:.4g}"
                )
        return tuple(lines)

    def _rows(self) -> Iterable[Row]:
        """Return the lines that are shown."""
        yield "name", self.name, ""
        yield "leg", self.leg.name, ""
        yield "contact point", self.posture.contact_point, "m"
        yield "foot speed", float(np.linalg.norm(self.posture.jacobian @ self.v)), "m/s"
        yield "ball", f"{self.ball.mass:.4g} kg, radius {self.ball.radius:.4g} m", ""
        if self.ball_velocity.any():
            yield "ball's velocity", self.ball_velocity, "m/s"
        if self.ball_spin.any():
            yield "ball's spin", self.ball_spin, "rad/s"
        yield "contact", repr(self.contact).removeprefix("Contact(").removesuffix(")"), ""
        if not self.is_compliant:
            yield "law", self.law, ""
        elif self.contact_time is not None:
            yield "contact time", 1e3 * self.contact_time, "ms"
        elif isinstance(self.stiffness, str):
            yield "stiffness", f"from the pressure, {self.ball.stiffness:.4g}", "N/m"
        else:
            yield "stiffness", self.stiffness, "N/m^1.5"
        if self.air is not None:
            acting = [name for name in ("drag", "lift", "torque") if getattr(self.air, name)]
            yield "air", ", ".join([f"{self.air.density:.4g} kg/m3", *acting]), ""
        for name, part in (("ground", self.ground), ("plane", self.plane), ("wall", self.wall)):
            if part is not None:
                kind = type(part).__name__
                yield name, repr(part).removeprefix(f"{kind}(").removesuffix(")"), ""


def _checked_uncertainty(value: Mapping[str, float] | None) -> dict[str, float]:
    """Return finite values by the names of `Impact.uncertainty`, or raise `InvalidInput`."""
    checked = validation.mapping("uncertainty", value)
    for name, deviation in checked.items():
        if name not in UNITS:
            known = ", ".join(UNITS)
            raise InvalidInput(
                f"uncertainty of {validation.brief(name)} is unknown: choose {known}"
            )
        validation.floats(f"uncertainty of {name}", deviation)
    return checked


def compliant_contact_faults(law: str, restitution: Restitution) -> list[str]:
    """Return a line for each value that does not go with a contact time."""
    lines = []
    if law != "newton":
        lines.append(
            f"law is {law!r}: a contact that takes time has no impact law; leave out law, "
            "or the contact time and the stiffness"
        )
    least = least_restitution(restitution)
    if least < LEAST_RESTITUTION:
        lines.append(
            f"restitution is {least:g}: in a contact that takes time it must be at least "
            f"{LEAST_RESTITUTION:g}"
        )
    return lines
