"""Flight without drag and lift: the closed form of Eqs. (24)-(25)."""

from __future__ import annotations

import math

import numpy as np

from kickdyn.checks import Array


def time_to_fall(rise_speed: float, drop: float, g: float) -> float:
    """Return when a body is `drop` below its start, on its way down [s].

    Args:
        rise_speed: upward speed at the start [m/s].
        drop: 0 or more [m].
        g: downward acceleration, above 0 [m/s2].
    """
    root = math.sqrt(rise_speed * rise_speed + 2.0 * g * drop)
    if rise_speed >= 0.0:
        return (rise_speed + root) / g
    return 2.0 * drop / (root - rise_speed)  # the same, without cancellation


def ballistic(velocity: Array, g: float, t: Array) -> Array:
    """Return displacement, velocity and 1, for a spin that stays, at times t, shape `(n, 7)`."""
    down = np.array([0.0, 0.0, -g])
    moved = velocity * t[:, None] + 0.5 * down * (t * t)[:, None]
    return np.hstack([moved, velocity + down * t[:, None], np.ones((len(t), 1))])
