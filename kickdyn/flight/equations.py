"""The equations of motion of one flight, in the states that it needs and no more."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.forces import brakes, forces, is_planar
from kickdyn.flight.integrate import Event


class FlightEquations:
    r"""The equations of motion of one flight, in the states that change.

    The eight states in space are the displacement from the launch [m], the velocity [m/s], the
    spin over that of the launch, and the integral of this ratio [s], by which the ball has turned:

    .. math:: \dot x = v, \; \dot v = a(z, v, s \omega_0), \; \dot s = -k s, \; \dot\tau = s

    with a and k of `forces`. In the x-z plane, y and its velocity are left out; without decay, so
    are the last two, and the last where the orientation is not asked for. The displacement is from
    the launch, so that a hop of 1e-20 m at a height of 100 m has its digits.

    Args:
        launch: the start.
        ball: what flies.
        air: through what.
        orientation: whether the orientation is asked for.

    Attributes:
        kept: which of the eight are states.
        begin: those at the launch.
        rise, climb: indices of height and of its rate.
        fault: what a coefficient or the wind raised last; the step is then tried shorter.
    """

    def __init__(self, launch: BallState, ball: Ball, air: Air, orientation: bool = False) -> None:
        planar = is_planar(air, launch.velocity, launch.spin)
        kept = [0, 2, 3, 5] if planar else [0, 1, 2, 3, 4, 5]
        if brakes(air, launch.spin):
            kept += [6, 7] if orientation else [6]
        self.kept = kept
        self.fault: Exception | None = None
        self._acting = forces(ball, air)
        self._height = float(launch.position[2])
        self._spin = tuple(launch.spin.tolist())
        self.begin: Array = np.concatenate([np.zeros(3), launch.velocity, [1.0, 0.0]])[kept]
        self.rise, self.climb = kept.index(2), kept.index(5)
        self._planar, self._turning = planar, 7 in kept
        self._left = kept.index(6) if 6 in kept else None

    def rates(self, _: float, states: Sequence[float]) -> list[float]:
        """Return the time derivative of the states."""
        left = 1.0 if self._left is None else float(states[self._left])
        wx, wy, wz = self._spin
        if self._planar:
            z, vx, vy, vz = float(states[1]), float(states[2]), 0.0, float(states[3])
        else:
            z, vx, vy, vz = (float(part) for part in states[2:6])
        height = self._height + z
        try:
            acted = self._acting(height, vx, vy, vz, left * wx, left * wy, left * wz)
            ax, ay, az, k = (float(part) for part in acted)
        except Exception as fault:  # someone's own function, perhaps only where no ball will be
            self.fault = fault
            ax = ay = az = k = math.nan
        result = [vx, vz, ax, az] if self._planar else [vx, vy, vz, ax, ay, az]
        if self._left is not None:
            result.append(-k * left)
            if self._turning:
                result.append(left)
        return result

    def reaching(self, normal: Array, gap: float) -> Event:
        """Return the event of having moved by `gap` against a normal."""
        across = np.array([normal[k] if k < 3 else 0.0 for k in self.kept])
        speed = np.array([normal[k - 3] if 3 <= k < 6 else 0.0 for k in self.kept])
        return Event(lambda states: gap + float(across @ states), lambda y: float(speed @ y))

    def whole(self, states: Array) -> Array:
        """Return all 8 states from those that change, shape `(8,)` or `(8, n)`."""
        full = np.zeros((8, *states.shape[1:]))
        full[6] = 1.0
        full[self.kept] = states
        return full
