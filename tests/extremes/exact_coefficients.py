"""Shipped drag, lift and torque coefficients in any number of digits, written from their sources.

Joins are regularised incomplete beta functions here, which is what the polynomials in use are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from references.exact_leg import DIGITS, mp

from kickdyn.aerodynamics import drag, lift, spin_decay

NUDGE = 10.0 ** -(DIGITS // 2)
"""Relative change of numbers, by which conditions are estimated."""


class Constants:
    """Makes mpmath's numbers of floats: exactly, or each changed by a share, up or down."""

    def __init__(self, m: Any = mp, seed: int | None = None) -> None:
        self.m, self.count = m, 0
        self._rng = None if seed is None else np.random.default_rng(seed)

    def __call__(self, value: float) -> Any:
        """Return a number."""
        self.count += value != 0
        exact = self.m.mpf(value)
        if self._rng is None:
            return exact
        return exact * (1 + int(self._rng.choice((-1, 1))) * self.m.mpf(NUDGE))


Formula = Callable[[Constants, float, float], Any]
"""Of constants, Reynolds number and spin parameter."""


def _joined(c: Constants, x: Any, low: Any, high: Any) -> Any:
    m = c.m
    if x <= low:
        return m.zero
    if x >= high:
        return m.one
    return m.betainc(4, 4, 0, m.log(x / low) / m.log(high / low), regularized=True)


def _stokes(c: Constants, reynolds: float, _: float) -> Any:
    return 24 / c(reynolds)


def _brown_lawler(c: Constants, reynolds: float, _: float) -> Any:
    re = c(reynolds)
    return 24 / re * (1 + c(0.150) * re ** c(0.681)) + c(0.407) / (1 + c(8710.0) / re)


def _sphere(c: Constants, reynolds: float, spin: float) -> Any:
    weight = _joined(c, c.m.mpf(reynolds), 1, 10)
    creeping = _stokes(c, reynolds, spin)
    if weight == 0:
        return creeping
    return (1 - weight) * creeping + weight * _brown_lawler(c, reynolds, spin)


def _level(c: Constants, ball: drag.SoccerBall, reynolds: float) -> Any:
    m, v = c.m, c(reynolds) / c(drag.REYNOLDS_PER_SPEED)
    a, v_c, v_s, low, high = (c(x) for x in (ball.a, ball.v_c, ball.v_s, ball.b_min, ball.b_max))
    v_min, v_max = c(ball.v_min), c(ball.v_max)
    if v > v_max:
        over = min(v - v_max, m.mpf(20))
        v = v_max + 1 - m.exp(-sum(over**k / k for k in (1, 2, 3, 4)))
    line = (high - low) / (v_max - v_min) * (v - v_min)
    return low + (a - low) / (1 + m.exp((v - v_c) / v_s)) + line / (1 + m.exp(-(v - v_min) / v_s))


def _soccer(ball: drag.SoccerBall) -> Formula:

    def formula(c: Constants, reynolds: float, spin: float) -> Any:
        m = c.m
        weight = _joined(c, m.mpf(reynolds), m.mpf(20000), m.mpf(70000))
        if weight == 0:
            return _sphere(c, reynolds, spin)
        sp = c(spin)
        grown = c(0.514) * sp / m.root(1 + (sp / c(0.4)) ** 8, 8)
        fast = _level(c, ball, reynolds) + grown
        return fast if weight == 1 else (1 - weight) * _sphere(c, reynolds, spin) + weight * fast

    return formula


def _supercritical(c: Constants, reynolds: float, spin: float) -> Any:
    weight = _joined(c, c.m.mpf(reynolds), c.m.mpf(20000), c.m.mpf(70000))
    return (1 - weight) * _sphere(c, reynolds, spin) + weight * c(0.2)


def _goff_carre(c: Constants, reynolds: float, spin: float) -> Any:
    m, v, middle = c.m, c(reynolds) / c(drag.REYNOLDS_PER_SPEED), c(12.19)
    level = c(0.155) + c(0.346) / (1 + m.exp((v - middle) / c(1.309)))
    weight = _joined(c, v, c(0.9) * middle, c(1.1) * middle)
    weight *= _joined(c, m.mpf(spin), c(0.04), c(0.06))
    return level if weight == 0 else level + weight * (c(0.4127) * c(spin) ** c(0.3056) - level)


def _saturating(c: Constants, reynolds: float, spin: float) -> Any:
    plateau, sp = c(0.4740), c(spin)
    drop = plateau - _level(c, drag.BALLS["brazuca"], reynolds)
    gate = drop / (plateau - c(0.1748588996))
    return gate * c(0.47) * sp / (c(0.135) + sp)


def _wang(c: Constants, _: float, spin: float) -> Any:
    return c(spin) ** c(0.4) / 2


def _nathan(c: Constants, _: float, spin: float) -> Any:
    sp = c(spin)
    return c(1.12) * sp / (c(0.583) + c(2.333) * sp)


FORMULAS: dict[tuple[str, str], Formula] = {("drag", "stokes"): _stokes,
    ("drag", "brown-lawler"): _brown_lawler, ("drag", "sphere"): _sphere,
    **{("drag", name): _soccer(ball) for name, ball in drag.BALLS.items()},
    ("drag", "supercritical"): _supercritical, ("drag", "goff-carre"): _goff_carre,
    ("lift", "saturating"): _saturating, ("lift", "wang"): _wang, ("lift", "nathan"): _nathan,
    ("torque", "smits-smith"): lambda c, _, __: c(0.010),
    ("torque", "tavares"): lambda c, _, __: c(0.012)}  # fmt: skip
"""By kind and name."""

MODELS = {"drag": drag.MODELS, "lift": lift.MODELS, "torque": spin_decay.MODELS}
"""What they are compared with."""
