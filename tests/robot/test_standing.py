"""The robot with its foot as the root is the same robot: kinematics, inertia, mass."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot.kicking_chain import rest_configuration
from kickdyn.robot.standing import (
    StandingRobot,
    _faces,
    _levelled,
    _sole,
    hold_support,
    lock_idle_mimics,
    sole_edges,
)

FOOT = "left_ankle_roll_link"
G1 = kd.Leg.from_robot("g1", base="floating", legs_only=True)
CORNERS = [(-0.1, -0.05, 0.0), (-0.1, 0.05, 0.0), (0.1, 0.05, 0.0), (0.1, -0.05, 0.0)]


def random_robot(rng):
    """A floating base with a random tree of joints on it, one branch to a foot, one to a toe."""
    model, place = pin.Model(), pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3))
    model.addJoint(0, pin.JointModelFreeFlyer(), place, "base")
    kinds = pin.JointModelRX(), pin.JointModelPZ(), pin.JointModelRUBY()
    nearly_x = np.array([1.0, 1e-4, 0.0]) / np.hypot(1.0, 1e-4)
    kinds = (*kinds, pin.JointModelRevoluteUnaligned(nearly_x))
    ends, start = {}, 2
    for end in ("foot", "spur", "toe", "arm"):
        # legs hang on the base, a spur and an arm somewhere on the leg before
        parent = 1 if end in ("foot", "toe") else int(rng.choice([1, *range(start, model.njoints)]))
        start = model.njoints
        for k in range(rng.integers(1, 5)):
            axis = rng.normal(size=3)
            kind = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
            if rng.random() < 0.3:
                kind = kinds[rng.integers(4)]
            offset = pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3))
            parent = model.addJoint(parent, kind, offset, f"{end}{k}")
        ends[end] = parent
    for body in range(1, model.njoints):
        model.appendBodyToJoint(body, random_inertia(rng), pin.SE3.Identity())
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    for end, joint in ends.items():
        turned = data.oMi[joint].rotation.T @ pin.utils.rotate("z", rng.uniform(-3, 3))
        level = pin.SE3(turned, rng.uniform(-0.2, 0.2, size=3))
        model.addFrame(pin.Frame(end, joint, 0, level, pin.FrameType.OP_FRAME))
    armature = rng.uniform(0.0, 0.1, size=model.nv)
    armature[:6] = 0.0
    model.armature, model.velocityLimit = armature, rng.uniform(1.0, 2.0, size=model.nv)
    model.effortLimit = rng.uniform(1.0, 2.0, size=model.nv)
    model.lowerPositionLimit, model.upperPositionLimit = rng.uniform([[-2], [1]], [[-1], [2]],
                                                                     (2, model.nq))  # fmt: skip
    return kd.Leg.from_model(model, "toe").with_supports(kd.Support("foot", sole=CORNERS))


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_the_rooted_robot_moves_and_weighs_as_the_robot_on_its_support(seed):
    rng = np.random.default_rng(seed)
    standing = StandingRobot(random_robot(rng))
    leg, robot = standing.leg, standing.robot
    q, _ = standing.robot_state(leg.configuration(), np.zeros(leg.nv))
    base = robot.model.jointPlacements[1]
    move = base * pin.XYZQUATToSE3(q[:7]) * base.inverse()  # with joints at 0, it is vertical
    assert move.rotation == pytest.approx(np.eye(3), abs=closed_form(10))
    assert move.translation[:2] == pytest.approx([0.0, 0.0], abs=closed_form(10))
    q = pin.integrate(leg.model, leg.configuration(), rng.uniform(-1, 1, size=leg.nv))
    v = rng.normal(size=leg.nv)
    whole_q, whole_v = standing.robot_state(q, v)
    rooted, whole = leg.posture(q), robot.posture(whole_q)
    rounding = closed_form(np.linalg.cond(whole.inertia))
    rows = whole.constraint_projector.rows
    np.testing.assert_allclose(rows @ whole_v, 0.0, atol=rounding * np.abs(whole_v).max())
    agrees(rooted.contact_point, whole.contact_point, closed_form())
    agrees(rooted.jacobian @ v, whole.jacobian @ whole_v, rounding)
    energy = 0.5 * v @ rooted.inertia @ v
    assert energy == pytest.approx(0.5 * whole_v @ whole.inertia @ whole_v, rel=rounding)
    agrees(rooted.delassus(), whole.delassus(), 100 * rounding)
    for name in leg.joint_names:
        assert leg.joint_range(name) == robot.joint_range(name)
        at, to = leg.velocity_index(name), robot.velocity_index(name)
        assert v[at] == whole_v[to]
        assert leg.velocity_limit[at] == robot.velocity_limit[to]
        assert leg.effort_limit[at] == robot.effort_limit[to]
        assert leg.model.armature[at] == robot.model.armature[to]
        assert leg.joint_values(q)[name] == pytest.approx(robot.joint_values(whole_q)[name])


BODY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
VISUAL = '<visual><origin xyz="{} {} {}"/><geometry>{}</geometry></visual>'


def biped(folder, shapes, tilt=0.0):
    """A trunk 1 m above two feet, 0.3 m to its sides, that are turned about y with joints at 0."""
    parts = f'<link name="trunk">{BODY}</inertial></link>' + "".join(
        f'<link name="{side}">{BODY}</inertial>{shapes}</link><joint name="{side}_hip" '
        f'type="revolute"><parent link="trunk"/><child link="{side}"/>'
        f'<origin xyz="0 {y} -1" rpy="0 {tilt} 0"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for side, y in (("left", 0.3), ("right", -0.3))
    )
    (folder / "biped.urdf").write_text(f'<robot name="biped">{parts}</robot>')
    return kd.Leg.from_urdf(folder / "biped.urdf", "right", base="floating")


def test_the_sole_of_round_feet_is_cut_out_of_their_spheres(tmp_path):
    """Two spheres stand on the ground; the third one, 1 mm higher, reaches less far into it."""
    ball = '<sphere radius="0.05"/>'
    places = (0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.1, 0.1, 0.001)
    robot = biped(tmp_path, "".join(VISUAL.format(*place, ball) for place in places))
    standing = StandingRobot(robot.with_supports("left"))
    low, high = (np.sqrt(2 * 0.05 * depth - depth**2) for depth in (2e-3, 1e-3))
    assert standing.sole[:, 0].min() == pytest.approx(-low, rel=closed_form(1e4))
    assert standing.sole[:, 0].max() == pytest.approx(0.2 + low, rel=closed_form(1e4))
    assert standing.sole[:, 1].max() == pytest.approx(0.3 + 0.1 + high, rel=closed_form(1e4))
    assert standing.placement.translation == pytest.approx([0, 0.3, 0.05])
    normals, offsets = sole_edges(standing)  # n x <= offset inside
    middle = standing.sole.mean(axis=0)
    assert (normals @ middle < offsets).all()
    farthest = (normals @ standing.sole.T).max(axis=1)
    assert farthest == pytest.approx(offsets, abs=closed_form(10))


def with_pad(robot):
    """Return a robot with a turned frame at its left foot, its number and place."""
    model, joint = robot.model, robot.model.getJointId("left_hip")
    place = pin.SE3(random_rotation(np.random.default_rng(2)), np.array([0.1, 0.2, 0.3]))
    pad = model.addFrame(pin.Frame("pad", joint, 0, place, pin.FrameType.OP_FRAME))
    return robot.with_model(model), pad, place


def test_the_sole_in_a_turned_frame_is_the_same(tmp_path):
    robot = biped(tmp_path, VISUAL.format(0, 0.02, -0.05, '<box size="0.2 0.08 0.02"/>'))
    padded, pad, place = with_pad(robot)
    turned = _sole(padded, kd.Support("pad"), pad, place.rotation)
    sole = _sole(robot, kd.Support("left"), robot.model.getFrameId("left"), np.eye(3))
    agrees(turned @ place.rotation.T + place.translation, sole, closed_form(10))
    robots = [one.with_supports(FOOT) for one in (G1, kd.kick_with(G1, "instep"))]
    poses = [StandingRobot(one).kicking_foot().pose.homogeneous for one in robots]
    agrees(*poses, closed_form(1e4))


@pytest.mark.parametrize("sole", [
    None, [(-0.1, -0.04, -0.06), (0.1, -0.04, -0.06), (0, 0.04, -0.06)]])  # fmt: skip
def test_a_foot_that_is_tilted_with_joints_at_0_is_turned_level(tmp_path, sole):
    """Each foot is a box 0.06 m below its ankle, its toes up by 15 degrees."""
    robot = biped(tmp_path, VISUAL.format(0, 0, -0.05, '<box size="0.2 0.08 0.02"/>'), -0.26)
    standing = StandingRobot(robot.with_supports(kd.Support("left", sole=sole)))
    assert standing.placement.rotation == pytest.approx(np.eye(3), abs=closed_form(1e4))
    assert standing.placement.translation == pytest.approx([0, 0.3, 0.06], abs=closed_form(1e4))
    assert np.ptp(standing.sole, axis=0) == pytest.approx([0.2, 0.08], abs=closed_form(1e4))
    agrees(np.ptp(standing.kicking_foot().sole, axis=0), [0.2, 0.08], closed_form(1e4))
    leg, q = standing.leg, standing.leg.configuration({"left_hip": 0.4})
    pin.forwardKinematics(leg.model, data := leg.model.createData(), q)
    base = pin.Quaternion(standing.robot_state(q, np.zeros(leg.nv))[0][3:7]).toRotationMatrix()
    trunk = data.oMi[leg.model.getJointId(standing.trunk_joint)].rotation
    assert trunk @ standing.trunk_axis == pytest.approx(base[:, 2], abs=closed_form(1e4))


def test_a_foot_stands_on_its_largest_face_within_30_degrees_of_the_ground(tmp_path):
    sizes, degrees = np.array([0.2, 0.08, 0.3]), np.radians([5.0, 25.0, 35.0])
    robot = biped(tmp_path, VISUAL.format(0, 0, -0.05, '<box size="0.2 0.08 0.3"/>'))
    robot, pad, place = with_pad(robot)
    normals, areas = _faces(robot, pad)
    along = np.abs(normals @ place.rotation.T)
    agrees(along.max(axis=1), np.ones(len(along)), closed_form(10))
    axes = along.argmax(axis=1)
    assert set(axes) == {0, 1, 2}
    agrees(areas, np.prod(sizes) / sizes[axes], closed_form(10))
    tilted = np.column_stack([np.sin(degrees), np.zeros(3), -np.cos(degrees)])
    level = _levelled(np.eye(3), tilted, np.array([1.0, 2.0, 3.0]))
    agrees(level @ tilted[1], [0.0, 0.0, -1.0], closed_form())


def test_a_supported_foot_stays_while_the_joints_move():
    robot = StandingRobot(G1.with_supports(FOOT)).robot
    posture = robot.posture(robot.configuration())
    bent = robot.configuration({"left_knee_joint": 0.7, "right_hip_pitch_joint": -1.0})
    bent[:7] = 0.3, -0.2, 0.5, 0.0, 0.6, 0.0, 0.8  # wherever its base is
    held, data, feet = hold_support(posture, bent), robot.model.createData(), []
    for q in (posture.q, held):
        pin.framesForwardKinematics(robot.model, data, q)
        feet.append(data.oMf[robot.model.getFrameId(FOOT)].homogeneous)
    np.testing.assert_allclose(feet[1], feet[0], atol=closed_form(10))
    assert held[7:].tolist() == bent[7:].tolist()
    assert hold_support(G1.posture(G1.configuration()), bent) is bent


def test_mimic_joints_of_neither_leg_are_locked_at_rest(leg_with_arm):
    leg = lock_idle_mimics(kd.Leg.from_urdf(leg_with_arm))
    assert (leg.joint_names, leg.mimics) == (("hip", "knee", "ankle"), ())
    busy = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    assert lock_idle_mimics(busy).mimics == busy.mimics
    leg_with_arm.write_text(leg_with_arm.read_text().replace('lower="-1"', 'lower="0.2"'))
    arm = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    assert arm.joint_values(rest_configuration(arm))["elbow"] == pytest.approx(0.2 + 0.3)


def on(sole):
    return G1.with_supports(kd.Support(FOOT, sole=np.array(sole)))


@pytest.mark.parametrize(("robot", "said"), [
    (G1, "does not stand"), (G1.with_supports(kd.Support(FOOT, point=True)), "one flat foot"),
    (G1.with_supports(FOOT).with_loops(("left_knee_link", "pelvis")), "no loops"),
    (on([(0, 0, 0), (0.1, 0, 0.1), (0, 0.1, 0.0)]), f"{FOOT} .*30 degrees"),
    (on([*CORNERS, (0.2, 0, 0.05)]), f"{FOOT} .*not in a plane"),
    (kd.Leg.from_model(G1.model, "toe").with_supports(FOOT), "no sole")])  # fmt: skip
def test_a_robot_that_cannot_stand_is_refused(robot, said):
    with pytest.raises(kd.InvalidInput, match=said):
        StandingRobot(robot)
