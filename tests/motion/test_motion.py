"""A motion of splines by Pinocchio alone, and its files, read back by readers of others."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from planned_motions import by_hand
from tolerances import EPSILON, agrees, closed_form, differenced

from kickdyn.motion.motion import SETTLING, settling
from kickdyn.simulators.mujoco_kick import COMPILER, write_bodies

SOLE = "left_ankle_roll_link"


def test_a_motion_of_a_fixed_leg_is_its_splines_and_its_inverse_dynamics(swinging):
    leg, t = swinging.robot, -0.2
    q, v, a = (swinging.before(t, order) for order in range(3))
    agrees(swinging.q(t), q, closed_form())
    agrees(swinging.v(t), v, closed_form())
    agrees(swinging.torque(t), pin.rnea(leg.model, leg.model.createData(), q, v, a), closed_form())
    assert not swinging.ground_wrench(t).any()
    assert (swinging.begin, swinging.end) == (-0.53, 0.61)
    assert [phase[1:] for phase in swinging.phases] == [(-0.53, 0.0), (0.0, 0.61)]
    # the impact is a jump of the velocity alone
    agrees(swinging.q(0.0), swinging.q(1e-12), closed_form(1e4))
    agrees(swinging.v(0.0), swinging.before(0.0, 1), closed_form())
    agrees(swinging.v_after, swinging.after(0.0, 1), closed_form())
    assert np.abs(swinging.v_after - swinging.v(0.0)).max() > 0.1


def test_a_robot_is_at_rest_before_and_after(walking):
    for t, end in ((-2.0, walking.begin), (2.0, walking.end)):
        agrees(walking.q(t), walking.q(end), closed_form())
        assert not walking.v(t).any()
        mass = pin.computeTotalMass(walking.robot.model)
        assert walking.ground_wrench(t)[2] == pytest.approx(9.81 * mass, rel=closed_form(10))


def test_joints_that_the_impact_pushed_return_to_rest():
    """The derivatives of the polynomial by differences, and its ends."""
    h = 1e-5
    for t in (0.1, 0.3, 0.55):
        low, middle, high = settling(np.array([t - h, t, t + h])).T
        agrees(middle[1:], ((high - low) / (2 * h))[:2], 10 * differenced())
    assert settling(np.array([0.0]))[:, 0] == pytest.approx([0, 1, 0], abs=closed_form(10))
    for t in (SETTLING, 2 * SETTLING):
        assert settling(np.array([t]))[:, 0] == pytest.approx([0, 0, 0], abs=closed_form(10))


def test_a_pushed_joint_moves_after_the_impact_only(make_motion, walking):
    robot, joints = walking.robot, walking.joints
    name = "left_shoulder_pitch_joint"
    others = tuple(joint for joint in joints if joint != name)
    motion = make_motion(robot, others, walking.placement, aside={name: 0.2}, pushed={name: 3.0})
    column, h = robot.velocity_index(name), 1e-6
    assert motion.v(0.0)[column] == 0.0
    assert motion.v_after[column] == pytest.approx(3.0)
    for t in (-0.2, 0.1, 0.3):
        rate = (motion.q(t + h)[column + 1] - motion.q(t - h)[column + 1]) / (2 * h)
        assert motion.v(t)[column] == pytest.approx(rate, abs=differenced())
    assert [motion.q(t)[column + 1] for t in (-0.2, 0.6)] == pytest.approx([0.2, 0.2])


@pytest.mark.parametrize("t", [-0.31, -0.07, 0.26])
def test_the_supporting_foot_stays_and_the_ground_closes_the_momentum(walking, t):
    model, q, v = walking.robot.model, walking.q(t), walking.v(t)
    data, frame = model.createData(), model.getFrameId(SOLE)
    pin.forwardKinematics(model, data, q, v)
    pose = pin.updateFramePlacement(model, data, frame)
    assert np.abs(pose.homogeneous - walking.placement.homogeneous).max() < closed_form(10)
    assert np.abs(pin.getFrameVelocity(model, data, frame).vector).max() < closed_form(10)
    torque = walking.torque(t)
    assert not torque[:6].any()
    h = 1e-6
    a = (walking.v(t + h) - walking.v(t - h)) / (2 * h)
    rate = pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a).vector
    weight = pin.computeTotalMass(model) * model.gravity.linear
    force, moment = np.split(walking.ground_wrench(t), 2)
    alone, other = walking.foot_wrenches(t)
    assert (alone.tolist(), other.any()) == (walking.ground_wrench(t).tolist(), False)
    supplied = np.concatenate([weight + force, moment - np.cross(data.com[0], force)])
    agrees(supplied, rate, differenced(1))
    local = walking.placement.actInv(pin.Force(walking.ground_wrench(t))).vector
    rows = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
    agrees(torque + rows.T @ local, pin.rnea(model, data, q, v, a), differenced(1))


def test_the_plot_has_shares_of_the_limits_and_margins_in_millimetres(make_motion, swinging):
    leg, joints, h = swinging.robot, swinging.joints, "height [m]"
    margins = SimpleNamespace(joints=joints, margins=lambda q, v, a: {h: 0.1 + a[0] / 99, "a": 0})
    motion = make_motion(leg, joints, limits=margins)
    torques, speeds, lengths = motion.plot().axes
    for axes, values, size, names in (
        (torques, motion.torque, 0.01 * leg.effort_limit, joints),
        (speeds, motion.v, 0.01 * leg.velocity_limit, joints),
        (lengths, lambda t: np.array([motion.margins(t)[h]]), 1e-3, ["height"]),
    ):
        *lines, _ = axes.lines
        assert len(lines) == (1 if axes is lengths else 2 * len(joints))
        for number, line in enumerate(lines):
            t, shown = line.get_data()
            right = [(values(x) / size)[number % len(names)] for x in t[::20]]
            agrees(shown[::20], right, closed_form(10))
            assert number >= len(names) or axes is speeds or line.get_label() == names[number]
    assert ("%" in torques.get_ylabel(), "%" in speeds.get_ylabel()) == (True, True)
    assert "[mm]" in lengths.get_ylabel()


READ = 1e-12  # rounding of numbers in 17 digits


def test_a_csv_has_root_and_joints_in_the_order_of_the_model(walking, tmp_path):
    walking.save(tmp_path / "kick.csv", rate=50)
    table = np.loadtxt(tmp_path / "kick.csv", delimiter=",")
    t = np.arange(-27, 32) / 50  # the rate's multiples around begin and end
    q = np.array([walking.q(time) for time in t])
    assert table.shape == q.shape == (59, 7 + walking.robot.nv - 6)
    agrees(table[:, :3], q[:, :3], READ)
    agrees(table[:, 7:], q[:, 7:], READ)
    for row, right in zip(table, q, strict=True):
        apart = pin.Quaternion(row[3:7]).angularDistance(pin.Quaternion(right[3:7]))
        assert apart < 10 * EPSILON**0.5  # of an arc cosine
    assert (np.sum(table[1:, 3:7] * table[:-1, 3:7], axis=1) > 0.9).all()


def test_an_npz_has_named_arrays(walking, tmp_path):
    walking.save(tmp_path / "kick.NPZ")
    with np.load(tmp_path / "kick.NPZ") as read:
        assert read["joint_names"].tolist() == list(walking.robot.joint_names[1:])
        assert read["fps"] == walking.samples().rate == 100
        for k in range(0, len(read["time"]), 20):
            t = read["time"][k]
            agrees(read["joint_pos"][k], walking.q(t)[7:], READ)
            agrees(read["joint_vel"][k], walking.v(t)[6:], READ)
            agrees(read["joint_torque"][k], walking.torque(t)[6:], READ)
            agrees(read["ground_wrench"][k], walking.ground_wrench(t), READ)
            agrees(read["root_pos"][k], walking.q(t)[:3], READ)


def test_a_yaml_is_a_trajectory_of_ros_from_its_begin_on(walking, tmp_path):
    yaml = pytest.importorskip("yaml")
    walking.save(tmp_path / "kick.yaml", rate=50)
    read = yaml.safe_load((tmp_path / "kick.yaml").read_text("utf-8"))
    assert read["joint_names"] == list(walking.robot.joint_names[1:])
    assert len(read["points"]) == 59
    for k, point in enumerate(read["points"]):
        t, since = (k - 27) / 50, point["time_from_start"]
        assert since["sec"] + 1e-9 * since["nanosec"] == pytest.approx(k / 50, abs=1e-9)
        assert 0 <= since["nanosec"] < 1e9
        agrees(point["positions"], walking.q(t)[7:], READ)
        agrees(point["velocities"], walking.v(t)[6:], READ)
        agrees(point["effort"], walking.torque(t)[6:], READ)
    by_hand().motion.save(tmp_path / "fixed.yaml", rate=50)  # of a leg on a fixed base
    for point in yaml.safe_load((tmp_path / "fixed.yaml").read_text("utf-8"))["points"]:
        assert len(point["velocities"]) == len(point["effort"]) == 3


def test_keyframes_put_mujocos_bodies_where_pinocchio_has_them(walking, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    walking.save(tmp_path / "kick.xml", rate=50)
    model = walking.robot.model
    bodies = f"<worldbody>{write_bodies(model, {})}</worldbody>"
    text = f'<mujoco>{COMPILER}{bodies}<include file="kick.xml"/></mujoco>'
    (tmp_path / "robot.xml").write_text(text, "utf-8")
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    state, data = mujoco.MjData(compiled), model.createData()
    for key in range(0, compiled.nkey, 14):
        mujoco.mj_resetDataKeyframe(compiled, state, key)
        mujoco.mj_forward(compiled, state)
        t = (key - 27) / 50
        assert state.time == pytest.approx(t, abs=closed_form(10))
        pin.forwardKinematics(model, data, walking.q(t), walking.v(t))
        for number in range(1, model.njoints):
            body, velocity = compiled.body(model.names[number]).id, np.zeros(6)
            mujoco.mj_objectVelocity(compiled, state, 2, body, velocity, 0)  # mjOBJ_XBODY
            rotation, right = data.oMi[number].rotation, data.v[number]
            agrees(state.xpos[body], data.oMi[number].translation, closed_form(1e4))
            assert velocity[:3] == pytest.approx(rotation @ right.angular, abs=closed_form(1e5))
            assert velocity[3:] == pytest.approx(rotation @ right.linear, abs=closed_form(1e5))
