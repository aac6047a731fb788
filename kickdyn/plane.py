"""Planes at which a flight ends: walls and goal lines."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, ValueEquality, format_value
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput


class ReachedBy(StrEnum):
    """The part of a ball that is on a plane when the plane counts as reached."""

    FRONT = "front"
    CENTRE = "centre"
    BACK = "back"


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Plane(ValueEquality, ReprMixin):
    """An infinite plane that ends a flight which reaches it from the side of its normal.

    Args:
        point: any point of the plane, shape `(3,)` [m, world frame].
        normal: normal to the side from which the ball comes, shape `(3,)`, of any length but zero.
        reached_by: what of the ball must be on the plane to reach it: `front`, its surface, as at a
            wall; `centre`; or `back`, when the whole ball is over the plane, as a goal is scored
            (IFAB, Laws of the Game 2023/24, Law 10).

    Raises:
        InvalidInput: a vector that is not finite, a normal of length 0, or another `reached_by`.

    Example:
        >>> import kickdyn as kd
        >>> wall = kd.Plane(point=(11, 0, 0), normal=(-1, 0, 0))
        >>> path = kd.fly(kd.BallState(velocity=(20, 0, 5)), kd.Ball(), plane=wall)
        >>> str(path.status), round(float(path.landing.position[0]), 2)  # a radius before it
        ('at-plane', 10.89)
    """

    point: Array
    normal: Array
    reached_by: ReachedBy

    def __init__(self, point: ArrayLike, normal: ArrayLike, reached_by: str = "front") -> None:
        self.__dict__.update(
            point=validation.read_only(validation.vector("point of the plane", point, 3, unit="m")),
            normal=validation.read_only(validation.direction("normal of the plane", normal)),
            reached_by=validation.choice("reached_by", reached_by, ReachedBy),
        )

    @property
    def is_goal_line(self) -> bool:
        """Whether it is upright and reached by the centre or back: a goal's."""
        return abs(float(self.normal[2])) < 1e-9 and self.reached_by != ReachedBy.FRONT

    def __repr__(self) -> str:
        place = f"point={format_value(self.point)} m, normal={format_value(self.normal)}"
        return f"Plane({place}, reached_by={self.reached_by.value!r})"

    def _rows(self) -> Iterable[Row]:
        yield "point", self.point, "m"
        yield "normal", self.normal, ""
        yield "reached by", f"the ball's {self.reached_by}", ""

    @validation.check_arguments
    def gap(self, ball: Ball, position: ArrayLike) -> float:
        r"""Return the distance along the normal that a ball still has to move to the plane [m].

        :math:`n \cdot (x - p) + k r`, where k is -1, 0 or 1 for `front`, `centre` and `back`, and x
        the position of the ball's centre, shape `(3,)` [m, world frame].

        Raises:
            InvalidInput: the ball is beyond it already.
        """
        return float(plane_gaps(self, ball, validation.vector("position", position, 3, unit="m")))


def plane_gaps(plane: Plane, ball: Ball, positions: Array) -> Array:
    """Return the distances of `Plane.gap`, for positions of shape `(n, 3)`, in shape `(n,)` [m]."""
    radii = {ReachedBy.FRONT: -1.0, ReachedBy.CENTRE: 0.0, ReachedBy.BACK: 1.0}
    away = (positions - plane.point) @ plane.normal + radii[plane.reached_by] * ball.radius
    scale = np.maximum(max(ball.radius, abs(plane.point).max()), abs(positions).max(axis=-1))
    beyond = np.flatnonzero(away < -1e-9 * scale)  # more than rounding
    if beyond.size:
        which = f" of flight {beyond[0]}" if np.ndim(away) else ""
        raise InvalidInput(
            f"the ball's {plane.reached_by}{which} starts {-np.ravel(away)[beyond[0]]:g} m "
            f"beyond the plane: the normal {plane.normal.tolist()} must point to where the ball "
            "comes from"
        )
    return np.maximum(away, 0.0)
