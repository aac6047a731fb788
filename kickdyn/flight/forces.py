"""Acceleration of a ball in the air: weight, buoyancy, drag (Eq. 12) and lift (Eq. 13)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.checks import Array

GRAVITY = 9.81
"""[m/s2], the paper's."""

Rates = Callable[[float, Sequence[float]], list[float]]


def downward(ball: Ball, air: Air | None) -> float:
    """Return weight less buoyancy per mass [m/s2]."""
    if air is None or not air.buoyancy:
        return GRAVITY
    return GRAVITY * (1.0 - air.density * ball.volume / ball.mass)


def is_ballistic(air: Air | None, spin: Array) -> bool:
    """Return whether neither drag nor lift acts, so that a closed form answers."""
    if air is None or air.density == 0.0:
        return True
    return air.drag is None and (air.lift is None or not spin.any())


def rates(ball: Ball, air: Air, spin: Array) -> Rates:
    """Return d/dt of (x, y, z, vx, vy, vz) as a function of time and state.

    The spin is constant: nothing brakes it here.
    """
    g = downward(ball, air)
    windx, windy, windz = (float(w) for w in air.wind)
    wx, wy, wz = (float(w) for w in spin)
    drag = air.drag
    lift = air.lift if spin.any() else None
    per_speed = 2.0 * ball.radius * air.density / air.viscosity  # Re over v
    pressure = 0.5 * air.density * ball.cross_section / ball.mass  # acceleration over C v^2
    radius = ball.radius
    spins = bool(spin.any())

    def derivative(_: float, state: Sequence[float]) -> list[float]:
        vx, vy, vz = float(state[3]), float(state[4]), float(state[5])
        ax, ay, az = 0.0, 0.0, -g
        ux, uy, uz = vx - windx, vy - windy, vz - windz
        speed = math.sqrt(ux * ux + uy * uy + uz * uz)
        reynolds = per_speed * speed
        if reynolds > 1e-100:  # below, no double precision acceleration is left
            mx = my = mz = across = spin_parameter = 0.0
            if spins:
                mx, my, mz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
                across = math.sqrt(mx * mx + my * my + mz * mz)  # |omega_perp| v
                spin_parameter = radius * across / (speed * speed)
            if drag is not None:
                k = pressure * drag(reynolds, spin_parameter) * speed
                ax, ay, az = ax - k * ux, ay - k * uy, az - k * uz
            if lift is not None and across > 0.0:
                k = pressure * lift(reynolds, spin_parameter) * speed * speed / across
                ax, ay, az = ax + k * mx, ay + k * my, az + k * mz
        return [vx, vy, vz, ax, ay, az]

    return derivative
