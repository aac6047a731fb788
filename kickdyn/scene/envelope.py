"""How far a disturbance can move the end of a flight, from one flight in a few large steps."""

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.core.gravity import GRAVITY
from kickdyn.flight.forces import acceleration_function
from kickdyn.scene.coarse_flight import State, coarse_end
from kickdyn.scene.scene import FlightEnvironment

STEPS = 4
"""Large steps of the flight."""

MARGIN = 1.25
"""Factor on accelerations, which are evaluated at a few states of that flight only."""

SLICES = 8
"""Into which the speeds and spin parameters of a flight are cut for the slopes of coefficients."""

FROM_NO_SPIN = (0.0, 0.01, 0.1, 0.4)
"""Spin parameters between which coefficients change with a spin of any size."""


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
    large steps, and where the ball is slowest between them, such as at the apex.

    Attributes:
        launch, environment, launch_error: as given.
        time: duration of the flight [s]; inf where nothing is known, as of a ball that bounces, in
            a wind that depends on height, or where a coefficient is the user's own or refuses
            extrapolation.
        obstacle: why no bound is known, where that is so; and when there would be one.
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
        self.obstacle = (
            "so large an effect may change what ends the path, such as the ground before a goal "
            "line; slower balls and smaller effects have bounds"
        )
        if launch_error.velocity == math.inf:
            self.obstacle = (
                "how much the contact time changes the launch is not known; an instantaneous "
                "contact has bounds"
            )
        elif ground is not None and ground.surface is not None:
            self.obstacle = (
                "after a bounce, small differences grow; a ground without a surface, where the "
                "path ends as the ball lands, has bounds"
            )
        elif air is not None and callable(air.wind):
            self.obstacle = "the wind is a function of height; a constant wind has bounds"
        elif self.end is None:
            self.obstacle = (
                "a few large steps do not follow this flight, or a coefficient is a function of "
                "the user's own; models by name have bounds"
            )
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
        left = min(node[6] for node in self._nodes)
        surface_speed = self.environment.ball.radius * self._spin
        if surface_speed == 0.0:
            return 0.0
        slow, *_, fast = self._air_speeds
        # half: a margin; less spin than that counts where its axis is along the flight
        least = 0.5 * min(left * surface_speed / fast, FROM_NO_SPIN[-1])
        # beyond 1, no coefficient changes faster than below
        most = max(min(surface_speed / slow, 1.0), 2.0 * least)
        parameters = np.geomspace(least, most, SLICES + 1).tolist()
        return self._by_spin(parameters) * (1.0 - left) * self._spin

    def shift(self, acceleration: float = 0.0, launch_error: LaunchError = EXACT) -> float:
        r"""Return how far the end can move [m]; inf where that is not known.

        Let the paths be :math:`\delta` apart when the flight ends at a surface of normal n. The
        other one reaches it later or earlier, at a mean velocity u, and its end lies
        :math:`\delta - u (n \cdot \delta) / (n \cdot u)` away, at most
        :math:`|\delta| |u| / |n \cdot u|`. Gravity and the air leave u no less than some speed
        towards the surface. The acceleration that is neglected is in m/s2.
        """
        if not math.isfinite(self.time):
            return math.inf
        if acceleration == 0.0 and launch_error == EXACT:
            return 0.0
        t, growth = self.time, self._growth * self.time
        if not growth < 50.0:
            return math.inf
        if launch_error.spin > 0.0:
            acceleration += self._by_spin(FROM_NO_SPIN) * launch_error.spin
        faster = (launch_error.velocity + acceleration * t) * math.exp(growth)
        parted = launch_error.position + launch_error.velocity * t + 0.5 * acceleration * t * t
        parted *= math.exp(growth)
        gap, closing, slowing = self._other_end()
        least = closing - faster
        left = least * least - 2.0 * max(slowing + acceleration, 0.0) * parted
        if not (least > 0.0 and left > 0.0):
            return math.inf
        late = parted / math.sqrt(left)
        strongest = MARGIN * max(math.hypot(*each) for each in self._own_accelerations)
        speed = math.hypot(*self._nodes[-1][3:6]) + faster + (strongest + acceleration) * late
        shift = late * speed
        return shift if shift < gap else math.inf

    @cached_property
    def _own_accelerations(self) -> Sequence[State]:
        """The acceleration at each sample [m/s2]."""
        return self._accelerations(self.environment.air)

    def _accelerations(self, air: Air | None) -> Sequence[State]:
        """Return the acceleration at each sample, with another air [m/s2]."""
        if air is None or air.density == 0.0:
            return [(0.0, 0.0, -GRAVITY)] * len(self._samples)
        acting, (wx, wy, wz) = (
            acceleration_function(self.environment.ball, air),
            self.launch.spin.tolist(),
        )
        height, found = float(self.launch.position[2]), []
        for _, _, z, vx, vy, vz, left in self._samples:
            found.append(acting(height + z, vx, vy, vz, left * wx, left * wy, left * wz)[:3])
        self.evaluations += len(found)
        return found

    @cached_property
    def _slowest(self) -> list[State]:
        """Between each two nodes, where the speed in the air is least, were velocity linear."""
        wind, found = self._wind, []
        for one, other in pairwise(self._nodes):
            change = [b - a for a, b in zip(one, other, strict=True)]
            square = math.fsum(c * c for c in change[3:6])
            ahead = math.fsum(
                (w - v) * c for w, v, c in zip(wind, one[3:6], change[3:6], strict=True)
            )
            share = min(max(ahead / square, 0.0), 1.0) if square > 0.0 else 0.0
            found.append(tuple(a + share * c for a, c in zip(one, change, strict=True)))
        return found

    @cached_property
    def _samples(self) -> Sequence[State]:
        """The nodes, and the slowest states between them."""
        return [*self._nodes, *(state for state in self._slowest if state not in self._nodes)]

    @property
    def _wind(self) -> Sequence[float]:
        """The velocity of the air, which is constant wherever there are bounds [m/s]."""
        air = self.environment.air
        return (0.0, 0.0, 0.0) if air is None else air.wind_at(0.0)

    def _air_speed(self, state: State) -> float:
        """Return the speed relative to the air [m/s]."""
        return math.dist(state[3:6], self._wind)

    @cached_property
    def _air_speeds(self) -> list[float]:
        """Speeds relative to the air, from the least of the flight to the largest [m/s]."""
        off, found = self.launch_error.velocity, [*map(self._air_speed, self._samples)]
        off += 0.02 * max(found)
        least, most = max(min(found) - off, 1e-9), max(max(found) + off, 2e-9)
        return [least + i * (most - least) / SLICES for i in range(SLICES + 1)]

    @cached_property
    def _coefficient_scale(self) -> tuple[float, float]:
        """Acceleration by a coefficient of 1 at 1 m/s, and the Reynolds number of that speed."""
        ball, air = self.environment.ball, self.environment.air
        assert air is not None
        per_speed = 2.0 * ball.radius * air.density / air.viscosity
        return MARGIN * 0.5 * air.density * ball.cross_section / ball.mass, per_speed

    @cached_property
    def _growth(self) -> float:
        """The mean rate at which drag and lift drive neighbouring flights apart at most [1/s].

        Each is the logarithmic norm of its derivative by velocity: that of drag is its fall with
        speed, that of lift, which is across the velocity, half of its change with speed.
        """
        ball, air, *_ = self.environment
        if air is None or air.density == 0.0:
            return 0.0
        speeds, (scale, per_speed) = self._air_speeds, self._coefficient_scale
        width, rates = speeds[1] - speeds[0], [0.0] * (len(speeds) - 1)
        if air.drag is not None:
            force = [air.drag(per_speed * v, 0.0) * v * v for v in speeds]
            rates = [max(0.0, a - b) for a, b in pairwise(force)]
        surface_speed = ball.radius * (self._spin + self.launch_error.spin)
        if air.lift is not None and surface_speed:
            lift = [air.lift(per_speed * v, surface_speed / v) * v for v in speeds]
            change = [abs(b - a) for a, b in pairwise(lift)]
            rates = [r + 0.5 * d * v for r, d, v in zip(rates, change, speeds[1:], strict=True)]
        steps = []
        for ends, slowest in zip(pairwise(self._nodes), self._slowest, strict=True):
            low, *_, high = sorted(self._air_speed(state) for state in (slowest, *ends))
            low, high = (low - speeds[0]) / width, (high - speeds[0]) / width
            # the slices that the speed is in, and one beside them
            steps.append(max(rates[max(int(low) - 1, 0) : int(high) + 2]))
        # the last step is shorter than the others, by an unknown share
        mean = max(sum(part) / len(part) for part in (steps, steps[:-1]))
        return scale * mean / width

    @cached_property
    def _spin(self) -> float:
        """The spin of the launch [rad/s]."""
        return math.hypot(*self.launch.spin.tolist())

    def _by_spin(self, parameters: Sequence[float]) -> float:
        """Return the largest change of acceleration with spin [m/s2 per rad/s].

        The slopes of drag and lift are those between the given spin parameters.
        """
        ball, air, *_ = self.environment
        if air is None or air.density == 0.0:
            return 0.0
        fastest, (scale, per_speed) = self._air_speeds[-1], self._coefficient_scale
        slope = 0.0
        for model in (air.drag, air.lift):
            if model is not None:
                found = [(s, model(per_speed * fastest, s)) for s in parameters]
                slope += max(abs(b - a) / (t - s) for (s, a), (t, b) in pairwise(found))
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
