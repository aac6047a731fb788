import numpy as np
import pytest
from chains import random_leg

import kickdyn as kd
from kickdyn.sweeps.kick import Kick, kick_from
from kickdyn.sweeps.speed_use import least_use, least_used, speed_use


def limited(leg, limits):
    model = leg.model
    model.velocityLimit = np.asarray(limits, float)
    return kd.Leg.from_model(model, leg.frame)


@pytest.mark.parametrize("special", [None, 0.0, np.inf, 1e-2])
def test_the_dual_is_the_linear_programme(special):
    rng = np.random.default_rng(5)
    for joints in (3, 4, 5, 6, 7, 8) * 4:
        limits = rng.uniform(0.5, 20.0, joints)
        if special is not None and joints > 4:
            limits[rng.integers(joints)] = special
        leg = limited(random_leg(rng, joints), limits)
        posture, wish = leg.posture(rng.uniform(-2, 2, joints)), rng.normal(size=3)
        v = least_used(posture, wish)
        assert posture.point_velocity(v) == pytest.approx(wish, abs=1e-12 * max(1, abs(v).max()))
        assert least_use(posture, wish) == pytest.approx(speed_use(posture, v), rel=1e-11)
        assert speed_use(posture, v) <= speed_use(posture, posture.joint_velocity(wish))


def test_in_a_plane_too():
    leg, wish = kd.Leg.human(), np.array([8.0, 0.0, 5.0])
    posture = leg.posture(np.radians([40, 30, -20]))
    v = least_used(posture, wish)
    assert posture.point_velocity(v) == pytest.approx(wish, rel=1e-13, abs=1e-13)
    assert least_use(posture, wish) == pytest.approx(speed_use(posture, v), rel=1e-13)
    assert sorted(abs(v) / leg.velocity_limit)[1:] == pytest.approx(2 * [speed_use(posture, v)])
    assert least_use(posture, 3 * wish) == pytest.approx(3 * speed_use(posture, v), rel=1e-13)


def test_joints_of_limit_0_and_of_none():
    leg, wish = kd.Leg.human(), np.array([1.0, 0.0, 0.0])
    q = np.radians([5, 10, -5])
    for limits, use in (([0, 10, 0], np.inf), ([0, 0, 0], np.inf), (3 * [np.inf], 0.0)):
        posture = limited(leg, limits).posture(q)
        assert least_use(posture, wish) == use
        assert speed_use(posture, least_used(posture, wish)) == use


def test_a_limit_beyond_all_others_is_none_and_its_rounding_does_not_count():
    rng = np.random.default_rng(2)
    leg = random_leg(rng, 5)
    limits, wish = rng.uniform(1.0, 9.0, 5), rng.normal(size=3)
    for k in range(5):
        uses = []
        for most in (1e9, 1e16, 1e20, 1e200, np.inf):
            limits[k], before = most, limits[k]
            posture = limited(leg, limits).posture(np.full(5, 0.4))
            uses.append(least_use(posture, wish))
            limits[k] = before
        assert uses == pytest.approx(5 * [uses[-1]], rel=1e-8)
        assert uses[-1] > 0


def test_a_held_foot_counts():
    leg = kd.Leg.from_robot("g1", base="floating").with_supports("left_ankle_roll_link")
    posture = leg.posture(
        leg.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.5})
    )
    wish = np.array([1.0, 0.0, 0.2])
    v = least_used(posture, wish)
    assert posture.point_velocity(v) == pytest.approx(wish, abs=1e-9)
    posture.check_velocity(v)
    assert least_use(posture, wish) == speed_use(posture, v)
    assert speed_use(posture, v) < speed_use(posture, posture.joint_velocity(wish))


def test_a_kick_that_some_velocity_can_do_is_not_too_fast():
    leg = kd.Leg.human()
    posture, kick = leg.posture(np.radians([40, 30, -20])), Kick(speed=10.0)
    wish = kick.speed * kick.direction
    outcome = kick_from(posture, kick)
    assert speed_use(posture, posture.joint_velocity(wish)) == pytest.approx(1.3197, rel=1e-4)
    assert (outcome.status, outcome.speed_use) == ("ok", least_use(posture, wish))
    assert speed_use(posture, outcome.hit.v_before) == pytest.approx(0.64024, rel=1e-5)
    slow = kd.strike(posture, posture.joint_velocity(wish), kick.ball, kick.contact)
    assert outcome.hit.impulse == pytest.approx(slow.impulse, rel=1e-12)
