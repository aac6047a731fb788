"""Launches of a motion against `kd.strike`, torques against Pinocchio, limits by hand."""

import numpy as np
import pinocchio as pin
import planned_motions
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.files import shipped
from kickdyn.motion.motion_record import record
from kickdyn.robot.standing import StandingRobot

BALL, CONTACT = kd.Ball(), kd.Contact(None, 0.7, 0.3)
BIPED = kd.Leg.from_urdf(shipped("urdf") / "biped.urdf", "right_foot", base="floating")
BIPED = BIPED.with_supports("left_foot")
COUNT, RATE = 30, 50.0
T = np.arange(COUNT) / RATE


def on_one_foot(**changes):
    """Return a motion of the biped whose left foot rests, while its right leg swings."""
    standing = StandingRobot(BIPED)
    leg, rows = standing.leg, []
    swing = {"right_hip_pitch": 0.4, "right_knee": 1.2, "right_ankle_pitch": -0.2}
    for time in T:
        wave = np.sin(3 * time)
        angles = {name: size * wave**2 for name, size in swing.items()} | {"left_hip_roll": 0.1}
        for name, (frame, value) in changes.items():
            angles[name] = value if frame == round(time * RATE) else angles.get(name, 0.0)
        rows.append(standing.robot_state(leg.configuration(angles), np.zeros(leg.nv))[0])
    rows = np.array(rows)
    return record(BIPED, RATE, T, rows)


@pytest.fixture(scope="module")
def swung():
    motion = on_one_foot()
    return motion, kd.check_motion(motion, BIPED, BALL, CONTACT, ground_friction=0.6)


def test_a_launch_is_that_of_strike_with_the_standing_foot_held(swung):
    motion, check = swung
    table, struck = check.launches, 0
    assert table.stands.all()
    for k in range(COUNT):
        row, posture = table.isel(frame=k), BIPED.posture(motion.q[k])
        v = posture.admissible(motion.v[k])
        foot, (x, y, z) = posture.point_velocity(v), posture.contact_point
        agrees(row.foot_velocity, foot, closed_form(100))
        assert float(row.contact_height) == pytest.approx(z)
        if not 0.0 < z < 2 * BALL.radius or np.hypot(*foot[:2]) < 1e-3:
            assert int(row.status) == 2
            continue
        rise = (BALL.radius - z) / BALL.radius
        level = np.cos(np.arcsin(rise)) / np.hypot(*foot[:2])
        normal = level * foot[0], level * foot[1], rise
        agrees(row.ball_position, [x, y, z] + BALL.radius * np.array(normal), closed_form(100))
        assert float(row.ball_position[2]) == pytest.approx(BALL.radius)  # it lies on the ground
        assert float(row.effective_mass) == pytest.approx(posture.effective_mass(normal))
        try:
            hit = kd.strike(posture, v, BALL, kd.Contact(normal, 0.7, 0.3))
        except kd.NoImpact:
            assert int(row.status) == 2
            continue
        struck += 1
        for name, right in (("ball_velocity", hit.ball_after.velocity),
                            ("ball_spin", hit.ball_after.spin),
                            ("joint_impulses", hit.joint_impulses)):  # fmt: skip
            agrees(row[name], right, closed_form(1e4))
        assert float(row.ball_speed) == pytest.approx(np.linalg.norm(hit.ball_after.velocity))
    assert struck > 5
    assert float(table.ball_speed[check.best]) == np.nanmax(table.ball_speed)


def test_torques_are_those_of_inverse_dynamics_with_the_ground_on_the_foot(swung):
    motion, check = swung
    model, data = BIPED.model, BIPED.model.createData()
    frame = model.getFrameId("left_foot")
    forces = check.forces
    np.testing.assert_array_equal(forces.stands[:, 0], np.ones(COUNT, bool))
    alone = np.flatnonzero(~forces.stands[:, 1])
    assert 10 < len(alone) < COUNT
    for k in alone:
        pin.framesForwardKinematics(model, data, motion.q[k])
        joint = int(model.frames[frame].parentJoint)
        outer = pin.StdVec_Force()
        outer.extend([pin.Force.Zero() for _ in range(model.njoints)])
        outer[joint] = data.oMi[joint].actInv(pin.Force(forces.wrench[k]))
        right = pin.rnea(model, data, motion.q[k], motion.v[k], motion.a[k], outer)
        agrees(forces.torque[k], right, closed_form(1e4))
        assert np.abs(right[:6]).max() < 1e-9  # the ground alone moves the base


def test_a_higher_ground_under_a_higher_robot_changes_nothing(swung):
    motion, check = swung
    q = motion.q + 0.3 * np.eye(BIPED.nq)[2]
    higher = record(BIPED, RATE, T, q)
    other = kd.check_motion(higher, BIPED, BALL, CONTACT, ground=0.3, ground_friction=0.6)
    agrees(other.forces.torque, check.forces.torque, closed_form(1e5))
    assert other.margins.keys() == check.margins.keys()
    for name, values in check.margins.items():
        agrees(np.nan_to_num(other.margins[name]), np.nan_to_num(values), closed_form(1e7))


def test_on_both_feet_the_wrenches_add_up():
    standing = StandingRobot(BIPED)
    q = standing.robot_state(standing.leg.configuration(), np.zeros(standing.leg.nv))[0]
    rows = np.tile(q, (COUNT, 1))
    motion = record(BIPED, RATE, T, rows)
    check = kd.check_motion(motion, BIPED, BALL)
    assert check.forces.stands.all()
    assert np.abs(check.forces.torque[:, :6]).max() < 1e-9
    weight = 9.81 * pin.computeTotalMass(BIPED.model)
    agrees(check.forces.wrench[:, 2], np.full(COUNT, weight), closed_form(100))
    assert check.broken == ()
    assert check.best is None


def test_a_frame_beyond_a_limit_is_named():
    motion = on_one_foot(right_ankle_roll=(17, 0.9))
    (broken,) = [limit for limit in kd.check_motion(motion, BIPED, BALL).broken
                 if limit.name == "range of right_ankle_roll"]  # fmt: skip
    assert (broken.frames, broken.unit) == (1, "rad")
    assert (broken.time, broken.amount) == pytest.approx((17 / RATE, 0.4))
    assert f"at {17 / RATE:.4g} s" in broken.sentence


def test_torque_speed_ground_and_bodies_are_named(swung):
    motion, check = swung
    weak = BIPED.with_drives({"right_knee": kd.Drive(0.0, torque_limit=1e-3, speed_limit=1e-3)})
    found = {x.name: x for x in kd.check_motion(motion, weak, BALL, ground=0.05).broken}
    column = BIPED.velocity_index("right_knee")
    for kind, values in (("torque", check.forces.torque), ("speed", motion.v)):
        share = np.abs(values[:, column]).max() / 1e-3
        assert found[f"{kind} of right_knee"].amount == pytest.approx(share - 1.0)
    assert found["left_foot is under the ground"].amount == pytest.approx(0.05, abs=1e-9)
    lifted = {x.name for x in kd.check_motion(motion, BIPED, BALL, ground=-0.05).broken}
    assert "the sole of the foot that stands is above the ground" in lifted
    smooth = {x.name for x in kd.check_motion(motion, BIPED, BALL, ground_friction=1e-4).broken}
    assert "friction under the supporting foot" in smooth


def test_without_a_known_foot_a_line_says_so(swung):
    check = kd.check_motion(swung[0], BIPED.with_supports(), BALL)
    assert any("no foot is known" in line for line in check.warnings)
    assert not check.launches.stands.any()


def test_a_motion_of_another_robot_is_refused(swung):
    for robot, options, words in (
        (kd.Leg.human(), {}, "motion is of biped with 18 degrees .* leg_human with 3"),
        (BIPED, {"ground_friction": -1.0}, "ground friction is -1"),
        (BIPED, {"ground": np.nan}, "ground is nan"),
    ):
        with pytest.raises(kd.InvalidInput, match=words):
            kd.check_motion(swung[0], robot, BALL, **options)


@pytest.mark.slow
def test_a_planned_motion_that_is_read_back_breaks_no_limit(tmp_path):
    """Of a leg, and of G1 on one foot, with its launch at the impact."""
    plan = planned_motions.swinging()
    plan.motion.save(tmp_path / "kick.csv", rate=500)
    begin = plan.motion.samples(500).t[0]
    motion = kd.read_motion(
        tmp_path / "kick.csv", planned_motions.HUMAN, rate=500, contact=-begin, window=5
    )
    check = kd.check_motion(motion, planned_motions.HUMAN, BALL)
    assert check.broken == ()
    plan = planned_motions.standing()
    plan.motion.save(tmp_path / "kick.npz", rate=500)
    robot = plan.motion.robot
    motion = kd.read_motion(tmp_path / "kick.npz", robot, window=5)
    check = kd.check_motion(motion, robot, BALL)
    assert check.broken == ()
    assert kd.check_motion(plan.motion, robot, BALL).broken == ()
    v = plan.motion.v(0.0)
    agrees(motion.v[motion.frame_at(0.0)], v, 1e-3)
