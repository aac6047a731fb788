"""Derivatives of legs with supports and loops, against differences that keep the constraints."""

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick, at, fourbar, random_leg, serial
from nudges import RESULTS, by_differences, margin
from tolerances import agrees, differenced

import kickdyn as kd
from kickdyn.impact.sensitivity import UNITS

SOLE, HANDS = "left_ankle_roll_link", ("left_wrist_yaw_link", "right_wrist_yaw_link")
G1 = kd.Leg.from_robot("g1", base="floating")
BOLT = kd.Leg.from_robot("bolt", base="floating")
LEGS = {
    "flat foot": G1.with_supports(SOLE),
    "point foot": BOLT.with_supports(kd.Support("FL_FOOT", point=True)),
    "foot, and hands joined": G1.with_loops(HANDS).with_supports(SOLE),
    "redundant supports": G1.with_supports(SOLE, kd.Support("left_ankle_pitch_link", point=True)),
    "loop in a plane": fourbar(),
    "loop and stiff hip in a plane": fourbar().with_stiff_joints("hip"),
    "stiff chain": random_leg(np.random.default_rng(5), 5).with_stiff_joints("joint2", "joint4"),
}


def some_kick(name, friction, seed=3):
    leg, rng = LEGS[name], np.random.default_rng(seed)
    (posture, v, ball, contact), options = any_kick(rng, leg, friction=friction)
    if name.endswith("in a plane"):  # across the plane, nothing moves
        q = leg.close_loops(leg.configuration({"hip": 0.2, "rocker_b": 0.4}), keep=("rocker_b",))
        posture = leg.posture(q)
        v = posture.admissible(np.array([3.0, 2.0, 1.0, -2.0, 4.0]))
        velocity = posture.point_velocity(v)
        contact = kd.Contact(velocity + 0.3 * velocity[[2, 1, 0]], 0.6, friction)
        options["ball_velocity"] = np.zeros(3)
    return (posture, v, ball, contact), options, rng


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize(("friction", "branch"), [
    (0.0, "frictionless"), (0.05, "slip"), (9.0, "stick")])  # fmt: skip
def test_against_differences(name, friction, branch):
    kick, options, rng = some_kick(name, friction)
    impact = kd.strike(*kick, **options)
    slopes = impact.sensitivity()
    assert slopes.branch == branch
    assert margin(impact) > 0.01 or not friction
    masses = np.array([link.mass for link in list(kick[0].leg.model.inertias)[1:]])
    for source in UNITS:
        size = slopes.impulse[source].shape[1]
        direction = rng.normal(size=size) / np.sqrt(size)
        if source == "link_mass":  # in proportion, for some are tiny
            direction = rng.uniform(-1, 1, size=size) * masses
        if source == "friction" and not friction:
            continue
        differences, impacts = by_differences(kick, options, source, direction)
        assert {one.sticking for one in impacts} == {impact.sticking}
        for result, right in differences.items():
            slope = getattr(slopes, result)[source] @ direction
            scale = max(np.abs(right).max(), np.abs(RESULTS[result](impact)).max())
            assert slope == pytest.approx(right, abs=100 * differenced() * scale), (result, source)


def composite():
    joint = pin.JointModelComposite()
    for axis in (pin.JointModelRX(), pin.JointModelRY()):
        joint.addJoint(axis)
    return joint


TURNING = [
    pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])),
    pin.JointModelSphericalZYX(),
    composite(),
]
STEADY = [pin.JointModelSpherical(), pin.JointModelRUBY(), pin.JointModelHX(0.1)]


def strike_with(hip):
    """A thigh on some joint, and a shank on a hinge."""
    down, body = at(0, 0, -0.4), pin.Inertia(1.0, np.array([0, 0, -0.2]), np.diag([2, 2, 1]) / 100)
    joints = ("hip", hip, at(0, 0, 0), body), ("knee", pin.JointModelRY(), down, body)
    leg = kd.Leg.from_model(serial(joints, down), "toe")
    posture, v = leg.posture(leg.configuration({"knee": 0.4})), np.arange(1.0, 1.0 + leg.nv)
    return kd.strike(posture, v, kd.Ball(), kd.Contact(posture.point_velocity(v), 0.7))


@pytest.mark.parametrize("hip", TURNING, ids=lambda joint: joint.shortname())
def test_joints_whose_axes_turn_are_refused(hip):
    with pytest.raises(kd.InvalidInput, match="axes of hip"):
        strike_with(hip).sensitivity()


@pytest.mark.parametrize("hip", STEADY, ids=lambda joint: joint.shortname())
def test_joints_whose_axes_stay_are_differentiated(hip):
    impact = strike_with(hip)
    kick = impact.posture, impact.v_before, impact.ball, impact.contact
    differences, _ = by_differences(kick, {}, "q", np.linspace(-0.5, 0.5, impact.posture.leg.nv))
    slope = impact.sensitivity().impulse["q"] @ np.linspace(-0.5, 0.5, impact.posture.leg.nv)
    agrees(slope, differences["impulse"], 100 * differenced())
