"""The motion just before the impact: every way to strike refuses the same inputs."""

import math

import numpy as np
import pytest
from chains import in_units
from extremes import extreme_impacts
from extremes.extreme_impacts import BENT, USUAL, chain
from tolerances import closed_form

import kickdyn as kd
from kickdyn.impact.strike import strike_by_pinocchio

LEG = kd.Leg.human()
Q = np.radians([5.0, 10.0, -5.0])
KICK = {
    "posture": LEG.posture(Q),
    "v": LEG.posture(Q).joint_velocity((3, 0, 1)),
    "ball": kd.Ball(),
    "contact": kd.Contact((1, 0, 0.3), 0.7),
}
FUNCTIONS = (kd.strike, strike_by_pinocchio, kd.collide, kd.unilateral_strike)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
@pytest.mark.parametrize(("change", "error", "words"), [
    ({"posture": LEG}, kd.InvalidInput, "posture is .*Posture"),
    ({"v": [0, math.nan, 0]}, kd.InvalidInput, "v is .*finite"),
    ({"v": [0, -1e160, -1e160]}, kd.InvalidInput, "double precision"),
    ({"ball_velocity": (1, 2)}, kd.InvalidInput, r"ball velocity has shape \(2,\)"),
    ({"ball_velocity": (-1e150, 0, 0)}, kd.InvalidInput, r"1e\+150 m/s"),
    ({"ball_spin": (0, 1e200, 0)}, kd.InvalidInput, r"1e\+140 m/s"),
    ({"v": [0, 0, 0]}, kd.NoImpact, "do not approach"),
    ({"ball_velocity": (9, 0, 0)}, kd.NoImpact, "away from the ball"),
    (
        {"posture": LEG.posture([5, 10, -5]), "ball_velocity": (99, 0, 0)},
        kd.NoImpact,
        r"radians: hip at 286\.48 deg",
    ),
])  # fmt: skip
def test_bad_input(function, change, error, words):
    with pytest.raises(error, match=words):
        function(**(KICK | change))


@pytest.mark.parametrize("metre", [2.0**-30, 1.0, 2.0**30])
@pytest.mark.parametrize("function", [kd.strike, kd.collide], ids=["strike", "collide"])
def test_an_approach_that_is_rounding_is_refused_in_every_unit_of_length(function, metre):
    kick = list(extreme_impacts.cancellations())[-2]
    posture, ball = in_units(kick.leg, metre, 1.0).posture(kick.q), kd.Ball(radius=0.1 * metre)
    with pytest.raises(kd.NoImpact, match="that is rounding"):
        function(posture, kick.v, ball, kick.contact)


def test_a_slow_approach_of_which_nothing_cancels_is_accepted():
    contact, sliding = kd.Contact((1, 0, 0), 0.8, 0.4), (-1e-300, 0.5, 0.2)
    posture = chain(USUAL).posture(BENT)
    impact = kd.strike(posture, np.zeros(3), kd.Ball(), contact, ball_velocity=sliding)
    assert impact.approach_speed == 1e-300
    assert impact.digits > 14


def test_the_energy_of_the_approach_is_that_of_the_reduced_mass():
    """Along the normal, M and m with u have the energy m M / (m + M) u^2 / 2."""
    impact = kd.strike(**KICK, ball_velocity=(-1.0, 0.2, 0.4))
    mass, ball, n = impact.effective_mass, impact.ball.mass, impact.contact.normal
    speed = n @ (impact.posture.jacobian @ KICK["v"] - [-1.0, 0.2, 0.4])
    assert impact.approach_speed == pytest.approx(speed, rel=closed_form(10))
    energy = 0.5 * mass * ball / (mass + ball) * speed**2
    assert impact.approach.energy() == pytest.approx(energy, rel=closed_form(10))
