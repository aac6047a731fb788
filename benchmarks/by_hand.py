"""Flights as most people would compute them: a loop of scipy's `solve_ivp`, the peer of others."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.flight.forces import acceleration_function


def fly_by_hand(
    states: kd.BallState, ball: kd.Ball, air: kd.Air, method: str = "RK45", rtol: float = 1e-9
) -> Array:
    """Return landing points at the height of the launch, shape `(n, 3)` [m]."""
    acting = acceleration_function(ball, air)

    def rates(_: float, y: Array) -> tuple[float, ...]:
        _, _, z, vx, vy, vz, wx, wy, wz = y.tolist()
        ax, ay, az, k = acting(z, vx, vy, vz, wx, wy, wz)
        return vx, vy, vz, ax, ay, az, -k * wx, -k * wy, -k * wz

    def down(t: float, y: Array) -> float:
        return float(y[2]) if t > 0 else 1.0

    down.terminal, down.direction = True, -1  # type: ignore[attr-defined]
    landed = []
    for i in range(len(states.position)):
        begin = np.concatenate([states.position[i], states.velocity[i], states.spin[i]])
        found = solve_ivp(rates, (0, 100), begin, method, rtol=rtol, atol=rtol, events=down)
        landed.append(found.y_events[0][0][:3])
    return np.array(landed)
