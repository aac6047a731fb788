r"""The equations of motion of one flight, and the tolerances they are integrated to.

The seven states are the displacement from the launch [m], the velocity [m/s] and the spin over that
of the launch:

.. math:: \dot x = v, \quad \dot v = a(z, v, s\, \omega_0), \quad \dot s = -k s

with a and k of `acceleration_function`. The displacement is from the launch, so that a hop of
1e-20 m at a height of 100 m has its digits.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from kickdyn.aerodynamics.coefficient_model import Coefficient, is_known
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.flight.forces import acceleration_function, brakes, downward

MAX_SPEED = 299_792_458.0
"""In air [m/s], the speed of light. Tolerances hold up to there; coefficients end far below."""

FINEST = 100 * float(np.finfo(float).eps)
"""Least relative tolerance of a step, as of scipy's DOP853: below it, the estimate of the step's
error is rounding."""

_PER_DECADE, _DECADES = 8, 3
_FARTHEST = 15
"""The drag length is tabulated for Reynolds numbers from 1e-15 to 1e15."""


class FlightEquations:
    """The equations of motion of a ball launched into the air.

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

    def rates(self, _: float, states: Array) -> list[float]:
        """Return the time derivative of the states, nan where a coefficient or the wind raises."""
        _, _, z, vx, vy, vz, share = states.tolist()
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

    def count_changing(self) -> int:
        """Return the number of the seven states that change after the launch, at least 1."""
        rates = np.array(self.rates(0.0, self.begin))
        axes = (self.begin[3:6] != 0.0) | (rates[3:6] != 0.0)
        return max(2 * int(axes.sum()) + bool(self._brakes), 1)


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
        slowed = free / drag_length(ball, air)(fastest)
        length = np.where(slowed > 0.0, free * np.log1p(slowed) / np.maximum(slowed, 1e-300), free)
        pace = np.maximum(fastest / np.sqrt(1.0 + slowed), wind)
        displacement, velocity = tol * np.maximum(length, drop), tol * pace
    # the integrators divide by atol: it is never 0, not even for a balloon that starts at rest
    return max(tol, FINEST), np.maximum(displacement, 1e-300), np.maximum(velocity, 1e-300)


def drag_length(ball: Ball, air: Air) -> Callable[[Array], Array]:
    r"""Return a function of speeds: the length in which drag takes most of them [m].

    It is :math:`2 m / (\rho A C_D)`, of the least C_D without spin that the ball meets within three
    decades as it slows down. Without drag it is infinite.
    """
    drag = air.drag
    if drag is None or air.density == 0.0:
        return lambda speed: np.full(np.shape(speed), math.inf)
    per_speed = 2.0 * ball.radius * air.density / air.viscosity
    most = 2.0 * ball.mass / (air.density * ball.cross_section)
    tabulated = is_known(drag)

    def length(speed: Array) -> Array:
        with np.errstate(divide="ignore", over="ignore"):
            decade = np.fmin(np.log10(per_speed * np.asarray(speed)), _FARTHEST)  # of nan too
            step = np.ceil(_PER_DECADE * np.maximum(decade, -_FARTHEST)).astype(int)
            first, last = int(step.min(initial=0)), int(step.max(initial=0))
            least = _known_drag(drag, first, last) if tabulated else _least_drag(drag, first, last)
            return np.asarray(most / least[step - first])

    return length


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
