"""Errors of six formulas that kickdyn uses, and of the plain ones that lose digits there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from references.exact_impact import Quantity, exact_impact, given
from references.exact_leg import ExactPosture, leg_numbers, length, mp, numbers

from extremes.extreme_impacts import BENT, USUAL, chain, grazes, sizes, usual
from kickdyn.aerodynamics.coefficient_model import smoothstep
from kickdyn.contact import Contact
from kickdyn.core.mechanics import GRAVITY, cross
from kickdyn.flight.forces import time_to_fall


class Gain(NamedTuple):
    """A formula that kickdyn uses in place of a plain one.

    Attributes:
        what: the result, and the input at which the plain formula loses digits.
        plain_error, our_error: the relative errors of both formulas, against 50 digits.
    """

    what: str
    plain_error: float
    our_error: float


def gains() -> list[Gain]:
    """Return all six comparisons."""
    return [_jump(), _straight(), _approach(), _far_base(), _fall(), _join()]


def _number(exact: Any) -> Quantity:
    """Return one exact number as a quantity, whose error is relative to its size."""
    return Quantity(np.array([exact]), abs(exact))


def _jump() -> Gain:
    """Compare the articulated-body algorithm with the Cholesky factor of M."""
    impact = next(kick for kick in sizes(50) if kick.name == "chain of 50").impact()
    exact = exact_impact(*given(impact))["joint velocity"]
    plain = impact.v_before + impact.posture.solve(-impact.impulse @ impact.posture.jacobian)
    what = "joint velocities after a strike, 50 joints"
    return Gain(what, exact.error(plain), exact.error(impact.v_after))


def _straight() -> Gain:
    """Compare 1 / (L^-1 J^T n)^2 with 1 / n^T (J M^-1 J^T) n, as in Eq. (10)."""
    q = (0.4, 1e-5, 0.0)
    along = chain(USUAL).posture(q).contact_point
    impact = usual("", Contact(along, 0.8), q=q, ball_velocity=9.0 * -along).impact()
    exact = exact_impact(*given(impact))["effective mass"]
    n, posture = impact.contact.normal, impact.posture
    delassus = posture.jacobian @ np.linalg.solve(posture.inertia, posture.jacobian.T)
    what, plain = "effective mass along a leg bent by 1e-5 rad", 1.0 / (n @ delassus @ n)
    return Gain(what, exact.error(plain), exact.error(impact.effective_mass))


def _approach() -> Gain:
    """Compare n . velocity of the ball's centre with n . velocity of its surface."""
    impact = next(kick for kick in grazes() if kick.name == "spin of 1e+12 rad/s").impact()
    n, ball = impact.contact.normal, impact.ball_before
    centre = ball.velocity - impact.foot_velocity
    whole = centre - impact.ball.radius * cross(ball.spin, n)
    foot = exact_impact(*given(impact))["foot velocity"].exact
    exact = _number(-numbers(n) @ (numbers(ball.velocity) - foot))
    what = "approach speed, ball spinning at 1e12 rad/s"
    return Gain(what, exact.error(-n @ whole), exact.error(-n @ centre))


def _far_base() -> Gain:
    """Compare the inertia in the axes of each joint with that about the origin of the world."""
    leg = chain(USUAL, base=(1e9, -1e9, 1e9))
    exact = ExactPosture(*leg_numbers(leg), numbers(BENT)).inertia
    space = leg.workspace
    world = pin.crba(space.model, space.data, np.array(BENT), pin.Convention.WORLD).copy()
    quantity = Quantity(exact.ravel(), length(exact.ravel()))
    what = "joint-space inertia, base 1e9 m from the origin"
    return Gain(what, quantity.error(world), quantity.error(leg.posture(BENT).inertia))


def _fall() -> Gain:
    """Compare 2 h / (v + sqrt(v^2 + 2 g h)) with the root of Eq. (25) as printed."""
    drop, dive, g = 1e-6, 1e6, GRAVITY
    a, b, c = numbers((drop, dive, g))
    exact = _number((mp.sqrt(b * b + 2 * c * a) - b) / c)
    plain = (math.sqrt(dive * dive + 2 * g * drop) - dive) / g
    what = "time of a fall by 1e-6 m that begins at 1e6 m/s"
    return Gain(what, exact.error(plain), exact.error(time_to_fall(-dive, drop, g)))


def _join() -> Gain:
    """Compare 1 less the polynomial in 1 - s with the polynomial of degree 7 in s."""
    low, high = 2e4, 7e4
    plain_error = our_error = 0.0
    for x in np.linspace(6e4, high, 100, endpoint=False).tolist():
        share = mp.log(mp.mpf(x) / mp.mpf(low)) / mp.log(mp.mpf(high) / mp.mpf(low))
        exact = _number(mp.betainc(4, 4, 0, share, regularized=True))
        s = math.log(x / low) / math.log(high / low)
        plain = s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)
        plain_error = max(plain_error, exact.error(plain))
        our_error = max(our_error, exact.error(smoothstep(x, low, high)))
    return Gain("weight of a drag formula that takes over", plain_error, our_error)
