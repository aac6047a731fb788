"""The contact between foot and ball."""

from collections.abc import Iterable
from dataclasses import dataclass

from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, ValueEquality, format_value
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.restitution import (
    Restitution,
    checked_restitution,
    format_restitution,
    restitution_at,
    restitution_for,
)


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Contact(ValueEquality, ReprMixin):
    """One point contact between foot and ball; equal numbers make equal contacts.

    Args:
        normal: direction from the foot into the ball, any length but zero, stored as a unit
            vector, shape `(3,)` [world frame]. None leaves it open, for `plan_kick`, which computes
            it; impacts need one.
        restitution: coefficient e of Eq. (1), 0 to 1. A rigid mechanical limb on a (leather, oval)
            ball measured 0.66 to 0.79 (Peacock & Ball 2016); the default 0.8 is what the paper's
            Table 2 needs. It may also depend on the speed of approach along the normal: as a table
            of rows (speed [m/s], e), shape `(n, 2)`, speeds increasing; or as the name of a model
            (`kickdyn.restitution.MODELS`): `inflated`, which follows from mass, radius and pressure
            of the ball, or `peacock-ball`, a measured one. Outside the rows e is taken from the
            nearest row, and results have a warning.
        friction: Coulomb's coefficient mu, 0 or more. The default 0 is the frictionless contact of
            Eqs. (8)-(10); the paper uses 0.4, and 0.37 to 0.63 was measured on nine match balls
            against leather (Proceedings 2020, 49(1):92).
        offset: position of the contact point in the leg's contact frame, shape `(3,)` [m]. It is
            fixed to the foot as the foot rotates, and replaces the offset of the posture. None, the
            default, keeps the contact point of the posture.

    Raises:
        InvalidInput: a normal of length 0, a coefficient outside its range, or speeds of a table
            that do not increase.
    """

    normal: Array
    restitution: Restitution
    friction: float
    offset: Array | None

    def __init__(
        self,
        normal: ArrayLike | None = None,
        restitution: float | str | ArrayLike = 0.8,
        friction: float = 0.0,
        offset: ArrayLike | None = None,
    ) -> None:
        unit = normal
        if normal is not None:
            unit = validation.read_only(validation.direction("contact normal", normal))
        if offset is not None:
            offset = validation.read_only(validation.vector("contact offset", offset, 3, unit="m"))
        e = checked_restitution(restitution)
        friction = validation.number("friction", friction, at_least=0)
        self.__dict__.update(normal=unit, restitution=e, friction=friction, offset=offset)

    def check_normal(self) -> None:
        """Raise `InvalidInput` where the contact has no normal."""
        if self.normal is None:
            raise InvalidInput(
                "the contact has no normal: it must have one, Contact(normal, ...), except for "
                "plan_kick, which computes it"
            )

    def for_ball(self, ball: Ball) -> "Contact":
        """Return the equal contact with the restitution of a ball, for which its rows are known.

        Raises:
            InvalidInput: the restitution is `inflated`, and the ball has no pressure.
        """
        restitution = restitution_for(self.restitution, ball)
        if restitution is self.restitution:
            return self
        contact = object.__new__(Contact)  # all else is checked
        contact.__dict__.update(self.__dict__, restitution=restitution)
        return contact

    def restitution_at(self, speed: float, ball: Ball | None = None) -> float:
        """Return the coefficient e at a speed of approach along the normal, 0 or more [m/s].

        The model `inflated` needs the ball.
        """
        speed = validation.number("speed", speed, at_least=0, unit="m/s")
        validation.check_type(Ball, type(None), ball=ball)
        contact = self if ball is None else self.for_ball(ball)
        return restitution_at(contact.restitution, speed)

    def __repr__(self) -> str:
        offset = "" if self.offset is None else f", offset={format_value(self.offset)} m"
        e = format_restitution(self.restitution)
        normal = format_value(self.normal)
        return f"Contact(normal={normal}, restitution={e}, friction={self.friction:g}{offset})"

    def _rows(self) -> Iterable[Row]:
        if self.normal is not None:
            yield "normal", self.normal, ""
        yield "restitution", format_restitution(self.restitution), ""
        yield "friction", self.friction, ""
        if self.offset is not None:
            yield "offset", self.offset, "m"
