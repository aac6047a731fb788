r"""What acts on a ball in flight, and the closed form where only its weight does.

Weight less buoyancy, drag (Eq. 12), lift (Eq. 13) and the torque that brakes the spin:

.. math::

    m \dot v &= -(m - \rho V) g\, e_z - \tfrac12 \rho A C_D |u|\, u
        + \tfrac12 \rho A C_L |u|^2 \frac{\omega \times u}{|\omega \times u|} \\
    I \dot\omega &= -(\rho A r^2 \beta |u| + 8 \pi \mu r^3)\, \omega

with u the velocity relative to the air.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array

VACUUM = Air(density=0.0)
"""The air of a flight in the vacuum."""

STILL_REYNOLDS = 1e-100
"""Reynolds number below which no acceleration in double precision is left."""

Reynolds = Callable[[float, float, float, float], float]

Acceleration = Callable[
    [float, float, float, float, float, float, float], tuple[float, float, float, float]
]


def downward(ball: Ball, air: Air | None) -> float:
    r"""Return weight less buoyancy per mass, :math:`g (1 - \rho V / m)` [m/s2].

    An obstacle, a ball of mass inf, raises `InvalidInput`.
    """
    ball.check_movable("a flight")
    if air is None or not air.buoyancy:
        return GRAVITY
    return GRAVITY * (1.0 - air.density * ball.volume / ball.mass)


def is_ballistic(air: Air | None, spin: Array) -> bool:
    """Return whether neither drag nor lift acts, so that a closed form holds."""
    if air is None or air.density == 0.0:
        return True
    return air.drag is None and (air.lift is None or not spin.any()) and not brakes(air, spin)


def brakes(air: Air | None, spin: Array) -> bool:
    """Return whether the air brakes the spin."""
    return air is not None and air.density > 0 and air.torque is not None and bool(spin.any())


def acceleration_function(ball: Ball, air: Air) -> Acceleration:
    r"""Return a function of height, velocity and spin: acceleration and rate of spin decay.

    It takes z [m], vx, vy, vz [m/s], wx, wy, wz [rad/s] and returns ax, ay, az [m/s2] and k [1/s]
    with :math:`\dot\omega = -k \omega`, all in the world frame. It uses only floats, `math` and
    functions of the same kind, so that numba can compile it.
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

    def acceleration(
        z: float, vx: float, vy: float, vz: float, wx: float, wy: float, wz: float
    ) -> tuple[float, float, float, float]:
        blowing = wind(z)
        ux, uy, uz = vx - blowing[0], vy - blowing[1], vz - blowing[2]
        speed = math.sqrt(ux * ux + uy * uy + uz * uz)
        reynolds = per_speed * speed
        if reynolds < STILL_REYNOLDS:
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

    return acceleration


def reynolds_number(ball: Ball, air: Air) -> Reynolds:
    """Return a function of height and velocity: the Reynolds number; numba can compile it too."""
    wind, per_speed = air.wind_at, 2.0 * ball.radius * air.density / air.viscosity

    def reynolds(z: float, vx: float, vy: float, vz: float) -> float:
        blowing = wind(z)
        ux, uy, uz = vx - blowing[0], vy - blowing[1], vz - blowing[2]
        return per_speed * math.sqrt(ux * ux + uy * uy + uz * uz)

    return reynolds


def time_to_fall(rise_speed: Any, drop: Any, g: Any) -> Any:
    r"""Return when a body first is `drop` below its start while moving down [s]; inf if never.

    :math:`(v + \sqrt{v^2 + 2 g d}) / g` (Eq. 24), with numbers or shape `(n,)`. Towards a plane
    the `drop` [m] is the gap, and `rise_speed` [m/s] and `g` [m/s2] are along its normal.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        fallen = 2.0 * g * np.asarray(drop)
        slowing = rise_speed * rise_speed + fallen
        root = np.where(
            fallen < 0.0,
            np.sqrt(np.maximum(slowing, 0.0)),
            np.hypot(rise_speed, np.sqrt(np.maximum(fallen, 0.0))),  # v^2 may be 0 in float64
        )
        # the root of Eq. (25) without cancellation, where it already moves down
        time = np.where(rise_speed < 0.0, 2.0 * drop / (root - rise_speed), (rise_speed + root) / g)
    never = np.where(rise_speed < 0.0, (fallen < 0.0) & (slowing < 0.0), np.asarray(g) <= 0.0)
    result = np.where(never, math.inf, time)
    return result if result.ndim else float(result)


def ballistic(velocity: Array, g: float, t: Array) -> Array:
    r"""Return the states of `FlightEquations` in a vacuum, shape `(n, 7)`.

    Displacement :math:`v t - \frac12 g t^2 e_z`, velocity :math:`v - g t\, e_z`, and 1, at times
    of shape `(n,)` [s], of one velocity `(3,)` or of n `(n, 3)` [m/s].
    """
    down, t = np.array([0.0, 0.0, -g]), t[:, None]
    displacement = velocity * t + 0.5 * down * (t * t)
    return np.hstack([displacement, velocity + down * t, np.ones_like(t)])


def fall_to_planes(
    velocity: Array, numbers: Array, g: float, time_limit: float
) -> tuple[Array, NDArray[np.intp]]:
    """Return the ends of n flights on which only weight acts, and which of k planes ends each.

    The velocities have shape `(n, 3)` [m/s], and `numbers` `(n, 4 k)`: distance [m] and normal of
    each plane, the ground first. Returned are time and states of `ballistic` at the end, then at
    the apex, shape `(n, 16)`; and the number of the plane, k where none ends the flight, `(n,)`.
    """
    times = []
    for k in range(0, numbers.shape[1], 4):
        gap, normal = numbers[:, k], numbers[:, k + 1 : k + 4]
        rise = np.einsum("ij,ij->i", normal, velocity)
        times.append(time_to_fall(rise, gap, g * normal[:, 2]))
    times.append(np.full(len(velocity), time_limit))
    reached, end = np.argmin(times, axis=0), np.min(times, axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        top = np.clip(velocity[:, 2] / g, 0.0, end)
        nodes = np.column_stack(
            [end, ballistic(velocity, g, end), top, ballistic(velocity, g, top)]
        )
    landed = reached == 0
    nodes[landed, 3] = -numbers[landed, 0]  # by definition; else but for rounding
    return nodes, reached
