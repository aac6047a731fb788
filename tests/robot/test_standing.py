"""A kicking chain, and a robot with its foot as the root, move and weigh as in the robot."""

import math

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg, random_inertia, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot import standing as module
from kickdyn.robot.standing import StandingRobot

G1_FIXED = kd.Leg.from_robot("g1")


def test_the_chain_of_a_robot_is_its_leg():
    chain = module.kicking_chain(G1_FIXED)
    assert chain.leg.joint_names == tuple(G1_FIXED.joint_names[i] for i in chain.vs)
    assert [name.startswith("right_") for name in chain.leg.joint_names] == [True] * 6
    assert G1_FIXED.lower[chain.qs].tolist() == chain.leg.lower.tolist()
    assert G1_FIXED.velocity_limit[chain.vs].tolist() == chain.leg.velocity_limit.tolist()
    q, v, a = np.random.default_rng(0).normal(0, 0.3, (3, 6))
    whole_q, whole_v = chain.robot_state(G1_FIXED, q, v)
    whole, alone = G1_FIXED.posture(whole_q), chain.leg.posture(q)
    rounding = closed_form(whole.condition)
    agrees(alone.contact_point, whole.contact_point, rounding)
    agrees(alone.jacobian @ v, whole.jacobian @ whole_v, rounding)
    agrees(alone.delassus(), whole.delassus(), rounding)
    whole_a = chain.robot_state(G1_FIXED, q, a)[1]
    torques, whole_torques = (
        pin.rnea(leg.model, leg.model.createData(), *state)
        for leg, state in ((chain.leg, (q, v, a)), (G1_FIXED, (whole_q, whole_v, whole_a)))
    )
    agrees(torques, whole_torques[chain.vs], rounding)


def test_joints_that_are_taken_out_may_be_elsewhere():
    others = {"left_elbow_joint": 0.4, "left_hip_roll_joint": 0.2}
    chain = module.kicking_chain(G1_FIXED, others=others).leg
    whole = G1_FIXED.configuration(others)
    for frame in ("left_ankle_roll_link", "left_rubber_hand"):
        places = []
        for leg, q in ((chain, chain.configuration()), (G1_FIXED, whole)):
            model, data = leg.model, leg.model.createData()
            pin.framesForwardKinematics(model, data, q)
            places.append(data.oMf[model.getFrameId(frame)].homogeneous)
        np.testing.assert_allclose(*places, atol=closed_form(10), err_msg=frame)


def add_body(model, parent, joint, name):
    number = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    body = pin.Inertia(1.0, np.array([0, 0, -0.1]), 0.01 * np.eye(3))
    model.appendBodyToJoint(number, body, pin.SE3.Identity())


def test_branches_are_kept_where_an_impact_moves_them():
    model = kd.Leg.human().model
    add_body(model, 1, pin.JointModelRY(), "pendulum on the thigh")
    add_body(model, 0, pin.JointModelSpherical(), "arm on the base")
    robot = kd.Leg.from_model(model, "toe")
    without, with_branch = (module.kicking_chain(robot, branches=b) for b in (False, True))
    assert without.leg.joint_names == ("hip", "knee", "ankle")
    assert with_branch.leg.joint_names == ("hip", "knee", "ankle", "pendulum on the thigh")
    n, q = (1.0, 0.0, 0.0), np.array([0.0, 0.3, 0.0, 0.0])
    whole = robot.posture(with_branch.robot_state(robot, q, np.zeros(4))[0]).effective_mass(n)
    assert with_branch.leg.posture(q).effective_mass(n) == pytest.approx(whole)
    assert without.leg.posture(q[:3]).effective_mass(n) > whole + 1e-3


def test_continuous_joints_by_angles_are_the_same_robot():
    robot = floating_leg(np.random.default_rng(3)).with_armature({"hip": 0.2})
    angles = module.with_angles(robot)
    assert (robot.nq, angles.nq, angles.nv) == (9 + 1, 9, robot.nv)
    q = [0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8, 2.0, -0.4]
    one, other = robot.posture(q), angles.posture(q)
    for name in ("contact_point", "jacobian", "inertia"):
        agrees(getattr(other, name), getattr(one, name), closed_form())
    assert angles.joint_range("hip") == (-math.pi, math.pi)
    assert angles.velocity_limit.tolist() == robot.velocity_limit.tolist()
    assert module.with_angles(G1_FIXED) is G1_FIXED


def test_joints_outside_the_chain_rest_at_the_nearest_value_in_their_range():
    model = kd.Leg.human().model
    for parent, kind, name in (
        (0, pin.JointModelRY(), "elbow"), (4, pin.JointModelRY(), "wrist"),
        (5, pin.JointModelRUBY(), "spinner"), (6, pin.JointModelSpherical(), "ball"),
        (0, pin.JointModelRY(), "arm"),
    ):  # fmt: skip
        add_body(model, parent, kind, name)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    lower[3:5], upper[3:5] = (0.25, -2.0), (1.5, -0.5)
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.addFrame(pin.Frame("hand", 8, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    robot = kd.Leg.from_model(model, "hand")
    rest = module.rest_configuration(robot)
    assert rest.tolist() == [0, 0, 0, 0.25, -0.5, 1, 0, 0, 0, 0, 1, 0]
    q, v = module.kicking_chain(robot).robot_state(robot, np.array([0.5]), np.array([2.0]))
    assert q.tolist() == [*rest[:-1], 0.5]
    assert v.tolist() == [*np.zeros(robot.nv - 1), 2.0]


def test_a_floating_base_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"'root_joint' .* base must be fixed"):
        module.kicking_chain(kd.Leg.from_robot("g1", base="floating"))


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
    normals, offsets = module.sole_edges(standing)  # n x <= offset inside
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
    turned = module._sole(padded, kd.Support("pad"), pad, place.rotation)
    sole = module._sole(robot, kd.Support("left"), robot.model.getFrameId("left"), np.eye(3))
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
    normals, areas = module._faces(robot, pad)
    along = np.abs(normals @ place.rotation.T)
    agrees(along.max(axis=1), np.ones(len(along)), closed_form(10))
    axes = along.argmax(axis=1)
    assert set(axes) == {0, 1, 2}
    agrees(areas, np.prod(sizes) / sizes[axes], closed_form(10))
    tilted = np.column_stack([np.sin(degrees), np.zeros(3), -np.cos(degrees)])
    level = module._levelled(np.eye(3), tilted, np.array([1.0, 2.0, 3.0]))
    agrees(level @ tilted[1], [0.0, 0.0, -1.0], closed_form())


def test_a_supported_foot_stays_while_the_joints_move():
    robot = StandingRobot(G1.with_supports(FOOT)).robot
    posture = robot.posture(robot.configuration())
    bent = robot.configuration({"left_knee_joint": 0.7, "right_hip_pitch_joint": -1.0})
    bent[:7] = 0.3, -0.2, 0.5, 0.0, 0.6, 0.0, 0.8  # wherever its base is
    held, data, feet = module.hold_support(posture, bent), robot.model.createData(), []
    for q in (posture.q, held):
        pin.framesForwardKinematics(robot.model, data, q)
        feet.append(data.oMf[robot.model.getFrameId(FOOT)].homogeneous)
    np.testing.assert_allclose(feet[1], feet[0], atol=closed_form(10))
    assert held[7:].tolist() == bent[7:].tolist()
    assert module.hold_support(G1.posture(G1.configuration()), bent) is bent


def test_mimic_joints_of_neither_leg_are_locked_at_rest(leg_with_arm):
    leg = module.lock_idle_mimics(kd.Leg.from_urdf(leg_with_arm))
    assert (leg.joint_names, leg.mimics) == (("hip", "knee", "ankle"), ())
    busy = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    assert module.lock_idle_mimics(busy).mimics == busy.mimics
    leg_with_arm.write_text(leg_with_arm.read_text().replace('lower="-1"', 'lower="0.2"'))
    arm = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    assert arm.joint_values(module.rest_configuration(arm))["elbow"] == pytest.approx(0.2 + 0.3)


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
