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
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.aerodynamics.coefficient_model import Coefficient, is_known
from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array, ArrayLike

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


MAX_SPEED = 299_792_458.0
"""In air [m/s], the speed of light. Tolerances hold up to there; coefficients end far below."""

FINEST = 100 * float(np.finfo(float).eps)
"""Least relative tolerance of a step, as of scipy's DOP853: below it, the estimate of the step's
error is rounding."""

_PER_DECADE, _DECADES = 8, 3
_FARTHEST = 15
"""The drag length is tabulated for Reynolds numbers from 1e-15 to 1e15."""


class FlightEquations:
    r"""The equations of motion of a ball launched into the air.

    The seven states are the displacement from the launch [m], of which a hop of 1e-20 m at a height
    of 100 m has its digits, the velocity [m/s] and the spin over that of the launch:

    .. math:: \dot x = v, \quad \dot v = a(z, v, s\, \omega_0), \quad \dot s = -k s

    with a and k of `acceleration_function`.

    Attributes:
        begin: the states at the launch, shape `(7,)`.
        fault: what a coefficient or the wind raised last; the step is then tried shorter.
    """

    def __init__(self, launch: BallState, ball: Ball, air: Air) -> None:
        self.begin: Array = np.concatenate([np.zeros(3), launch.velocity, [1.0]])
        self.fault: Exception | None = None
        self._acting = acceleration_function(ball, air)
        self._height = float(launch.position[2])
        self._spin = tuple(launch.spin.tolist())
        self._brakes = brakes(air, launch.spin)

    def rates(self, states: list[float]) -> list[float]:
        """Return the time derivative of the states, nan where a coefficient or the wind raises."""
        _, _, z, vx, vy, vz, share = states
        wx, wy, wz = self._spin
        try:
            ax, ay, az, k = self._acting(
                self._height + z, vx, vy, vz, share * wx, share * wy, share * wz
            )
            decay = -float(k) * share if self._brakes else 0.0
            return [vx, vy, vz, float(ax), float(ay), float(az), decay]
        except Exception as fault:  # someone's own function, perhaps only where no ball will be
            self.fault = fault
            return [vx, vy, vz, math.nan, math.nan, math.nan, math.nan if self._brakes else 0.0]


def tolerances(
    speed: ArrayLike, drop: ArrayLike, wind: ArrayLike, ball: Ball, air: Air, tol: float
) -> tuple[float, Array, Array]:
    r"""Return rtol, and atol of displacement [m] and of velocity [m/s], of one flight or of many.

    They are relative to what a ball does that is shot straight up as fast as this one ever is, with
    quadratic drag of the length L: it rises :math:`\frac{L}{2} \ln(1 + v^2/(g L))` and comes back
    with :math:`v / \sqrt{1 + v^2/(g L)}`.

    The speed of the launch [m/s], the drop to the ground [m] and the speed of the wind at the
    launch [m/s] are numbers or have shape `(n,)`.
    """
    g = max(abs(downward(ball, air)), 1e-5)  # a weight of less moves nothing for minutes
    drop = np.asarray(drop)
    fallen = np.minimum(math.sqrt(2.0 * g) * np.sqrt(drop), MAX_SPEED)
    with np.errstate(over="ignore", invalid="ignore"):  # spoils its own flight only
        fastest = np.maximum(speed, np.maximum(wind, fallen))
        fastest = np.maximum(fastest, 1e-100)
        free = fastest * fastest / g
        slowed = free / _drag_length(fastest, ball, air)
        length = np.where(slowed > 0.0, free * np.log1p(slowed) / np.maximum(slowed, 1e-300), free)
        pace = np.maximum(fastest / np.sqrt(1.0 + slowed), wind)
        displacement, velocity = tol * np.maximum(length, drop), tol * pace
    # the integrators divide by atol: it is never 0, not even for a balloon that starts at rest
    return max(tol, FINEST), np.maximum(displacement, 1e-300), np.maximum(velocity, 1e-300)


def _drag_length(speed: Array, ball: Ball, air: Air) -> Array:
    r"""Return the length in which drag takes most of speeds [m]; infinite without drag.

    It is :math:`2 m / (\rho A C_D)`, of the least C_D without spin that the ball meets within three
    decades as it slows down.
    """
    drag = air.drag
    if drag is None or air.density == 0.0:
        return np.full(np.shape(speed), math.inf)
    per_speed = 2.0 * ball.radius * air.density / air.viscosity
    with np.errstate(divide="ignore", over="ignore"):
        decade = np.fmin(np.log10(per_speed * np.asarray(speed)), _FARTHEST)  # of nan too
        step = np.ceil(_PER_DECADE * np.maximum(decade, -_FARTHEST)).astype(int)
        lowest, highest = int(step.min(initial=0)), int(step.max(initial=0))
        least = (_known_drag if is_known(drag) else _least_drag)(drag, lowest, highest)
        most = 2.0 * ball.mass / (air.density * ball.cross_section)
        return np.asarray(most / least[step - lowest])


def _least_drag(drag: Coefficient, first: int, last: int) -> Array:
    """Return the least C_D without spin within three decades below Reynolds numbers.

    These are 10 to the multiples, from `first` to `last`, of an eighth. A C_D that is not known is
    0, which is no bound.
    """

    def coefficient(reynolds: float) -> float:
        try:
            value = float(drag(reynolds, 0.0))
        except Exception:  # a model of one's own, where nobody may ever fly
            return 0.0
        return max(value, 0.0) if value < math.inf else 0.0

    below = _PER_DECADE * _DECADES
    values = [coefficient(10.0 ** (k / _PER_DECADE)) for k in range(first - below, last + 1)]
    windows = np.lib.stride_tricks.sliding_window_view(np.array(values), below + 1)
    return np.asarray(windows.min(axis=1))


_known_drag = lru_cache(maxsize=256)(_least_drag)
"""The same of a constant or a model of the registries, which never change."""
