"""Thousands of flights at once: the answers of `fly`, in machine code."""

import math
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn._version import __version__
from kickdyn.aerodynamics.coefficient_model import CoefficientModel
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.compilation import calling_beside
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.compiling import compiled_rates
from kickdyn.flight.equations import FINEST, MAX_SPEED, tolerances
from kickdyn.flight.events import drops
from kickdyn.flight.flight_result import (
    ROUNDING,
    FlightStatus,
    least_error,
    outside_ranges,
    refinement,
)
from kickdyn.flight.forces import ballistic, brakes, downward, is_ballistic
from kickdyn.flight.march import ALOFT, FAILED, LANDED, compiled_march, march, march_is_kept
from kickdyn.ground import Ground


@validation.check_arguments
def fly_many(
    states: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    time_limit: float = 1000.0,
    error: bool = False,
) -> xr.Dataset:
    """Return the flights of a ball from many launches.

    The results are those of `fly`, computed hundreds of times as fast, without planes, orientation
    and samples in between. The first call in a process takes about a second to load, the very first
    some five to compile, and each new air or ball another one.

    Args:
        states: the launches, such as `BallState(velocity=velocities)` with velocities of shape
            `(n, 3)`. An argument of `BallState` that is left out or has shape `(3,)` is the same
            for all launches. Their times are not used.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum. Wind and coefficients that are functions must be written
            with floats and `math`, so that numba can compile them.
        ground: the ground, where the flights end; None ends each at the height of its launch.
        tol: relative tolerance of the integration, as for `fly`.
        time_limit: time after which a flight ends with the status `aloft` if the ball has not come
            down [s].
        error: whether to estimate the error of each landing point from a second flight, as
            `Flight.error` does. This takes three times as long, and longer with functions of your
            own.

    Returns:
        A dataset along `flight` in the order of the launches. Where `status` is `failed`, the
        acceleration was not finite, the integrator gave up, the launch was faster than light, or
        the flight left the range of a coefficient that refuses that, and the numbers are nan;
        where it is `aloft`, the landing is merely the last state. `outside` is about launch, apex
        and landing only, while a ball is slowest between apex and landing.

    Raises:
        InvalidInput: a single state, a ball that starts inside the ground, a bad tolerance, a
            function that cannot be compiled.

    Example:
        >>> import kickdyn as kd
        >>> states = kd.BallState(velocity=[(20, 0, 10), (25, 0, 8)])
        >>> flights = kd.fly_many(states, kd.Ball(), kd.Air())
        >>> flights.range.values.round(2).tolist()
        [32.14, 32.33]
    """
    if states.position.ndim != 2:
        raise InvalidInput(
            f"launches have shape {states.position.shape}: fly_many takes (n, 3), fly takes one"
        )
    tol = validation.number("tol", tol, at_least=1e-13, at_most=1e-2)
    time_limit = validation.number("time limit", time_limit, above=0, unit="s")
    drop = drops(states.position, ball, ground)
    flown = _flown(states, ball, air, drop, time_limit, tol)
    outside = _outside(states, flown.nodes, np.flatnonzero(flown.evaluations), ball, air)
    data = _variables(states, *flown, outside)
    if validation.flag("error", error):
        finer_tol, longest = refinement(tol, flown.nodes[:, 0], air)
        finer = _flown(states, ball, air, drop, time_limit, finer_tol, longest).nodes
        meaning = {"units": "m", "long_name": "estimate of the error of the landing point"}
        data["error"] = ("flight", _errors(states, flown, finer, tol), meaning)
    attributes = {
        "title": "flights of a ball",
        "source": f"kickdyn {__version__}",
        "ball_mass_kg": ball.mass,
        "ball_radius_m": ball.radius,
        "air": "none" if air is None else repr(air),
        "ground": "height of each launch" if ground is None else f"{ground.height:g} m",
        "tol": tol,
    }
    return xr.Dataset(data, {"axis": ["x", "y", "z"]}, attributes)


@lru_cache(maxsize=16)
def compile_flights(ball: Ball, air: Air) -> None:
    """Compile what `fly_many` calls, in two processes at once, or read it from disk."""
    if march_is_kept() is False:
        with calling_beside("the equations of motion of a ball", compiled_rates, ball, air):
            compiled_march()
    compiled_march()
    compiled_rates(ball, air)


class _Flown(NamedTuple):
    """What `march` finds out about n flights: nodes `(n, 16)`, status and evaluations `(n,)`."""

    nodes: Array
    status: NDArray[np.int8]
    evaluations: NDArray[np.int64]


def _flown(
    states: BallState,
    ball: Ball,
    air: Air | None,
    drop: Array,
    time_limit: float,
    tol: float,
    longest: Array | None = None,
) -> _Flown:
    """Return all flights, by closed form or by integration in steps of at most `longest` [s]."""
    closed = _have_closed_form(states, ball, air)
    too_fast = ~closed & (validation.length(states.velocity) > MAX_SPEED)  # what `fly` refuses
    integrated = np.flatnonzero(~closed & ~too_fast)
    if air is not None and len(integrated) == len(drop):
        scenes = _scenes(states, ball, air, drop, tol, longest)
        return _Flown(*_integrate(scenes, states.velocity, ball, air, tol, time_limit))
    nodes, evaluations = np.full((len(drop), 16), np.nan), np.zeros(len(drop), np.int64)
    status = np.full(len(drop), FAILED, np.int8)
    fall = _closed_forms(states.velocity[closed], downward(ball, air), drop[closed], time_limit)
    nodes[closed], status[closed] = fall
    if air is not None and len(integrated):
        scenes = _scenes(states, ball, air, drop, tol, longest)[integrated]
        flown = _integrate(scenes, states.velocity[integrated], ball, air, tol, time_limit)
        nodes[integrated], status[integrated], evaluations[integrated] = flown
    return _Flown(nodes, status, evaluations)


def _errors(states: BallState, flown: _Flown, finer: Array, tol: float) -> Array:
    """Return the estimate of `Flight.error` for each flight [m], nan where it failed."""
    nodes = flown.nodes
    length = np.abs(nodes[:, [1, 2, 3, 9, 10, 11]]).max(axis=1, initial=0.0)
    late = validation.length(nodes[:, 4:7]) * np.abs(finer[:, 0] - nodes[:, 0])
    moved = np.maximum(validation.length(finer[:, 1:4] - nodes[:, 1:4]), late)
    error = np.maximum(least_error(tol) * length, 2.0 * np.where(np.isnan(moved), math.inf, moved))
    error = np.where(flown.evaluations > 0, error, ROUNDING * length)
    error += ROUNDING * np.abs(states.position).max(axis=1, initial=0.0)
    return np.where(flown.status == FAILED, math.nan, error)


def _spins(states: BallState) -> NDArray[np.bool_]:
    """Return which balls spin; numpy's `any` is slow along a short axis."""
    x, y, z = (states.spin[:, axis] for axis in range(3))
    return np.asarray((x != 0.0) | (y != 0.0) | (z != 0.0))


def _have_closed_form(states: BallState, ball: Ball, air: Air | None) -> NDArray[np.bool_]:
    """Return which flights a closed form answers, those with spin or those without, or both."""
    spins = _spins(states)
    if downward(ball, air) <= 0.0:
        return np.zeros_like(spins)
    return np.where(spins, is_ballistic(air, np.ones(3)), is_ballistic(air, np.zeros(3)))


def _closed_forms(
    velocity: Array, g: float, drop: Array, time_limit: float
) -> tuple[Array, NDArray[np.int8]]:
    """Return nodes as `march` does, and status, of flights that only weight acts on."""
    rise = velocity[:, 2]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        root = np.sqrt(rise * rise + 2.0 * g * drop)
        end = np.where(rise >= 0.0, (rise + root) / g, 2.0 * drop / (root - rise))
        landed = end <= time_limit
        end = np.minimum(end, time_limit)
        top = np.clip(rise / g, 0.0, end)
        states = [ballistic(velocity, g, t) for t in (end, top)]
    flown = np.column_stack([end, states[0], top, states[1]])
    flown[landed, 3] = -drop[landed]
    status = np.where(landed, LANDED, ALOFT).astype(np.int8)
    lost = ~np.isfinite(flown).all(axis=1)
    flown[lost], status[lost] = np.nan, FAILED
    return flown, status


def _integrate(
    scenes: Array, velocities: Array, ball: Ball, air: Air, tol: float, time_limit: float
) -> tuple[Array, NDArray[np.int8], NDArray[np.int64]]:
    """Return nodes, status and evaluations of flights through the air."""
    compile_flights(ball, air)
    rates, velocities = compiled_rates(ball, air), np.array(velocities)  # which can be written to
    limits = max(tol, FINEST), tol, time_limit
    try:
        return march(rates, scenes, velocities, *limits)
    except Exception:  # a coefficient's own: only its rows shall fail
        n = len(scenes)
        flown = np.full((n, 16), np.nan), np.full(n, FAILED, np.int8), np.zeros(n, np.int64)
        for i in range(n):
            with suppress(Exception):
                one = march(rates, scenes[i : i + 1], velocities[i : i + 1], *limits)
                flown[0][i], flown[1][i], flown[2][i] = (part[0] for part in one)
        return flown


def _scenes(
    states: BallState, ball: Ball, air: Air, drop: Array, tol: float, longest: Array | None
) -> Array:
    """Return what `march` needs of each flight, with the tolerances of `fly`, shape `(n, 9)`."""
    decays = _spins(states) & brakes(air, np.ones(3))
    if callable(air.wind):
        wind = np.array([_speed(air, height) for height in states.position[:, 2].tolist()])
    else:
        wind = np.full(len(drop), math.hypot(*air.wind))
    _, near, slow = tolerances(states.velocity, drop, wind, ball, air, tol)
    height = states.position[:, 2]
    steps = np.full(len(drop), math.inf) if longest is None else longest
    columns = [height, states.spin, decays, drop, near, slow, steps]
    return np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)


def _outside(
    states: BallState, nodes: Array, rows: NDArray[np.intp], ball: Ball, air: Air | None
) -> NDArray[np.bool_]:
    """Return which flights have a node outside the range of a coefficient."""
    outside = np.zeros(len(nodes), bool)
    models = () if air is None else (air.drag, air.lift)
    if air is None or not any(isinstance(model, CoefficientModel) for model in models):
        return outside
    every = slice(None) if len(rows) == len(nodes) else rows
    launch, spin, flown = states.position[every, 2], states.spin[every], nodes[every]
    found = np.zeros(len(flown), bool)
    for height, velocity, share in (
        (launch, states.velocity[every], 1.0),
        (launch + flown[:, 3], flown[:, 4:7], flown[:, 7:8]),
        (launch + flown[:, 11], flown[:, 12:15], flown[:, 15:]),
    ):
        for _, out in outside_ranges(height, velocity, share * spin, ball, air):
            found |= out.any(axis=0)
    outside[every] = found & (flown[:, 0] > 0.0)  # else it failed, or never flew
    return outside


def _speed(air: Air, height: float) -> float:
    """Return the speed of the wind [m/s], nan where its function, a user's own, fails."""
    try:
        return math.hypot(*air.wind_at(height))
    except Exception:
        return math.nan


def _variables(
    states: BallState,
    nodes: Array,
    status: NDArray[np.int8],
    evaluations: NDArray[np.int64],
    outside: NDArray[np.bool_],
) -> dict[str, tuple[str | tuple[str, ...], NDArray[Any], dict[str, Any]]]:
    """Return the results with names, units and meanings."""
    ended, moved, velocity = nodes[:, 0], nodes[:, 1:4], nodes[:, 4:7]
    data: dict[str, tuple[str | tuple[str, ...], NDArray[Any], dict[str, Any]]] = {}
    for name, values, unit, meaning in (
        ("range", np.hypot(moved[:, 0], moved[:, 1]), "m", "horizontal distance to the landing"),
        ("duration", ended, "s", "time from launch to landing"),
        ("height", nodes[:, 11], "m", "height of the apex above the launch"),
        ("apex_time", nodes[:, 8], "s", "time from launch to apex"),
        ("apex_position", states.position + nodes[:, 9:12], "m", "centre of the ball at the apex"),
        ("landing_position", states.position + moved, "m", "centre of the ball at the landing"),
        ("landing_velocity", velocity, "m/s", "velocity at the landing"),
        ("landing_spin", nodes[:, 7:8] * states.spin, "rad/s", "spin at the landing"),
        ("evaluations", evaluations, "1", "evaluations of the acceleration"),
        ("outside", outside, "1", "launch, apex or landing is out of a coefficient's range"),
    ):
        dims = ("flight", "axis")[: values.ndim]
        data[name] = (dims, values, {"units": unit, "long_name": meaning})
    flags = {
        "long_name": "how the flight ends",
        "flag_values": np.array([LANDED, ALOFT, FAILED], dtype=np.int8),
        "flag_meanings": " ".join([FlightStatus.LANDED, FlightStatus.ALOFT, FlightStatus.FAILED]),
    }
    return data | {"status": ("flight", status, flags)}
