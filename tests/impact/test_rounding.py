"""Digits that an impact claims: random chains and extremes against 50 digits."""

import dataclasses

import numpy as np
import pytest
from digits import FAMILIES, shortfalls
from extremes import extreme_impacts
from references.exact_impact import exact_impact, given

import kickdyn as kd
from kickdyn.impact.rounding import _spread

HARSH = [*extreme_impacts.heavy_balls(), *list(extreme_impacts.cancellations())[:4],
         *extreme_impacts.short_links(), *extreme_impacts.masses()]  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_no_claim_is_false(family):
    """A few of the kicks that `python tools/digits.py` measures by the thousand."""
    for seed in range(4):
        impulse, joints, impact = shortfalls(family, seed)
        assert impulse < 1.0, seed
        assert max(joints) < 1.0, seed
        usual = family in ("ordinary", "light_foot", "short_links", "parallel")
        assert impact.digits > 12 or not usual or impact.approach_speed < 0.1, seed


@pytest.mark.parametrize("kick", HARSH, ids=lambda kick: kick.name)
def test_an_extreme_impact_has_the_digits_that_it_claims(kick):
    impact = kick.impact()
    exact = exact_impact(*given(impact))
    assert exact["impulse"].error(impact.impulse) < 10**-impact.digits
    for i, digits in enumerate(impact.joint_digits):
        assert exact[f"joint {i + 1}"].error(impact.joint_impulses[i]) < 10**-digits


def test_digits_fall_with_what_cancels():
    """A share s of the speed that remains costs -log10(s) digits, and a ball's mass likewise."""
    usual = extreme_impacts.usual("", kd.Contact(extreme_impacts.OBLIQUE, 0.8, 0.4))
    assert 14 < usual.impact().digits < 16
    approaches = [kick.impact() for kick in list(extreme_impacts.cancellations())[:4]]
    speeds, digits = np.array([[impact.approach_speed, impact.digits] for impact in approaches]).T
    np.testing.assert_allclose(np.diff(digits), np.diff(np.log10(speeds)), atol=0.3)
    heavy = [kick.impact().digits for kick in list(extreme_impacts.heavy_balls())[1::2]]
    assert np.diff(heavy).max() < -2


def test_the_speeds_that_cancel_are_those_along_the_links():
    """Of thigh, shank and foot of 0.371, 0.443 and 0.145 m, however they are bent."""
    posture, v = kd.Leg.human().posture([0.4, 1.5, 0.1]), np.array([[2.0, 0.0], [-3, 1], [4, 0]])
    right = [2 * (0.371 + 0.443 + 0.145) + 3 * (0.443 + 0.145) + 4 * 0.145, 0.443 + 0.145]
    assert _spread(posture, v) == pytest.approx(right)


@pytest.mark.parametrize(("share", "creates"), [(1e-13, False), (1e-11, True)])
@pytest.mark.parametrize("mass", [1e-6, 0.4])
def test_energy_within_the_rounding_of_a_fast_spin_is_not_created(share, creates, mass):
    posture, ball = kd.Leg.human().posture([0.1, 0.2, 0.3]), kd.Ball(mass)
    v, contact = posture.joint_velocity((3, 0, 1)), kd.Contact((3, 0, 1), 0.8, 0.4)
    impact = kd.strike(posture, v, ball, contact, ball_spin=(0.0, 1e6, 0.0))
    gained = share * float(np.abs(impact.impulse).max()) * ball.radius * 1e6
    solution = impact.solution._replace(energy_lost=-gained)
    assert dataclasses.replace(impact, solution=solution).creates_energy is creates
