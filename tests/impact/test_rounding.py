"""Digits that an impact claims: random chains against 50 digits, and what takes digits."""

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick
from digits import FAMILIES, shortfalls

import kickdyn as kd
from kickdyn.impact.rounding import digits_left


@pytest.mark.parametrize("family", FAMILIES)
def test_no_claim_is_false(family):
    """A few of the kicks that `python tools/digits.py` measures by the thousand."""
    for seed in range(8):
        impulse, joints, hit = shortfalls(family, seed)
        assert impulse < 1.0, seed
        assert max(joints) < 1.0, seed
        usual = family in ("ordinary", "light_foot", "short_links", "parallel", "gimbal")
        assert hit.digits > 12 or not usual or hit.approach_speed < 0.1, seed


def test_redundant_supports_claim_a_finite_number_of_digits():
    leg = kd.Leg.from_robot("g1", base="floating")
    leg = leg.with_supports("left_ankle_roll_link")
    kick, motion = any_kick(np.random.default_rng(1), leg, friction=0.4)
    hit = kd.strike(*kick, **motion)
    assert 10 < hit.digits < 15
    assert hit.joint_digits.shape == (len(leg.joint_names),)
    assert 10 < hit.joint_digits.max() < 15


def test_digits_are_those_of_float64():
    assert digits_left(np.array([0.0, 1e-3, 2.0])) == pytest.approx([16.0, 3.0, 0.0])


def test_a_spin_takes_at_least_the_digits_of_a_velocity_that_moves_the_surface_alike():
    """Either follows the foot across the normal at 1e4 times the speed of approach."""
    model = pin.Model()
    for kind, name in ((pin.JointModelPX(), "ahead"), (pin.JointModelPZ(), "up")):
        joint = model.addJoint(model.njoints - 1, kind, pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("face", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    posture, ball = kd.Leg.from_model(model, "face").posture([0.0, 0.0]), kd.Ball()
    contact, v = kd.Contact((1, 0, 0), 0.7, 0.5), [1.0, 1e4]
    by_velocity = kd.strike(posture, v, ball, contact, ball_velocity=(0, 0, 1e4))
    by_spin = kd.strike(posture, v, ball, contact, ball_spin=(0, 1e4 / ball.radius, 0))
    assert by_spin.impulse == pytest.approx(by_velocity.impulse, abs=1e-10)
    assert by_velocity.digits - 0.1 < by_spin.digits <= by_velocity.digits  # in two directions
    assert by_spin.digits < 12.0
