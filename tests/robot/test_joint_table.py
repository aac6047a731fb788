import math

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg

import kickdyn as kd

BODY = pin.Inertia(1.0, np.array([0.0, 0.0, -0.25]), np.diag([0.1, 0.1, 0.05]))


def mixed():
    """One joint of each kind: limited, continuous, prismatic."""
    model = pin.Model()
    model.name = "mixed"
    parent = 0
    for kind, name, limits in (
        (pin.JointModelRY(), "turn", ([-1.0], [2.0])),
        (pin.JointModelRUBY(), "spin", ([-1.1] * 2, [1.1] * 2)),
        (pin.JointModelPZ(), "slide", ([0.0], [0.3])),
    ):
        low, high = (np.array(limit) for limit in limits)
        size = np.ones(1)
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, size, size, low, high)
        model.appendBodyToJoint(parent, BODY, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
    model.addFrame(pin.Frame("toe", parent, 0, tip, pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe")


def test_joints_of_every_kind():
    leg = mixed()
    assert (leg.nq, leg.nv) == (4, 3)
    q = leg.configuration({"spin": 3.0, "slide": 0.2})
    assert q == pytest.approx([0, math.cos(3), math.sin(3), 0.2], abs=1e-15)
    assert leg.posture(q).contact_point == pytest.approx(
        [-0.8 * math.sin(3), 0, -0.8 * math.cos(3)]
    )
    assert leg.joint_range("turn") == (-1, 2)
    assert leg.joint_range("spin") == (-math.pi, math.pi)
    assert leg.joint_range("slide") == (0, 0.3)
    assert [leg.joint_unit(name) for name in leg.joint_names] == ["rad", "rad", "m"]
    assert leg.joint_values(q) == pytest.approx({"turn": 0, "spin": 3, "slide": 0.2})
    assert leg.angles_deg(list(q)) == pytest.approx({"turn": 0, "spin": math.degrees(3)})
    assert leg.positions_m(q) == pytest.approx({"slide": 0.2})
    assert leg.display_values(q)["slide"] == (pytest.approx(0.2), "m")


def test_a_continuous_joint_may_be_given_by_its_angle():
    leg = mixed()
    q = leg.configuration({"turn": 0.5, "spin": 3.0, "slide": 0.2})
    assert leg.posture([0.5, 3.0, 0.2]).q == pytest.approx(q, abs=1e-15)
    assert leg.joint_values([0.5, -3.0, 0.2])["spin"] == pytest.approx(-3)
    said = r"q has shape \(5,\): it must be \(3,\), with one angle for each continuous joint, or"
    with pytest.raises(kd.InvalidInput, match=said):
        leg.posture(np.zeros(5))
    with pytest.raises(kd.InvalidInput, match="must have length 1"):
        leg.posture([0.5, 3.0, 0.2, 0.0])


def test_a_floating_base_beside_a_continuous_joint():
    leg = floating_leg(np.random.default_rng(0))
    base = [1, 2, 3, 0, 0, 0, 1]
    q = leg.posture([*base, 0.3, 0.4]).q
    assert q == pytest.approx([*base, math.cos(0.3), math.sin(0.3), 0.4])


def test_nothing_named_is_everything_at_zero():
    assert mixed().configuration().tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ({"twist": 1}, "joint 'twist' is unknown: mixed has turn, spin, slide"),
        ({"turn": math.nan}, "joint turn is nan"),
        ({"turn": "30"}, "joint turn is '30'"),
        ({"universe": 1}, "joint 'universe' is unknown"),
        (["turn"], "^angles is .*must map names to values"),
    ],
)
def test_bad_angles_are_refused(angles, said):
    with pytest.raises(kd.InvalidInput, match=said):
        mixed().configuration(angles)


@pytest.mark.parametrize("method", ["velocity_index", "joint_range", "joint_unit"])
def test_joint_of_many_degrees_is_refused_by_name(method):
    leg = kd.Leg.from_robot("bolt", base="floating")
    assert leg.configuration()[:7].tolist() == [0, 0, 0, 0, 0, 0, 1]
    assert "root_joint" not in leg.angles_deg(leg.configuration())
    with pytest.raises(kd.InvalidInput, match="joint 'root_joint' has 6 degrees of freedom"):
        getattr(leg, method)("root_joint")


@pytest.mark.parametrize(
    ("q", "said"),
    [
        ([0, 0], r"shape \(2,\): it must be \(3,\)"),
        ([[0, 0, 0]], r"shape \(1, 3\)"),
        (np.zeros((3, 1)), r"shape \(3, 1\)"),
        ([0, math.nan, 0], "finite"),
        ([0, math.inf, 0], "finite"),
        ([0, 1j, 0], "real numbers"),
        ("000", "real numbers"),
        ([True, False, True], "real numbers"),
        (np.ma.array([0.0, 1.0, 2.0], mask=[0, 0, 1]), "masked"),
        ({"hip": 0.3}, r"\{'hip': 0.3\}: it must be 3 numbers; Leg.configuration makes them"),
    ],
    ids=str,
)
def test_bad_q_is_refused(q, said):
    leg = kd.Leg.human()
    for takes in (leg.posture, leg.close_loops, leg.angles_deg, leg.outside_range):
        with pytest.raises(kd.InvalidInput, match=f"^q .*{said}"):
            takes(q)


@pytest.mark.parametrize("pair", [[0, 0], [2, 0], [1, 1e-3]])
def test_cosine_and_sine_must_belong_together(pair):
    with pytest.raises(kd.InvalidInput, match=r"the \(cos, sin\) pair of spin must have length 1"):
        mixed().posture([0.1, *pair, 0.2])
    assert mixed().posture([0.1, 0.6, 0.8, 0.2]).q.tolist() == [0.1, 0.6, 0.8, 0.2]


def test_a_floating_base_without_its_quaternion_is_named():
    leg = kd.Leg.from_robot("bolt", base="floating")
    with pytest.raises(kd.InvalidInput, match=r"the quaternion \(xyzw, last\) of root_joint must"):
        leg.posture(np.zeros(leg.nq))
    stretched = leg.configuration()
    stretched[3:7] *= 2
    with pytest.raises(kd.InvalidInput, match="of root_joint must have length 1"):
        leg.posture(stretched)


def test_what_is_outside_its_range_is_named():
    leg = mixed()
    for inside in ({}, {"turn": -1, "spin": 3.1, "slide": 0.3}, {"turn": 2 + 1e-7}):
        assert leg.outside_range(leg.configuration(inside)) == []
    outside = leg.configuration({"turn": 2.001, "spin": 3.1, "slide": -0.01})
    assert leg.outside_range(outside) == [
        "turn at 114.65 deg is outside its range -57.296 to 114.59 deg",
        "slide at -0.01 m is outside its range 0 to 0.3 m",
    ]
    degrees = kd.Leg.human().outside_range(np.array([20.0, 0.25, 0.3]))
    assert degrees == ["hip at 1145.9 deg is outside its range -30 to 125 deg"]


def test_what_is_faster_than_its_limit_is_named():
    model = mixed().model
    model.velocityLimit = np.array([2.0, np.inf, 0.0])
    leg = kd.Leg.from_model(model, "toe")
    for v in ([-2, 1e300, 0], [2 * (1 + 1e-7), -1e300, 0]):
        assert leg.too_fast(np.array(v)) == []
    assert leg.too_fast(np.array([-2.96, 1e300, 1e-9])) == [
        "turn at 148 % of its speed limit",
        "slide moves, its speed limit is 0",
    ]
    assert leg.too_fast(np.array([2.0001, 0.0, 0.0])) == ["turn at 100 % of its speed limit"]
    floating = kd.Leg.from_robot("bolt", base="floating")
    assert floating.too_fast(np.full(floating.nv, 1e-3)) == []


@pytest.mark.parametrize("joint", ["turn", "spin", "slide"])
def test_a_model_without_frames_of_joints_can_be_locked(joint):
    free = mixed()
    locked = free.locked({joint: 0.2})
    assert joint not in locked.joint_names
    values = {"turn": 0.1, "spin": -0.4, "slide": 0.3, joint: 0.2}
    whole = free.posture(free.configuration(values))
    kept = {name: value for name, value in values.items() if name != joint}
    alone = locked.posture(locked.configuration(kept))
    assert alone.contact_point == pytest.approx(whole.contact_point, abs=1e-14)
    column = [index for index, name in enumerate(free.joint_names) if name != joint]
    assert alone.inertia == pytest.approx(whole.inertia[np.ix_(column, column)], abs=1e-14)


def test_without_a_limit_there_is_none():
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hip")
    model.addJoint(1, pin.JointModelRY(), pin.SE3.Identity(), "knee")
    for joint in (1, 2):
        model.appendBodyToJoint(joint, BODY, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
    model.addFrame(pin.Frame("toe", 2, 0, tip, pin.FrameType.OP_FRAME))
    model.velocityLimit = np.array([5.0, np.finfo(float).max])  # the largest float is Pinocchio's
    leg = kd.Leg.from_model(model, "toe")
    assert leg.velocity_limit.tolist() == [5.0, math.inf]
    assert leg.effort_limit.tolist() == [math.inf, math.inf]
    assert leg.locked({"hip": 0.5}).velocity_limit.tolist() == [math.inf]
    assert leg.locked({"knee": 0.5}).velocity_limit.tolist() == [5.0]
