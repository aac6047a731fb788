"""Files of a motion, read back by readers of others."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.motion.motion import Motion
from kickdyn.robot.standing import StandingRobot
from kickdyn.simulators.mujoco_kick import COMPILER, write_bodies


def test_a_csv_has_root_and_joints_in_the_order_of_the_model(walking, tmp_path):
    walking.save(tmp_path / "kick.csv", rate=50)
    table = np.loadtxt(tmp_path / "kick.csv", delimiter=",")
    t = np.arange(-27, 32) / 50  # the rate's multiples around begin and end
    q = np.array([walking.q(time) for time in t])
    assert table.shape == q.shape == (59, 7 + walking.robot.nv - 6)
    np.testing.assert_allclose(table[:, :3], q[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(table[:, 7:], q[:, 7:], rtol=0, atol=1e-9)
    turned = [pin.Quaternion(row[3:7]).angularDistance(pin.Quaternion(true[3:7]))
              for row, true in zip(table, q, strict=True)]  # fmt: skip
    assert max(turned) < 1e-9
    assert (np.sum(table[1:, 3:7] * table[:-1, 3:7], axis=1) > 0.9).all()


def test_a_leg_on_a_fixed_base_has_joints_only(swinging, tmp_path):
    swinging.save(tmp_path / "kick.csv", rate=500)
    table = np.loadtxt(tmp_path / "kick.csv", delimiter=",")
    assert table.shape == (265 + 1 + 305, 3)
    np.testing.assert_allclose(table[265], swinging.q(0.0), rtol=0, atol=1e-9)


def test_an_npz_has_named_arrays(walking, tmp_path):
    walking.save(tmp_path / "kick.NPZ")
    with np.load(tmp_path / "kick.NPZ") as read:
        names = read["joint_names"].tolist()
        assert names == list(walking.robot.joint_names[1:])
        assert read["fps"] == 100
        for number, t in enumerate(read["time"]):
            np.testing.assert_allclose(read["joint_pos"][number], walking.q(t)[7:], atol=1e-9)
            np.testing.assert_allclose(read["joint_vel"][number], walking.v(t)[6:], atol=1e-9)
            np.testing.assert_allclose(read["joint_torque"][number], walking.torque(t)[6:])
            np.testing.assert_allclose(read["ground_wrench"][number], walking.ground_wrench(t))


def test_a_yaml_is_a_joint_trajectory_of_ros_2(walking, tmp_path):
    yaml = pytest.importorskip("yaml")
    walking.save(tmp_path / "kick.yaml", rate=200)
    read = yaml.safe_load((tmp_path / "kick.yaml").read_text("utf-8"))
    assert set(read) == {"header", "joint_names", "points"}  # as the message has them
    assert read["joint_names"] == list(walking.robot.joint_names[1:])
    for number, point in enumerate(read["points"]):
        time = point["time_from_start"]
        t = time["sec"] + 1e-9 * time["nanosec"]
        assert t == pytest.approx(number / 200, abs=1e-9)
        assert 0 <= time["nanosec"] < 10**9
        t = (number - 106) / 200
        np.testing.assert_allclose(point["positions"], walking.q(t)[7:], rtol=0, atol=1e-9)
        np.testing.assert_allclose(point["velocities"], walking.v(t)[6:], rtol=0, atol=1e-8)
        np.testing.assert_allclose(point["effort"], walking.torque(t)[6:], rtol=0, atol=1e-6)
    assert len(read["points"]) == 106 + 1 + 122


def test_small_numbers_are_numbers_in_yaml(swinging, tmp_path):
    yaml = pytest.importorskip("yaml")
    still = Motion(
        swinging.robot, swinging.joints, *2 * [BSpline([-1, -1, 1, 1], [[1e-5] * 3] * 2, 1)]
    )
    still.save(tmp_path / "kick.yaml")
    read = yaml.safe_load((tmp_path / "kick.yaml").read_text("utf-8"))
    assert read["points"][0]["positions"] == [1e-5] * 3


def test_keyframes_put_mujocos_bodies_where_pinocchio_has_them(walking, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    walking.save(tmp_path / "kick.xml", rate=50)
    model = walking.robot.model
    bodies = f"<worldbody>{write_bodies(model, {})}</worldbody>"
    (tmp_path / "robot.xml").write_text(
        f'<mujoco>{COMPILER}{bodies}<include file="kick.xml"/></mujoco>', "utf-8"
    )
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    state, data = mujoco.MjData(compiled), model.createData()
    assert compiled.nkey == 59
    for key in range(0, compiled.nkey, 7):
        mujoco.mj_resetDataKeyframe(compiled, state, key)
        mujoco.mj_forward(compiled, state)
        t = (key - 27) / 50
        assert state.time == pytest.approx(t, abs=1e-12)
        pin.forwardKinematics(model, data, walking.q(t), walking.v(t))
        for number in range(1, model.njoints):
            body = compiled.body(model.names[number]).id
            np.testing.assert_allclose(state.xpos[body], data.oMi[number].translation, atol=1e-9)
            moved = np.zeros(6)
            mujoco.mj_objectVelocity(compiled, state, 2, body, moved, 0)  # mjOBJ_XBODY
            rotation, velocity = data.oMi[number].rotation, data.v[number]
            np.testing.assert_allclose(moved[:3], rotation @ velocity.angular, rtol=0, atol=1e-8)
            np.testing.assert_allclose(moved[3:], rotation @ velocity.linear, rtol=0, atol=1e-8)


ROBOT = """<mujoco model="legs"><worldbody>
  <body name="ball" pos="2 0 0.1"><freejoint name="loose"/><geom size="0.1"/></body>
  <body name="trunk" pos="0 0 1"><freejoint name="base"/><geom size="0.2"/>
    <body name="right" pos="0 -0.1 -0.2">
      <joint name="r_hip" axis="0 1 0" range="-90 90"/><geom size="0.1"/>
      <body name="foot" pos="0 0 -0.7">
        <joint name="r_knee" axis="0 1 0" range="-90 90"/><geom size="0.1"/>
      </body>
    </body>
    <body name="left" pos="0 0.1 -0.2">
      <joint name="l_hip" axis="1 0 0" range="-90 90"/><geom size="0.1"/>
      <body name="stand" pos="0 0 -0.75">
        <joint name="l_knee" axis="0 1 0" range="-90 90"/>
        <geom type="box" size="0.1 0.05 0.05"/>
      </body>
    </body>
  </body>
</worldbody>{include}</mujoco>
"""


def test_keyframes_fit_the_mjcf_file_of_the_robot(tmp_path, make_motion):
    """The file has a ball, which is not part of the robot, and a joint that is locked."""
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "robot.xml").write_text(ROBOT.replace("{include}", ""), "utf-8")
    leg = kd.Leg.from_mjcf(
        tmp_path / "robot.xml", "foot", base="floating", locked={"r_hip": 0.0}
    )  # fmt: skip
    standing = StandingRobot(leg.with_supports("stand"))
    motion = make_motion(standing.robot, standing.leg.joint_names, standing.placement)
    motion.save(tmp_path / "kick.xml")
    (tmp_path / "field.xml").write_text(
        ROBOT.replace("{include}", '<include file="kick.xml"/>'), "utf-8"
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "field.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 53)
    assert data.time == 0.0
    values = motion.robot.joint_values(motion.q(0.0))
    for name in ("r_knee", "l_hip", "l_knee"):
        assert data.joint(name).qpos[0] == pytest.approx(values[name], abs=1e-9)
    assert data.joint("r_hip").qpos[0] == 0.0
    assert data.joint("base").qpos[:3] == pytest.approx(motion.q(0.0)[:3], abs=1e-9)
    assert data.joint("loose").qpos[:3].tolist() == [2.0, 0.0, 0.1]


@pytest.mark.parametrize(
    ("name", "rate", "message"),
    [
        ("kick.txt", 100, r"kick\.txt has the extension '\.txt': a motion is written as \.csv"),
        ("kick", 100, "has the extension ''"),
        ("no/folder/kick.csv", 100, "cannot be written"),
        ("kick.csv", 49, r"rate is 49\.0: it must be .* at least 50 and at most 500"),
        ("kick.csv", float("nan"), "rate is nan"),
    ],
)
def test_bad_input(swinging, tmp_path, name, rate, message):
    with pytest.raises(kd.InvalidInput, match=message):
        swinging.save(tmp_path / name, rate)
    assert list(tmp_path.iterdir()) == []
