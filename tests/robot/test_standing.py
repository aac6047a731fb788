"""The robot with its foot as the root is the same robot: kinematics, inertia, mass."""

import re

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia, random_rotation
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.robot.catalog import robots_folder
from kickdyn.robot.standing import (
    StandingRobot,
    hold_support,
    joint_spheres,
    lock_idle_mimics,
    missing_shapes,
)

FOOT = "left_ankle_roll_link"
G1 = kd.Leg.from_robot("g1", base="floating", legs_only=True)
CORNERS = [(-0.1, -0.05, 0.0), (-0.1, 0.05, 0.0), (0.1, 0.05, 0.0), (0.1, -0.05, 0.0)]


def test_mimic_joints_of_neither_leg_are_locked_at_rest(leg_with_arm):
    leg = lock_idle_mimics(kd.Leg.from_urdf(leg_with_arm))
    assert (leg.joint_names, leg.mimics) == (("hip", "knee", "ankle"), ())
    busy = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    assert lock_idle_mimics(busy).mimics == busy.mimics


def random_robot(rng):
    """A floating base with a random tree of joints on it, one branch to a foot, one to a toe."""
    model = pin.Model()
    model.name = "tree"
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    kinds = pin.JointModelRX, pin.JointModelPZ, pin.JointModelRUBY
    ends, first = {}, 2
    for end in ("foot", "spur", "toe", "arm"):
        # legs hang on the base, a spur and an arm somewhere on the leg before
        parent = 1 if end in ("foot", "toe") else int(rng.choice([1, *range(first, model.njoints)]))
        first = model.njoints
        for k in range(rng.integers(1, 5)):
            axis = rng.normal(size=3)
            kind = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
            if rng.random() < 0.3:
                kind = kinds[rng.integers(3)]()
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
    model.armature = armature
    leg = kd.Leg.from_model(model, "toe")
    return leg.with_supports(kd.Support("foot", sole=CORNERS))


@given(st.integers(0, 10**6))
def test_the_rooted_robot_moves_and_weighs_as_the_robot_on_its_support(seed):
    rng = np.random.default_rng(seed)
    standing = StandingRobot(random_robot(rng))
    leg, robot = standing.leg, standing.robot
    assert sorted(leg.joint_names) == sorted(robot.joint_names[1:])
    q = pin.integrate(leg.model, leg.configuration(), rng.uniform(-1, 1, size=leg.nv))
    v = rng.normal(size=leg.nv)
    whole_q, whole_v = standing.robot_state(q, v)
    here, there = leg.posture(q), robot.posture(whole_q)
    assert np.abs(there.constraint_projector.rows @ whole_v).max() < 1e-11 * np.abs(whole_v).max()
    assert here.contact_point == pytest.approx(there.contact_point, abs=1e-12)
    assert here.jacobian @ v == pytest.approx(there.jacobian @ whole_v, abs=1e-11)
    energy = 0.5 * v @ here.inertia @ v
    assert energy == pytest.approx(0.5 * whole_v @ there.inertia @ whole_v, rel=1e-10)
    size = np.abs(here.delassus()).max()
    assert here.delassus() == pytest.approx(there.delassus(), abs=1e-9 * size)
    for name in leg.joint_names:
        assert leg.joint_range(name) == robot.joint_range(name)
        at, to = leg.velocity_index(name), robot.velocity_index(name)
        assert v[at] == whole_v[to]
        assert leg.joint_values(q)[name] == pytest.approx(robot.joint_values(whole_q)[name])


@pytest.mark.parametrize("seed", range(3))
def test_with_joints_at_0_the_base_is_where_it_is_without_a_support(seed):
    standing = StandingRobot(random_robot(np.random.default_rng(seed)))
    q, _ = standing.robot_state(standing.leg.configuration(), np.zeros(standing.leg.nv))
    assert q[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.abs(q[3:7]) == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-12)


def test_the_sole_is_what_the_shapes_have_at_the_ground():
    standing = StandingRobot(G1.with_supports(FOOT))
    (support,) = standing.robot.constraints.supports
    assert np.ptp(support.sole[:, 2]) < 1e-6  # the foot's frame is level
    assert 0.15 < np.ptp(standing.sole[:, 0]) < 0.25
    assert 0.05 < np.ptp(standing.sole[:, 1]) < 0.1
    q, v = standing.robot_state(standing.leg.configuration(), np.zeros(standing.leg.nv))
    data = G1.model.createData()
    pin.framesForwardKinematics(G1.model, data, q)
    foot = data.oMf[G1.model.getFrameId(FOOT)]
    assert foot.isApprox(standing.placement)
    assert (support.sole @ foot.rotation.T + foot.translation)[:, 2] == pytest.approx(0.0, abs=1e-9)
    assert not v.any()


def test_the_sole_of_round_feet_is_cut_out_of_their_spheres(tmp_path):
    """Two spheres stand on the ground; the third one, 1 mm higher, reaches less far into it."""
    spheres = "".join(
        f'<visual><origin xyz="{x} {y} {z}"/><geometry><sphere radius="0.05"/></geometry></visual>'
        for x, y, z in ((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.1, 0.1, 0.001))
    )
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    parts = f'<link name="trunk">{body}</inertial></link>' + "".join(
        f'<link name="{side}">{body}</inertial>{spheres}</link><joint name="{side}_hip" '
        f'type="revolute"><parent link="trunk"/><child link="{side}"/><origin xyz="0 {y} -1"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for side, y in (("left", 0.3), ("right", -0.3))
    )
    (tmp_path / "biped.urdf").write_text(f'<robot name="biped">{parts}</robot>')
    biped = kd.Leg.from_urdf(tmp_path / "biped.urdf", "right", base="floating")
    sole = StandingRobot(biped.with_supports("left")).sole
    low, high = (np.sqrt(2 * 0.05 * depth - depth**2) for depth in (2e-3, 1e-3))
    assert sole[:, 0].min() == pytest.approx(-low, rel=1e-9)
    assert sole[:, 0].max() == pytest.approx(0.2 + low, rel=1e-9)
    assert sole[:, 1].max() == pytest.approx(0.3 + 0.1 + high, rel=1e-9)


TILT = 0.26  # about y, toes up


@pytest.mark.parametrize(
    "sole", [None, [(-0.1, -0.04, -0.06), (0.1, -0.04, -0.06), (0, 0.04, -0.06)]]
)
def test_a_foot_that_is_tilted_with_joints_at_0_is_turned_level(tmp_path, sole):
    """Each foot is a box, turned about y, 0.06 m below its ankle."""
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    box = (
        '<visual><origin xyz="0 0 -0.05"/><geometry><box size="0.2 0.08 0.02"/></geometry></visual>'
    )
    parts = f'<link name="trunk">{body}</inertial></link>' + "".join(
        f'<link name="{side}">{body}</inertial>{box}</link><joint name="{side}_hip" '
        f'type="revolute"><parent link="trunk"/><child link="{side}"/>'
        f'<origin xyz="0 {y} -1" rpy="0 {-TILT} 0"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for side, y in (("left", 0.3), ("right", -0.3))
    )
    (tmp_path / "biped.urdf").write_text(f'<robot name="biped">{parts}</robot>')
    biped = kd.Leg.from_urdf(tmp_path / "biped.urdf", "right", base="floating")
    standing = StandingRobot(biped.with_supports(kd.Support("left", sole=sole)))
    assert standing.placement.rotation == pytest.approx(np.eye(3), abs=1e-6)
    assert standing.placement.translation == pytest.approx([0, 0.3, 0.06], abs=1e-6)
    assert np.ptp(standing.sole, axis=0) == pytest.approx([0.2, 0.08], abs=1e-6)
    leg, q = standing.leg, standing.leg.configuration({"left_hip": 0.4})
    pin.forwardKinematics(leg.model, data := leg.model.createData(), q)
    base = pin.Quaternion(standing.robot_state(q, np.zeros(leg.nv))[0][3:7]).toRotationMatrix()
    trunk = data.oMi[leg.model.getJointId(standing.trunk_joint)].rotation
    assert trunk @ standing.trunk_axis == pytest.approx(base[:, 2], abs=1e-6)
    assert np.ptp(standing.kicking_foot().sole, axis=0) == pytest.approx([0.2, 0.08], abs=1e-6)


def without_meshes(folder, *, collisions):
    """Return G1 from a copy of its file that is far from its meshes."""
    text = (robots_folder() / "g1_description/urdf/g1_29dof_rev_1_0.urdf").read_text()
    if not collisions:
        text = re.sub("<collision.*?</collision>", "", text, flags=re.DOTALL)
    (folder / "g1.urdf").write_text(text)
    return kd.Leg.from_urdf(folder / "g1.urdf", "right_ankle_roll_link", base="floating")


def test_collision_shapes_are_used_where_a_mesh_is_missing(tmp_path):
    leg = without_meshes(tmp_path, collisions=True)
    standing = StandingRobot(leg.with_supports(FOOT))
    drawn = StandingRobot(G1.with_supports(FOOT))
    assert np.ptp(standing.sole, axis=0) == pytest.approx(np.ptp(drawn.sole, axis=0), abs=0.04)
    foot = joint_spheres(leg, leg.contact_joint)
    assert float((foot.centres[:, 2] - foot.radii).min()) == pytest.approx(-0.035)
    line, points = missing_shapes(leg, kd.Support(FOOT))  # one for all bodies without any shape
    assert line.startswith("the shape of right_ankle_roll_link is not known (mesh ")
    assert "--package-dir names the folder of meshes), neither are the shapes of right_" in points
    assert line.endswith("its other shapes are used instead")


def test_a_foot_without_any_shape_is_announced(tmp_path):
    leg = without_meshes(tmp_path, collisions=False)
    (line,) = [x for x in missing_shapes(leg, kd.Support(FOOT)) if "right_ankle_roll" in x]
    assert line.endswith("it is treated as a point and may reach lower than the plan says")
    with pytest.raises(kd.InvalidInput, match=r"no sole \(mesh .*--package-dir.*name its corners"):
        StandingRobot(leg.with_supports(FOOT))
    bare = kd.Leg.from_model(G1.model, "right_ankle_roll_link")
    assert missing_shapes(bare, kd.Support(FOOT)) == [
        "the kicking foot has no shape: right_ankle_roll_link is treated as a point, and the foot "
        "may be lower than the plan says"
    ]
    assert missing_shapes(G1, kd.Support(FOOT)) == []


def test_a_given_sole_is_kept():
    support = kd.Support(
        FOOT, friction=0.5, sole=[(-0.05, 0.02, -0.035), (-0.05, -0.02, -0.035), (0.1, 0.0, -0.035)]
    )
    standing = StandingRobot(G1.with_supports(support))
    assert standing.robot.constraints.supports == (support,)
    assert standing.placement.translation[2] == pytest.approx(0.035)


def test_limits_and_rotors_go_with_the_joints():
    robot = G1.with_armature({"left_knee_joint": 0.03, "right_knee_joint": 0.02})
    standing = StandingRobot(robot.with_supports(FOOT))
    for name in standing.leg.joint_names:
        at, to = standing.leg.velocity_index(name), robot.velocity_index(name)
        for limit in ("velocity_limit", "effort_limit"):
            assert getattr(standing.leg, limit)[at] == getattr(robot, limit)[to]
        assert standing.leg.model.armature[at] == robot.model.armature[to]


def test_a_supported_foot_stays_while_the_joints_move():
    robot = StandingRobot(G1.with_supports(FOOT)).robot
    posture = robot.posture(robot.configuration())
    moved = robot.configuration({"left_knee_joint": 0.7, "right_hip_pitch_joint": -1.0})
    held = hold_support(posture, moved)
    data = robot.model.createData()
    feet = []
    for q in (posture.q, held):
        pin.framesForwardKinematics(robot.model, data, q)
        feet.append(data.oMf[robot.model.getFrameId(FOOT)].copy())
    assert feet[0].isApprox(feet[1], 1e-12)
    assert held[7:].tolist() == moved[7:].tolist()
    free = G1.posture(G1.configuration())
    assert hold_support(free, moved) is moved


def spherical(model):
    number = model.getJointId("left_knee_joint")
    new = pin.Model()
    for joint in range(1, model.njoints):
        kind = pin.JointModelSpherical() if joint == number else model.joints[joint]
        parent, place = model.parents[joint], model.jointPlacements[joint]
        new.addJoint(parent, kind, place, model.names[joint])
        new.appendBodyToJoint(joint, model.inertias[joint], pin.SE3.Identity())
    for frame in model.frames:
        if frame.name in ("toe", FOOT):
            new.addFrame(pin.Frame(frame.name, frame.parentJoint, 0, frame.placement, frame.type))
    return new


BAD = {
    "no support": (G1, "does not stand"),
    "a point": (G1.with_supports(kd.Support(FOOT, point=True)), "from one flat foot"),
    "a loop": (
        G1.with_supports(FOOT).with_loops(("left_knee_link", "pelvis")),
        "no loops",
    ),
    "a tilted sole": (
        G1.with_supports(kd.Support(FOOT, sole=[(0, 0, 0), (0.1, 0, 0.1), (0, 0.1, 0.0)])),
        "corners of the sole of left_ankle_roll_link are .* tilted by more than 30 degrees",
    ),
    "a bent sole": (
        G1.with_supports(kd.Support(FOOT, sole=[*CORNERS, (0.2, 0, 0.05)])),
        "corners of the sole of left_ankle_roll_link are not in a plane",
    ),
    "a knee of three angles": (
        kd.Leg.from_model(spherical(G1.model), "toe").with_supports(
            kd.Support(FOOT, sole=np.array(CORNERS))
        ),
        "must turn about or slide along one axis",
    ),
    "no shapes": (
        kd.Leg.from_model(G1.model, "toe").with_supports(FOOT),
        "have no sole: name its corners",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_robot_that_cannot_stand_is_refused(name):
    robot, message = BAD[name]
    with pytest.raises(kd.InvalidInput, match=message):
        StandingRobot(robot)
