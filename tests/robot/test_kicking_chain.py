import math

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg

import kickdyn as kd
from kickdyn.robot.kicking_chain import (
    kicking_chain,
    rest_configuration,
    with_angles,
)

G1 = kd.Leg.from_robot("g1")


def test_the_chain_of_a_robot_is_its_leg():
    chain = kicking_chain(G1)
    assert chain.leg.joint_names == tuple(G1.joint_names[i] for i in chain.vs)
    assert [name.startswith("right_") for name in chain.leg.joint_names] == [True] * 6
    assert G1.lower[chain.qs].tolist() == chain.leg.lower.tolist()
    assert G1.velocity_limit[chain.vs].tolist() == chain.leg.velocity_limit.tolist()
    draw = np.random.default_rng(0)
    q, v = draw.normal(0, 0.3, 6), draw.normal(0, 1, 6)
    whole_q, whole_v = chain.robot_state(G1, q, v)
    whole, alone = G1.posture(whole_q), chain.leg.posture(q)
    assert whole.contact_point == pytest.approx(alone.contact_point, abs=1e-14)
    assert whole.jacobian @ whole_v == pytest.approx(alone.jacobian @ v, rel=1e-12)
    assert whole.effective_mass([1, 0, 0]) == pytest.approx(alone.effective_mass([1, 0, 0]))


def test_torques_of_the_chain_are_those_of_the_robot():
    chain, model = kicking_chain(G1), G1.model
    draw = np.random.default_rng(1)
    q, v, a = draw.normal(0, 0.3, (3, 6))
    own = pin.rnea(chain.leg.model, chain.leg.model.createData(), q, v, a)
    whole_q, whole_v = chain.robot_state(G1, q, v)
    whole_a = chain.robot_state(G1, q, a)[1]
    whole = pin.rnea(model, model.createData(), whole_q, whole_v, whole_a)
    assert whole[chain.vs] == pytest.approx(own, rel=1e-12)


def test_a_leg_that_is_nothing_else_stays_itself():
    leg = kd.Leg.human()
    for branches in (False, True):
        chain = kicking_chain(leg, branches=branches)
        assert chain.leg is leg
        assert chain.qs.tolist() == chain.vs.tolist() == [0, 1, 2]


def add_body(model, parent, joint, name):
    number = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    body = pin.Inertia(1.0, np.array([0, 0, -0.1]), 0.01 * np.eye(3))
    model.appendBodyToJoint(number, body, pin.SE3.Identity())


def test_branches_are_kept_where_an_impact_moves_them():
    model = kd.Leg.human().model
    add_body(model, 1, pin.JointModelRY(), "pendulum on the thigh")
    add_body(model, 0, pin.JointModelSpherical(), "arm on the base")
    robot = kd.Leg.from_model(model, "toe")
    without, with_branch = kicking_chain(robot), kicking_chain(robot, branches=True)
    assert without.leg.joint_names == ("hip", "knee", "ankle")
    assert with_branch.leg.joint_names == ("hip", "knee", "ankle", "pendulum on the thigh")
    n, q = (1.0, 0.0, 0.0), np.array([0.0, 0.3, 0.0, 0.0])
    whole = robot.posture(with_branch.robot_state(robot, q, np.zeros(4))[0])
    assert with_branch.leg.posture(q).effective_mass(n) == pytest.approx(whole.effective_mass(n))
    assert without.leg.posture(q[:3]).effective_mass(n) > whole.effective_mass(n) + 1e-3


def test_a_floating_base_is_refused():
    with pytest.raises(kd.InvalidInput, match="'root_joint' moves the contact frame"):
        kicking_chain(kd.Leg.from_robot("g1", base="floating"))


def test_continuous_joints_by_angles_are_the_same_robot():
    robot = floating_leg(np.random.default_rng(3))
    robot = robot.with_armature({"hip": 0.2}).with_supports()
    angles = with_angles(robot)
    assert (robot.nq, angles.nq, angles.nv) == (9 + 1, 9, robot.nv)
    pose = [0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8]
    one, other = robot.posture([*pose, 2.0, -0.4]), angles.posture([*pose, 2.0, -0.4])
    assert other.contact_point == pytest.approx(one.contact_point, abs=1e-14)
    assert other.jacobian == pytest.approx(one.jacobian, abs=1e-14)
    assert other.inertia == pytest.approx(one.inertia, rel=1e-13, abs=1e-13)
    assert angles.joint_range("hip") == (-math.pi, math.pi)
    assert angles.velocity_limit.tolist() == robot.velocity_limit.tolist()
    assert with_angles(G1) is G1


def test_a_continuous_joint_may_move_beside_the_kicking_limb():
    model = kd.Leg.human().model
    add_body(model, 0, pin.JointModelRUBZ(), "turret")
    robot = kd.Leg.from_model(model, "toe")
    chain, alone = kicking_chain(with_angles(robot)), kicking_chain(kd.Leg.human())
    assert chain.leg.joint_names == alone.leg.joint_names
    assert chain.leg.velocity_limit.tolist() == alone.leg.velocity_limit.tolist()
    plan = kd.plan_kick(robot, kd.Goal(3, time=0.5), kd.Ball(), kd.Air())
    assert plan.status == "met"
    assert plan.q[:3] == pytest.approx(
        kd.plan_kick(kd.Leg.human(), kd.Goal(3, time=0.5), kd.Ball(), kd.Air()).q, abs=1e-6
    )


def test_joints_outside_the_chain_rest_at_the_nearest_value_in_their_range():
    model = kd.Leg.human().model
    add_body(model, 0, pin.JointModelRY(), "elbow")
    add_body(model, 4, pin.JointModelRY(), "wrist")
    add_body(model, 5, pin.JointModelRUBY(), "spinner")
    add_body(model, 6, pin.JointModelSpherical(), "ball")
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    lower[3:5], upper[3:5] = (0.25, -2.0), (1.5, -0.5)
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    robot = kd.Leg.from_model(model, "toe")
    rest = rest_configuration(robot)
    assert rest.tolist() == [0, 0, 0, 0.25, -0.5, 1, 0, 0, 0, 0, 1]
    chain = kicking_chain(robot)
    assert chain.robot_state(robot, np.ones(3), np.ones(3))[0].tolist() == [1, 1, 1, *rest[3:]]


def test_a_mimic_joint_rests_where_its_driver_puts_it(tmp_path):
    joint = (
        '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
        '<axis xyz="0 1 0"/><limit lower="{3}" upper="{4}" effort="1" velocity="1"/>{5}</joint>'
    )
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="{{}}"><inertial><mass value="1"/>{inertia}</inertial></link>'
    follow = '<mimic joint="elbow" multiplier="2"/>'
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r"><link name="base"/>'
        + "".join(link.format(name) for name in ("toe", "arm", "hand"))
        + joint.format("hip", "base", "toe", -1, 1, "")
        + joint.format("elbow", "base", "arm", 0.25, 1, "")
        + joint.format("wrist", "arm", "hand", 0.125, 2, follow)
        + "</robot>"
    )
    leg = kd.Leg.from_urdf(path)
    assert leg.joint_values(rest_configuration(leg)) == {"hip": 0, "elbow": 0.25, "wrist": 0.5}


@pytest.mark.parametrize(("joint", "driver"), [("knee", "arm"), ("arm", "knee")])
def test_a_mimic_joint_of_the_kicking_limb_is_refused_as_driver_and_as_driven(
    tmp_path, joint, driver
):
    """Of the joint that mimics, the message names the driver to be locked."""
    text = kd.Leg.human().file.text
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    arm = (
        f'<link name="upper_arm">{body}</inertial></link><joint name="arm" type="revolute">'
        '<parent link="base"/><child link="upper_arm"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint></robot>'
    )
    text = text.replace("</robot>", arm)
    start = text.index("</joint>", text.index(f'<joint name="{joint}"'))
    path = tmp_path / "leg.urdf"
    path.write_text(f'{text[:start]}<mimic joint="{driver}"/>{text[start:]}')
    robot = kd.Leg.from_urdf(path, "toe")
    words = f"joint {joint!r} mimics {driver!r}: .*lock {driver!r}, .* --lock {driver}=VALUE"
    with pytest.raises(kd.InvalidInput, match=words):
        kicking_chain(robot)


def test_joints_that_are_taken_out_may_be_elsewhere():
    others = {"left_elbow_joint": 0.4, "left_hip_roll_joint": 0.2}
    chain = kicking_chain(G1, others=others).leg
    whole = G1.posture(G1.configuration(others))
    for frame in ("left_ankle_roll_link", "left_rubber_hand"):
        seen = []
        for leg, q in ((chain, chain.configuration()), (G1, whole.q)):
            model = leg.model
            data = model.createData()
            pin.forwardKinematics(model, data, q)
            number = model.getFrameId(frame)
            seen.append(pin.updateFramePlacement(model, data, number).homogeneous)
        np.testing.assert_allclose(*seen, atol=1e-12)
