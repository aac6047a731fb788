"""Every way to strike says the same of what is no kick."""

import math

import numpy as np
import pytest
from chains import by_pinocchio, in_units
from extremes import extreme_impacts
from extremes.extreme_impacts import BENT, SPEEDS, USUAL, chain
from references.exact_impact import exact_impact, given

import kickdyn as kd

LEG = kd.Leg.human()
Q = np.radians([5.0, 10.0, -5.0])
KICK = {
    "posture": LEG.posture(Q),
    "v": LEG.posture(Q).joint_velocity((3, 0, 1)),
    "ball": kd.Ball(),
    "contact": kd.Contact((1, 0, 0.3), 0.7),
}
DOORS = (kd.strike, by_pinocchio, kd.collide, kd.unilateral_strike)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"posture": LEG}, kd.InvalidInput, r"^posture is Leg\(.*: it must be a kickdyn\.Posture$"),
        ({"v": [0, math.nan, 0]}, kd.InvalidInput, r"^v is .*finite"),
        (
            {"v": [0, -1e160, -1e160]},
            kd.InvalidInput,
            r"^foot and ball collide at .*double precision",
        ),
        ({"ball": None}, kd.InvalidInput, r"^ball is None"),
        ({"contact": None}, kd.InvalidInput, r"^contact is None"),
        ({"ball_velocity": (1, 2)}, kd.InvalidInput, r"^ball velocity has shape \(2,\)"),
        (
            {"ball_velocity": (-1e150, 0, 0)},
            kd.InvalidInput,
            r"^foot and ball collide at up to 1e\+150 m/s",
        ),
        ({"ball_spin": (0, math.inf, 0)}, kd.InvalidInput, r"^ball spin is .*finite.*rad/s"),
        ({"ball_spin": (0, 1e200, 0)}, kd.InvalidInput, r"collide at .* below 1e\+140 m/s"),
        ({"v": [0, 0, 0]}, kd.NoImpact, "^foot and ball do not approach"),
        ({"ball_velocity": (9, 0, 0)}, kd.NoImpact, r"away from the ball$"),
        (
            {"posture": LEG.posture([5, 10, -5]), "ball_velocity": (99, 0, 0)},
            kd.NoImpact,
            r"ball \(angles are in radians: hip at 286\.48 deg is outside its range .*\)$",
        ),
    ],
)
def test_what_is_no_kick_is_refused(door, change, error, words):
    with pytest.raises(error, match=words) as caught:
        door(**(KICK | change))
    assert "\n" not in str(caught.value)


def test_what_is_given_stays_the_callers():
    v, spin = KICK["v"].copy(), np.array([0.0, 5.0, 0.0])
    hit = kd.strike(**(KICK | {"v": v, "ball_spin": spin}))
    v[:], spin[:] = 9.0, 9.0
    assert hit.v_before.tolist() == KICK["v"].tolist()
    assert hit.ball_before.spin.tolist() == [0.0, 5.0, 0.0]


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
    assert 2 < heavy[-1] < 5
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


@pytest.mark.parametrize("metre", [2.0**-30, 2.0**30])
def test_that_it_is_rounding_does_not_depend_on_the_unit_of_length(metre):
    kick = list(extreme_impacts.cancellations())[-2]
    posture, ball = in_units(kick.leg, metre, 1.0).posture(kick.q), kd.Ball(radius=0.1 * metre)
    with pytest.raises(kd.NoImpact, match="that is rounding"):
        kd.strike(posture, kick.v, ball, kick.contact)


def test_a_slow_approach_of_which_nothing_cancels_is_not():
    contact = kd.Contact((1, 0, 0), 0.8, 0.4)
    sliding = (-1e-300, 0.5, 0.2)
    hit = kd.strike(
        chain(USUAL).posture(BENT), np.zeros(3), kd.Ball(), contact, ball_velocity=sliding
    )
    assert hit.approach_speed == 1e-300
    assert hit.digits > 14
