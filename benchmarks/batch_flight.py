"""Compare flights by kickdyn with scipy's and heyoka's: time at equal error, estimates, first call.

    python benchmarks/batch_flight.py

Many flights: `fly_many` against heyoka's Taylor integrators, one by one and in batches of 4 and 8
with vector instructions, for the drag of a Brazuca and for constant coefficients. heyoka finds the
landing by an event or on its interpolant; `known time` is told when the ball lands and finds
nothing, so that it is a lower limit. The error is that of the landing point, below which 99 % of
the flights stay, against `fly_many(tol=1e-13)` (for the Brazuca its largest difference from
heyoka's Taylor series at 1e-17 is printed). heyoka is left out where it is missing.

Single flights: `fly` against `solve_ivp` (DOP853) with the landing as an event and dense output,
both of which are then read at 100 times.

All times are processor times of one process, the shortest of several rounds, which the methods take
in turn. Times at equal error are interpolated between tolerances, in logarithms.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from by_hand import fly_by_hand
from heyoka_flight import heyoka_batch_landings, heyoka_landings
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.flight.batch import fly_many
from kickdyn.flight.forces import FlightEquations

BALL, ROUNDS = kd.Ball(), 5
AIRS = {"brazuca": kd.Air(drag="brazuca"), "constant": kd.Air(drag=0.2, lift=0.15, torque=0.01)}
MANY, HEYOKA, FEW = 10_000, 2_000, 48
TOLERANCES = tuple(10.0**-k for k in range(4, 12))
HEYOKA_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
ERRORS = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)

FIRST_CALL = """
import time; began = time.process_time(), time.perf_counter()
import numpy as np, kickdyn as kd
speeds = np.random.default_rng(1).normal((20, 0, 8), 3, (1000, 3))
kd.fly_many(kd.BallState(velocity=speeds, spin=(0, -30, 5)), kd.Ball(), kd.Air())
print(time.process_time() - began[0], time.perf_counter() - began[1])
"""


def launches(n: int) -> kd.BallState:
    """Return spinning kicks that stay above Re 7e4, where heyoka's form of the drag is whole."""
    draw = np.random.default_rng(1)
    speed, up, turn = draw.uniform(15, 32, n), draw.uniform(0.1, 0.8, n), draw.uniform(-3, 3, n)
    level = speed * np.cos(up)
    velocity = np.column_stack([level * np.cos(turn), level * np.sin(turn), speed * np.sin(up)])
    return kd.BallState(np.zeros((n, 3)), velocity, draw.normal(0, 30, (n, 3)), np.zeros(n))


def part(states: kd.BallState, n: int) -> kd.BallState:
    """Return the first n states."""
    return kd.BallState(*(each[:n] for each in (states.position, states.velocity, states.spin)))


Run = Callable[[], Array]
"""Flies some flights and returns their landing points, shape `(n, 3)` [m]."""

Curve = list[tuple[float, float]]
"""Error [m] and time of a flight [us] of a method, for each of its tolerances."""


def measured(methods: dict[str, list[Run]], exact: Array, rounds: int) -> dict[str, Curve]:
    """Return each method's errors and shortest times, of rounds that the methods take in turn."""
    times: dict[tuple[str, int], float] = {}
    errors: dict[tuple[str, int], float] = {}
    for _ in range(rounds + 1):  # the first compiles
        for name, runs in methods.items():
            for k, run in enumerate(runs):
                began = time.process_time()
                landed = run()
                seconds = (time.process_time() - began) / len(landed)
                if (name, k) in errors:
                    times[name, k] = min(seconds, times.get((name, k), math.inf))
                off = np.linalg.norm(landed - exact[: len(landed)], axis=1)
                errors[name, k] = float(np.quantile(off, 0.99))
    return {
        name: [(errors[name, k], times[name, k] * 1e6) for k in range(len(runs))]
        for name, runs in methods.items()
    }


def at_error(curve: Curve, error: float) -> float:
    """Return the time of a method where its error is `error`, nan beyond its tolerances."""
    errors, times = np.log(np.array(sorted(curve))).T
    if not errors[0] <= math.log(error) <= errors[-1]:
        return math.nan
    return math.exp(float(np.interp(math.log(error), errors, times)))


def print_curves(curves: dict[str, Curve]) -> None:
    """Print the time of a flight at each of `ERRORS`, and that over the first method's."""
    first = next(iter(curves.values()))
    print(f"{'us per flight at error [m]':26}" + "".join(f"{error:>15.0e}" for error in ERRORS))
    for name, curve in curves.items():
        cells = []
        for error in ERRORS:
            own = at_error(curve, error)
            cells.append(f"{own:8.2f} ({own / at_error(first, error):4.1f})")
        print(f"{name:26}" + "".join(cells))


def landings(fly: Callable[..., tuple[Array, int]], *arguments: kd.BallState | Array) -> Array:
    """Return the landing points by one of heyoka's integrators, without its number of steps."""
    return fly(*arguments)[0]


def many_flights(air: kd.Air) -> None:
    """Print the times of many flights by every method."""
    states = launches(MANY)
    reference = fly_many(states, BALL, air, tol=1e-13)
    exact, durations = reference.landing_position.values, reference.duration.values
    few = part(states, HEYOKA)

    def many(tol: float) -> Array:
        return np.asarray(fly_many(states, BALL, air, tol=tol).landing_position.values)

    methods: dict[str, list[Run]] = {"fly_many": [partial(many, tol) for tol in TOLERANCES]}
    finest = heyoka_landings(BALL, air, 1e-17)
    if finest is not None:
        off = np.linalg.norm(finest(few)[0] - exact[:HEYOKA], axis=1)
        print(f"fly_many at 1e-13 and heyoka at 1e-17 differ by {np.quantile(off, 0.99):.1e} m "
              f"(99 %), {off.max():.1e} m (all)")  # fmt: skip
        single = [heyoka_landings(BALL, air, tol) for tol in HEYOKA_TOLERANCES]
        methods["heyoka, event"] = [partial(landings, fly, few) for fly in single if fly]
        for width, ending in ((4, "event"), (8, "event"), (8, "dense output"), (4, "known time"),
                              (8, "known time")):  # fmt: skip
            n = 80 if ending == "dense output" else HEYOKA
            runs: list[Run] = []
            for tol in HEYOKA_TOLERANCES:
                fly = heyoka_batch_landings(BALL, air, tol, ending, width)
                assert fly is not None
                runs.append(partial(landings, fly, part(few, n), durations[:n]))
            methods[f"heyoka, {width}, {ending}"] = runs
    print_curves(measured(methods, exact, ROUNDS))


def solved(state: kd.BallState, air: kd.Air, tol: float, times: Array) -> Array:
    """Return the landing point by `solve_ivp`, whose dense output is read as well."""
    motion = FlightEquations(state, BALL, air)

    def height(_: float, y: Array) -> float:
        return float(y[2])

    height.terminal, height.direction = True, -1  # type: ignore[attr-defined]
    scale = np.maximum(np.abs(motion.begin), 1.0)
    answer = solve_ivp(
        lambda _, y: motion.rates(y.tolist()), (0, 30), motion.begin, "DOP853", events=height,
        rtol=tol, atol=tol * scale, dense_output=True,
    )  # fmt: skip
    answer.sol(times * answer.t_events[0][-1])
    return np.asarray(answer.y_events[0][-1][:3])


def flown(state: kd.BallState, air: kd.Air, tol: float, times: Array) -> Array:
    """Return the landing point by `fly`, which is read at as many times."""
    path = kd.fly(state, BALL, air, tol=tol)
    path.sample(times * path.duration)
    return path.landing.position


def single_flights(air: kd.Air) -> None:
    """Print the times of single flights by `fly` and by `solve_ivp`."""
    states = part(launches(MANY), FEW)
    singles = [kd.BallState(*row) for row in zip(states.position, states.velocity, states.spin,
                                                 strict=True)]  # fmt: skip
    exact = fly_many(states, BALL, air, tol=1e-13).landing_position.values
    times = np.linspace(0.0, 1.0, 100)

    def each(one: Callable[..., Array], tol: float) -> Array:
        return np.array([one(state, air, tol, times) for state in singles])

    tolerances = tuple(10.0**-k for k in range(3, 13))
    print_curves(measured({
        "fly": [partial(each, flown, tol) for tol in tolerances],
        "solve_ivp DOP853": [partial(each, solved, tol) for tol in tolerances],
        "solve_ivp RK45, landing": [
            partial(fly_by_hand, states, BALL, air, "RK45", tol) for tol in (1e-6, 1e-8, 1e-10)
        ],
    }, exact, 3))  # fmt: skip


def estimates(air: kd.Air, tolerances: Sequence[float]) -> None:
    """Print the estimates of the error over the error, and how often they are below it."""
    states = part(launches(MANY), HEYOKA)
    finest = heyoka_landings(BALL, air, 1e-17)
    exact = (
        fly_many(states, BALL, air, tol=1e-13).landing_position.values
        if finest is None
        else finest(states)[0]
    )
    print(f"{'estimate over error':26}" + "".join(f"{tol:>15.0e}" for tol in tolerances))
    for name, n in (("fly_many", HEYOKA), ("fly", FEW)):
        cells = []
        for tol in tolerances:
            if name == "fly":
                paths = [
                    kd.fly(kd.BallState(*row), BALL, air, tol=tol)
                    for row in zip(states.position[:n], states.velocity[:n], states.spin[:n],
                                   strict=True)
                ]  # fmt: skip
                landed = np.array([path.landing.position for path in paths])
                error = np.array([path.error for path in paths])
            else:
                data = fly_many(states, BALL, air, tol=tol, error=True)
                landed, error = data.landing_position.values, data.error.values
            ratio = error / np.maximum(np.linalg.norm(landed - exact[:n], axis=1), 1e-16)
            cells.append(f"{np.median(ratio):7.1f} ({np.mean(ratio < 1):5.2%})")
        print(f"{name + ', median (below 1)':26}" + "".join(f"{cell:>15}" for cell in cells))


def main() -> None:
    """Print the tables."""
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for name, air in AIRS.items():
        print(f"\nMany flights, coefficients: {name}")
        many_flights(air)
    for name, air in AIRS.items():
        print(f"\nSingle flights with the landing and 100 samples, coefficients: {name}")
        single_flights(air)
    print("\nEstimates of the error by tolerance, coefficients: brazuca")
    estimates(AIRS["brazuca"], (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13))
    with tempfile.TemporaryDirectory() as folder:
        told = subprocess.run(
            [sys.executable, "-c", FIRST_CALL], env={**os.environ, "NUMBA_CACHE_DIR": folder},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
    cpu, wall = map(float, told.stdout.split())
    print(f"\nfirst fly_many of 1,000 balls with an empty cache: {cpu:.1f} s of processor time, "
          f"{wall:.1f} s in all; load {os.getloadavg()[0]:.1f}")  # fmt: skip


if __name__ == "__main__":
    main()
