"""A flight by the vector formulas of its forces and by scipy's `solve_ivp`, in double precision."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array

GRAVITY = 9.81


def rates(y: Array, ball: Ball, air: Air, height: float = 0.0) -> Array:
    """Return the rates of displacement, velocity and spin, each of three components.

    The wind is that at the height of the launch [m] plus the displacement.
    """
    weight = ball.mass - air.density * 4 / 3 * math.pi * ball.radius**3 * air.buoyancy
    u, spin = y[3:6] - np.array(air.wind_at(height + y[2])), y[6:]
    speed = math.sqrt(u @ u) or 1e-300
    direction = u / speed
    reynolds = max(air.density * speed * 2 * ball.radius / air.viscosity, 1e-290)
    magnus = np.cross(spin, direction)
    perpendicular = math.sqrt(magnus @ magnus)
    spin_parameter = ball.radius * perpendicular / speed
    pressure = 0.5 * air.density * math.pi * ball.radius**2 * speed**2
    force = np.array([0.0, 0.0, -GRAVITY * weight])
    if air.drag is not None:
        force -= pressure * air.drag(reynolds, spin_parameter) * direction
    if air.lift is not None and perpendicular:
        force += pressure * air.lift(reynolds, spin_parameter) * magnus / perpendicular
    torque = np.zeros(3)
    if air.torque is not None:
        beta = air.torque(reynolds, spin_parameter)
        brake = air.density * math.pi * ball.radius**4 * beta * speed
        torque -= (brake + 8 * math.pi * air.viscosity * ball.radius**3) * spin
    return np.concatenate([y[3:6], force / ball.mass, torque / ball.inertia])


def landing(state: BallState, ball: Ball, air: Air, drop: float = 0.0) -> tuple[float, Array]:
    """Return time [s], displacement, velocity and spin when a ball is a drop [m] below its launch.

    `solve_ivp` finds the step that the landing falls into; Newton's method ends at the landing.
    """
    height = float(state.position[2])

    def rate(_: float, y: Array) -> Array:
        return rates(y, ball, air, height)

    def below(t: float, y: Array) -> float:
        return float(y[2]) + drop if t > 0 else 1.0

    below.terminal, below.direction = True, -1.0  # type: ignore[attr-defined]
    y = np.concatenate([np.zeros(3), state.velocity, state.spin])
    speed = max(float(np.linalg.norm(state.velocity)), math.sqrt(2 * GRAVITY * drop))
    near = 1e-15 * min(speed * speed / GRAVITY, 300.0)
    atol = np.array([*3 * [near], *3 * [1e-15 * min(speed, 30.0)], *3 * [1e-13]])
    path = solve_ivp(rate, (0, 1e3), y, "DOP853", events=below, rtol=1e-13, atol=atol)
    t = float(path.t_events[0][0])
    last = int(np.flatnonzero(path.t < t)[-1])
    start = path.t[last], path.y[:, last]
    y = solve_ivp(rate, (start[0], t), start[1], "DOP853", rtol=1e-13, atol=atol).y[:, -1]
    for _ in range(3):
        late = -(y[2] + drop) / y[5]
        y, t = y + late * rate(t, y + late / 2 * rate(t, y)), t + late
    return t, np.asarray(y)
