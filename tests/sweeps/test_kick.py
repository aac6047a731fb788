import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.kick import Kick, kick_from
from kickdyn.sweeps.speed_use import least_use

LEG = kd.Leg.human()


def test_it_is_strike_and_fly():
    kick = Kick(speed=2.0, attack=math.radians(20), restitution=0.7, friction=0.1)
    posture = LEG.posture(np.radians([20, 30, 10]))
    outcome = kick_from(posture, kick)
    n = [math.cos(math.radians(20)), 0, math.sin(math.radians(20))]
    v = posture.joint_velocity(2 * np.array(n))
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact(n, 0.7, 0.1))
    assert outcome.status == "ok"
    assert outcome.hit.impulse == pytest.approx(hit.impulse, rel=1e-13)
    assert outcome.carry == pytest.approx(
        kd.fly(hit.ball_after, kd.Ball(), kd.Air()).range, rel=1e-9
    )
    assert outcome.speed_use == least_use(posture, 2 * np.array(n))


def test_a_stretched_leg_cannot_kick_along_itself():
    outcome = kick_from(LEG.posture(np.radians([90, 0, 90])), Kick(attack=0.0))
    assert outcome.status == "out of reach"
    assert outcome.hit is None
    assert math.isnan(outcome.carry)


def test_a_fast_kick_exceeds_the_joints():
    outcome = kick_from(LEG.posture(np.radians([5, 10, -5])), Kick(speed=50))
    assert outcome.status == "too fast"
    assert outcome.speed_use > 1
    assert outcome.hit is not None


def test_two_joints_that_may_not_move_leave_too_few():
    model = LEG.model
    for limits, status in (([0.0, 10.0, 10.0], "ok"), ([0.0, 0.0, 10.0], "too fast")):
        model.velocityLimit = np.array(limits)
        leg = kd.Leg.from_model(model, "toe")
        outcome = kick_from(leg.posture(np.radians([5, 10, -5])), Kick())
        assert outcome.status == status
        assert (outcome.speed_use == math.inf) is (status == "too fast")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"speed": 0}, "foot speed is 0"),
        ({"speed": math.nan}, "foot speed is nan"),
        ({"attack": 2.0}, r"attack is 2\.0: .* at least -1\.5708"),
        ({"restitution": 1.2}, r"restitution is 1\.2"),
        ({"friction": -0.1}, r"friction is -0\.1"),
    ],
)
def test_bad_kicks(change, words):
    with pytest.raises(kd.InvalidInput, match=words):
        Kick(**change)


def test_straight_up_is_allowed():
    assert Kick(attack=math.radians(90)).direction == pytest.approx([0, 0, 1], abs=1e-15)
