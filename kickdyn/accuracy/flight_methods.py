"""Flight: error of the landing point against time, for each integrator and tolerance.

heyoka is among them where it is installed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from kickdyn.accuracy.exact_flight import landing, mp
from kickdyn.accuracy.taylor import taylor
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.equations import FlightEquations
from kickdyn.flight.fly import fly
from kickdyn.flight.forces import downward

SCIPY = ("RK45", "DOP853", "LSODA", "Radau")
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
LEAST_ERROR = 1e-16
"""What a landing is at least taken to be off by [m], for pictures with logarithms."""
ROUNDS = 3
"""Times that each is timed: the shortest counts, for whatever else runs only adds."""
MANY = 2000
"""Flights that the batch engine is timed with: it is made for many."""


@dataclass(frozen=True)
class Measured:
    """One method at one tolerance.

    Attributes:
        scene: `vacuum`, `drag only`, without spin, or `full`: drag, lift and decay of spin.
        method: integrator.
        tol: relative tolerance it was asked for; 0 of a closed form.
        error: largest distance of a landing from the reference's [m].
        evaluations: of the acceleration, per flight; of heyoka, its steps.
        seconds: of this process, per flight.
        pareto: whether no other is both faster and more exact.
    """

    scene: str
    method: str
    tol: float
    error: float
    evaluations: float
    seconds: float
    pareto: bool = False


def kicks(number: int = 6) -> list[BallState]:
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
    """Measure every integrator on the same kicks, in one run, against 20 digits.

    Args:
        tolerances: to ask each for.
        told: called with each method's name as it begins.

    Returns:
        One row per scene, method and tolerance; those on a scene's Pareto front are marked.
    """
    ball, whole, rows = Ball(), Air(), _vacuum()
    plain = [BallState(state.position, state.velocity) for state in kicks()]
    for scene, air, states in (
        ("drag only", Air(lift=None, torque=None), plain),
        ("full", whole, kicks()),
    ):
        if told is not None:
            told(f"{scene}: the reference")
        exact, measured = np.array([landing(s, ball, whole) for s in states]), []
        for name, flown in _methods(scene, ball, air, tolerances).items():
            if told is not None:
                told(f"{scene}: {name}")
            flown(states, max(tolerances))  # compiles, loads
            for tol in tolerances:
                seconds = math.inf
                for _ in range(ROUNDS):
                    began = time.process_time()
                    landings, evaluations, flights = flown(states, tol)
                    seconds = min(seconds, (time.process_time() - began) / flights)
                error = float(np.linalg.norm(landings - exact, axis=1).max())
                error = max(error, LEAST_ERROR)
                measured.append(Measured(scene, name, tol, error, evaluations, seconds))
        rows += [_marked(row, measured) for row in measured]
    return rows


def _vacuum() -> list[Measured]:
    """Return the row of the closed form, against Eq. (25) in twice the digits."""
    ball, states, g = Ball(), kicks(), downward(Ball(), None)
    began, rounds = time.process_time(), 20
    for _ in range(rounds):
        paths = [fly(state, ball) for state in states]
    seconds = (time.process_time() - began) / rounds / len(states)
    worst = 0.0
    for state, path in zip(states, paths, strict=True):
        x, y, z = (mp.mpf(float(part)) for part in state.velocity)
        gap = [float(v * 2 * z / g - path.landing.position[i]) for i, v in enumerate((x, y))]
        worst = max(worst, math.hypot(*gap))
    return [Measured("vacuum", "closed form", 0.0, max(worst, LEAST_ERROR), 0, seconds, True)]


Flown = Callable[[list[BallState], float], tuple[Array, float, int]]


def _methods(scene: str, ball: Ball, air: Air, tolerances: Sequence[float]) -> dict[str, Flown]:
    methods: dict[str, Flown] = {name: _scipy(name, ball, air) for name in SCIPY}
    methods["kd.fly"] = _fly(ball, air)
    methods["kd.fly_many"] = _many(ball, air)
    if scene != "full":  # its equations for heyoka divide by the spin
        return methods
    compiled = {tol: run for tol in tolerances if (run := taylor(ball, air, tol)) is not None}
    if compiled:
        methods["heyoka"] = _heyoka(compiled)
    return methods


def _scipy(name: str, ball: Ball, air: Air) -> Flown:
    """The plain use of `solve_ivp` with a landing event, as a user would write it."""

    def flown(states: list[BallState], tol: float) -> tuple[Array, float, int]:
        landings, calls = [], 0
        for state in states:
            motion = FlightEquations(state, ball, air)

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
    return replace(row, pareto=not beaten)
