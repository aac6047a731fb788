"""What the air does to a ball: weight, buoyancy, drag (Eq. 12), lift (Eq. 13), spin brake."""

from __future__ import annotations

import math
from collections.abc import Callable

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core.validation import Array
from kickdyn.core.vectors import GRAVITY

STILL = 1e-100
"""Reynolds number below which no acceleration in double precision is left."""

Reynolds = Callable[[float, float, float, float], float]

Forces = Callable[
    [float, float, float, float, float, float, float], tuple[float, float, float, float]
]


def downward(ball: Ball, air: Air | None) -> float:
    """Return weight less buoyancy per mass [m/s2]."""
    if air is None or not air.buoyancy:
        return GRAVITY
    return GRAVITY * (1.0 - air.density * ball.volume / ball.mass)


def is_ballistic(air: Air | None, spin: Array) -> bool:
    """Return whether neither drag nor lift acts, so that a closed form answers."""
    if air is None or air.density == 0.0:
        return True
    return air.drag is None and (air.lift is None or not spin.any()) and not brakes(air, spin)


def brakes(air: Air | None, spin: Array) -> bool:
    """Return whether the spin decays, which costs one more state."""
    return air is not None and air.density > 0 and air.torque is not None and bool(spin.any())


def is_planar(air: Air | None, velocity: Array, spin: Array) -> bool:
    """Return whether all stays in the x-z plane, which saves two states."""
    calm = air is None or (not callable(air.wind) and air.wind[1] == 0.0)
    return bool(calm and velocity[1] == 0.0 and spin[0] == 0.0 and spin[2] == 0.0)


def forces(ball: Ball, air: Air) -> Forces:
    """Return a function of height, velocity and spin: acceleration and rate of spin decay.

    It takes z, vx, vy, vz, wx, wy, wz and returns ax, ay, az [m/s2] and k [1/s] with
    d omega/dt = -k omega. It is made of floats, `math` and functions of the same kind only, so that
    it can be compiled.
    """
    g = downward(ball, air)
    drag, lift, beta = (
        constant(0.0) if model is None else getattr(model, "function", model)
        for model in (air.drag, air.lift, air.torque)
    )
    wind = air.wind_at
    per_speed = 2.0 * ball.radius * air.density / air.viscosity  # Re over v
    pressure = 0.5 * air.density * ball.cross_section / ball.mass  # acceleration over C v^2
    radius = ball.radius
    brake = air.density * ball.cross_section * radius**2 / ball.inertia  # k over beta v
    creep = 0.0
    if air.torque is not None:
        creep = 8.0 * math.pi * air.viscosity * radius**3 / ball.inertia

    def acting(
        z: float, vx: float, vy: float, vz: float, wx: float, wy: float, wz: float
    ) -> tuple[float, float, float, float]:
        blowing = wind(z)
        ux, uy, uz = vx - blowing[0], vy - blowing[1], vz - blowing[2]
        speed = math.sqrt(ux * ux + uy * uy + uz * uz)
        reynolds = per_speed * speed
        if reynolds < STILL:
            return 0.0, 0.0, -g, creep
        mx, my, mz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
        across = math.sqrt(mx * mx + my * my + mz * mz)  # |omega_perp| v
        spin_parameter = radius * across / (speed * speed)
        k = pressure * drag(reynolds, spin_parameter) * speed
        ax, ay, az = -k * ux, -k * uy, -g - k * uz
        if across > 0.0:
            k = pressure * lift(reynolds, spin_parameter) * speed * speed / across
            ax, ay, az = ax + k * mx, ay + k * my, az + k * mz
        return ax, ay, az, brake * beta(reynolds, spin_parameter) * speed + creep

    return acting


def reynolds_number(ball: Ball, air: Air) -> Reynolds:
    """Return a function of height and velocity: the Reynolds number; compiles as `forces` does."""
    wind, per_speed = air.wind_at, 2.0 * ball.radius * air.density / air.viscosity

    def reynolds(z: float, vx: float, vy: float, vz: float) -> float:
        blowing = wind(z)
        ux, uy, uz = vx - blowing[0], vy - blowing[1], vz - blowing[2]
        return per_speed * math.sqrt(ux * ux + uy * uy + uz * uz)

    return reynolds
