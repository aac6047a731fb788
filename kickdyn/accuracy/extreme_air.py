"""Shipped coefficients at Reynolds numbers from 0 to 1e9, and flights that begin there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import mpmath
import numpy as np

from kickdyn.accuracy.exact import mp
from kickdyn.accuracy.exact_coefficients import FORMULAS, MODELS, NUDGE, Constants, Formula
from kickdyn.accuracy.exact_impact import Quantity
from kickdyn.accuracy.extreme_flights import shot
from kickdyn.accuracy.extremes_row import Row, compared, refused
from kickdyn.aerodynamics.drag import BALLS, REYNOLDS_PER_SPEED
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.flight.forces import downward
from kickdyn.ground import Ground

JOINS = (
    1.0, 10.0, 2e4, 7e4, *(part * 12.19 * REYNOLDS_PER_SPEED for part in (0.9, 1.1)),
    17.75 * REYNOLDS_PER_SPEED, 35.0 * REYNOLDS_PER_SPEED, 55.0 * REYNOLDS_PER_SPEED,
)  # fmt: skip
"""Reynolds numbers where a formula begins or ends."""

SPINS = (0.0, 1e-300, 0.04, 0.05, 0.06, 0.2, 1e9)

DRAGS = ("stokes", "sphere", "brazuca")
"""Drag models that are flown."""

coarse: Any = mpmath.MPContext()
"""Arithmetic of the quadratures: they need fewer digits than what is compared with them."""
coarse.dps = 24


def reynolds_numbers() -> list[float]:
    """Return denormals, tiny and huge numbers, and each join with its neighbours."""
    found = [5e-324, 1e-310, 1e-300, 1e-3, 3.0, 1e3, 4e4, 1.9e5, 3.3e5, 1e6, 1e9]
    for join in JOINS:
        found += [math.nextafter(join, 0.0), join, math.nextafter(join, math.inf)]
    return sorted(found)


def coefficients() -> Iterator[Row]:
    """Yield a row for each shipped model: the number with least digits to spare of them all."""
    for (kind, name), formula in FORMULAS.items():
        model = MODELS[kind][name]
        errors: dict[str, float] = {}
        allowed: dict[str, float] = {}
        for reynolds in reynolds_numbers():
            for spin in SPINS if kind != "torque" else (0.0,):
                case = f"Re {reynolds:.6g}, Sp {spin:g}"
                exact, condition = conditioned(formula, reynolds, spin)
                error = exact.error(model(reynolds, spin))
                if case not in errors or error > errors[case]:  # a join's neighbours print alike
                    errors[case], allowed[case] = error, condition
        yield compared("coefficient of air", f"{kind} {name}, Re to 1e9", errors, allowed, {})


def conditioned(formula: Formula, reynolds: float, spin: float) -> tuple[Quantity, float]:
    """Return a coefficient and its condition number, estimated as in `exact_impact.conditions`."""
    right = formula(Constants(), reynolds, spin)
    exact, squares, samples = Quantity([right], abs(right)), 0.0, 3
    if right == 0:
        return exact, 1.0
    for seed in range(samples):
        constants = Constants(seed=seed)
        moved = formula(constants, reynolds, spin)
        squares += float(abs((moved - right) / right) / NUDGE) ** 2 * constants.count
    return exact, max(1.0, math.sqrt(squares / samples))


def refusals() -> list[Row]:
    """Return what becomes of Reynolds number 0, NaN and inf, for which no model is meant."""
    return [
        refused(f"{kind} {name} at Re {bad:g}", partial(MODELS[kind][name], bad))
        for kind, name in FORMULAS
        for bad in (0.0, math.nan, math.inf)
    ]


def flights(drags: Sequence[str] = DRAGS) -> Iterator[Row]:
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
            found, claims = shot(launch, ball, air, ground)
            exact = vertical(FORMULAS["drag", name], speed, drop, ball, air, found["landing speed"])
            errors = {key: exact[key].error(value) for key, value in found.items()}
            yield compared("drag", case, errors, dict.fromkeys(errors, 1.0), claims)


def vertical(
    formula: Formula, speed: float, drop: float, ball: Ball, air: Air, near: float
) -> dict[str, Quantity]:
    """Return height, duration and landing speed of a ball thrown up, or dropped, by quadrature.

    With a(v) what drag makes, dt is dv over g + a on the way up and over g - a on the way down, and
    dz is v dt. The landing speed is Newton's root of the height.

    Args:
        formula: of the drag coefficient.
        speed: upward [m/s].
        drop: how far below the start it ends [m].
        ball: what flies.
        air: what through.
        near: a landing speed to begin with.
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
    return {key: Quantity([mp.mpf(str(v))], mp.mpf(str(v))) for key, v in found.items()}


def _breaks(low: Any, high: Any, per_speed: float) -> list[Any]:
    """Return where a quadrature over speeds is cut: at joins, decades, the crisis, and its ends."""
    reynolds = [
        1,
        2,
        5,
        10,
        100,
        1e3,
        1e4,
        2e4,
        2.5e4,
        3e4,
        4e4,
        5e4,
        6e4,
        7e4,
        *np.logspace(6, 9, 7),
    ]
    speeds = [one / per_speed for one in reynolds] + [float(v) for v in range(5, 60)]
    ball = BALLS["brazuca"]
    speeds += [REYNOLDS_PER_SPEED / per_speed * v for v in (ball.v_max, ball.v_max + 20.0)]
    speeds += [float(high) * (1.0 - 0.5**j) for j in range(1, 40)]
    inside = sorted({speed for speed in speeds if low < speed < high})
    return [low, *inside, high]
