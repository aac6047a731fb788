"""The result of `fly`: path, apex, landing, error and warnings."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.aerodynamics.coefficient_model import CoefficientModel, is_known
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.ground import Ground
from kickdyn.plane import Plane

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

SAMPLES = 101
"""Number of states of a flight, or of all flights of a course, that are compared with ranges."""

COMPRESSIBLE = 100.0
"""Speed from which the compressibility of air matters [m/s]: 0.3 of the speed of sound."""

ROUNDING = 4 * float(np.finfo(float).eps)
"""Of a position, relative to its size."""


LANDED, ALOFT, FAILED, FURTHER = range(4)
"""Status of one of many flights; `FURTHER` and more are of the ends after the ground."""


class FlightStatus(StrEnum):
    """How a flight (the first three), a row of `fly_many` or a `Course` ends."""

    LANDED = "landed"
    AT_PLANE = "at-plane"
    ALOFT = "aloft"
    FAILED = "failed"
    AT_REST = "at-rest"
    BOUNCING = "bouncing"
    BLOWN = "blown"


@dataclass(frozen=True, eq=False, repr=False)
class Flight(ReprMixin):
    """The flight of a ball; all times count from the launch.

    Attributes:
        ball, air, ground, plane, tol: the arguments of `fly`.
        launch: the ball at the launch, at time 0.
        apex: the ball at its highest point, as exact as the landing; the launch if it never rises.
        landing: the ball at the end of the flight: on the ground, back at the height of the launch,
            or at the plane.
        status: `landed`; `at-plane`, where the ball reached the plane first; the name of one of
            the further ends; or `aloft`, where the ball reached none before the time limit, and
            `landing` is merely the last state.
        method: how the flight was computed.
        evaluations: number of evaluations of the acceleration, up to the landing; 0 for the closed
            form.
    """

    ball: Ball
    air: Air | None
    ground: Ground | None
    plane: Plane | None
    tol: float
    _fly_again: "Callable[..., Flight]" = field(repr=False)
    launch: BallState
    apex: BallState
    landing: BallState
    status: str
    method: str
    evaluations: int
    _trajectory: Callable[[Array], Array] = field(repr=False)

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
        yield from warned(self.warnings)

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

        It is twice what the landing moves, in space or along the path in its time, when the
        tolerance is 10,000 times tighter (at tightest 5e-15), and at least 1e-3 of the tolerance or
        3e-14 times the flight's length, plus the rounding of the position. In the median it is 2 to
        10 times the error (`benchmarks/batch_flight.py`). Where the integrator gives the second
        flight up, it is infinite. Where the wind or a coefficient is a function of your own, that
        flight takes at least 500 steps, so that a narrow peak of C_D counts.
        """
        ends = self.apex.position, self.landing.position
        length = float(np.abs(np.subtract(ends, self.launch.position)).max())
        speed, grazing = math.hypot(*self.landing.velocity), 1.0
        if self.status is FlightStatus.AT_PLANE and self.plane is not None:
            normal_speed = abs(float(self.plane.normal @ self.landing.velocity))
            grazing = speed / max(normal_speed, 1e-300)
        rounding = ROUNDING * float(np.abs(self.launch.position).max()) * grazing
        if self.evaluations == 0:
            return rounding + ROUNDING * length * grazing
        tol, longest = refinement(self.tol, self.duration, self.air)
        try:
            finer = self._fly_again(tol=tol, max_step=longest).landing
        except KickdynError:
            return math.inf
        late = speed * abs(self.duration - float(finer.time))
        apart = float(np.linalg.norm(self.landing.position - finer.position))
        return max(2.0 * late, 2.0 * apart, least_error(self.tol) * length) + rounding

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for the ball, for each coefficient outside its range, and above Mach 0.3."""
        return flight_warnings([self])

    def arrival(self, x: float) -> BallState | None:
        """Return the ball where its centre first is at `x`, or None if it never is.

        The state is as exact as a landing: it is the end of a second flight, at a plane. The
        coordinate is of the ball's centre [m, world frame].
        """
        coordinate = validation.number("x", x, unit="m")
        before = float(self.launch.position[0]) - coordinate
        if before == 0.0:
            return self.sample(0.0)
        path = self._fly_again(plane=Plane((coordinate, 0, 0), (before, 0, 0), "centre"))
        tie = 10 * self.tol
        if path.status is FlightStatus.AT_PLANE:
            return path.landing if path.duration <= self.duration * (1 + tie) else None
        # the ground may have come first by rounding
        short = abs(float(path.landing.position[0]) - coordinate)
        return path.landing if short <= tie * abs(before) else None

    def __reduce__(self) -> "tuple[Callable[[], Flight], tuple[()]]":
        """Pickle the inputs of the flight; unpickling flies it again, to the same last bit."""
        return self._fly_again, ()

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at one time or many.

        The states are interpolated within the steps of the integration. The error of a position is
        a few times `tol` times the length of the flight in the median, and can be some 60 times
        that.

        Args:
            t: time since the launch, from 0 to `duration`, a number or shape `(n,)` [s].
        """
        times = validation.times(t, self.duration, "the flight")
        states = self._trajectory(np.atleast_1d(times)).reshape(*times.shape, 7)
        position, spin = self.launch.position + states[..., :3], states[..., 6:7] * self.launch.spin
        if not (np.isfinite(states).all() and np.isfinite(position).all()):
            return BallState(position, states[..., 3:6], spin, times)  # raises
        validation.protect(times)
        time = times if times.ndim else float(times)
        return BallState.computed(position, states[..., 3:6], spin, time)

    def orientation(self, t: ArrayLike) -> "Rotation":
        r"""Return the rotation of the ball since its launch, in the world frame.

        The air brakes the spin but does not turn its axis, so the rotation vector is
        :math:`\int_0^t \omega\, dt`, by Gauss's rule. Its `as_quat()` gives `(x, y, z, w)`,
        as Pinocchio and meshcat take it, `as_matrix()` the rotation matrix.

        Args:
            t: time since the launch, as for `sample` [s].
        """
        from scipy.spatial.transform import Rotation  # takes 0.1 s

        times = validation.times(t, self.duration, "the flight")
        nodes, weights = np.polynomial.legendre.leggauss(32)  # spin is far smoother than the path
        share = self._trajectory(np.outer(times, 0.5 * (nodes + 1.0)).ravel())[:, 6]
        spin_time = 0.5 * times * (share.reshape(*times.shape, len(nodes)) @ weights)
        return Rotation.from_rotvec(spin_time[..., None] * self.launch.spin)


def refinement(tol: float, duration: Any, air: Air | None) -> tuple[float, Any]:
    """Return tolerance and longest step [s] of the flight that shows the error of one at `tol`.

    The duration is of one flight, or of n, shape `(n,)` [s]. The steps are limited where a
    wind or coefficient of the user's own may have features that are too narrow for them.
    """
    models = () if air is None else (air.drag, air.lift, air.torque)
    registered = all(model is None or is_known(model) for model in models)
    is_unknown = air is not None and (callable(air.wind) or not registered)
    return max(1e-4 * tol, 5e-15), duration / 500 if is_unknown else None


def least_error(tol: float) -> float:
    """Return the least estimate of an error that is believed, relative to the flight's length."""
    return max(1e-3 * tol, 3e-14)


def flight_warnings(flights: Sequence[Flight]) -> tuple[str, ...]:
    """Return the warnings of consecutive flights of a ball; shares are of their common duration."""
    ball, air = flights[0].ball, flights[0].air
    lines = list(ball.warnings)
    if air is None or not any(flight.evaluations for flight in flights):
        return tuple(lines)
    aloft = sum(flight.duration for flight in flights)
    samples = []
    for flight in flights:
        count = max(2, round(SAMPLES * flight.duration / aloft)) if aloft else 2
        samples.append(flight.sample(np.linspace(0.0, flight.duration, count)))
    position, velocity, spin = (
        np.concatenate([getattr(states, name) for states in samples])
        for name in ("position", "velocity", "spin")
    )
    per_speed = 2 * ball.radius * air.density / air.viscosity
    for model, beyond in outside_ranges(position[:, 2], velocity, spin, ball, air):
        names = (
            f"airspeed below {model.reynolds[0] / per_speed:.3g} m/s",
            f"airspeed above {model.reynolds[1] / per_speed:.3g} m/s",
            f"spin parameter below {model.spin[0]:g}",
            f"spin parameter above {model.spin[1]:g}",
        )
        limits = [name for name, rows in zip(names, beyond, strict=True) if rows.any()]
        if limits:
            lines.append(
                f"{model.kind} {model.name}: {100 * beyond.any(axis=0).mean():.0f} % of the "
                f"flight is outside its data ({', '.join(limits)})"
            )
    if (speed := flights[0].launch.speed) > COMPRESSIBLE:
        lines.append(
            f"the launch speed of {speed:.3g} m/s is above {COMPRESSIBLE:g} m/s, "
            "Mach 0.3: there the air is compressed, and no coefficient is valid"
        )
    return tuple(lines)


def outside_ranges(
    height: Array, velocity: Array, spin: Array, ball: Ball, air: Air
) -> list[tuple[CoefficientModel, NDArray[np.bool_]]]:
    """Return each model of drag and lift, and where n states are `beyond` its range, `(4, n)`.

    Models of the torque are left out: nobody measured it for soccer balls. Heights of the centres
    have shape `(n,)` [m], velocities and spins `(n, 3)` [m/s, rad/s, world frame].
    """
    wind = air.wind
    if callable(wind):
        wind = np.array([wind(z) for z in height.tolist()]).reshape(-1, 3)
    through = velocity - wind
    square = np.maximum(np.einsum("ij,ij->i", through, through), 1e-300)
    along = np.einsum("ij,ij->i", through, spin)
    spin_square = np.einsum("ij,ij->i", spin, spin)
    transverse = np.sqrt(np.maximum(spin_square - along * along / square, 0.0))
    speed = np.sqrt(square)
    reynolds = 2 * ball.radius * air.density / air.viscosity * speed
    spin_parameter = ball.radius * transverse / speed
    spins = ball.radius * np.sqrt(spin_square) > 1e-9 * speed  # rounding leaves less to a plan
    return [
        (model, (spins | (model is air.drag)) & model.beyond(reynolds, spin_parameter))
        for model in (air.drag, air.lift)
        if isinstance(model, CoefficientModel)
    ]
