"""What a flight answers, once it is flown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, side_view
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.forces import brakes
from kickdyn.flight.validity_ranges import outside, said
from kickdyn.ground import Ground
from kickdyn.plane import Plane

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class FlightStatus(StrEnum):
    """How a flight or a course ends.

    `fly` gives the first three, `follow` all but `landed` and `failed`, `fly_many` all but those of
    planes and of the ground.
    """

    LANDED = "landed"
    AT_PLANE = "at-plane"
    ALOFT = "aloft"
    FAILED = "failed"
    AT_REST = "at-rest"
    BOUNCING = "bouncing"
    BLOWN = "blown"


@dataclass(frozen=True, eq=False, repr=False)
class Flight(ReprMixin):
    """A ball's way through the air; all times count from the launch.

    Attributes:
        launch: the start.
        apex: the highest point; the launch if the ball never rises.
        landing: the end, a node too: on the ground, back at the height of the launch, or at the
            plane.
        status: `landed`; `at-plane`, where that came first; `aloft`, where the time limit did:
            `landing` is then merely the last state.
        method: how it was computed.
        evaluations: of the acceleration; 0 for the closed form.
        ball, air, ground, plane, tol: what was flown, and how exactly.
        turning: whether `orientation` was asked for.
    """

    ball: Ball
    air: Air | None
    ground: Ground | None
    plane: Plane | None
    tol: float
    turning: bool
    launch: BallState
    apex: BallState
    landing: BallState
    status: str
    method: str
    evaluations: int
    _trajectory: Callable[[Array], Array] = field(repr=False)
    _again: Callable[..., Flight] = field(repr=False)

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "launch", self.launch.velocity, "m/s"
        yield "spin", self.launch.spin, "rad/s"
        yield "range", self.range, "m"
        yield "height", self.height, "m"
        yield "duration", self.duration, "s"
        yield "landing", self.landing.position, "m"
        yield "landing speed", self.landing.speed, "m/s"
        yield "method", f"{self.method}, {self.evaluations} evaluations", ""
        for line in self.warnings:
            yield "warning", line, ""

    def _picture(self) -> str:
        return profile(self.sample(np.linspace(0, self.duration, 65)), (self.apex, self.landing))

    @property
    def duration(self) -> float:
        """Time from launch to landing [s]."""
        return float(self.landing.time)

    @property
    def range(self) -> float:
        """Horizontal distance from launch to landing [m]."""
        return float(np.hypot(*(self.landing.position - self.launch.position)[:2]))

    @property
    def height(self) -> float:
        """Height of the apex above the launch [m]."""
        return float(self.apex.position[2] - self.launch.position[2])

    @cached_property
    def error(self) -> float:
        """Estimate of the error of the landing point [m], from a second flight; not a bound.

        Twice what the landing moves, in space or along the way in its time, when the tolerance is
        10,000 times tighter, but 1e-13 at tightest, or where that says too little, 100 times wider;
        never less than a thousandth of the tolerance's share of the flight's length, where they
        happen to agree. Of a closed form, its rounding. Computed when asked for: it costs that
        flight, and below 1e-9 two.
        """
        length = float(np.abs(self._trajectory(np.linspace(0, self.duration, 33))[:, :3]).max())
        if self.evaluations == 0:
            grazing = 1.0
            if self.status == "at-plane" and self.plane is not None:
                speed = math.hypot(*self.landing.velocity)
                across = abs(float(self.plane.normal @ self.landing.velocity))
                grazing = speed / max(across, 1e-300)
            length += float(np.abs(self.launch.position).max())
            return 4 * float(np.finfo(float).eps) * length * grazing
        tolerances = [max(1e-4 * self.tol, 1e-13)]
        if self.tol < 1e-9:
            tolerances.append(100 * self.tol)
        speed, moved = math.hypot(*self.landing.velocity), 0.0
        for other in (self._again(tol=tol).landing for tol in tolerances):
            late = speed * abs(self.duration - float(other.time))
            moved = max(moved, late, float(np.linalg.norm(self.landing.position - other.position)))
        return max(2 * moved, 1e-3 * self.tol * length, 1e-12 * length)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for each coefficient that was used outside the range it is meant for."""
        return tuple(said(model, share) for model, share in outside(self) if share > 0)

    def arrival(self, x: float) -> BallState | None:
        """Return the ball where its centre first is at `x` [m, world frame]; None if it never is.

        The height there is `position[2]`; the time is in the state. As exact as a landing: it is
        flown to, which costs a flight.
        """
        there = validation.number("x", x, unit="m")
        before = float(self.launch.position[0]) - there
        if before == 0.0:
            return self.sample(0.0)
        path = self._again(plane=Plane((there, 0, 0), (before, 0, 0), "centre"))
        tie = 10 * self.tol
        if path.status == "at-plane":
            return path.landing if path.duration <= self.duration * (1 + tie) else None
        short = abs(
            float(path.landing.position[0]) - there
        )  # where the ground came first, by a hair
        return path.landing if short <= tie * abs(before) else None

    def __reduce__(self) -> tuple[Callable[[], Flight], tuple[()]]:
        """Pickle what was flown; it is flown anew, to the same last bit."""
        return partial(self._again, orientation=self.turning), ()

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at one time or many.

        Args:
            t: since the launch, from 0 to `duration`, a number or shape `(n,)` [s].

        Raises:
            InvalidInput: a time outside the flight.
        """
        times, moved = self._states(t)
        spin = moved[..., 6:7] * self.launch.spin
        return BallState(self.launch.position + moved[..., :3], moved[..., 3:6], spin, times)

    def orientation(self, t: ArrayLike) -> Rotation:
        """Return how the ball is turned from its orientation at the launch, world frame.

        The air brakes the spin but does not turn its axis, so this is a turn about that axis, by
        the integral of the spin. `as_quat()` of the result gives `(x, y, z, w)`, as Pinocchio and
        meshcat take it, `as_matrix()` the rotation matrix.

        Args:
            t: as for `sample`.

        Returns:
            A scipy `Rotation`: one, or a stack of n.

        Raises:
            InvalidInput: a time outside the flight, or one flown without `orientation=True`.
        """
        from scipy.spatial.transform import Rotation

        if not self.turning:
            raise InvalidInput("the orientation is not known: ask fly for it, orientation=True")
        times, moved = self._states(t)
        turned = moved[..., 7] if brakes(self.air, self.launch.spin) else times
        return Rotation.from_rotvec(turned[..., None] * self.launch.spin)

    def _states(self, t: ArrayLike) -> tuple[Array, Array]:
        """Return checked times, and there what changes since the launch, shape `(..., m)`."""
        times = validation.times(t, self.duration, "the flight")
        moved = self._trajectory(np.atleast_1d(times))
        return times, moved.reshape(*times.shape, moved.shape[-1])


def profile(way: BallState, marked: tuple[BallState, ...]) -> str:
    """Draw a ball's way as an SVG: height over the distance ahead, where it was launched to.

    Args:
        way: states along it, the first the launch.
        marked: states to put a dot on.
    """
    start = way.position[0]
    ahead = next((v[:2] for v in way.velocity if np.any(v[:2])), np.array([1.0, 0.0]))
    ahead = ahead / math.hypot(*ahead)

    def seen(position: Array) -> Array:
        return np.stack([(position - start)[..., :2] @ ahead, position[..., 2]], axis=-1)

    dots = np.array([seen(state.position) for state in marked])
    return side_view(seen(way.position), dots=dots)
