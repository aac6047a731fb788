"""Time `fly_many` against a loop of scipy's `solve_ivp` and against heyoka, on the same flights.

    python benchmarks/batch_flight.py

One core. Errors are of the landing point, the largest of all flights and the one that 99 % of them
stay below, against `fly(tol=1e-13)` for the first 200 flights (their agreement with
`fly_many(tol=1e-13)` is printed) and that for the rest. heyoka is left out where it is missing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from by_hand import fly_by_hand

import kickdyn as kd
from kickdyn.accuracy.heyoka_flight import heyoka_landings
from kickdyn.core.validation import Array
from kickdyn.flight.batch import fly_many

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
MANY, FEW = 10_000, 200


def launches(n: int) -> kd.BallState:
    """Return spinning kicks that stay above Re 7e4, where heyoka's form of the drag is whole."""
    draw = np.random.default_rng(1)
    speed, up, turn = draw.uniform(15, 32, n), draw.uniform(0.1, 0.8, n), draw.uniform(-3, 3, n)
    level = speed * np.cos(up)
    velocity = np.column_stack([level * np.cos(turn), level * np.sin(turn), speed * np.sin(up)])
    return kd.BallState(np.zeros((n, 3)), velocity, draw.normal(0, 30, (n, 3)), np.zeros(n))


def timed(run: Callable[[], Array], repeats: int) -> tuple[float, Array]:
    """Return the shortest time and the result, after a run that compiles."""
    result, best = run(), math.inf
    for _ in range(repeats):
        began = time.perf_counter()
        result = run()
        best = min(best, time.perf_counter() - began)
    return best, result


def main() -> None:
    """Print the table."""
    states = launches(MANY)
    few = kd.BallState(*(part[:FEW] for part in (states.position, states.velocity, states.spin)),
                       states.time[:FEW])  # fmt: skip
    exact = fly_many(states, BALL, AIR, tol=1e-13).landing_position.values
    singles = [kd.BallState(*row) for row in zip(few.position, few.velocity, few.spin, strict=True)]
    flown = np.array([kd.fly(one, BALL, AIR, tol=1e-13).landing.position for one in singles])
    print(f"fly and fly_many at 1e-13 differ by {np.abs(flown - exact[:FEW]).max():.1e} m")
    exact[:FEW] = flown
    rows = []

    def row(name: str, tol: float, n: int, run: Callable[[], Array], repeats: int) -> None:
        seconds, landed = timed(run, repeats)
        error = np.linalg.norm(landed - exact[:n], axis=1)
        rows.append((name, tol, error.max(), float(np.quantile(error, 0.99)), seconds / n * 1e6))

    for method, tol in (("RK45", 1e-6), ("RK45", 1e-9), ("DOP853", 1e-9)):
        row(
            f"solve_ivp {method}",
            tol,
            FEW,
            lambda m=method, t=tol: fly_by_hand(few, BALL, AIR, m, t),
            1,
        )  # type: ignore[misc]

    def one_by_one() -> Array:
        return np.array([kd.fly(one, BALL, AIR).landing.position for one in singles])

    row("fly", 1e-9, FEW, one_by_one, 1)
    for tol in (1e-6, 1e-9, 1e-12):
        flown = heyoka_landings(BALL, AIR, tol)
        if flown is not None:
            row("heyoka", tol, MANY, lambda run=flown: run(states)[0], 3)  # type: ignore[misc]
    for tol in (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12):
        row("fly_many", tol, MANY,
            lambda t=tol: fly_many(states, BALL, AIR, tol=t).landing_position.values, 5)  # type: ignore[misc]  # fmt: skip
    slowest = rows[0][-1]
    print(
        f"{'method':17} {'tol':>6} {'max err m':>10} {'99 % m':>9} {'us/flight':>10} {'ratio':>7}"
    )
    for name, tol, most, usual, each in rows:
        print(f"{name:17} {tol:6.0e} {most:10.1e} {usual:9.1e} {each:10.1f} {slowest / each:7.0f}")


if __name__ == "__main__":
    main()
