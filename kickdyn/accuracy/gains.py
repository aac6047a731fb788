"""Where the straightforward formula loses digits, and what the one in use keeps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.accuracy.exact import ExactPosture, described, length, mp, numbers, plus
from kickdyn.accuracy.exact_impact import Quantity, exact_impact, given
from kickdyn.accuracy.extreme_impacts import BENT, USUAL, chain, grazes, sizes
from kickdyn.checks import Array
from kickdyn.flight.ballistic import time_to_fall
from kickdyn.vectors import cross


class Gain(NamedTuple):
    """One formula in place of another.

    Attributes:
        what: is computed, and where.
        plain, ours: the formulas.
        plain_error, our_error: relative to 50 digits.
    """

    what: str
    plain: str
    ours: str
    plain_error: float
    our_error: float


def gains() -> list[Gain]:
    """Return every such place, measured."""
    return [_jump(), _approach(), _far_base(), _fall()]


def _jump() -> Gain:
    kick = next(kick for kick in sizes(50) if kick.name == "chain of 50")
    hit = kick.struck()
    exact = exact_impact(*given(hit))["joint velocity"]
    posture = hit.posture
    plain = hit.v_before + posture.solve(-hit.impulse @ posture.jacobian)
    return Gain(
        "joint velocity after, 50 joints", "Cholesky factor of M", "articulated bodies",
        exact.error(plain), exact.error(hit.v_after),
    )  # fmt: skip


def _approach() -> Gain:
    kick = next(kick for kick in grazes() if kick.name == "spin of 1e+12 rad/s")
    hit = kick.struck()
    n, ball = hit.touch.normal, hit.ball_before
    centre = ball.velocity - hit.foot_velocity
    whole = centre - hit.struck.radius * cross(ball.spin, n)
    foot = exact_impact(*given(hit))["foot velocity"].exact
    right = -sum(
        a * b for a, b in zip(numbers(n), plus(numbers(ball.velocity), foot, -1), strict=True)
    )
    exact = Quantity([right], abs(right))
    return Gain(
        "approach, spin 1e12 rad/s", "n . velocity of the ball's surface", "n . that of its centre",
        exact.error(-n @ whole), exact.error(-n @ centre),
    )  # fmt: skip


def _far_base() -> Gain:
    leg = chain(USUAL, base=(1e9, -1e9, 1e9))
    structure = described(leg)
    exact = ExactPosture(structure, structure["values"], numbers(BENT)).inertia
    space = leg.workspace
    world = pin.crba(space.model, space.data, np.array(BENT), pin.Convention.WORLD).copy()
    flat = [entry for row in exact for entry in row]

    def error(found: Array) -> float:
        return float(length(plus(numbers(found.ravel()), flat, -1)) / length(flat))

    ours = leg.posture(BENT).inertia
    return Gain(
        "joint-space inertia, base at 1e9 m", "about the world's origin", "in each joint's axes",
        error(world), error(ours),
    )  # fmt: skip


def _fall() -> Gain:
    drop, dive, g = 1e-6, 1e6, 9.81
    a, b, c = numbers((drop, dive, g))
    right = (mp.sqrt(b * b + 2 * c * a) - b) / c
    exact = Quantity([right], right)
    plain = (math.sqrt(dive * dive + 2 * g * drop) - dive) / g
    return Gain(
        "fall by 1e-6 m at 1e6 m/s", "root of Eq. (24) as printed", "its other form",
        exact.error(plain), exact.error(time_to_fall(-dive, drop, g)),
    )  # fmt: skip
