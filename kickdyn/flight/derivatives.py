r"""A flight with its derivatives by whatever it depends on: internal differentiation.

The flight and those with one parameter changed are integrated side by side with the same steps, so
that their differences are differences of the equations and not of the steps (Bock 1981, Numerical
treatment of inverse problems in chemical reaction kinetics). With the states :math:`y(t; p)` and
the increments :math:`h_j`, the derivatives are

.. math:: \frac{\partial y}{\partial p_j} \approx \frac{y(t; p + h_j e_j) - y(t; p)}{h_j}
    \quad\text{or}\quad \frac{y(t; p + h_j e_j) - y(t; p - h_j e_j)}{2 h_j} .

The second, central difference takes twice as many flights. The derivatives by the spin need it: a
drag coefficient that depends on the size of the spin has a kink where the ball does not spin.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from kickdyn.aerodynamics.coefficient_model import ScaledCoefficient
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.flight.forces import (
    VACUUM,
    acceleration_function,
    ballistic,
    downward,
    is_ballistic,
    time_to_fall,
)
from kickdyn.plane import Plane

INCREMENT = 1e-6
"""Increment of a parameter over its usual size: about the root of the rounding of a flight."""

MAX_EVALUATIONS = 10_000
"""Evaluations of all accelerations after which the integration is given up; most flights take 100
to 500."""

TIME_LIMIT = 1000.0
"""Time after which a ball that has not reached a plane is taken never to reach it [s]."""

FIRST_STEP = 1.0 / 16.0
"""First step of the integration, as a fraction of the flight, or of its duration in a vacuum."""

LaunchFunction = Callable[[Array], tuple[BallState, Air | None]]
"""From parameters, shape `(p,)`, to the launch and the air of a flight; None is the vacuum."""

StatesFunction = Callable[[float | Array], Array]
"""From a time, or n times, to the states of all flights, `(p + 1, 7)` or `(n, p + 1, 7)`; for
central differences, 2 p stands for p."""

Flights = list[tuple[BallState, Air]]
"""Launches and airs of the flight and of its neighbours."""


@dataclass(frozen=True, eq=False)
class DifferentiableFlight:
    """A flight and its derivatives by p parameters, at any time from the launch to the end."""

    end: float  # time of the end since the launch [s]
    # of the flight and of its p neighbours, then for central differences of the p opposite ones:
    # displacement from the launch [m], velocity [m/s], and the fraction of the spin that is left
    all_states: StatesFunction
    increments: Array  # by which the parameters of the neighbours differ, shape `(p,)`

    def states(self, times: float | Array) -> Array:
        """Return the states at a time, shape `(7,)`, or at n times, shape `(n, 7)`."""
        return np.asarray(self.all_states(times)[..., 0, :])

    def position(self, time: float) -> Array:
        """Return the displacement from the launch, shape `(3,)` [m]."""
        return self.states(time)[:3]

    def velocity(self, time: float) -> Array:
        """Return the velocity, shape `(3,)` [m/s]."""
        return self.states(time)[3:6]

    def slopes(self, times: float | Array) -> Array:
        """Return the derivatives of the position, shape `(3, p)`, or `(n, 3, p)` for n times."""
        positions, p = self.all_states(times)[..., :3], len(self.increments)
        if positions.shape[-2] == p + 1:
            change = positions[..., 1:, :] - positions[..., :1, :]
        else:
            change = 0.5 * (positions[..., 1 : p + 1, :] - positions[..., p + 1 :, :])
        return np.asarray(np.swapaxes(change, -1, -2) / self.increments)

    def slopes_at_plane(self, normal: Array, time: float) -> tuple[Array, Array]:
        r"""Return the derivatives of position and time at a plane that the ball passes at a time.

        With the derivatives :math:`S` of the position at that time, and the velocity v,

        .. math:: \frac{\partial t}{\partial p} = -\frac{n^T S}{n \cdot v}, \qquad
            \frac{\partial x}{\partial p} = S + v\, \frac{\partial t}{\partial p} .

        The normal has any length; the results have the shapes `(3, p)` and `(p,)`.
        """
        slopes, velocity = self.slopes(time), self.velocity(time)
        delay = -(normal @ slopes) / (normal @ velocity)
        return slopes + np.outer(velocity, delay), delay


def fly_with_slopes(
    launch: LaunchFunction,
    parameters: ArrayLike,
    increments: ArrayLike,
    ball: Ball,
    end: float | Plane,
    tol: float = 1e-12,
    *,
    central: bool = False,
) -> DifferentiableFlight:
    """Fly a launch that depends on parameters, with the derivatives by these parameters.

    `scipy.integrate.solve_ivp` integrates all flights as one system by DOP853. Where only weight
    acts, the closed form is used.

    Args:
        launch: function of the parameters that returns the launch and the air.
        parameters: values of the parameters, shape `(p,)`: components of the velocity, the size of
            the spin, a factor of a coefficient, the wind, or anything else.
        increments: changes of the parameters, shape `(p,)`: `INCREMENT` times the size of each; or
            shape `(0,)`, for the flight without derivatives.
        ball: the ball; its mass and radius count.
        end: time of the end since the launch [s]; or a plane, such as the ground or a wall, which
            the ball must reach within `TIME_LIMIT`.
        tol: tolerance of the integration, relative to the flight's length and speed.
        central: whether to take central differences.

    Raises:
        InvalidInput: the ball starts beyond the plane.
        KickdynError: the flight cannot be integrated, or does not reach the plane.
    """
    values, steps = np.asarray(parameters, dtype=float), np.asarray(increments, dtype=float)
    changes = np.eye(len(steps), len(values)) * steps[:, None]
    changed = [values, *(values + changes), *(values - changes if central else ())]
    flights = [(state, VACUUM if air is None else air) for state, air in map(launch, changed)]
    if all(is_ballistic(air, state.spin) for state, air in flights):
        duration, states = _fall(flights, ball, end)
    else:
        duration, states = _integrate(flights, ball, end, tol)
    return DifferentiableFlight(duration, states, steps)


def fly_with_launch_slopes(
    launch: BallState, ball: Ball, air: Air | None, end: float | Plane, tol: float = 1e-12
) -> DifferentiableFlight:
    """Fly with the derivatives by velocity (3), spin (3) and the relative drag coefficient (1).

    They are central differences. Without drag the last derivative is zero.
    """
    speed = max(math.hypot(*launch.velocity), 1e-300)
    spin = max(math.hypot(*launch.spin), 0.1 * speed / ball.radius)

    def changed(change: Array) -> tuple[BallState, Air | None]:
        velocity, turning = launch.velocity + change[:3], launch.spin + change[3:6]
        state = BallState.computed(np.array(launch.position), velocity, turning)
        if air is None or air.drag is None or change[6] == 0.0:
            return state, air
        return state, replace(air, drag=ScaledCoefficient(air.drag, 1.0 + change[6]))

    sizes = np.array([*3 * [speed], *3 * [spin], 1.0])
    return fly_with_slopes(changed, np.zeros(7), INCREMENT * sizes, ball, end, tol, central=True)


def _starts(flights: Flights) -> Array:
    origin = flights[0][0].position
    return np.array([[*(state.position - origin), *state.velocity, 1.0] for state, _ in flights])


def _time_to_fall(flights: Flights, ball: Ball, plane: Plane) -> float:
    """Return when the first ball would reach a plane in a vacuum [s]; inf if never."""
    launch, air = flights[0]
    gap = plane.gap(ball, launch.position)
    closing = downward(ball, air) * float(plane.normal[2])
    return float(time_to_fall(float(plane.normal @ launch.velocity), gap, closing))


def _expected_duration(flights: Flights, ball: Ball, end: float | Plane) -> float:
    """Return about how long a flight takes [s], for the first step and the tolerances."""
    if not isinstance(end, Plane):
        return end
    distance = max(end.gap(ball, flights[0][0].position), ball.radius)
    fastest = max(math.hypot(*flights[0][0].velocity), math.sqrt(GRAVITY * distance))
    falling = _time_to_fall(flights, ball, end)
    return max(falling if falling < math.inf else distance / fastest, ball.radius / fastest)


def _fall(flights: Flights, ball: Ball, end: float | Plane) -> tuple[float, StatesFunction]:
    starts = _starts(flights)
    weights = [downward(ball, air) for _, air in flights]
    duration = _time_to_fall(flights, ball, end) if isinstance(end, Plane) else end
    if not duration < math.inf:
        raise KickdynError("the ball does not reach the plane")

    def states(times: float | Array) -> Array:
        moments = np.atleast_1d(np.asarray(times, dtype=float))
        rows = np.stack(
            [ballistic(start[3:6], g, moments) for start, g in zip(starts, weights, strict=True)], 1
        )
        rows[..., :3] += starts[:, :3]
        return rows if np.ndim(times) else rows[0]

    return duration, states


def _integrate(
    flights: Flights, ball: Ball, end: float | Plane, tol: float
) -> tuple[float, StatesFunction]:
    """Return the end of flights through the air, and their states.

    All end when the first one reaches the plane.
    """
    launch = flights[0][0]
    height = float(launch.position[2])
    forces = [
        (7 * i, acceleration_function(ball, air), *state.spin.tolist())
        for i, (state, air) in enumerate(flights)
    ]
    evaluations = 0

    def rates(_: float, flat: Array) -> list[float]:
        nonlocal evaluations
        evaluations += 1
        if evaluations > MAX_EVALUATIONS:
            raise ArithmeticError(f"it takes more than {MAX_EVALUATIONS} evaluations of forces")
        result: list[float] = []
        values = flat.tolist()
        for k, acceleration, wx, wy, wz in forces:
            z, vx, vy, vz, share = values[k + 2 : k + 7]
            ax, ay, az, decay = acceleration(
                height + z, vx, vy, vz, share * wx, share * wy, share * wz
            )
            result += (vx, vy, vz, ax, ay, az, -decay * share)
        return result

    event, limit = None, end
    if isinstance(end, Plane):
        normal, gap, limit = end.normal, end.gap(ball, launch.position), TIME_LIMIT

        def distance(_: float, flat: Array) -> float:
            return gap + float(normal @ flat[:3])

        distance.terminal, distance.direction = True, -1.0  # type: ignore[attr-defined]
        event = distance
    duration = _expected_duration(flights, ball, end)
    speed = max(math.hypot(*launch.velocity), 0.1 * GRAVITY * duration)
    scale = np.array([*3 * [speed * duration], *3 * [speed], 1.0])
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # in steps that are too long
            solution = solve_ivp(
                rates, (0.0, limit), _starts(flights).ravel(), "DOP853", rtol=tol,
                atol=tol * np.tile(scale, len(flights)), dense_output=True, events=event,
                first_step=FIRST_STEP * duration,
            )  # fmt: skip
    except (ArithmeticError, ValueError) as error:
        raise KickdynError(f"the flight cannot be integrated: {error}") from None
    if not solution.success or not np.isfinite(solution.y[:, -1]).all():
        raise KickdynError(f"the flight cannot be integrated: {solution.message}")
    if event is not None and solution.status != 1:
        raise KickdynError(f"the ball does not reach the plane within {TIME_LIMIT:g} s")

    def states(times: float | Array) -> Array:
        return np.asarray(solution.sol(times).T.reshape(*np.shape(times), len(flights), 7))

    return float(solution.t[-1]), states
