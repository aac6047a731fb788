"""Thousands of flights at once: the answers of `fly`, in machine code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn._version import __version__
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.compiling import compiled_rates
from kickdyn.flight.flight_result import outside_ranges
from kickdyn.flight.fly import MAX_SPEED, check_scene
from kickdyn.flight.forces import downward
from kickdyn.flight.march import march
from kickdyn.flight.steps import ALOFT, FAILED, LANDED
from kickdyn.flight.tolerances import tolerances
from kickdyn.ground import Ground

STATUSES = ("landed", "aloft", "failed")
"""How a flight ends, in the order of the flags."""


def fly_many(
    states: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    time_limit: float = 1000.0,
) -> xr.Dataset:
    """Let a ball fly from many launches.

    The answers are those of `fly`, hundreds of times as fast, without its planes, orientation and
    samples in between. The first call in a process takes about a second to load, the very first
    some ten to compile, and each new air or ball another one.

    Args:
        states: the launches, arrays of shape `(n, 3)`; their time is not used.
        ball: mass and radius.
        air: None is the vacuum. Wind and coefficients that are functions must be written with
            floats and `math`, so that numba can compile them.
        ground: where the flights end; None ends each at the height of its launch.
        tol: relative tolerance of the integration, 1e-13 to 1e-2.
        time_limit: after which a ball that will not come down is left alone [s].

    Returns:
        A dataset along `flight` in the order of the launches. Where `status` is `failed`, the
        acceleration was not finite, the integrator gave up, the launch was faster than light, or
        the flight left the range of a coefficient that refuses that, and the numbers are nan;
        where it is `aloft`, the landing is merely the last state. `outside` knows launch, apex
        and landing only, while a ball is slowest between apex and landing.

    Raises:
        InvalidInput: a single state, a ball that starts inside the ground, a bad tolerance, a
            function that cannot be compiled.
    """
    check_scene(states, ball, air, ground)
    if states.position.ndim != 2:
        raise InvalidInput(
            f"launches have shape {states.position.shape}: fly_many takes (n, 3), fly takes one"
        )
    tol = validation.number("tol", tol, at_least=1e-13, at_most=1e-2)
    time_limit = validation.number("time limit", time_limit, above=0, unit="s")
    drop = _drops(states, ball, ground)
    n = len(drop)
    nodes = np.full((n, 16), np.nan)
    status, evaluations = np.zeros(n, np.int8), np.zeros(n, np.int64)
    closed = _closed(states, ball, air)
    if closed.any():
        g = downward(ball, air)
        with np.errstate(over="ignore", invalid="ignore"):
            fallen, ended = _fall(states.velocity[closed], g, drop[closed], time_limit)
        lost = ~np.isfinite(fallen).all(axis=1)
        fallen[lost], ended[lost] = np.nan, FAILED
        nodes[closed], status[closed] = fallen, ended
    too_fast = ~closed & (validation.length(states.velocity) > MAX_SPEED)  # what `fly` refuses
    status[too_fast] = FAILED
    rows = np.flatnonzero(~closed & ~too_fast)
    if air is not None and len(rows):
        rtol = max(tol, 100 * float(np.finfo(float).eps))
        solved, ends, counts = np.empty((len(rows), 16)), status[rows], evaluations[rows]
        scenes = _scenes(states, ball, air, drop, tol)[rows]
        velocities = np.ascontiguousarray(states.velocity[rows])
        rates = compiled_rates(ball, air)
        given = (rtol, tol, time_limit)
        try:
            march(rates, scenes, velocities, *given, solved, ends, counts)
        except Exception:  # a coefficient's own: only its rows shall fail
            for i in range(len(rows)):
                one = slice(i, i + 1)
                answer = solved[one], ends[one], counts[one]
                try:
                    march(rates, scenes[one], velocities[one], *given, *answer)
                except Exception:
                    solved[i], ends[i], counts[i] = np.nan, FAILED, 0
        nodes[rows], status[rows], evaluations[rows] = solved, ends, counts
    left = _outside(states, nodes, rows, ball, air)
    attributes = _attributes(ball, air, ground, tol)
    return _dataset(states, nodes, status, evaluations, left, attributes)


def _drops(states: BallState, ball: Ball, ground: Ground | None) -> Array:
    """Return how far below its launch each flight ends [m]."""
    if ground is None:
        return np.zeros(len(states.position))
    gap = states.position[:, 2] - ball.radius - ground.height
    inside = np.flatnonzero(gap < -1e-9 * max(ball.radius, abs(ground.height)))
    if inside.size:
        raise InvalidInput(
            f"flight {inside[0]} starts {-gap[inside[0]]:g} m inside the ground: the ball's centre "
            f"must be at or above {ground.height + ball.radius:g} m"
        )
    return np.maximum(gap, 0.0)


def _closed(
    states: BallState, ball: Ball, air: Air | None
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which flights a closed form answers: `forces.is_ballistic`, row by row."""
    spins = states.spin.any(axis=1)
    if air is None:
        return np.ones_like(spins)
    if downward(ball, air) <= 0.0:
        return np.zeros_like(spins)
    if air.density == 0.0:
        return np.ones_like(spins)
    if air.drag is not None:
        return np.zeros_like(spins)
    if air.lift is None and air.torque is None:
        return np.ones_like(spins)
    return np.logical_not(spins)


def _fall(
    velocity: Array, g: float, drop: Array, time_limit: float
) -> tuple[Array, NDArray[np.int8]]:
    """Return nodes as `march` does, and status, of flights in a vacuum."""
    rise = velocity[:, 2]
    root = np.sqrt(rise * rise + 2.0 * g * drop)
    with np.errstate(divide="ignore", invalid="ignore"):  # in the branch not taken
        end = np.where(rise >= 0.0, (rise + root) / g, 2.0 * drop / (root - rise))
    landed = end <= time_limit
    end = np.minimum(end, time_limit)
    top = np.clip(rise / g, 0.0, end)
    nodes = np.ones((len(end), 16))
    for column, t in ((0, end), (8, top)):
        nodes[:, column] = t
        nodes[:, column + 1 : column + 4] = velocity * t[:, None]
        nodes[:, column + 3] -= 0.5 * g * t * t
        nodes[:, column + 4 : column + 7] = velocity
        nodes[:, column + 6] -= g * t
    nodes[landed, 3] = -drop[landed]
    return nodes, np.where(landed, LANDED, ALOFT).astype(np.int8)


def _scenes(states: BallState, ball: Ball, air: Air, drop: Array, tol: float) -> Array:
    """Return what `march` must know of each flight, with the tolerances of `fly`."""
    n = len(drop)
    spins = states.spin.any(axis=1)
    decays = spins & (air.torque is not None)
    calm = not callable(air.wind) and air.wind[1] == 0.0
    planar = calm & (states.velocity[:, 1] == 0.0) & ~states.spin[:, ::2].any(axis=1)
    if callable(air.wind):
        wind = np.array([_speed(air, height) for height in states.position[:, 2].tolist()])
    else:
        wind = np.full(n, math.hypot(*air.wind))
    _, near, slow = tolerances(states.velocity, drop, wind, ball, air, tol)
    count = np.where(planar, 4.0, 6.0) + decays
    height = states.position[:, 2]
    columns = [height, states.spin, decays, drop, count, near, slow]
    return np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)


def _outside(
    states: BallState, nodes: Array, rows: NDArray[np.intp], ball: Ball, air: Air | None
) -> NDArray[np.bool_]:
    """Return which flights have a node where a coefficient is not meant to be used."""
    left = np.zeros(len(nodes), bool)
    if air is None:
        return left
    launch, flown = states.position[rows, 2], nodes[rows]
    spin, one = states.spin[rows], np.ones((len(rows), 1))
    for height, velocity, share in (
        (launch, states.velocity[rows], one),
        (launch + flown[:, 3], flown[:, 4:7], flown[:, 7:8]),
        (launch + flown[:, 11], flown[:, 12:15], flown[:, 15:]),
    ):
        for _, out in outside_ranges(height, velocity, share * spin, ball, air):
            left[rows] |= out
    left[~(nodes[:, 0] > 0.0)] = False  # failed: nobody knows; or never flew
    return left


def _speed(air: Air, height: float) -> float:
    """Return the speed of the wind, nan where its function fails."""
    try:
        return math.hypot(*air.wind_at(height))
    except Exception:  # someone's own function
        return math.nan


def _attributes(
    ball: Ball, air: Air | None, ground: Ground | None, tol: float
) -> dict[str, str | float]:
    return {
        "title": "flights of a ball",
        "source": f"kickdyn {__version__}",
        "ball_mass_kg": ball.mass,
        "ball_radius_m": ball.radius,
        "air": "none" if air is None else repr(air),
        "ground": "height of each launch" if ground is None else f"{ground.height:g} m",
        "tol": tol,
    }


def _dataset(
    states: BallState,
    nodes: Array,
    status: NDArray[np.int8],
    evaluations: NDArray[np.int64],
    left: NDArray[np.bool_],
    attributes: dict[str, str | float],
) -> xr.Dataset:
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
        ("outside", left, "1", "whether launch, apex or landing is out of a coefficient's range"),
    ):
        dims = ("flight", "axis")[: values.ndim]
        data[name] = (dims, values, {"units": unit, "long_name": meaning})
    flags = {
        "long_name": "how the flight ends",
        "flag_values": np.arange(len(STATUSES), dtype=np.int8),
        "flag_meanings": " ".join(STATUSES),
    }
    data["status"] = ("flight", status, flags)
    return xr.Dataset(data, {"axis": ["x", "y", "z"]}, attributes)
