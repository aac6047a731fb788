"""Flight: error of the landing point against time, for each integrator and tolerance.

heyoka is among them where it is installed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from kickdyn.accuracy.taylor import taylor
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.flight.fly import fly
from kickdyn.flight.motion import Motion

SCIPY = ("RK45", "DOP853", "LSODA", "Radau")
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
REFERENCE = 1e-13
MANY = 2000
"""Flights that the batch engine is timed with: it is made for many."""


@dataclass(frozen=True)
class Measured:
    """One method at one tolerance.

    Attributes:
        method: integrator.
        tol: relative tolerance it was asked for.
        error: largest distance of a landing from the reference's [m].
        evaluations: of the acceleration, per flight; of heyoka, its steps.
        seconds: per flight.
        pareto: whether no other is both faster and more exact.
    """

    method: str
    tol: float
    error: float
    evaluations: float
    seconds: float
    pareto: bool = False


def kicks(number: int = 12) -> list[BallState]:
    """Return spinning kicks of 15 to 30 m/s, the same ones every time."""
    rng = np.random.default_rng(2005)
    states = []
    for _ in range(number):
        speed, up = rng.uniform(15, 30), rng.uniform(0.15, 0.8)
        velocity = speed * np.array([math.cos(up), 0.1 * rng.normal(), math.sin(up)])
        states.append(BallState(velocity=velocity, spin=rng.normal(size=3) * [10, 30, 20]))
    return states


def measure(
    tolerances: Sequence[float] = TOLERANCES, told: Callable[[str], None] | None = None
) -> list[Measured]:
    """Measure every integrator on the same kicks, in one run.

    Args:
        tolerances: to ask each for.
        told: called with each method's name as it begins.

    Returns:
        One row per method and tolerance; those on the Pareto front are marked.
    """
    ball, air, states = Ball(), Air(), kicks()
    exact = np.array([fly(s, ball, air, tol=REFERENCE).landing.position for s in states])
    rows = []
    for name, flown in _methods(ball, air, tolerances).items():
        if told is not None:
            told(name)
        flown(states, max(tolerances))  # compiles, loads
        for tol in tolerances:
            began = time.perf_counter()
            landings, evaluations, flights = flown(states, tol)
            seconds = (time.perf_counter() - began) / flights
            error = float(np.linalg.norm(landings - exact, axis=1).max())
            rows.append(Measured(name, tol, error, evaluations, seconds))
    return [_marked(row, rows) for row in rows]


Flown = Callable[[list[BallState], float], tuple[Array, float, int]]


def _methods(ball: Ball, air: Air, tolerances: Sequence[float]) -> dict[str, Flown]:
    methods: dict[str, Flown] = {name: _scipy(name, ball, air) for name in SCIPY}
    methods["kd.fly"] = _fly(ball, air)
    methods["kd.fly_many"] = _many(ball, air)
    compiled = {tol: run for tol in tolerances if (run := taylor(ball, air, tol)) is not None}
    if compiled:
        methods["heyoka"] = _heyoka(compiled)
    return methods


def _scipy(name: str, ball: Ball, air: Air) -> Flown:
    """The plain use of `solve_ivp` with a landing event, as a user would write it."""

    def flown(states: list[BallState], tol: float) -> tuple[Array, float, int]:
        landings, calls = [], 0
        for state in states:
            motion = Motion(state, ball, air)

            def down(_: float, y: Array, rise: int = motion.rise) -> float:
                return float(y[rise])

            down.terminal, down.direction = True, -1  # type: ignore[attr-defined]
            scale = np.maximum(np.abs(motion.begin), 1.0)
            answer = solve_ivp(
                motion.rates, (0, 30), motion.begin, name, events=down, rtol=tol, atol=tol * scale
            )
            landings.append(state.position + motion.whole(answer.y_events[0][-1])[:3])
            calls += answer.nfev
        return np.array(landings), calls / len(states), len(states)

    return flown


def _fly(ball: Ball, air: Air) -> Flown:
    def flown(states: list[BallState], tol: float) -> tuple[Array, float, int]:
        paths = [fly(state, ball, air, tol=tol) for state in states]
        landings = np.array([path.landing.position for path in paths])
        return landings, sum(path.evaluations for path in paths) / len(paths), len(paths)

    return flown


def _many(ball: Ball, air: Air) -> Flown:
    from kickdyn.flight.batch import fly_many

    def flown(states: list[BallState], tol: float) -> tuple[Array, float, int]:
        data = fly_many(_copied(states), ball, air, tol=tol)
        landings = data.landing_position.values[: len(states)]
        return landings, float(data.evaluations.mean()), len(data.flight)

    return flown


def _heyoka(compiled: dict[float, Callable[[BallState], tuple[Array, int]]]) -> Flown:
    def flown(states: list[BallState], tol: float) -> tuple[Array, float, int]:
        landings, steps = compiled[tol](_copied(states))
        return landings[: len(states)], steps / len(landings), len(landings)

    return flown


def _copied(states: list[BallState]) -> BallState:
    copies = MANY // len(states)
    position, velocity, spin = (
        np.tile([getattr(state, name) for state in states], (copies, 1))
        for name in ("position", "velocity", "spin")
    )
    return BallState(position, velocity, spin, np.zeros(len(position)))


def _marked(row: Measured, rows: list[Measured]) -> Measured:
    beaten = any(o.seconds < row.seconds and o.error < row.error for o in rows)
    return Measured(row.method, row.tol, row.error, row.evaluations, row.seconds, not beaten)
