"""How far a disturbance can move the end of a flight, from one flight in a few large steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

from kickdyn.aerodynamics.coefficient_model import Coefficient
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.flight.forces import GRAVITY, time_to_fall
from kickdyn.scene.coarse_flight import FlightEnvironment, State, coarse_path, drop_of

STEPS = 4

MARGIN = 1.25
"""On what is looked at in the nodes of that flight only."""


class Jump(NamedTuple):
    """What the launch may be off by.

    Attributes:
        velocity, spin, moved: [m/s, rad/s, m].
    """

    velocity: float = 0.0
    spin: float = 0.0
    moved: float = 0.0


NO_JUMP = Jump()


class Envelope:
    """Bounds around the flight with every effect that the scene names.

    Let X be that flight and Y one whose acceleration differs by at most a where X is. Then both are
    a t^2/2 exp(lt) apart at most (Gronwall), l being the largest rate at which the forces drive
    neighbours apart: drag does so only where it falls as speed grows.

    Args:
        launch: by the instant's strike.
        way: what the ball moves through.
        jump: what the launch may be off by.

    Attributes:
        way, jump: as given.
        speeds: relative to the air, at the nodes of the flight [m/s].
        spin: the largest [rad/s].
        time: of the flight [s]; inf where nothing is known, as of what bounces, or may leave the
            range of a coefficient that refuses to be used there.
        drag, lift, buoyancy: largest acceleration by each [m/s2].
        crisis: by what drag differs from that with the coefficient of the launch [m/s2].
        by_spin, by_wind: change of acceleration with spin [m/s2 per rad/s], and by wind [m/s2].
        end: state at its end; None where nothing is known.
        evaluations: of the acceleration.
    """

    def __init__(self, launch: BallState, way: FlightEnvironment, jump: Jump = NO_JUMP) -> None:
        self.way, self.jump = way, jump
        self._launched, self._rise = float(launch.position[2]), float(launch.velocity[2])
        self._fastest = math.hypot(*launch.velocity.tolist())
        self._drop = max(drop_of(launch, way), 0.0)
        self.time, self.evaluations = math.inf, 0
        self.spin = math.hypot(*launch.spin.tolist()) + jump.spin
        self.drag = self.lift = self.crisis = self.by_spin = self.by_wind = self._apart = 0.0
        self.buoyancy = 0.0
        self.speeds: list[float] = []
        self.end: BallState | None = None
        air, bounces = way.air, way.ground is not None and way.ground.surface is not None
        if bounces or not jump.velocity < math.inf or (air is not None and refuses(air)):
            return
        (self.end, _, self.evaluations), nodes = coarse_path(launch, way, STEPS)
        if self.end is None or not float(self.end.time) > 0.0:
            return
        self.time = float(self.end.time)
        if air is not None and air.density > 0.0:
            self.buoyancy = GRAVITY * air.density * way.ball.volume / way.ball.mass
            if callable(air.wind):
                self.time = math.inf
                return
            self._look(air, nodes)

    def _look(self, air: Air, nodes: list[State]) -> None:
        """Evaluate the coefficients at the nodes."""
        ball = self.way.ball
        wx, wy, wz = (float(part) for part in air.wind)  # type: ignore[union-attr]
        wind = math.hypot(wx, wy, wz)
        speeds = [math.hypot(y[3] - wx, y[4] - wy, y[5] - wz) + self.jump.velocity for y in nodes]
        speeds = [max(speed, 1e-9) for speed in speeds]
        self.speeds = speeds
        per_speed = 2.0 * ball.radius * air.density / air.viscosity
        k = MARGIN * 0.5 * air.density * ball.cross_section / ball.mass
        turning, fastest = ball.radius * self.spin, max(speeds)
        if air.drag is not None:
            found = [air.drag(per_speed * v, turning / v) for v in speeds]
            level = air.drag(per_speed * speeds[0], turning / speeds[0])
            self.drag = k * max(c * v * v for c, v in zip(found, speeds, strict=True))
            still = [air.drag(per_speed * v, 0.0) for v in speeds]  # a spin along the flight
            off = [max(abs(a - level), abs(b - level)) for a, b in zip(found, still, strict=True)]
            self.crisis = k * max(c * v * v for c, v in zip(off, speeds, strict=True))
            steepest = self._shape(air.drag, per_speed, fastest, min(speeds), k)
            both = (2.0 * fastest + wind) * max(found) + steepest * fastest * fastest
            self.by_wind = k * both * wind
            self.by_spin = k * _slope(air.drag, per_speed * fastest) * ball.radius * fastest
        if air.lift is not None and turning:
            found = [air.lift(per_speed * v, turning / v) for v in speeds]
            self.lift = k * max(c * v * v for c, v in zip(found, speeds, strict=True))
            self._apart += k * max(found) * fastest
            self.by_spin += k * _slope(air.lift, per_speed * fastest) * ball.radius * fastest
            self.by_wind += 2.0 * k * max(found) * (2.0 * fastest + wind) * wind

    def _shape(
        self, drag: Coefficient, per_speed: float, fastest: float, slowest: float, k: float
    ) -> float:
        """Note how drag drives neighbours apart; return its coefficient's steepest slope [s/m]."""
        width = (fastest - slowest) / 8.0
        if not width > 1e-6 * fastest:
            return 0.0
        speeds = [slowest + i * width for i in range(9)]
        found = [drag(per_speed * v, 0.0) for v in speeds]
        force = [c * v * v for c, v in zip(found, speeds, strict=True)]
        self._apart += k * max(0.0, *(a - b for a, b in pairwise(force))) / width
        return max(abs(a - b) for a, b in pairwise(found)) / width

    def shift(self, acceleration: float = 0.0, jump: Jump = NO_JUMP) -> float:
        """Return how far the end can move [m]; inf where that is not known.

        By an acceleration left out, and by a launch that is off: as far as the paths part until the
        later one ends, and as far as that one goes on after the other has ended.
        """
        if self.end is None or not math.isfinite(self.time):
            return math.inf
        if acceleration == 0.0 and jump == NO_JUMP:
            return 0.0
        acceleration += self.by_spin * jump.spin
        velocity = self.end.velocity
        speed = max(self._fastest, math.hypot(*velocity.tolist())) + jump.velocity
        gap, closing = self._reached()
        moved = self._late(self.time, acceleration, jump, speed, closing)
        if self.way.plane is None:
            moved = min(moved, self._early(acceleration, jump, speed))
        return moved if moved < gap else math.inf

    def _away(self, t: float, acceleration: float, jump: Jump) -> float:
        """Return how far paths part in a time [m]."""
        grown = math.exp(min(self._apart * t, 50.0))
        return (jump.moved + jump.velocity * t + 0.5 * acceleration * t * t) * grown

    def _late(
        self, t: float, acceleration: float, jump: Jump, speed: float, closing: float
    ) -> float:
        """Return the shift of a path that comes down, or to a plane, steeply enough.

        What is `away` from reaching it still has to cover that, at no less than the speed that
        gravity leaves it.
        """
        away = self._away(t, acceleration, jump)
        if not away < math.inf:
            return math.inf
        left = closing * closing - 2.0 * MARGIN * GRAVITY * away
        if not (closing > 0.0 and left > 0.0):
            return math.inf
        return away * (1.0 + (speed + acceleration * t) / math.sqrt(left))

    def _early(self, acceleration: float, jump: Jump, speed: float) -> float:
        """Return the shift of a path that the air hardly bends.

        Its time is gravity's, more or less, and grows with rise, drop, and what pulls less.
        """
        force = self.drag + self.lift + self.buoyancy + acceleration
        if not force < 0.9 * GRAVITY:
            return math.inf
        up, drop, off = self._rise, self._drop, jump.velocity
        longest = time_to_fall(up + off, drop + jump.moved, GRAVITY - force)
        shortest = time_to_fall(up - off, max(drop - jump.moved, 0.0), GRAVITY + force)
        return self._away(longest, acceleration, jump) + speed * (longest - max(shortest, 0.0))

    def _reached(self) -> tuple[float, float]:
        """Return how far what did not end the flight is away [m], and the speed at what did."""
        way, end = self.way, self.end
        assert end is not None
        falling = -float(end.velocity[2])
        if way.plane is None:
            return math.inf, falling
        normal, radius = way.plane.normal, way.ball.radius
        closing = -float(normal @ end.velocity)
        parts = {"front": -radius, "centre": 0.0, "back": radius}
        gap = float(normal @ (end.position - way.plane.point)) + parts[way.plane.reached_by]
        if gap > 1e-6 * radius:
            return gap, falling
        floor = self._launched if way.ground is None else way.ground.height + radius
        return float(end.position[2]) - floor, closing


def refuses(air: Air) -> bool:
    """Return whether a coefficient ends a flight that leaves its range."""
    return any(getattr(model, "refuses", False) for model in (air.drag, air.lift))


def _slope(model: Callable[[float, float], float], reynolds: float) -> float:
    """Return the steepest change of a coefficient with the spin parameter."""
    grid = (0.0, 0.01, 0.1, 0.4)
    found = [model(reynolds, s) for s in grid]
    return max(
        abs(b - a) / (t - s) for s, t, a, b in zip(grid, grid[1:], found, found[1:], strict=False)
    )
