"""Flight: error of the landing point against time, for each integrator and tolerance."""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial

import numpy as np
from measurement import Measurement, mark_front, shortest_time
from scipy.integrate import solve_ivp

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.batch import fly_many
from kickdyn.flight.fly import fly
from kickdyn.flight.forces import FlightEquations, downward

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)

LANDINGS = {
    "drag only": (
        (40.876829524385656, 2.970843904199962),
        (37.184214300248236, 0.23422754023780776),
        (40.378632870855306, -1.654314242117961),
        (29.43779351819524, 0.3951323749463864),
        (29.09618472830275, -1.9034772499479753),
        (50.46313042765848, 7.0152805822739674),
    ),
    "full": (
        (38.402690276226075, 10.882880432311808),
        (24.153263510743095, -2.867484649590026),
        (28.487361624808393, -5.048096402200834),
        (14.395005795302684, -0.17907909892303536),
        (19.795736453245652, -4.0017946149487305),
        (51.66393385065251, -2.726171305878152),
    ),
}
"""Landing points x, y of `kicks` by scene [m], computed with 20 digits and rounded to float64; the
test of this file computes them anew."""

LEAST_ERROR = 1e-16
"""Least error of a landing that is reported [m], for pictures with logarithms."""

Landings = Callable[[list[BallState], float], tuple[Array, float, int]]
"""Of launches and a tolerance: landing points, calls per flight, and the number of flights."""


def kicks(number: int = 6) -> list[BallState]:
    """Return spinning kicks of 15 to 30 m/s, the same ones every time."""
    rng = np.random.default_rng(2005)
    states = []
    for _ in range(number):
        speed, up = rng.uniform(15, 30), rng.uniform(0.15, 0.8)
        velocity = speed * np.array([math.cos(up), 0.1 * rng.normal(), math.sin(up)])
        states.append(BallState(velocity=velocity, spin=rng.normal(size=3) * [10, 30, 20]))
    return states


def measure_flights(
    tolerances: Sequence[float] = TOLERANCES,
    report: Callable[[str], None] = lambda _: None,
) -> list[Measurement]:
    """Measure every integrator on the same kicks, in one run, against 20 digits.

    The scenes are `vacuum`; `drag only`, without spin; and `full`: drag, lift and decay of spin.
    The measurements on a scene's Pareto front are marked; `report` is called with each method's
    name.
    """
    ball, rows = Ball(), [_measure_vacuum()]
    without_spin = [BallState(state.position, state.velocity) for state in kicks()]
    for scene, air, states in (
        ("drag only", Air(drag="brazuca", lift=None, torque=None), without_spin),
        ("full", Air(drag="brazuca"), kicks()),
    ):
        exact, measured = np.array(LANDINGS[scene][: len(states)]), []
        for name, land in _methods(ball, air).items():
            report(f"{scene}: {name}")
            land(states, max(tolerances))  # compiles, loads
            for tol in tolerances:
                landings, calls, number = land(states, tol)
                seconds = shortest_time(partial(land, states, tol)) / number
                error = max(
                    float(np.linalg.norm(landings[:, :2] - exact, axis=1).max()), LEAST_ERROR
                )
                measured.append(Measurement(scene, name, f"tol {tol:g}", error, seconds, calls))
        rows += mark_front(measured)
    return rows


def _measure_vacuum() -> Measurement:
    """Return the measurement of the closed form, against Eq. (25) in rational numbers."""
    ball, states, g = Ball(), kicks(), downward(Ball(), None)
    seconds = shortest_time(lambda: [fly(state, ball) for state in states]) / len(states)
    worst = LEAST_ERROR
    for state in states:
        x, y, z = (Fraction(float(component)) for component in state.velocity)
        landing = fly(state, ball).landing.position
        fall = 2 * z / Fraction(g)
        gap = (
            float(component * fall - Fraction(float(f)))
            for component, f in zip((x, y), landing, strict=False)
        )
        worst = max(worst, math.hypot(*gap))
    return Measurement("vacuum", "closed form", "", worst, seconds, 0.0, True)


def _methods(ball: Ball, air: Air) -> dict[str, Landings]:
    """Return functions that compute landings, one per integrator, by name."""
    methods: dict[str, Landings] = {
        name: partial(_land_by_scipy, name, ball, air)
        for name in ("RK45", "DOP853", "LSODA", "Radau")
    }
    methods["kd.fly"] = partial(_land_by_fly, ball, air)
    methods["kd.fly_many"] = partial(_land_by_fly_many, ball, air)
    return methods


def _land_by_scipy(
    name: str, ball: Ball, air: Air, states: list[BallState], tol: float
) -> tuple[Array, float, int]:
    """Land by `solve_ivp` with a landing event, as a user would write it."""

    def height(_: float, y: Array) -> float:
        return float(y[2])

    height.terminal, height.direction = True, -1  # type: ignore[attr-defined]
    landings, calls = [], 0
    for state in states:
        motion = FlightEquations(state, ball, air)
        scale = np.maximum(np.abs(motion.begin), 1.0)
        answer = solve_ivp(
            lambda _, y, motion=motion: motion.rates(y.tolist()),
            (0, 30),
            motion.begin,
            name,
            events=height,
            rtol=tol,
            atol=tol * scale,
        )
        landings.append(state.position + answer.y_events[0][-1][:3])
        calls += answer.nfev
    return np.array(landings), calls / len(states), len(states)


def _land_by_fly(
    ball: Ball, air: Air, states: list[BallState], tol: float
) -> tuple[Array, float, int]:
    """Land by `kickdyn.fly`, one flight after the other."""
    paths = [fly(state, ball, air, tol=tol) for state in states]
    landings = np.array([path.landing.position for path in paths])
    return landings, sum(path.evaluations for path in paths) / len(paths), len(paths)


def _land_by_fly_many(
    ball: Ball, air: Air, states: list[BallState], tol: float
) -> tuple[Array, float, int]:
    """Land 2000 flights at once by `kickdyn.fly_many`."""
    data = fly_many(repeated(states), ball, air, tol=tol)
    landings = data.landing_position.values[: len(states)]
    return landings, float(data.evaluations.mean()), len(data.flight)


def repeated(states: list[BallState]) -> BallState:
    """Return 2000 states, by repeating a few: the batch integrators are made for many."""
    position, velocity, spin = (
        np.tile([getattr(state, name) for state in states], (2000 // len(states), 1))
        for name in ("position", "velocity", "spin")
    )
    return BallState(position, velocity, spin, np.zeros(len(position)))
