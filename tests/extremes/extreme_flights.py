"""Coefficients and flights at the extremes, against their sources and another integration."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from references.exact_flight import landing as exact_landing
from references.exact_impact import Quantity

from extremes.exact_coefficients import FORMULAS, MODELS, NUDGE, Constants, Formula
from extremes.extreme_case import ExtremeCase, compare, digits
from kickdyn.aerodynamics.drag import REYNOLDS_PER_SPEED
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.flight.fly import fly

JOINS = (1.0, 10.0, 2e4, 7e4, *(part * 12.19 * REYNOLDS_PER_SPEED for part in (0.9, 1.1)),
    17.75 * REYNOLDS_PER_SPEED, 35.0 * REYNOLDS_PER_SPEED, 55.0 * REYNOLDS_PER_SPEED)  # fmt: skip
"""Reynolds numbers where a formula begins or ends."""

SPINS = (0.0, 1e-300, 0.04, 0.05, 0.06, 0.2, 1e9)
"""Spin parameters."""


def flight_cases() -> Iterator[ExtremeCase]:
    """Yield a spinning kick at every tolerance, against 20 digits, and every coefficient."""
    ball, air = Ball(), Air(drag="brazuca")
    start = BallState((0, 0, 0), (24, 1, 9), (0, -30, 15))
    exact = exact_landing(start, ball, air)
    scale = math.hypot(*(exact - start.position))
    for exponent in range(2, 13):
        path, name = fly(start, ball, air, None, 10.0**-exponent), f"tol 1e-{exponent}"
        error = {"landing": math.hypot(*(path.landing.position - exact)) / scale}
        claimed = {"landing": digits(path.error / scale)}
        yield compare("tolerance", name, error, {"landing": 1.0}, claimed)
    reynolds = [5e-324, 1e-310, 1e-300, 1e-3, 3.0, 1e3, 4e4, 1.9e5, 3.3e5, 1e6, 1e9]
    for join in JOINS:
        reynolds += [math.nextafter(join, 0.0), join, math.nextafter(join, math.inf)]
    for kind, name in FORMULAS:
        yield coefficient_case(kind, name, reynolds, SPINS)


def coefficient_case(
    kind: str, name: str, reynolds_numbers: Sequence[float], spins: Sequence[float]
) -> ExtremeCase:
    """Return the case of a shipped model: the number with least digits to spare of all."""
    model, formula = MODELS[kind][name], FORMULAS[kind, name]
    errors: dict[str, float] = {}
    allowed: dict[str, float] = {}
    for reynolds in reynolds_numbers:
        for spin in spins if kind != "torque" else (0.0,):
            case = f"Re {reynolds:.17g}, Sp {spin:g}"
            exact, allowed[case] = conditioned(formula, reynolds, spin)
            errors[case] = exact.error(model(reynolds, spin))
    return compare("coefficient of air", f"{kind} {name}", errors, allowed, {})


def conditioned(formula: Formula, reynolds: float, spin: float) -> tuple[Quantity, float]:
    """Return a coefficient and its condition, estimated as in `extreme_impacts.conditions`."""
    right = formula(Constants(), reynolds, spin)
    exact, squares, samples = Quantity(np.array([right]), abs(right)), 0.0, 3
    if right == 0:
        return exact, 1.0
    for seed in range(samples):
        constants = Constants(seed=seed)
        moved = formula(constants, reynolds, spin)
        squares += float(abs((moved - right) / right) / NUDGE) ** 2 * constants.count
    return exact, max(1.0, math.sqrt(squares / samples))
