"""Flights to a time with their derivatives by the launch: internal differentiation.

The flight and those of slightly changed launches are integrated side by side with the same steps,
so that their differences are those of the equations and not of the steps (Bock 1981).
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core.gravity import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.flight.forces import acceleration_function, ballistic, downward, is_ballistic

NUDGE = 1e-6
"""Change of an unknown of the launch, over `ShootingProblem.sizes`."""

LOOKS = 64
"""Intervals of a flight in each of which it may turn from down to up, or from up to down."""

MOST_EVALUATIONS = 10_000
"""Evaluations of the accelerations after which a flight is given up; most take 100 to 500."""


class Trajectory(NamedTuple):
    """A flight to a time, and its derivatives by launch velocity, then by the spin's size.

    Attributes:
        state: from a time [s] to position `(3,)` [m, from the launch] and velocity `(3,)` [m/s].
        slope: from a time to the derivatives of the position, shape `(3, 3)` or `(3, 4)`.
        time: up to which both hold [s].
    """

    state: Callable[[float], tuple[Array, Array]]
    slope: Callable[[float], Array]
    time: float

    def apex(self) -> tuple[float, Array]:
        """Return the greatest height up to the end, and its derivatives, shape `(3,)` or `(4,)`."""
        when = self._extreme(1.0)
        return float(self.state(when)[0][2]), self.slope(when)[2]

    def lowest(self) -> float:
        """Return the least height, ends included [m, from the launch]."""
        return float(self.state(self._extreme(-1.0))[0][2])

    def crossing(self, ahead: Array, distance: float, along: Array) -> tuple[float, Array]:
        """Return the position along a unit vector at a distance ahead [m], and its derivatives.

        Both are nan where the flight does not come so far.
        """
        when = self.when(lambda at: float(ahead @ self.state(at)[0]) - distance, 0.0, self.time)
        if when is None:
            return math.nan, np.full(self.slope(0.0).shape[1], math.nan)
        position, velocity = self.state(when)
        slope = self.slope(when)
        delay = -(ahead @ slope) / (ahead @ velocity)  # of the crossing
        return float(along @ position), along @ slope + (along @ velocity) * delay

    def _extreme(self, sign: float) -> float:
        """Return when the height times a sign is greatest [s]: at an end or where it turns."""
        looks = pairwise(np.linspace(0.0, self.time, LOOKS + 1).tolist())
        turns = [self.when(lambda at: -sign * float(self.state(at)[1][2]), *look) for look in looks]
        times = [0.0, self.time, *(at for at in turns if at is not None)]
        return max(times, key=lambda at: sign * float(self.state(at)[0][2]))

    def when(self, value: Callable[[float], float], first: float, last: float) -> float | None:
        """Return when a value rises through zero; None where it does not."""
        if not value(first) < 0.0 <= value(last):
            return None
        return float(brentq(value, first, last, xtol=1e-15 * self.time))


class ShootingProblem:
    """A ball in the air, or in the vacuum, to be shot.

    With `seeks_spin`, the size of the spin is an unknown and `spin` its axis. The tolerance is
    relative to the flight's length and speed.
    """

    def __init__(
        self,
        ball: Ball,
        air: Air | None,
        spin: Array,
        seeks_spin: bool = False,
        tol: float = 1e-12,
    ) -> None:
        self.tol = tol
        self.ball, self.air, self.spin, self.seeks_spin = ball, air, spin, seeks_spin
        self._acting = None if air is None else acceleration_function(ball, air)

    def with_tolerance(self, tol: float) -> "ShootingProblem":
        """Return the same problem with another relative tolerance of the integration."""
        return ShootingProblem(self.ball, self.air, self.spin, self.seeks_spin, tol)

    def sizes(self, unknowns: Array) -> Array:
        """Return scales of launch velocity [m/s], time [s] and, where sought, spin size [rad/s]."""
        time = float(unknowns[3])
        speed = max(math.hypot(*unknowns[:3]), 0.1 * GRAVITY * time)
        return np.array([*3 * [speed], time, 0.1 * speed / self.ball.radius][: len(unknowns)])

    def spin_of(self, size: float) -> Array:
        """Return the spin, shape `(3,)` [rad/s]."""
        return self.spin * size if self.seeks_spin else self.spin

    def shoot(self, velocity: Array, time: float, size: float = 0.0) -> Trajectory | None:
        """Fly from a launch velocity `(3,)` [m/s] for a time [s]; None where that fails."""
        spin = self.spin_of(size)
        if is_ballistic(self.air, spin) and not self.seeks_spin:
            g = downward(self.ball, self.air)

            def fall(at: float) -> tuple[Array, Array]:
                """Return position and velocity of the parabola."""
                place = ballistic(velocity, g, np.array([at]))[0]
                return place[:3], place[3:6]

            return Trajectory(fall, lambda at: at * np.eye(3), time)
        sizes = self.sizes(np.array([*velocity, time, size]))
        nudges = NUDGE * sizes[[0, 1, 2, 4]]
        unknowns = 4 if self.seeks_spin else 3
        lanes = np.array([*velocity, size]) + np.vstack([np.zeros(4), np.diag(nudges)[:unknowns]])
        begin = np.array([[0, 0, 0, *lane[:3], 1.0] for lane in lanes])
        turning = [tuple(self.spin_of(lane[3]).tolist()) for lane in lanes]
        acting = self._acting
        assert acting is not None

        evaluations = 0

        def rates(_: float, flat: Array) -> list[float]:
            """Return the rates of all flights."""
            nonlocal evaluations
            evaluations += 1
            if evaluations > MOST_EVALUATIONS:
                raise ArithmeticError
            result: list[float] = []
            values = flat.tolist()
            for lane, (wx, wy, wz) in enumerate(turning):
                _, _, z, vx, vy, vz, left = values[7 * lane : 7 * lane + 7]
                ax, ay, az, k = acting(z, vx, vy, vz, left * wx, left * wy, left * wz)
                result += (vx, vy, vz, ax, ay, az, -k * left)
            return result

        scale = np.tile([*sizes[:3] * time, *sizes[:3], 1.0], len(lanes))
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # of launches without measure
                found = solve_ivp(
                    rates, (0.0, time), begin.ravel(), "DOP853", rtol=self.tol,
                    atol=self.tol * scale, dense_output=True, first_step=time / 64,
                )  # fmt: skip
        except (ArithmeticError, ValueError):
            return None
        if not found.success or not np.isfinite(found.y[:, -1]).all():
            return None
        last = found.y[:, -1]

        def states(at: float) -> Array:
            """Return the states of all flights at a time."""
            return np.asarray(last if at == time else found.sol(at)).reshape(len(lanes), 7)

        def state(at: float) -> tuple[Array, Array]:
            """Return position and velocity of the first flight."""
            first = states(at)[0]
            return first[:3], first[3:6]

        def slope(at: float) -> Array:
            """Return the derivatives of the position."""
            where = states(at)[:, :3]
            return np.asarray(((where[1:] - where[0]) / nudges[:unknowns, None]).T)

        return Trajectory(state, slope, time)
