"""Flight without drag and lift: the closed form of Eqs. (24)-(25)."""

from __future__ import annotations

import math

import numpy as np

from kickdyn.core.validation import Array


def time_to_fall(rise_speed: float, drop: float, g: float) -> float:
    """Return when a body first is `drop` below its start while moving down [s]; inf if never.

    Down is any direction: a plane's, where `drop` is the gap, and `rise_speed` and `g` are the
    components across it.

    Args:
        rise_speed: upward speed at the start [m/s].
        drop: 0 or more [m].
        g: downward acceleration [m/s2].
    """
    fallen = 2.0 * g * drop
    if fallen < 0.0:
        square = rise_speed * rise_speed + fallen
        if rise_speed >= 0.0 or square < 0.0:
            return math.inf
        root = math.sqrt(square)
    else:
        root = math.hypot(rise_speed, math.sqrt(fallen))  # speeds below 1e-154 have no square
    if rise_speed < 0.0:
        return 2.0 * drop / (root - rise_speed)  # Eq. (24), without cancellation
    return (rise_speed + root) / g if g > 0.0 else math.inf


def ballistic(velocity: Array, g: float, t: Array) -> Array:
    """Return displacement, velocity and 1, for a spin that stays, at times t, shape `(n, 7)`."""
    down = np.array([0.0, 0.0, -g])
    moved = velocity * t[:, None] + 0.5 * down * (t * t)[:, None]
    return np.hstack([moved, velocity + down * t[:, None], np.ones((len(t), 1))])
