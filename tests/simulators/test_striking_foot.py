"""The robot's own foot strikes the ball in MuJoCo: which shapes it has, and how the ball leaves."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from chains import shapes
from planned_motions import HUMAN, by_hand
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.core.mechanics import rotation_between
from kickdyn.robot.robot_file import Shape, Visual
from kickdyn.robot.standing import missing_shapes
from kickdyn.simulators.mujoco_field import MujocoField

mujoco = pytest.importorskip("mujoco")
OFF = math.radians(14)


def wearing(touching, drawn=(), plan=None):
    """Return the kick by hand of a leg with these shapes."""
    plan, file = plan or by_hand(), shapes(touching, drawn)
    motion = replace(plan.motion, robot=replace(HUMAN, file=file))
    return replace(plan, motion=motion)


def place(offset=(0.0, 0.0, 0.0), turn=None):
    """Return a pose at the contact point, z along the contact normal, in the foot's axes."""
    impact = by_hand().impact
    posture, pose = impact.posture, np.eye(4)
    normal = posture.rotation_world_joint.T @ impact.contact.normal
    face = rotation_between(np.array([0.0, 0.0, 1.0]), normal)
    pose[:3, :3] = face if turn is None else face @ turn
    pose[:3, 3] = posture.contact_lever + face @ np.asarray(offset)
    return pose


def shape(kind, size, **where):
    return Visual("foot", place(**where), kind, size)


def box():
    """Return a box whose front is where the plate is."""
    return shape(Shape.BOX, (0.1, 0.1, 0.06), offset=(0.0, 0.0, -0.03))


@pytest.fixture(scope="module")
def struck():
    return kd.run_in_mujoco(by_hand(), foot="plate")


def test_a_box_with_the_front_of_the_plate_strikes_as_the_plate_does(struck):
    own = kd.run_in_mujoco(wearing([box()]), tuning=struck.tuning)
    agrees(own.ball_after.velocity, struck.ball_after.velocity, closed_form(1e7))
    assert (own.foot, own.doubts, struck.foot) == ("shapes", (), "plate")
    seen, flat = wearing([box()]).sensitivity_to_ball, wearing([]).sensitivity_to_ball
    agrees([*seen.along, *seen.across], [*flat.along, *flat.across], optimized(1e-6))
    asked = kd.run_in_mujoco(wearing([box()]), tuning=struck.tuning, foot="plate")
    assert (asked.foot, asked.warnings) == ("plate", struck.warnings)
    # 38 mm are the distance of (0, 0, 0.11) from (0.03, 0, -0.04) without both radii
    below = [shape(Shape.SPHERE, (0.005,), offset=(x, 0.0, -0.04)) for x in (-0.03, 0.03)]
    for touching, reason in ((below, "for contacts 38 mm from the ball"), ([], "has no shapes")):
        drawn = kd.run_in_mujoco(wearing(touching, [box()]), tuning=struck.tuning)
        agrees(drawn.ball_after.velocity, struck.ball_after.velocity, closed_form(1e7))
        (line,) = drawn.doubts
        assert re.search(reason, line)
        assert "those that are drawn" in line


def test_a_foot_without_known_shapes_strikes_with_a_plate_and_says_so(struck):
    lost = Visual("foot", np.eye(4), Shape.MESH, (1.0,), "lost.stl")
    unknown = replace(by_hand().motion, robot=replace(HUMAN, file=None))
    for plan, reason in (
        (replace(by_hand(), motion=unknown), "leg_human has no shapes"),
        (wearing([]), "the foot of leg_human has no shapes"),
        (wearing([lost]), r"the shape of foot is not known .*lost\.stl"),
    ):
        run = kd.run_in_mujoco(plan, tuning=struck.tuning)
        assert run.foot == "plate"
        assert run.ball_after.velocity.tolist() == struck.ball_after.velocity.tolist()
        assert re.match(f"{reason}.*: a plate at the contact point", run.doubts[0])
    run = kd.run_in_mujoco(wearing([box(), lost]), tuning=struck.tuning)
    assert (run.foot, len(run.doubts)) == ("shapes", 1)
    assert run.doubts[0].endswith("others are used")
    with pytest.raises(kd.InvalidInput, match=r"foot is 'boot'.* shapes, plate"):
        kd.run_in_mujoco(by_hand(), foot="boot")


def test_shapes_that_begin_in_the_ball_or_in_the_ground_are_named(struck):
    plan = by_hand()
    model, data, ball = HUMAN.model, HUMAN.model.createData(), plan.impact.ball_before.position
    pin.forwardKinematics(model, data, plan.motion.q(plan.motion.begin))
    pose = np.eye(4)
    pose[:3, 3] = data.oMi[HUMAN.contact_joint].actInv(ball)
    knob = Visual("foot", pose, Shape.SPHERE, (0.01,))
    run = kd.run_in_mujoco(wearing([box(), knob]), tuning=struck.tuning)
    assert (run.foot, len(run.doubts)) == ("plate", 1)
    assert run.doubts[0].startswith("the shape of foot begins 120 mm inside the ball: a plate")
    agrees(run.ball_after.velocity, struck.ball_after.velocity, closed_form(1e7))
    held = object.__new__(MujocoField)
    for hip, buried in ((math.pi, False), (0.0, True)):  # above the hip at z = 0, or below it
        held.warnings, q = [], np.array([hip, 0.0, 0.0])
        held.motion = SimpleNamespace(robot=HUMAN, begin=0.0, q=lambda _, q=q: q)
        spheres = held._foot_on_floor()
        assert (len(spheres.radii) == 0, len(held.warnings)) == (buried, int(buried))
    assert "under the ground: the floor does not hold it up" in held.warnings[0]


def wedge():
    """Return points of a body whose front is inclined to the normal of the contact."""
    turn = pin.rpy.rpyToMatrix(0.6 * OFF, OFF, 0.0)
    corners = np.array(
        [[x, y, z] for x in (-0.07, 0.06) for y in (-0.05, 0.08) for z in (-0.04, 0)]
    )
    return corners @ turn.T


def own_launch(plan, tuning, points):
    """Return the ball's velocity by a model that MuJoCo makes of the leg's URDF, as a user does."""
    robot, impact, ball = HUMAN, plan.impact, plan.impact.ball
    spec = mujoco.MjSpec.from_string(HUMAN.file.text)
    spec.compiler.discardvisual = True
    pose = place()
    spec.add_mesh(name="wedge", uservert=(points @ pose[:3, :3].T + pose[:3, 3]).ravel())
    kinds, size = mujoco.mjtGeom, [ball.radius - tuning.margin, 0, 0]
    spec.body("foot").add_geom(name="wedge", type=kinds.mjGEOM_MESH, meshname="wedge", mass=0.0)
    body = spec.worldbody.add_body(name="ball", pos=impact.ball_before.position)
    body.add_freejoint()
    body.add_geom(name="ball", type=kinds.mjGEOM_SPHERE, size=size)
    body.ipos, body.explicitinertial = np.zeros(3), True
    body.mass, body.inertia = ball.mass, [ball.inertia] * 3
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    spec.add_pair(
        geomname1="wedge", geomname2="ball", condim=tuning.condim, margin=tuning.margin,
        solref=tuning.solref, solimp=tuning.solimp, solreffriction=tuning.solreffriction,
        friction=[tuning.friction, tuning.friction, 0, 0, 0],
    )  # fmt: skip
    motion, limit = plan.motion, robot.effort_limit
    stiffness = 8.0 * limit
    damping = 0.6 * np.sqrt(stiffness * robot.posture(motion.q(0.0)).inertia.diagonal())
    for name, most, k, d in zip(robot.joint_names, limit, stiffness, damping, strict=True):
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.biastype, drive.gainprm[0] = mujoco.mjtBias.mjBIAS_AFFINE, k
        drive.biasprm[1:3] = -k, -d
        drive.forcelimited, drive.forcerange = True, [-most, most]
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 100
    spec.option.timestep = step = tuning.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    model.dof_armature[:3] = robot.model.armature
    data = mujoco.MjData(model)
    data.qpos[:3], touched, number = motion.q(motion.begin), False, round(motion.begin / step)
    while True:
        if not touched:
            data.qpos[3:6], data.qvel[3:] = impact.ball_before.position, 0.0
        t = min(number * step, -1e-9)  # the motion waits for the ball to leave
        data.ctrl[:] = motion.q(t) + (damping * motion.v(t) + motion.torque(t)) / stiffness
        mujoco.mj_step(model, data)
        number += 1
        pushed = data.ncon and data.efc_force[data.contact.efc_address[0]] > 0.0
        if touched and not pushed:
            return data.qvel[3:6].copy()
        touched = touched or pushed
        assert number * step < 0.1


def test_an_own_model_of_the_foot_gives_the_same_launch(struck):
    points = wedge()
    shaped = replace(shape(Shape.MESH, (1.0,)), vertices=points, faces=np.array([[0, 1, 2]]))
    run = kd.run_in_mujoco(wearing([shaped]), tuning=struck.tuning)
    simulated, own = run.ball_after.velocity, own_launch(by_hand(), struck.tuning, points)
    assert np.linalg.norm(simulated) == pytest.approx(np.linalg.norm(own), rel=0.01)

    def angle(a, b):
        return math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), a @ b))

    assert angle(simulated, own) < 1.0
    assert angle(simulated, struck.ball_after.velocity) > 5.0  # unlike the plate
    assert any("16 deg off the planned one" in line for line in run.doubts)


def test_the_motion_goes_on_to_its_impact_where_the_ball_leaves_before(struck):
    """A ball 35 cm nearer to the foot than planned."""
    plan, nearer = by_hand(), -0.35 * by_hand().aim.ahead[:2]
    run = kd.run_in_mujoco(wearing([box()]), tuning=struck.tuning, ball_displacement=nearer)
    agrees(run.ball_position[0] - plan.impact.ball_before.position, [*nearer, 0], closed_form(1e4))
    assert run.ball_after.time < -0.01
    later = (run.t > run.ball_after.time) & (run.t < 0.0)
    for t, q in zip(run.t[later], run.q[later], strict=True):
        assert q == pytest.approx(plan.motion.q(t), abs=0.1)


def test_shapes_of_the_kicking_limb_that_cannot_be_read_are_named():
    robot = kd.Leg.from_robot("g1", base="floating")
    names = ["pelvis", "left_ankle_roll_link", "right_ankle_roll_link"]
    lost = [Visual(name, np.eye(4), Shape.MESH, mesh="lost.stl") for name in names]
    (line,) = missing_shapes(replace(robot, file=shapes(drawn=lost)), kd.Support(names[1]))
    assert [name in line for name in names] == [False, False, True]
    assert "lost.stl" in line
