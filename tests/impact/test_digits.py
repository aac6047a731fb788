"""An impact says how many digits it has, and an approach that is rounding is none."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.accuracy import extreme_impacts
from kickdyn.accuracy.extreme_impacts import BENT, SPEEDS, USUAL, chain
from kickdyn.accuracy.references.exact_impact import exact_impact, given

HARSH = [
    *extreme_impacts.heavy_balls(),
    *list(extreme_impacts.cancellations())[:4],
    *extreme_impacts.short_links(),
    *extreme_impacts.masses(),
]


@pytest.mark.parametrize("kick", HARSH, ids=lambda kick: kick.name)
def test_the_impulse_has_the_digits_it_claims(kick):
    hit = kick.impact()
    assert exact_impact(*given(hit))["impulse"].error(hit.impulse) < 10**-hit.digits


def test_digits_fall_with_a_heavy_ball_and_a_faint_approach():
    assert extreme_impacts.ExtremeKick("", chain(USUAL), BENT, SPEEDS, kd.Ball(), kd.Contact(
        extreme_impacts.OBLIQUE, 0.8, 0.4)).impact().digits > 14  # fmt: skip
    heavy = [kick.impact().digits for kick in list(extreme_impacts.heavy_balls())[1::2]]
    assert np.diff(heavy).max() < -2
    assert 3 < heavy[-1] < 5
    faint = [kick.impact().digits for kick in list(extreme_impacts.cancellations())[:4]]
    assert faint == pytest.approx([11.3, 7.3, 3.3, 1.3], abs=0.7)


def test_joints_claim_no_more_than_the_impulse():
    hit = list(extreme_impacts.heavy_balls())[-2].impact()
    assert hit.joint_digits.max() <= hit.digits < 5
    exact = exact_impact(*given(hit))
    for i, digits in enumerate(hit.joint_digits):
        assert exact[f"joint {i + 1}"].error(hit.joint_impulses[i]) < 10**-digits


@pytest.mark.parametrize("contact", [kd.strike, kd.collide], ids=["strike", "collide"])
def test_an_approach_that_is_rounding_is_refused(contact):
    kick = list(extreme_impacts.cancellations())[-2]
    options = {"contact_time": 0.01} if contact is kd.collide else {}
    with pytest.raises(kd.NoImpact, match=r"that is rounding, of 3e-15 m/s in what cancels"):
        contact(kick.leg.posture(kick.q), kick.v, kick.ball, kick.contact, **options)


def test_a_slow_approach_of_which_nothing_cancels_is_not():
    contact = kd.Contact((1, 0, 0), 0.8, 0.4)
    sliding = (-1e-300, 0.5, 0.2)
    hit = kd.strike(
        chain(USUAL).posture(BENT), np.zeros(3), kd.Ball(), contact, ball_velocity=sliding
    )
    assert hit.approach_speed == 1e-300
    assert hit.digits > 14
