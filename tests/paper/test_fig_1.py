import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.paper.fig_1 import self_motion

LEG = kd.Leg.human()


def test_the_contact_point_stays():
    postures = self_motion(LEG, np.radians([25, 40, 10]))
    points = np.array([posture.contact_point for posture in postures])
    assert np.ptp(points, axis=0).max() < 1e-11
    q = np.array([posture.q for posture in postures])
    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    assert steps.max() < 0.011
    assert steps.min() > 0.009


def test_it_goes_from_limit_to_limit():
    postures = self_motion(LEG, np.radians([25, 40, 10]))
    for end in (postures[0], postures[-1]):
        room = np.minimum(end.q - LEG.lower, LEG.upper - end.q).min()
        assert 0 <= room < 0.03


def test_every_posture_is_that_of_two_circles():
    """Independent of the KIC: hip, knee and ankle by the law of cosines from the foot's angle."""
    for posture in self_motion(LEG, np.radians([25, 40, 10]))[::20]:
        hip, knee, ankle = posture.q
        foot = -hip + knee + ankle  # below the horizontal
        toe = posture.contact_point[[0, 2]]
        at_ankle = toe - 0.145 * np.array([np.cos(foot), -np.sin(foot)])
        reach = np.linalg.norm(at_ankle)
        cosine = (reach**2 - 0.371**2 - 0.443**2) / (2 * 0.371 * 0.443)
        assert np.arccos(cosine) == pytest.approx(knee, abs=1e-9)


@pytest.mark.parametrize(
    ("q", "words"),
    [([0.0, -1.0, 0], "outside the joints' range"), ([0.0, 0.0], r"q has shape \(2,\)")],
)
def test_bad_input(q, words):
    with pytest.raises(kd.InvalidInput, match=words):
        self_motion(LEG, q)


def test_a_leg_without_redundancy_is_refused():
    chain = pin.Model()
    joint = chain.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "only")
    chain.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    chain.addFrame(pin.Frame("toe", joint, 0, tip, pin.FrameType.OP_FRAME))
    chain.lowerPositionLimit, chain.upperPositionLimit = np.array([-1.0]), np.array([1.0])
    with pytest.raises(kd.InvalidInput, match="0 degrees of self-motion"):
        self_motion(kd.Leg.from_model(chain, "toe"), [0.0])


def test_a_held_leg_is_refused():
    robot = kd.Leg.from_robot("bolt", base="floating")
    leg = robot.with_supports(kd.Support("FL_FOOT", point=True))
    with pytest.raises(kd.InvalidInput, match="a leg without supports, loops and mimic joints"):
        self_motion(leg, leg.configuration())
