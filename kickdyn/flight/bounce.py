"""A bounce on level ground: restitution along the vertical, grip or slip across it."""

from __future__ import annotations

import math

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.ground import Surface


def slip(state: BallState, ball: Ball) -> tuple[float, float]:
    """Return the horizontal velocity of a ball's lowest point [m/s]."""
    vx, vy, _ = state.velocity.tolist()
    wx, wy, _ = state.spin.tolist()
    return vx - ball.radius * wy, vy + ball.radius * wx


def bounce(state: BallState, ball: Ball, surface: Surface) -> BallState:
    """Return the ball just after it touched the ground.

    The tangential impulse that grips, reversing the slip u times the tangential restitution, is
    2/5 m (1 + e_t) u for a thin shell; friction gives no more than mu times the normal one. Energy
    never rises: each part is a passive collision of its own.

    Args:
        state: just before, moving downwards.
        ball: mass, radius and inertia.
        surface: of the ground.
    """
    vx, vy, vz = state.velocity.tolist()
    wx, wy, wz = state.spin.tolist()
    ux, uy = slip(state, ball)
    sliding = math.hypot(ux, uy)
    normal = (1.0 + surface.restitution) * -vz  # impulse over mass
    shell = ball.mass * ball.radius**2 / ball.inertia  # 3/2
    grip = (1.0 + surface.tangential_restitution) * sliding / (1.0 + shell)
    share = min(grip, surface.friction * normal) / sliding if sliding else 0.0
    turn = shell / ball.radius * share
    return BallState(
        state.position,
        (vx - share * ux, vy - share * uy, -surface.restitution * vz),
        (wx - turn * uy, wy + turn * ux, wz),
        state.time,
    )


def energy(state: BallState, ball: Ball) -> float:
    """Return the kinetic energy of a ball [J]; a particle's is that of its centre."""
    linear = float(np.dot(state.velocity, state.velocity))
    turning = ball.inertia if ball.inertia < math.inf else 0.0
    return 0.5 * (ball.mass * linear + turning * float(np.dot(state.spin, state.spin)))
