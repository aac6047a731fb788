"""The states a flight needs, and no more: two fewer in a plane, one more where spin decays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.flight.forces import brakes, forces, is_planar


class Motion:
    """The equations of one flight, in the states that change.

    All of them are displacement from the launch, velocity, and spin over that of the launch: 7 in
    space. In the x-z plane, y and its velocity are left out; without decay, so is the spin. The
    displacement is from the launch, so that a hop of 1e-20 m at a height of 100 m is one.

    Attributes:
        kept: which of the 7 change.
        begin: those at the launch.
        rise, climb: indices of height and of its rate.
    """

    def __init__(self, launch: BallState, ball: Ball, air: Air) -> None:
        planar = is_planar(air, launch.velocity, launch.spin)
        kept = [0, 2, 3, 5] if planar else [0, 1, 2, 3, 4, 5]
        if brakes(air, launch.spin):
            kept.append(6)
        self.kept = kept
        self._acting = forces(ball, air)
        self._height = float(launch.position[2])
        self._spin = tuple(launch.spin.tolist())
        self.begin: Array = np.concatenate([np.zeros(3), launch.velocity, np.ones(1)])[kept]
        self.rise, self.climb = kept.index(2), kept.index(5)
        self._planar, self._braking = planar, 6 in kept

    def rates(self, _: float, states: Sequence[float]) -> list[float]:
        """Return the time derivative of the states."""
        left = float(states[-1]) if self._braking else 1.0
        wx, wy, wz = self._spin
        if self._planar:
            z, vx, vy, vz = float(states[1]), float(states[2]), 0.0, float(states[3])
        else:
            z, vx, vy, vz = (float(part) for part in states[2:6])
        height = self._height + z
        ax, ay, az, k = self._acting(height, vx, vy, vz, left * wx, left * wy, left * wz)
        result = [vx, vz, ax, az] if self._planar else [vx, vy, vz, ax, ay, az]
        if self._braking:
            result.append(-k * left)
        return result

    def whole(self, states: Array) -> Array:
        """Return all 7 states from those that change, shape `(7,)` or `(7, n)`."""
        full = np.zeros((7, *states.shape[1:]))
        full[6] = 1.0
        full[self.kept] = states
        return full
