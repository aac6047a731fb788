"""Many flights: the answers of `fly`, in Python or, for thousands, in machine code."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn._version import __version__
from kickdyn.aerodynamics.coefficient_model import CoefficientModel
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.compilation import MachineCode, Source
from kickdyn.core.mechanics import difference_slopes
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.events import (
    NUMBERS,
    Event,
    checked_ends,
    count_known,
    distance_to_plane,
    ground_event,
    plane_events,
)
from kickdyn.flight.flight_result import (
    ALOFT,
    FAILED,
    FURTHER,
    LANDED,
    ROUNDING,
    FlightStatus,
    least_error,
    outside_ranges,
    refinement,
)
from kickdyn.flight.fly import flight_tolerance, fly_arc
from kickdyn.flight.forces import (
    FINEST,
    MAX_SPEED,
    VACUUM,
    brakes,
    downward,
    fall_to_planes,
    is_ballistic,
    tolerances,
)
from kickdyn.flight.integrate import StepGenerator, Tolerance, solve_together
from kickdyn.ground import Ground
from kickdyn.plane import Plane

FLIGHTS_TOGETHER = 50
"""Flights whose steps numpy computes together where there is no machine code."""

TIME_LIMIT = 1000.0
"""Time after which a flight ends if the ball has not come down [s]."""


@validation.check_arguments
def fly_many(
    states: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    plane: Plane | None = None,
    time_limit: float = TIME_LIMIT,
    error: bool = False,
    ends: Sequence[Event] = (),
    slopes: bool = False,
) -> xr.Dataset:
    """Return the flights of a ball from many launches.

    The results are as from `fly`. Some thousand flights are computed as by it, in Python.
    Machine code, which is a hundred times as fast, is loaded or compiled when the calls of a
    process have taken as long as that would, half a second or eight; a new air, ball or event then
    takes another one. Both ways keep the tolerance, with errors of their own.

    Args:
        states: the launches, such as `BallState(velocity=velocities)` with velocities of shape
            `(n, 3)`. An argument of `BallState` that is left out or has shape `(3,)` is the same
            for all launches. Their times are not used.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum. Wind and coefficients that are functions must be written
            with floats and `math`, so that numba can compile them for many flights.
        ground: the ground, where the flights end; None ends each at the height of its launch.
        tol: relative tolerance of the integration, as for `fly`.
        plane: a wall or a goal line, which ends each flight that reaches it before the ground.
        time_limit: time after which a flight ends with the status `aloft` if the ball has not come
            down [s].
        error: whether to estimate the error of each landing point as `Flight.error` does, which
            takes three times as long, and longer with functions of your own.
        ends: further events that end flights, as for `fly`; numba must be able to compile their
            functions.
        slopes: whether to differentiate the landing positions by velocity and spin of the launch,
            by differences of fourth order: `landing_by_velocity` [s] and `landing_by_spin` [m s],
            each of shape `(n, 3, 3)`, exact to about 1e-7. It takes 40 times as long.

    Returns:
        A dataset along `flight` in the order of the launches. Where `status` is `failed`, the
        acceleration was not finite, the integrator gave up, the launch was faster than light, or
        the function of an event was not a number, and the numbers are nan; where it is `aloft`, the
        landing is merely the last state. `outside` is about launch, apex and landing only, while a
        ball is slowest between apex and landing.

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
    tol, time_limit = checked_launches(states, "fly", tol, time_limit)
    events = ground_event(ball, ground), *plane_events(ball, plane), *checked_ends(ends)
    launched = tuple(event.launched(states) for event in events)
    runs = 1 + 3 * validation.flag("error", error) + 40 * validation.flag("slopes", slopes)
    in_python = len(states.position) * runs * seconds_of_fly(tol)
    task = _Task(states, ball, air, launched, time_limit, MARCH.pays(in_python))
    flown = _flown(task, tol)
    outside = _outside(states, flown.nodes, np.flatnonzero(flown.evaluations), ball, air)
    rows = _rows(states, flown, outside)
    if error:
        finer_tol, longest = refinement(tol, flown.nodes[:, 0], air)
        errors = _errors(states, flown, _flown(task, finer_tol, longest).nodes, tol)
        rows.append(("error", errors, "m", "estimate of the error of the landing point"))
    if slopes:
        rows += _slopes(task, events, tol)
    names: list[str] = [FlightStatus.LANDED, FlightStatus.ALOFT, FlightStatus.FAILED]
    names += [event.name for event in events[1:]]
    attributes = {
        "title": "flights of a ball",
        "ball_mass_kg": ball.mass,
        "ball_radius_m": ball.radius,
        "warnings": "; ".join(ball.warnings),
        "air": "none" if air is None else repr(air),
        "ground": "height of each launch" if ground is None else f"{ground.height:g} m",
        "tol": tol,
    }
    return dataset(rows, flown.status, names, attributes)


Rows = list[tuple[str, NDArray[Any], str, str]]
"""Name, values, unit and meaning of each result."""


def dataset(
    rows: Rows, status: NDArray[np.int8], names: Sequence[str], attributes: dict[str, Any]
) -> xr.Dataset:
    """Return results of n balls along `flight`, and their status, a flag with a name."""
    data: dict[str, Any] = {
        name: (("flight", "axis", "by")[: values.ndim], values, {"units": unit, "long_name": what})
        for name, values, unit, what in rows
    }
    flags = {
        "long_name": "how the motion ends",
        "flag_values": np.arange(len(names), dtype=np.int8),
        "flag_meanings": " ".join(names),
    }
    data["status"] = ("flight", status, flags)
    source = {"source": f"kickdyn {__version__}"}
    return xr.Dataset(data, {"axis": ["x", "y", "z"]}, source | attributes)


def checked_launches(
    states: BallState, single: str, tol: float, time_limit: float
) -> tuple[float, float]:
    """Return tolerance and limit of time [s] of many flights; the function `single` takes one."""
    if states.position.ndim != 2:
        raise InvalidInput(
            f"launches have shape {states.position.shape}: {single}_many takes (n, 3), {single} "
            "takes one"
        )
    tol = validation.number("tol", tol, at_least=1e-13, at_most=1e-2)
    return tol, validation.number("time limit", time_limit, above=0, unit="s")


DIFFERENCE = 1e-3
"""Step of the differences, relative to speed and spin of the launch."""

DIFFERENCES_TOL = 1e-11
"""Tolerance of flights whose differences are taken: their errors count a thousand times."""


def landings(
    states: BallState,
    ball: Ball,
    air: Air | None,
    events: Sequence[Event],
    tol: float,
    time_limit: float,
    *,
    machine_code: bool,
) -> tuple[BallState, NDArray[np.int8]]:
    """Return the balls at the ends of their flights, nan if failed, and the statuses, shape `(n,)`.

    The times are since the launches. The ground is the first of the events; `machine_code` is
    whether the balls fly in it, or one after the other.
    """
    launched = tuple(event.launched(states) for event in events)
    flown = _flown(_Task(states, ball, air, launched, time_limit, machine_code, False), tol)
    nodes = flown.nodes
    vectors = states.position + nodes[:, 1:4], nodes[:, 4:7], nodes[:, 7:8] * states.spin
    return BallState.computed(*vectors, nodes[:, 0]), flown.status


def seconds_of_fly(tol: float) -> float:
    """Return the processor time of one of many flights in Python, roughly [s]."""
    return float(0.8e-3 * (1e-9 / tol) ** 0.125)


def _source(within: bool | None = None) -> Source:
    from kickdyn.flight import march  # imports numba

    return march.source() if within is None else march.reading_source(within)


MARCH = MachineCode(_source, "the integration of flights", 8.0)
"""With the equations of motion, which are compiled for each ball and air."""

_READING = {
    within: MachineCode(partial(_source, within), "the reading of events within steps", seconds)
    for within, seconds in ((False, 0.3), (True, 2.0))
}


def integrate_many(
    rates: Any,
    ends: Sequence[Event],
    numbers: Array,
    launch: tuple[Array, Array],
    scales: Sequence[Any],
    tol: float,
    time_limit: float,
    apex: bool = False,
) -> "Flown":
    """Return n flights by machine code for their rates, such as `compiled_rates`.

    The launch is `scene` and `velocity` of `march.Flights`; the scales are absolute tolerances of
    displacement [m] and velocity [m/s] and the longest step [s], numbers or shape `(n,)`.
    """
    from kickdyn.flight.compiling import compiled_ends
    from kickdyn.flight.march import Flights, march

    n, known = len(numbers), count_known(ends)
    # the error of a quintic falls with the cube of the distance from its end
    columns = *scales[:2], tol, scales[2], 0.1 * tol ** (1.0 / 3.0)
    tolerance = np.column_stack([np.broadcast_to(column, n) for column in columns])
    inputs = [np.array(x, dtype=float, order="C") for x in (*launch, numbers, tolerance)]
    results = np.empty((n, 16 if apex else 8)), np.empty(n, np.int8), np.zeros(n, np.int64)
    flights = Flights._make([*inputs, np.empty((n, 8 + 2 * len(ends))), *results])
    values = compiled_ends(tuple(end.function for end in ends), tuple(end.name for end in ends))
    code = MARCH(), _READING[known < len(ends)](), rates, values
    try:
        march(*code, flights, max(tol, FINEST), time_limit, known)
    except Exception:  # a coefficient's own: only its rows shall fail
        for i in range(n):
            row = Flights._make(array[i : i + 1] for array in flights)
            try:
                march(*code, row, max(tol, FINEST), time_limit, known)
            except Exception:
                row.nodes[:], row.status[:], row.evaluations[:] = np.nan, FAILED, 0
    return Flown(*results)


def numbers_of(ends: Sequence[Event], n: int) -> Array:
    """Return the numbers of k events that n flights share or not, shape `(n, 4 k)`."""
    return np.column_stack([np.broadcast_to(x, n) for end in ends for x in end.numbers])


class _Task(NamedTuple):
    """Launches of a ball, and the events that end the flights, the ground first."""

    states: BallState
    ball: Ball
    air: Air | None
    ends: tuple[Event, ...]
    time_limit: float
    machine_code: bool
    apex: bool = True  # whether it is asked; else its numbers may be any


class Flown(NamedTuple):
    """Nodes `(n, 16)`, or `(n, 8)` without apex, status and evaluations `(n,)` of n flights.

    They are as in `march.Flights`.
    """

    nodes: Array
    status: NDArray[np.int8]
    evaluations: NDArray[np.int64]

    def put(self, rows: NDArray[Any], flown: "Flown") -> None:
        """Fill in other flights at some rows."""
        self.nodes[rows, : flown.nodes.shape[1]], self.status[rows] = flown.nodes, flown.status
        self.evaluations[rows] = flown.evaluations


def _flown(task: _Task, tol: float, longest: Array | None = None) -> Flown:
    """Return all flights, by closed form or by integration in steps of at most `longest` [s]."""
    states = task.states
    closed = np.where(  # flights with spin, those without, or both
        _spins(states), is_ballistic(task.air, np.ones(3)), is_ballistic(task.air, np.zeros(3))
    )
    closed &= downward(task.ball, task.air) > 0.0
    closed &= all(end.function is distance_to_plane for end in task.ends)
    too_fast = ~closed & (validation.length(states.velocity) > MAX_SPEED)  # what `fly` refuses
    integrated = np.flatnonzero(~closed & ~too_fast)
    n = len(closed)
    if len(integrated) == n:
        return _integrate(task, slice(None), tol, longest)
    flown = Flown(np.full((n, 16), np.nan), np.full(n, FAILED, np.int8), np.zeros(n, np.int64))
    if closed.any():
        flown.put(closed, _closed_forms(task, closed))
    if len(integrated):
        flown.put(integrated, _integrate(task, integrated, tol, longest))
    return flown


def _slopes(task: _Task, events: Sequence[Event], tol: float) -> Rows:
    """Return the derivatives of the landing positions by velocity and spin of the launches."""
    states = task.states
    speed = np.maximum(validation.length(states.velocity), 1e-9)
    spin = np.maximum(validation.length(states.spin), speed / task.ball.radius)

    def landing(name: str, change: Array) -> Array:
        changed = replace(states, **{name: getattr(states, name) + change})
        launched = tuple(event.launched(changed) for event in events)
        changes = task._replace(states=changed, ends=launched, apex=False)
        flown = _flown(changes, min(tol, DIFFERENCES_TOL))
        return flown.nodes[:, 1:4]

    by_velocity, by_spin = (
        difference_slopes(partial(landing, name), DIFFERENCE * size, 3)
        for name, size in (("velocity", speed), ("spin", spin))
    )
    meaning = "derivative of the landing position by the"
    return [
        ("landing_by_velocity", by_velocity, "s", f"{meaning} launch"),
        ("landing_by_spin", by_spin, "m s", f"{meaning} spin"),
    ]


def _errors(states: BallState, flown: Flown, finer: Array, tol: float) -> Array:
    nodes = flown.nodes
    length = np.abs(nodes[:, [1, 2, 3, 9, 10, 11]]).max(axis=1, initial=0.0)
    late = validation.length(nodes[:, 4:7]) * np.abs(finer[:, 0] - nodes[:, 0])
    apart = np.maximum(validation.length(finer[:, 1:4] - nodes[:, 1:4]), late)
    error = np.maximum(least_error(tol) * length, 2.0 * np.where(np.isnan(apart), math.inf, apart))
    error = np.where(flown.evaluations > 0, error, ROUNDING * length)
    error += ROUNDING * np.abs(states.position).max(axis=1, initial=0.0)
    return np.where(flown.status == FAILED, math.nan, error)


def _spins(states: BallState) -> NDArray[np.bool_]:
    """Return which balls spin; numpy's `any` is slow along a short axis."""
    x, y, z = (states.spin[:, axis] for axis in range(3))
    return np.asarray((x != 0.0) | (y != 0.0) | (z != 0.0))


def _closed_forms(task: _Task, rows: NDArray[np.bool_]) -> Flown:
    nodes, reached = fall_to_planes(
        task.states.velocity[rows],
        numbers_of(task.ends, len(rows))[rows],
        downward(task.ball, task.air),
        task.time_limit,
    )
    status = np.where(reached == 0, LANDED, FURTHER - 1 + reached)
    status[reached == len(task.ends)] = ALOFT
    lost = ~np.isfinite(nodes).all(axis=1)
    nodes[lost], status[lost] = np.nan, FAILED
    return Flown(nodes, status.astype(np.int8), np.zeros(len(nodes), np.int64))


def _integrate(
    task: _Task, rows: slice | NDArray[np.intp], tol: float, longest: Array | None
) -> Flown:
    states, ball, ends = task.states, task.ball, task.ends
    air = VACUUM if task.air is None else task.air
    drop, height = np.asarray(ends[0].numbers[0]), states.position[:, 2]
    if callable(air.wind):
        wind = np.array([_speed(air, z) for z in height.tolist()])
    else:
        wind = np.full(len(drop), math.hypot(*air.wind))
    speed = validation.length(states.velocity)
    relative, length, pace = tolerances(speed, drop, wind, ball, air, tol)
    if not task.machine_code:
        which = np.arange(len(height))[rows]
        tolerance = [
            flight_tolerance(
                relative, (float(length[i]), float(pace[i]), tol),
                None if longest is None else float(longest[i]),
            )
            for i in which
        ]  # fmt: skip
        return _in_python(task, which, tolerance)
    from kickdyn.flight.compiling import compiled_rates

    decays = _spins(states) & brakes(air, np.ones(3))
    flown = integrate_many(
        compiled_rates(ball, air),
        ends,
        numbers_of(ends, len(height))[rows],
        (np.column_stack([height, states.spin, decays])[rows], states.velocity[rows]),
        (length[rows], pace[rows], math.inf if longest is None else longest[rows]),
        tol,
        task.time_limit,
        task.apex,
    )
    landed = flown.status == LANDED
    flown.nodes[landed, 3] = -drop[rows][landed]  # by definition; else but for rounding
    return flown


def _in_python(task: _Task, rows: NDArray[np.intp], tolerances: Sequence[Tolerance]) -> Flown:
    """Return flights as `fly` computes them."""
    states, air, n = task.states, VACUUM if task.air is None else task.air, len(rows)
    nodes, status = np.full((n, 16), np.nan), np.full(n, FAILED, np.int8)
    evaluations, numbers = np.zeros(n, np.int64), numbers_of(task.ends, len(states.position))

    def fly(i: int) -> StepGenerator[None]:
        row = int(rows[i])
        state = BallState.computed(
            states.position[row], states.velocity[row], states.spin[row], 0.0
        )
        quadruples = numbers[row].reshape(-1, NUMBERS).tolist()
        ends = [replace(end, numbers=tuple(quadruples[k])) for k, end in enumerate(task.ends)]
        flown = yield from fly_arc(
            state, task.ball, air, ends, task.time_limit, tolerances[i], keep_steps=False
        )
        reached, evaluations[i] = flown.arc.reached, flown.arc.evaluations
        for k, (time, moved) in ((0, flown.end), (8, flown.apex)):
            nodes[i, k], nodes[i, k + 1 : k + 8] = time, moved
        end = -1 if reached is None else ends.index(reached)
        status[i] = ALOFT if end < 0 else LANDED if end == 0 else FURTHER - 1 + end

    for begin in range(0, n, FLIGHTS_TOGETHER):
        solve_together(map(fly, range(begin, min(begin + FLIGHTS_TOGETHER, n))))
    return Flown(nodes, status, evaluations)


def _outside(
    states: BallState, nodes: Array, rows: NDArray[np.intp], ball: Ball, air: Air | None
) -> NDArray[np.bool_]:
    outside = np.zeros(len(nodes), bool)
    models = () if air is None else (air.drag, air.lift)
    if air is None or not any(isinstance(model, CoefficientModel) for model in models):
        return outside
    every = slice(None) if len(rows) == len(nodes) else rows
    launch, spin, flown = states.position[every, 2], states.spin[every], nodes[every]
    is_outside = np.zeros(len(flown), bool)
    for height, velocity, share in (
        (launch, states.velocity[every], 1.0),
        (launch + flown[:, 3], flown[:, 4:7], flown[:, 7:8]),
        (launch + flown[:, 11], flown[:, 12:15], flown[:, 15:]),
    ):
        for _, out in outside_ranges(height, velocity, share * spin, ball, air):
            is_outside |= out.any(axis=0)
    outside[every] = is_outside & (flown[:, 0] > 0.0)  # else it failed, or never flew
    return outside


def _speed(air: Air, height: float) -> float:
    try:
        return math.hypot(*air.wind_at(height))
    except Exception:
        return math.nan


def _rows(states: BallState, flown: Flown, outside: NDArray[np.bool_]) -> Rows:
    nodes, evaluations = flown.nodes, flown.evaluations
    ended, offset, velocity = nodes[:, 0], nodes[:, 1:4], nodes[:, 4:7]
    return [
        ("range", np.hypot(offset[:, 0], offset[:, 1]), "m", "horizontal distance to the landing"),
        ("duration", ended, "s", "time from launch to landing"),
        ("height", nodes[:, 11], "m", "height of the apex above the launch"),
        ("apex_time", nodes[:, 8], "s", "time from launch to apex"),
        ("apex_position", states.position + nodes[:, 9:12], "m", "centre of the ball at the apex"),
        ("landing_position", states.position + offset, "m", "centre of the ball at the landing"),
        ("landing_velocity", velocity, "m/s", "velocity at the landing"),
        ("landing_spin", nodes[:, 7:8] * states.spin, "rad/s", "spin at the landing"),
        ("evaluations", evaluations, "1", "evaluations of the acceleration"),
        ("outside", outside, "1", "launch, apex or landing is out of a coefficient's range"),
    ]
