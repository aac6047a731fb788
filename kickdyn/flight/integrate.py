"""Flight through the air: scipy's integrators, cut exactly at apex and landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from kickdyn.checks import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.forces import Rates

METHOD = "DOP853"

Trajectory = Callable[[Array], Array]


class Arc(NamedTuple):
    """A piece of flight that ends at an event.

    Attributes:
        end: time of the event, or of the time limit [s].
        state: there, displacement from the launch and velocity, shape `(6,)`.
        trajectory: the same at many times, shape `(n, 6)`.
        evaluations: of the acceleration.
        reached: whether the event came before the time limit.
    """

    end: float
    state: Array
    trajectory: Trajectory
    evaluations: int
    reached: bool


def fly_until(
    event: Callable[[float, Array], float],
    rates: Rates,
    start: tuple[float, Array],
    time_limit: float,
    rtol: float,
    atol: Array,
) -> Arc:
    """Integrate until `event` falls through zero, or to the time limit.

    Raises:
        KickdynError: the integrator gave up.
    """

    def falling(t: float, state: Array) -> float:
        return event(t, state)

    falling.terminal = True  # type: ignore[attr-defined]
    falling.direction = -1  # type: ignore[attr-defined]
    began, state = start
    answer = solve_ivp(
        rates,
        (began, time_limit),
        state,
        method=METHOD,
        events=falling,
        dense_output=True,
        rtol=rtol,
        atol=atol,
    )
    if answer.status < 0 or not np.isfinite(answer.y[:, -1]).all():
        raise KickdynError(f"the flight could not be integrated: {answer.message}")
    reached = answer.status == 1
    end = float(answer.t_events[0][0]) if reached else float(answer.t[-1])
    last = answer.y_events[0][0] if reached else answer.y[:, -1]
    dense = answer.sol
    return Arc(end, last, lambda t: np.asarray(dense(t).T), int(answer.nfev), reached)


def tolerances(speed: float, drop: float, g: float, wind: float, tol: float) -> tuple[float, Array]:
    """Return rtol and atol: `tol` relative to the flight's own lengths and speeds."""
    pace = max(speed, wind, math.sqrt(2.0 * abs(g) * drop))
    length = max(pace * pace / max(abs(g), 1e-300), drop)
    # solve_ivp raises rtol to 100 machine epsilons by itself, with a warning: do it here
    rtol = max(tol, 100 * np.finfo(float).eps)
    return rtol, tol * np.repeat([length, pace], 3)
