"""How far a disturbance can move the end of a flight, from one flight in a few large steps."""

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

from kickdyn.aerodynamics.coefficient_model import Coefficient
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.core.gravity import GRAVITY
from kickdyn.flight.forces import acceleration_function
from kickdyn.scene.coarse_flight import State, coarse_end
from kickdyn.scene.scene import FlightEnvironment

STEPS = 4
"""Large steps of the flight."""

MARGIN = 1.25
"""Factor on accelerations, which are evaluated at the nodes of that flight only."""


class LaunchError(NamedTuple):
    """How far velocity [m/s], spin [rad/s] and position [m] of the launch may be off."""

    velocity: float = 0.0
    spin: float = 0.0
    position: float = 0.0


EXACT = LaunchError()


class Envelope:
    r"""Bounds around the flight with every effect that the scene names.

    Let X be that flight and Y one whose acceleration differs by at most a where X is. Then both are
    :math:`\tfrac12 a t^2 e^{\lambda t}` apart at most (Gronwall's inequality), with
    :math:`\lambda` the largest rate at which the forces drive neighbours apart: drag does so only
    where it falls as speed grows. Accelerations are evaluated at the nodes of X, which has few
    large steps.

    Attributes:
        launch, environment, launch_error: as given.
        time: duration of the flight [s]; inf where nothing is known, as of a ball that bounces, in
            a wind that depends on height, or where a coefficient is the user's own or refuses
            extrapolation.
        obstacle: why no bound is known, where that is so; `docs/how-to/tolerance.md` explains it.
        end: state at the end of the flight in large steps; None where these do not suffice.
        evaluations: of the acceleration.
    """

    def __init__(
        self,
        launch: BallState,
        environment: FlightEnvironment,
        launch_error: LaunchError = EXACT,
    ) -> None:
        self.launch, self.environment, self.launch_error = launch, environment, launch_error
        self.time, found = math.inf, coarse_end(launch, environment, STEPS)
        self.end, _, self.evaluations, self._nodes = found
        air, ground = environment.air, environment.ground
        self.obstacle = "it is not certain where the path ends without it"
        if launch_error.velocity == math.inf:
            self.obstacle = "the contact takes time"
        elif ground is not None and ground.surface is not None:
            self.obstacle = "the ball bounces or rolls"
        elif air is not None and callable(air.wind):
            self.obstacle = "the wind is a function of height"
        elif self.end is None:
            self.obstacle = "a few large steps do not follow this flight"
        elif self.end.time > 0.0:
            self.time = float(self.end.time)

    def difference(self, air: Air | None) -> float:
        """Return how far the acceleration with another air differs at most on the flight [m/s2]."""
        if not math.isfinite(self.time):
            return math.inf
        return MARGIN * max(map(math.dist, self._accelerations(air), self._own_accelerations))

    def spin_decay(self) -> float:
        """Return how far the acceleration differs at most where the spin does not decay [m/s2]."""
        if not math.isfinite(self.time):
            return math.inf
        lost = 1.0 - min(node[6] for node in self._nodes)
        return self._by_spin * lost * math.hypot(*self.launch.spin.tolist())

    def shift(self, acceleration: float = 0.0, launch_error: LaunchError = EXACT) -> float:
        """Return how far the end can move [m]; inf where that is not known.

        What separates a path from its end as the other ends remains to be covered, at no less than
        the speed that gravity and the air leave the ball. The acceleration that is neglected is in
        m/s2.
        """
        if not math.isfinite(self.time):
            return math.inf
        if acceleration == 0.0 and launch_error == EXACT:
            return 0.0
        t, growth = self.time, self._growth * self.time
        if not growth < 50.0:
            return math.inf
        if launch_error.spin > 0.0:
            acceleration += self._by_spin * launch_error.spin
        faster = (launch_error.velocity + acceleration * t) * math.exp(growth)
        parted = launch_error.position + launch_error.velocity * t + 0.5 * acceleration * t * t
        parted *= math.exp(growth)
        gap, closing, slowing = self._other_end()
        least = closing - faster
        left = least * least - 2.0 * max(slowing + acceleration, 0.0) * parted
        if not (least > 0.0 and left > 0.0):
            return math.inf
        shift = parted * (1.0 + (self._fastest + faster) / math.sqrt(left))
        return shift if shift < gap else math.inf

    @cached_property
    def _own_accelerations(self) -> Sequence[State]:
        """The acceleration at each node [m/s2]."""
        return self._accelerations(self.environment.air)

    def _accelerations(self, air: Air | None) -> Sequence[State]:
        """Return the acceleration at each node, with another air [m/s2]."""
        if air is None or air.density == 0.0:
            return [(0.0, 0.0, -GRAVITY)] * len(self._nodes)
        acting, (wx, wy, wz) = (
            acceleration_function(self.environment.ball, air),
            self.launch.spin.tolist(),
        )
        height, found = float(self.launch.position[2]), []
        for _, _, z, vx, vy, vz, left in self._nodes:
            found.append(acting(height + z, vx, vy, vz, left * wx, left * wy, left * wz)[:3])
        self.evaluations += len(found)
        return found

    @cached_property
    def _fastest(self) -> float:
        """The largest speed of the flight [m/s]."""
        return max(math.hypot(*state[3:6]) for state in self._nodes)

    @cached_property
    def _air_speeds(self) -> list[float]:
        """Speeds relative to the air, from the least of the flight to the largest [m/s]."""
        air, off = self.environment.air, self.launch_error.velocity
        assert air is not None
        wind = air.wind_at(0.0)
        found = [math.dist(state[3:6], wind) for state in self._nodes]
        least, most = max(min(found) - off, 1e-9), max(max(found) + off, 2e-9)
        return [least + i * (most - least) / 8.0 for i in range(9)]

    @cached_property
    def _coefficient_scale(self) -> tuple[float, float]:
        """Acceleration by a coefficient of 1 at 1 m/s, and the Reynolds number of that speed."""
        ball, air = self.environment.ball, self.environment.air
        assert air is not None
        per_speed = 2.0 * ball.radius * air.density / air.viscosity
        return MARGIN * 0.5 * air.density * ball.cross_section / ball.mass, per_speed

    @cached_property
    def _growth(self) -> float:
        """The largest rate at which drag and lift drive neighbouring flights apart [1/s]."""
        ball, air, *_ = self.environment
        if air is None or air.density == 0.0:
            return 0.0
        speeds, (scale, per_speed) = self._air_speeds, self._coefficient_scale
        rate, width = 0.0, speeds[1] - speeds[0]
        if air.drag is not None and width > 1e-6 * speeds[-1]:
            force = [air.drag(per_speed * v, 0.0) * v * v for v in speeds]
            rate += scale * max(0.0, *(a - b for a, b in pairwise(force))) / width
        spin = math.hypot(*self.launch.spin.tolist()) + self.launch_error.spin
        surface_speed = ball.radius * spin
        if air.lift is not None and surface_speed:
            most = max(abs(air.lift(per_speed * v, surface_speed / v)) for v in speeds)
            rate += scale * most * speeds[-1]
        return rate

    @cached_property
    def _by_spin(self) -> float:
        """The largest change of acceleration with spin [m/s2 per rad/s]."""
        ball, air, *_ = self.environment
        if air is None or air.density == 0.0:
            return 0.0
        fastest, (scale, per_speed) = self._air_speeds[-1], self._coefficient_scale
        models = [model for model in (air.drag, air.lift) if model is not None]
        slope = sum(_spin_slope(model, per_speed * fastest) for model in models)
        return scale * slope * ball.radius * fastest

    def _other_end(self) -> tuple[float, float, float]:
        """Return the distance to what did not end the flight, and how the flight ends.

        The distance is in m; then follow the speed at what ended the flight [m/s] and the largest
        deceleration towards that [m/s2].
        """
        ball, _, ground, plane = self.environment
        end = self.end
        assert end is not None
        falling = -float(end.velocity[2])
        by_air = [math.hypot(x, y, z + GRAVITY) for x, y, z in self._own_accelerations]
        slowing = MARGIN * max(by_air)
        if plane is None:
            return math.inf, falling, slowing - GRAVITY
        closing = -float(plane.normal @ end.velocity)
        reached = {"front": -ball.radius, "centre": 0.0, "back": ball.radius}[plane.reached_by]
        gap = float(plane.normal @ (end.position - plane.point)) + reached
        if gap > 1e-6 * ball.radius:
            return gap, falling, slowing - GRAVITY
        height = float(self.launch.position[2])
        floor = height if ground is None else ground.height + ball.radius
        slowing += GRAVITY * float(plane.normal[2])
        return float(end.position[2]) - floor, closing, slowing


def _spin_slope(model: Coefficient, reynolds: float) -> float:
    """Return the steepest change of a coefficient with the spin parameter."""
    grid = (0.0, 0.01, 0.1, 0.4)
    found = [model(reynolds, s) for s in grid]
    return max(
        abs(b - a) / (t - s) for s, t, a, b in zip(grid, grid[1:], found, found[1:], strict=False)
    )
