"""Flights at the extremes: against closed forms with 50 digits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from kickdyn.accuracy.exact import Vector, length, mp, numbers, plus
from kickdyn.accuracy.exact_flight import landing as exact_landing
from kickdyn.accuracy.exact_impact import NUDGE
from kickdyn.accuracy.extremes_row import FULL, Row, compared, digits, refused
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.fly import fly
from kickdyn.flight.forces import downward
from kickdyn.ground import Ground

TOL = 1e-13

Exact = Callable[[Vector], dict[str, Vector]]


def vacuum() -> Iterator[Row]:
    """Yield closed-form flights of 1e-9 s to 1e5 s, and falls that start with a rise or a dive."""
    g, radius = downward(Ball(), None), Ball().radius
    launches = [
        (f"{seconds:g} s", (3e-9 * seconds, 0.5 * g * seconds), 0.0)
        for seconds in (1e-9, 1e-3, 1.0, 1e5)
    ]
    launches += [
        ("dive of 1e6 m/s from 1e-6 m", (1.0, -1e6), 1e-6),
        ("dive of 1e-6 m/s from 1e6 m", (1.0, -1e-6), 1e6),
        ("rise of 1e6 m/s from 1e-6 m", (1.0, 1e6), 1e-6),
        ("rise of 1e-9 m/s from 1e-9 m", (1.0, 1e-9), 1e-9),
    ]

    def exact(values: Vector) -> dict[str, Vector]:
        along, up, radius, height, pull = values
        drop = -radius - height
        time = (up + mp.sqrt(up * up + 2 * pull * drop)) / pull
        return {"landing": [along * time, -drop], "duration": [time]}

    for name, (along, up), drop in launches:
        start = BallState((0, 0, 0), (along, 0, up), (0, 0, 0))
        ground = Ground(height=-drop - radius) if drop else None

        def found(
            start: BallState = start, ground: Ground | None = ground
        ) -> tuple[dict[str, Any], dict[str, float]]:
            path = fly(start, Ball(), None, ground, time_limit=1e9)
            return {"landing": path.landing.position[[0, 2]], "duration": path.duration}, {}

        values = (along, up, radius, -drop - radius, g) if drop else (along, up, 0.0, 0.0, g)
        yield _judged("vacuum", name, exact, values, found)


def dragged() -> Iterator[Row]:
    """Yield vertical shots with a constant drag coefficient, Reynolds numbers up to 1e9 and on."""
    ball, air = Ball(), Air(drag=_half, lift=None, torque=None)
    g = downward(ball, air)

    def exact(values: Vector) -> dict[str, Vector]:
        up, mass, radius, density, coefficient, pull = values
        limit = mp.sqrt(2 * mass * pull / (density * coefficient * mp.pi)) / radius
        high = limit**2 / (2 * pull) * mp.log1p((up / limit) ** 2)
        down = up / mp.sqrt(1 + (up / limit) ** 2)
        time = limit / pull * (mp.atan(up / limit) + mp.atanh(down / limit))
        return {"height": [high], "duration": [time], "landing speed": [down]}

    for reynolds in (1e-9, 1e-3, 1.0, 1e3, 1e5, 1e6, 1e9, 1e12):
        up = reynolds * air.viscosity / (air.density * 2 * ball.radius)
        launch = BallState(velocity=(0, 0, up))
        values = (up, ball.mass, ball.radius, air.density, 0.5, g)
        name = f"straight up at Re {reynolds:g}"
        yield _judged("drag", name, exact, values, partial(shot, launch, ball, air))


def shot(
    launch: BallState, ball: Ball, air: Air, ground: Ground | None = None
) -> tuple[dict[str, Any], dict[str, float]]:
    """Return what a vertical flight answers, and the digits that its own estimate leaves each.

    The ball ends where it must, and what may be wrong is when: `Flight.error` counts that too.
    `Flight.error` estimates a distance d at the end of a flight of time T and final speed v. It is
    d of the height; d / v of the time, as long as the ball takes to cover it; and of the speed
    2 d / T, for a speed that goes wrong evenly along the way leaves its mean times T behind.
    """
    path = fly(launch, ball, air, ground, tol=TOL, time_limit=1e9)
    speed, off = float(path.landing.speed), path.error
    answers = {"height": path.height, "duration": path.duration, "landing speed": speed}
    way = speed * path.duration
    claims = {"height": digits(off / path.height) if path.height else FULL}
    claims["duration"] = digits(off / way) if way else FULL
    claims["landing speed"] = digits(2.0 * off / way) if way else FULL
    return answers, claims if path.evaluations else dict.fromkeys(answers, FULL)


def _half(reynolds: float, spin_parameter: float) -> float:
    return 0.5


def tolerances() -> Iterator[Row]:
    """Yield a spinning kick at every tolerance, and flown in pieces, against 20 digits."""
    ball, air = Ball(), Air()
    start = BallState((0, 0, 0), (24, 1, 9), (0, -30, 15))
    ground = Ground(height=-ball.radius)
    finest = exact_landing(start, ball, air)
    scale = math.hypot(*(finest - start.position))
    for exponent in range(2, 13):
        path = fly(start, ball, air, ground, 10.0**-exponent)
        error = math.hypot(*(path.landing.position - finest)) / scale
        claimed = {"landing": digits(path.error / scale)}
        yield compared(
            "tolerance", f"tol 1e-{exponent}", {"landing": error}, {"landing": 1.0}, claimed
        )
    for pieces in (10, 1000):
        for tol in (1e-6, 1e-9, 1e-12):
            landed, own = _in_pieces(start, ball, air, ground, tol, pieces)
            error = math.hypot(*(landed - finest)) / scale
            name = f"{pieces} flights in a row, tol {tol:g}"
            claimed = {"landing": digits(pieces**2 * own / scale)}
            yield compared("tolerance", name, {"landing": error}, {"landing": 1.0}, claimed)


def _in_pieces(
    start: BallState, ball: Ball, air: Air, ground: Ground, tol: float, pieces: int
) -> tuple[Array, float]:
    """Return the landing of a flight flown in pieces, and the largest error that one estimates.

    A tenth of the pieces are asked. With d the largest, the speed after one of time t is off by
    2 d / t (see `shot`), which the way still to go turns into 2 d for each piece of it. The sum
    over n pieces is d n^2, if air brings neighbours no farther apart.
    """
    limit = fly(start, ball, air, ground, tol).duration / (pieces - 0.5)
    state, number, own = start, 0, 0.0
    while True:
        path = fly(state, ball, air, ground, tol, time_limit=limit)
        if number % max(pieces // 10, 1) == 0 or path.status == "landed":
            own = max(own, path.error)
        if path.status == "landed":
            return path.landing.position, own
        state, number = path.landing, number + 1


def refusals() -> list[Row]:
    """Return what becomes of NaN and inf in a launch, the air and the tolerance."""
    return [
        refused(f"{name} = {bad}", made)
        for bad in (math.nan, math.inf, -math.inf)
        for name, made in _spoilt(bad).items()
    ]


def _spoilt(bad: float) -> dict[str, Callable[[], object]]:
    launch, ball = BallState(velocity=(1, 0, 1)), Ball()
    return {
        "position": lambda: BallState((bad, 0, 0)),
        "velocity": lambda: BallState(velocity=(0, bad, 0)),
        "spin": lambda: BallState(spin=(0, 0, bad)),
        "density": lambda: Air(density=bad),
        "wind": lambda: Air(wind=(bad, 0, 0)),
        "ground": lambda: Ground(height=bad),
        "tol": lambda: fly(launch, ball, Air(), tol=bad),
        "drag coefficient": lambda: fly(launch, ball, Air(drag=lambda _, __: bad)),
    }


def _judged(
    family: str,
    name: str,
    exact: Exact,
    values: Sequence[float],
    found: Callable[[], tuple[dict[str, Any], dict[str, float]]],
) -> Row:
    """Return the row of an answer against a closed form, conditions by changing each number."""
    try:
        ours, claimed = found()
    except KickdynError as error:
        return Row(family, name, refusal=str(error))
    inputs = numbers(values)
    right = exact(inputs)
    sums = dict.fromkeys(right, 0.0)
    for i, value in enumerate(inputs):
        moved = exact([*inputs[:i], value * (1 + NUDGE), *inputs[i + 1 :]])
        for key, one in right.items():
            sums[key] += float(length(plus(moved[key], one, -1)) / length(one) / NUDGE)
    errors = {
        key: float(length(plus(numbers(np.ravel(ours[key])), one, -1)) / length(one))
        for key, one in right.items()
    }
    allowed = {key: max(1.0, total) for key, total in sums.items()}
    return compared(family, name, errors, allowed, claimed)
