"""A ball that is shot: its flight to a time, where that turns, and where it passes a place."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.derivatives import INCREMENT, DifferentiableFlight, fly_with_slopes

INTERVALS = 64
"""Intervals of a flight in each of which it may turn once from up to down, or from down to up."""

UP = np.array([0.0, 0.0, 1.0])
"""Unit vector upwards [world frame]."""


@dataclass(frozen=True, eq=False)
class ShootingProblem:
    """A ball in the air to be shot from the origin.

    Attributes:
        ball: the ball.
        air: the air; None is the vacuum.
        spin: the spin, shape `(3,)` [rad/s]; with `seeks_spin` its axis, a unit vector.
        seeks_spin: whether the size of the spin is an unknown.
        tol: tolerance of the integration, relative to the flight's length and speed.
    """

    ball: Ball
    air: Air | None
    spin: Array
    seeks_spin: bool = False
    tol: float = 1e-12

    def sizes(self, unknowns: Array) -> Array:
        """Return scales of launch velocity [m/s], time [s] and, where sought, spin size [rad/s]."""
        time = float(unknowns[3])
        speed = max(math.hypot(*unknowns[:3]), 0.1 * GRAVITY * time)
        return np.array([*3 * [speed], time, 0.1 * speed / self.ball.radius][: len(unknowns)])

    def spin_of(self, size: float) -> Array:
        """Return the spin, shape `(3,)` [rad/s]."""
        return self.spin * size if self.seeks_spin else self.spin

    def shoot(
        self, velocity: Array, time: float, spin_size: float = 0.0
    ) -> DifferentiableFlight | None:
        """Fly from a launch velocity `(3,)` [m/s] for a time [s]; None where that fails.

        The derivatives are by the launch velocity and, where it is sought, by the spin's size.
        """
        count = 4 if self.seeks_spin else 3
        parameters = np.array([*velocity, spin_size])[:count]
        sizes = self.sizes(np.array([*velocity, time, spin_size]))[[0, 1, 2, 4][:count]]

        def launch(values: Array) -> tuple[BallState, Air | None]:
            spin = np.array(self.spin_of(float(values[-1])))
            return BallState.computed(np.zeros(3), values[:3].copy(), spin), self.air

        try:
            return fly_with_slopes(launch, parameters, INCREMENT * sizes, self.ball, time, self.tol)
        except KickdynError:
            return None


def apex(flight: DifferentiableFlight) -> tuple[float, Array]:
    """Return the greatest height of a flight [m, from the launch], and its derivatives."""
    time = _extreme_time(flight, 1.0)
    return float(flight.position(time)[2]), flight.slopes(time)[2]


def lowest(flight: DifferentiableFlight) -> float:
    """Return the least height of a flight, ends included [m, from the launch]."""
    return float(flight.position(_extreme_time(flight, -1.0))[2])


def crossing(
    flight: DifferentiableFlight, ahead: Array, distance: float, along: Array
) -> tuple[float, Array]:
    """Return the position along a unit vector at a distance ahead [m], and its derivatives.

    They are nan where the flight does not come so far.
    """
    time = crossing_time(flight, ahead, distance)
    if time is None:
        return math.nan, np.full(len(flight.increments), math.nan)
    slopes, _ = flight.slopes_at_plane(ahead, time)
    return float(along @ flight.position(time)), along @ slopes


def crossing_time(
    flight: DifferentiableFlight, direction: Array, distance: float, begin: float = 0.0
) -> float | None:
    """Return when the displacement along a direction rises through a distance [s].

    It is sought from `begin` [s] on; None where it does not so between there and the end.
    """
    return _root(
        lambda time: float(direction @ flight.position(time)) - distance, begin, flight.end
    )


def _extreme_time(flight: DifferentiableFlight, sign: float) -> float:
    """Return when the height times a sign is greatest [s]: at an end or where it turns."""
    times = np.linspace(0.0, flight.end, INTERVALS + 1)
    sinking = -sign * flight.states(times)[:, 5]
    candidates = [0.0, flight.end]
    for k in np.flatnonzero((sinking[:-1] < 0.0) & (sinking[1:] >= 0.0)):
        turn = _root(lambda time: -sign * float(flight.velocity(time)[2]), times[k], times[k + 1])
        candidates += [] if turn is None else [turn]
    return max(candidates, key=lambda time: sign * float(flight.position(time)[2]))


def _root(value: Callable[[float], float], begin: float, end: float) -> float | None:
    """Return the time at which a value rises through zero [s]; None where it does not."""
    if not value(begin) < 0.0 <= value(end):
        return None
    return float(brentq(value, begin, end, xtol=1e-15 * end))
