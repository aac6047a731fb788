"""Coefficients and flights at the extremes: against their sources, closed forms and quadratures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from references.exact_flight import landing as exact_landing
from references.exact_impact import Quantity
from references.exact_leg import Exact, context, length, mp, numbers

from extremes.exact_coefficients import (
    FORMULAS,
    MODELS,
    NUDGE,
    Constants,
    Formula,
)
from extremes.extreme_case import FULL, ExtremeCase, compare, digits, expect_refusal
from kickdyn.aerodynamics.drag import BALLS, REYNOLDS_PER_SPEED, constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.fly import fly
from kickdyn.flight.forces import downward
from kickdyn.ground import Ground

TOL = 1e-13
"""Relative tolerance of flights that are compared with closed forms and quadratures."""

JOINS = (
    1.0, 10.0, 2e4, 7e4, *(part * 12.19 * REYNOLDS_PER_SPEED for part in (0.9, 1.1)),
    17.75 * REYNOLDS_PER_SPEED, 35.0 * REYNOLDS_PER_SPEED, 55.0 * REYNOLDS_PER_SPEED,
)  # fmt: skip
"""Reynolds numbers where a formula begins or ends."""

DRAGS = ("stokes", "sphere", "brazuca")
"""Drag models that are flown."""

coarse = context(24)
"""Arithmetic of the quadratures: they need fewer digits than what is compared with them."""

Answers = tuple[dict[str, Any], dict[str, float]]
"""Answers of a flight by name, and the digits that they claim."""


def flight_cases(drags: Sequence[str] = DRAGS) -> Iterator[ExtremeCase]:
    """Yield every coefficient and every flight, those in shipped air with the `drags`."""
    for cases in (vacuum, constant_drag, tolerances, coefficients):
        yield from cases()
    yield from shipped_drag(drags)


def vacuum() -> Iterator[ExtremeCase]:
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

    def exact(values: Exact) -> dict[str, Any]:
        along, up, radius, height, pull = values
        drop = -radius - height
        time = (up + mp.sqrt(up * up + 2 * pull * drop)) / pull
        return {"landing": [along * time, -drop], "duration": [time]}

    for name, (along, up), drop in launches:
        start = BallState((0, 0, 0), (along, 0, up), (0, 0, 0))
        ground = Ground(height=-drop - radius) if drop else None

        def found(start: BallState = start, ground: Ground | None = ground) -> Answers:
            path = fly(start, Ball(), None, ground, time_limit=1e9)
            return {"landing": path.landing.position[[0, 2]], "duration": path.duration}, {}

        values = (along, up, radius, -drop - radius, g) if drop else (along, up, 0.0, 0.0, g)
        yield _judge("vacuum", name, exact, values, found)


def constant_drag() -> Iterator[ExtremeCase]:
    """Yield vertical shots with a constant drag coefficient, at Reynolds numbers up to 1e12."""
    ball, air = Ball(), Air(drag=constant(0.5), lift=None, torque=None)
    g = downward(ball, air)

    def exact(values: Exact) -> dict[str, Any]:
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
        yield _judge("drag", name, exact, values, partial(vertical_answers, launch, ball, air))


def vertical_answers(
    launch: BallState, ball: Ball, air: Air, ground: Ground | None = None
) -> Answers:
    """Return the answers of a vertical flight, and the digits that its error estimate leaves each.

    `Flight.error` estimates a distance d at the end of a flight of duration T and final speed v; it
    counts when the ball ends, too. It is d of the height; d / v of the duration, in which the ball
    covers d; and 2 d / T of the speed, since an error of the speed that grows evenly to that value
    moves the ball by d. Of the speed it is at least the tolerance, by which each step may err:
    the error of the last steps has not moved the ball yet.
    """
    path = fly(launch, ball, air, ground, tol=TOL, time_limit=1e9)
    speed, error = float(path.landing.speed), path.error
    answers = {"height": path.height, "duration": path.duration, "landing speed": speed}
    travelled = speed * path.duration
    claims = {"height": digits(error / path.height) if path.height else FULL}
    claims["duration"] = digits(error / travelled) if travelled else FULL
    claims["landing speed"] = digits(max(2.0 * error / travelled, TOL)) if travelled else FULL
    return answers, claims if path.evaluations else dict.fromkeys(answers, FULL)


def tolerances() -> Iterator[ExtremeCase]:
    """Yield a spinning kick at every tolerance, and flown in pieces, against 20 digits."""
    ball, air = Ball(), Air(drag="brazuca")
    start = BallState((0, 0, 0), (24, 1, 9), (0, -30, 15))
    ground = Ground(height=-ball.radius)
    finest = exact_landing(start, ball, air)
    scale = math.hypot(*(finest - start.position))
    for exponent in range(2, 13):
        path = fly(start, ball, air, ground, 10.0**-exponent)
        error = math.hypot(*(path.landing.position - finest)) / scale
        claimed = {"landing": digits(path.error / scale)}
        name = f"tol 1e-{exponent}"
        yield compare("tolerance", name, {"landing": error}, {"landing": 1.0}, claimed)
    for pieces in (10, 1000):
        for tol in (1e-6, 1e-9, 1e-12):
            landed, own = _in_pieces(start, ball, air, ground, tol, pieces)
            error = math.hypot(*(landed - finest)) / scale
            name = f"{pieces} flights in a row, tol {tol:g}"
            claimed = {"landing": digits(pieces**2 * own / scale)}
            yield compare("tolerance", name, {"landing": error}, {"landing": 1.0}, claimed)


def _in_pieces(
    start: BallState, ball: Ball, air: Air, ground: Ground, tol: float, pieces: int
) -> tuple[Array, float]:
    """Return the landing of a flight in pieces, and the largest error of a tenth of the pieces.

    With d that error, the speed after a piece of duration t is off by 2 d / t, as in
    `vertical_answers`: this moves the ball by 2 d in each piece that follows. The sum over n pieces
    is d n^2, if the air brings neighbours no farther apart.
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


def reynolds_numbers() -> list[float]:
    """Return denormals, tiny and huge numbers, and each join with its neighbours."""
    found = [5e-324, 1e-310, 1e-300, 1e-3, 3.0, 1e3, 4e4, 1.9e5, 3.3e5, 1e6, 1e9]
    for join in JOINS:
        found += [math.nextafter(join, 0.0), join, math.nextafter(join, math.inf)]
    return sorted(found)


def coefficients() -> Iterator[ExtremeCase]:
    """Yield a case for each shipped model: the number with least digits to spare of all."""
    spins = (0.0, 1e-300, 0.04, 0.05, 0.06, 0.2, 1e9)
    for (kind, name), formula in FORMULAS.items():
        model = MODELS[kind][name]
        errors: dict[str, float] = {}
        allowed: dict[str, float] = {}
        for reynolds in reynolds_numbers():
            for spin in spins if kind != "torque" else (0.0,):
                case = f"Re {reynolds:.6g}, Sp {spin:g}"
                exact, condition = conditioned(formula, reynolds, spin)
                error = exact.error(model(reynolds, spin))
                if case not in errors or error > errors[case]:  # a join's neighbours print alike
                    errors[case], allowed[case] = error, condition
        yield compare("coefficient of air", f"{kind} {name}, Re to 1e9", errors, allowed, {})


def conditioned(formula: Formula, reynolds: float, spin: float) -> tuple[Quantity, float]:
    """Return a coefficient and its condition number, estimated as in `exact_impact.conditions`."""
    right = formula(Constants(), reynolds, spin)
    exact, squares, samples = Quantity(np.array([right]), abs(right)), 0.0, 3
    if right == 0:
        return exact, 1.0
    for seed in range(samples):
        constants = Constants(seed=seed)
        moved = formula(constants, reynolds, spin)
        squares += float(abs((moved - right) / right) / NUDGE) ** 2 * constants.count
    return exact, max(1.0, math.sqrt(squares / samples))


def shipped_drag(drags: Sequence[str] = DRAGS) -> Iterator[ExtremeCase]:
    """Yield vertical shots, and a fall from rest, with shipped drag, against quadratures."""
    ball = Ball()
    for name in drags:
        air = Air(drag=name, lift=None, torque=None)
        per_speed = 2 * ball.radius * air.density / air.viscosity
        for reynolds in (0.0, 5e-324, 1e-300, 1.0, 7e4, 1e9):
            speed = reynolds / per_speed or reynolds
            case = f"drag {name}, up at Re {reynolds:g}"
            ground, drop = None, 0.0
            if speed == 0.0:
                case, ground, drop = f"drag {name}, dropped, from Re 0", Ground(height=-1.0), 1.0
            launch = BallState((0.0, 0.0, ball.radius if ground else 0.0), (0.0, 0.0, speed))
            found, claims = vertical_answers(launch, ball, air, ground)
            exact = vertical(FORMULAS["drag", name], speed, drop, ball, air, found["landing speed"])
            errors = {key: exact[key].error(value) for key, value in found.items()}
            yield compare("drag", case, errors, dict.fromkeys(errors, 1.0), claims)


def vertical(
    formula: Formula, speed: float, drop: float, ball: Ball, air: Air, near: float
) -> dict[str, Quantity]:
    """Return height, duration and landing speed of a ball thrown up, or dropped, by quadrature.

    With a(v) what drag makes, dt is dv over g + a on the way up and over g - a on the way down, and
    dz is v dt. The landing speed is Newton's root of the height, from a `near` one [m/s]. The
    flight begins at an upward speed [m/s] and ends a drop [m] below its start.
    """
    m, constants = coarse, Constants(coarse)
    g = m.mpf(downward(ball, air))
    per_speed = 2.0 * ball.radius * air.density / air.viscosity
    pressure = m.mpf(air.density) * m.pi * m.mpf(ball.radius) ** 2 / (2 * m.mpf(ball.mass))
    tiny = per_speed * max(speed, near) < 1e-100

    def slowing(v: Any) -> Any:
        return 0 if tiny or v == 0 else pressure * formula(constants, v * per_speed, 0.0) * v * v

    def over(power: int, sign: int, low: Any, high: Any) -> Any:
        return m.quad(lambda v: v**power / (g + sign * slowing(v)), _breaks(low, high, per_speed))

    start, last = m.mpf(speed), m.mpf(near)
    if tiny:
        found = {"height": start**2 / (2 * g), "duration": 2 * start / g, "landing speed": start}
    else:
        high = over(1, 1, m.zero, start)
        fallen = over(1, -1, m.zero, last)
        for _ in range(3):
            better = last + (high + drop - fallen) * (g - slowing(last)) / last
            fallen, last = fallen + over(1, -1, last, better), better
        time = over(0, 1, m.zero, start) + over(0, -1, m.zero, last)
        found = {"height": high, "duration": time, "landing speed": last}
    return {key: Quantity(np.array([mp.mpf(str(v))]), mp.mpf(str(v))) for key, v in found.items()}


def _breaks(low: Any, high: Any, per_speed: float) -> list[Any]:
    """Return where a quadrature over speeds is cut: at joins, decades, the crisis, and its ends."""
    decades = (*np.logspace(0, 4, 5), *np.logspace(6, 9, 7))
    reynolds = [*decades, 2, 5, 2e4, 2.5e4, 3e4, 4e4, 5e4, 6e4, 7e4]
    speeds = [one / per_speed for one in reynolds] + [float(v) for v in range(5, 60)]
    ball = BALLS["brazuca"]
    speeds += [REYNOLDS_PER_SPEED / per_speed * v for v in (ball.v_max, ball.v_max + 20.0)]
    speeds += [float(high) * (1.0 - 0.5**j) for j in range(1, 40)]
    inside = sorted({speed for speed in speeds if low < speed < high})
    return [low, *inside, high]


def flight_refusals() -> list[ExtremeCase]:
    """Return what becomes of NaN and inf in a flight's arguments, and as Reynolds numbers."""
    flights = [
        expect_refusal(f"{name} = {bad}", attempt)
        for bad in (math.nan, math.inf, -math.inf)
        for name, attempt in _bad_flights(bad).items()
    ]
    return flights + [
        expect_refusal(f"{kind} {name} at Re {bad:g}", partial(MODELS[kind][name], bad))
        for kind, name in FORMULAS
        for bad in (0.0, math.nan, math.inf)
    ]


def _bad_flights(bad: float) -> dict[str, Callable[[], object]]:
    """Return flights with one bad argument each, by its name."""
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


def _judge(
    family: str,
    name: str,
    exact: Callable[[Exact], dict[str, Any]],
    values: Sequence[float],
    found: Callable[[], Answers],
) -> ExtremeCase:
    """Return the row of an answer against a closed form, conditions by changing each number."""
    try:
        ours, claimed = found()
    except KickdynError as error:
        return ExtremeCase(family, name, refusal=str(error))
    inputs, nudge = numbers(values), mp.mpf(NUDGE)
    right = {key: np.array(value) for key, value in exact(inputs).items()}
    sums = dict.fromkeys(right, 0.0)
    for i in range(len(inputs)):
        nudged = inputs.copy()
        nudged[i] *= 1 + nudge
        moved = exact(nudged)
        for key, value in right.items():
            sums[key] += float(length(np.array(moved[key]) - value) / length(value) / nudge)
    errors = {
        key: float(length(numbers(np.ravel(ours[key])) - value) / length(value))
        for key, value in right.items()
    }
    allowed = {key: max(1.0, total) for key, total in sums.items()}
    return compare(family, name, errors, allowed, claimed)
