"""Files of a motion, read back by readers of others."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import EPSILON, agrees, closed_form

from kickdyn.simulators.mujoco_kick import COMPILER, write_bodies

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
