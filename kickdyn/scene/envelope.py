"""How far a disturbance can move the end of a flight, from one flight in a few large steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

from kickdyn.aerodynamics.coefficient_model import Coefficient
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.core.gravity import GRAVITY
from kickdyn.flight.forces import time_to_fall
from kickdyn.scene.coarse_flight import State, coarse_path, drop_below, refuses_extrapolation
from kickdyn.scene.scene import FlightEnvironment

STEPS = 4
"""Large steps of the flight."""

MARGIN = 1.25
"""Factor on coefficients, which are evaluated at the nodes of that flight only."""


class LaunchError(NamedTuple):
    """How far the launch may be off.

    Attributes:
        velocity: [m/s].
        spin: [rad/s].
        position: [m].
    """

    velocity: float = 0.0
    spin: float = 0.0
    position: float = 0.0


EXACT = LaunchError()


class Envelope:
    r"""Bounds around the flight with every effect that the scene names.

    Let X be that flight and Y one whose acceleration differs by at most a where X is. Then both are
    :math:`\tfrac12 a t^2 e^{\lambda t}` apart at most (Gronwall's inequality), with
    :math:`\lambda` the largest rate at which the forces drive neighbours apart: drag does so only
    where it falls as speed grows.

    Args:
        launch: by the instantaneous strike.
        environment: what the ball flies through, and what ends its path.
        launch_error: how far the launch may be off.

    Attributes:
        environment, launch_error: as given.
        speeds: relative to the air, at the nodes of the flight [m/s].
        spin: the largest [rad/s].
        time: duration of the flight [s]; inf where nothing is known, as of a ball that bounces, or
            that may leave the range of a coefficient that refuses extrapolation.
        drag, lift, buoyancy: largest acceleration by each [m/s2].
        drag_crisis: largest change of acceleration from the drag coefficient of the launch [m/s2].
        by_spin: change of acceleration with spin [m/s2 per rad/s].
        by_wind: change of acceleration by the wind [m/s2].
        end: state at the end of the flight; None where nothing is known.
        evaluations: of the acceleration.
    """

    def __init__(
        self,
        launch: BallState,
        environment: FlightEnvironment,
        launch_error: LaunchError = EXACT,
    ) -> None:
        self.environment, self.launch_error = environment, launch_error
        self._height, self._rise = float(launch.position[2]), float(launch.velocity[2])
        self._fastest = math.hypot(*launch.velocity.tolist())
        self._drop = max(drop_below(launch, environment), 0.0)
        self.time, self.evaluations = math.inf, 0
        self.spin = math.hypot(*launch.spin.tolist()) + launch_error.spin
        self.drag = self.lift = self.buoyancy = self.drag_crisis = 0.0
        self.by_spin = self.by_wind = self._growth = 0.0
        self.speeds: list[float] = []
        self.end: BallState | None = None
        ball, air, ground, _ = environment
        bounces = ground is not None and ground.surface is not None
        if bounces or not launch_error.velocity < math.inf or refuses_extrapolation(air):
            return
        (self.end, _, self.evaluations), nodes = coarse_path(launch, environment, STEPS)
        if self.end is None or not float(self.end.time) > 0.0:
            return
        self.time = float(self.end.time)
        if air is not None and air.density > 0.0:
            self.buoyancy = GRAVITY * air.density * ball.volume / ball.mass
            if callable(air.wind):
                self.time = math.inf
                return
            self._bound_forces(air, nodes)

    def shift(self, acceleration: float = 0.0, launch_error: LaunchError = EXACT) -> float:
        """Return how far the end can move [m]; inf where that is not known.

        The paths part until the later one ends, and that one goes on after the other has ended.

        Args:
            acceleration: that is neglected [m/s2].
            launch_error: how far the launch is off.
        """
        if self.end is None or not math.isfinite(self.time):
            return math.inf
        if acceleration == 0.0 and launch_error == EXACT:
            return 0.0
        acceleration += self.by_spin * launch_error.spin
        velocity = self.end.velocity
        speed = max(self._fastest, math.hypot(*velocity.tolist())) + launch_error.velocity
        gap, closing = self._other_end()
        shift = self._steep_shift(self.time, acceleration, launch_error, speed, closing)
        if self.environment.plane is None:
            shift = min(shift, self._light_shift(acceleration, launch_error, speed))
        return shift if shift < gap else math.inf

    def _bound_forces(self, air: Air, nodes: list[State]) -> None:
        """Evaluate the coefficients at the nodes: the largest accelerations and their changes."""
        ball = self.environment.ball
        wx, wy, wz = (float(part) for part in air.wind)  # type: ignore[union-attr]
        wind = math.hypot(wx, wy, wz)
        off = self.launch_error.velocity
        self.speeds = speeds = [
            max(math.hypot(y[3] - wx, y[4] - wy, y[5] - wz) + off, 1e-9) for y in nodes
        ]
        per_speed = 2.0 * ball.radius * air.density / air.viscosity
        k = MARGIN * 0.5 * air.density * ball.cross_section / ball.mass
        surface_speed, fastest = ball.radius * self.spin, max(speeds)

        def largest(values: list[float]) -> float:
            return k * max(c * v * v for c, v in zip(values, speeds, strict=True))

        if air.drag is not None:
            found = [air.drag(per_speed * v, surface_speed / v) for v in speeds]
            level = air.drag(per_speed * speeds[0], surface_speed / speeds[0])
            self.drag = largest(found)
            still = [air.drag(per_speed * v, 0.0) for v in speeds]  # spin along the flight
            pairs = zip(found, still, strict=True)
            self.drag_crisis = largest([max(abs(a - level), abs(b - level)) for a, b in pairs])
            steepest = self._steepest_drag(air.drag, per_speed, fastest, min(speeds), k)
            change = (2.0 * fastest + wind) * max(found) + steepest * fastest * fastest
            self.by_wind = k * change * wind
            self.by_spin = k * _spin_slope(air.drag, per_speed * fastest) * ball.radius * fastest
        if air.lift is not None and surface_speed:
            found = [air.lift(per_speed * v, surface_speed / v) for v in speeds]
            self.lift = largest(found)
            self._growth += k * max(found) * fastest
            self.by_spin += k * _spin_slope(air.lift, per_speed * fastest) * ball.radius * fastest
            self.by_wind += 2.0 * k * max(found) * (2.0 * fastest + wind) * wind

    def _steepest_drag(
        self, drag: Coefficient, per_speed: float, fastest: float, slowest: float, k: float
    ) -> float:
        """Return the steepest slope of the drag coefficient [s/m]; add to the rate of parting."""
        width = (fastest - slowest) / 8.0
        if not width > 1e-6 * fastest:
            return 0.0
        speeds = [slowest + i * width for i in range(9)]
        found = [drag(per_speed * v, 0.0) for v in speeds]
        force = [c * v * v for c, v in zip(found, speeds, strict=True)]
        self._growth += k * max(0.0, *(a - b for a, b in pairwise(force))) / width
        return max(abs(a - b) for a, b in pairwise(found)) / width

    def _parted(self, t: float, acceleration: float, error: LaunchError) -> float:
        """Return how far two paths are apart at most after a time [m]."""
        growth = math.exp(min(self._growth * t, 50.0))
        return (error.position + error.velocity * t + 0.5 * acceleration * t * t) * growth

    def _steep_shift(
        self, t: float, acceleration: float, error: LaunchError, speed: float, closing: float
    ) -> float:
        """Return the shift of a path that reaches the ground, or the plane, steeply enough.

        What separates a path from its end remains to be covered, at no less than the speed that
        gravity leaves the ball.
        """
        parted = self._parted(t, acceleration, error)
        if not parted < math.inf:
            return math.inf
        left = closing * closing - 2.0 * MARGIN * GRAVITY * parted
        if not (closing > 0.0 and left > 0.0):
            return math.inf
        return parted * (1.0 + (speed + acceleration * t) / math.sqrt(left))

    def _light_shift(self, acceleration: float, error: LaunchError, speed: float) -> float:
        """Return the shift of a path that the air bends by little.

        Its duration is gravity's, more or less, and grows with rise, drop, and with what opposes
        gravity.
        """
        force = self.drag + self.lift + self.buoyancy + acceleration
        if not force < 0.9 * GRAVITY:
            return math.inf
        rise, drop, off = self._rise, self._drop, error.velocity
        longest = time_to_fall(rise + off, drop + error.position, GRAVITY - force)
        shortest = time_to_fall(rise - off, max(drop - error.position, 0.0), GRAVITY + force)
        return self._parted(longest, acceleration, error) + speed * (longest - max(shortest, 0.0))

    def _other_end(self) -> tuple[float, float]:
        """Return the distance to what did not end the flight [m], and the speed at what did."""
        ball, _, ground, plane = self.environment
        end = self.end
        assert end is not None
        falling = -float(end.velocity[2])
        if plane is None:
            return math.inf, falling
        closing = -float(plane.normal @ end.velocity)
        reached = {"front": -ball.radius, "centre": 0.0, "back": ball.radius}[plane.reached_by]
        gap = float(plane.normal @ (end.position - plane.point)) + reached
        if gap > 1e-6 * ball.radius:
            return gap, falling
        floor = self._height if ground is None else ground.height + ball.radius
        return float(end.position[2]) - floor, closing


def _spin_slope(model: Callable[[float, float], float], reynolds: float) -> float:
    """Return the steepest change of a coefficient with the spin parameter."""
    grid = (0.0, 0.01, 0.1, 0.4)
    found = [model(reynolds, s) for s in grid]
    return max(
        abs(b - a) / (t - s) for s, t, a, b in zip(grid, grid[1:], found, found[1:], strict=False)
    )
