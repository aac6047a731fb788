"""The contact between foot and ball."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.equality import ValueEquality
from kickdyn.core.representation import ReprMixin, Row, format_value
from kickdyn.core.validation import Array


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Contact(ValueEquality, ReprMixin):
    """One point contact, for the instant of the impact.

    Args:
        normal: direction from the foot into the ball, any length but zero, stored as a unit
            vector, shape `(3,)` [world frame]. The ball's centre is at `contact point + r normal`.
        restitution: coefficient e of Eq. (1), 0 to 1. A rigid mechanical limb on a (leather,
            oval) ball measured 0.66 to 0.79 (Peacock & Ball 2016); the paper's Table 2 needs 0.8.
        friction: Coulomb's coefficient mu, 0 or more. 0, the frictionless contact of
            Eqs. (8)-(10), when not named; the paper uses 0.4, and 0.37 to 0.63 was measured on
            nine match balls against leather (Proceedings 2020, 49(1):92).
        offset: of the contact point from the origin of the leg's contact frame, in that frame's
            axes, so that it stays on the foot as the foot turns, shape `(3,)` [m]; it replaces
            that of a posture from `with_contact_offset`. None, which leaves the point alone, when
            not named.

    Raises:
        InvalidInput: a normal of length 0, or a coefficient outside its range.
    """

    normal: Array
    restitution: float
    friction: float
    offset: Array | None

    def __init__(
        self,
        normal: ArrayLike,
        restitution: float,
        friction: float = 0.0,
        offset: ArrayLike | None = None,
    ) -> None:
        unit = validation.direction("contact normal", normal)
        unit.setflags(write=False)
        object.__setattr__(self, "normal", unit)
        e = validation.number("restitution", restitution, at_least=0, at_most=1)
        object.__setattr__(self, "restitution", e)
        object.__setattr__(self, "friction", validation.number("friction", friction, at_least=0))
        patch = None if offset is None else validation.vector("contact offset", offset, 3, unit="m")
        if patch is not None:
            patch.setflags(write=False)
        object.__setattr__(self, "offset", patch)

    def __repr__(self) -> str:
        """Name every value, in a line."""
        said = f"normal={format_value(self.normal)}, restitution={self.restitution:g}"
        offset = "" if self.offset is None else f", offset={format_value(self.offset)} m"
        return f"Contact({said}, friction={self.friction:g}{offset})"

    def _rows(self) -> Iterable[Row]:
        yield "normal", self.normal, ""
        yield "restitution", self.restitution, ""
        yield "friction", self.friction, ""
        if self.offset is not None:
            yield "offset", self.offset, "m"
