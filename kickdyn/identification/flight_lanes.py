r"""Flights with slightly different launches or coefficients, integrated with the same steps.

The difference between two such flights is one of the equations and not of the steps, so that it
gives derivatives as exact as the flights (internal differentiation, Bock 1981).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core.validation import Array
from kickdyn.flight.forces import acceleration_function


class Lane(NamedTuple):
    """One flight: launch velocity [m/s] and spin [rad/s], each `(3,)`, and the air."""

    velocity: Array
    spin: Array
    air: Air


def fly_lanes(
    lanes: Sequence[Lane], ball: Ball, height: float, times: Array, tol: float
) -> Array | None:
    """Return the displacements from the launch at given times, shape `(lanes, n, 3)` [m].

    It is None where the integration fails.

    Args:
        lanes: the flights; they share the ball and the height of the launch.
        ball: mass and radius.
        height: of the launch [m].
        times: since the launch, shape `(n,)` [s], from 0 on and increasing.
        tol: of the integration, relative to the first flight's length and speed.
    """
    acting = [acceleration_function(ball, lane.air) for lane in lanes]
    spins = [tuple(lane.spin.tolist()) for lane in lanes]

    def rates(_: float, flat: Array) -> list[float]:
        result: list[float] = []
        values = flat.tolist()
        for k, (act, (wx, wy, wz)) in enumerate(zip(acting, spins, strict=True)):
            _, _, z, vx, vy, vz, left = values[7 * k : 7 * k + 7]
            ax, ay, az, decay = act(height + z, vx, vy, vz, left * wx, left * wy, left * wz)
            result += (vx, vy, vz, ax, ay, az, -decay * left)
        return result

    begin = np.array([[0, 0, 0, *lane.velocity, 1.0] for lane in lanes], dtype=float)
    speed = max(float(np.linalg.norm(lanes[0].velocity)), 1e-3)
    end = float(times[-1])
    scale = np.tile([*3 * [max(speed * end, 1e-6)], *3 * [speed], 1.0], len(lanes))
    try:
        found = solve_ivp(
            rates, (0.0, end), begin.ravel(), "DOP853", t_eval=times, rtol=max(tol, 1e-13),
            atol=tol * scale,
        )  # fmt: skip
    except (ArithmeticError, ValueError):
        return None
    if not found.success or not np.isfinite(found.y).all():
        return None
    return np.asarray(np.moveaxis(found.y.reshape(len(lanes), 7, -1)[:, :3], 1, 2))
