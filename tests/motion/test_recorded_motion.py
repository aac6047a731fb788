"""Motions from files: polynomials and turns differentiated, files of others, bad input."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.files import shipped
from kickdyn.motion.read_motion import breadth_first

HUMAN = kd.Leg.human()
BIPED = kd.Leg.from_urdf(shipped("urdf") / "biped.urdf", "right_foot", base="floating")
RATE, COUNT = 100.0, 40
T = np.arange(COUNT) / RATE
LEG = np.column_stack([0.3 * T + T**4, 0.4 - T**3, -0.2 + T**2])


def standing(columns=12):
    """Return rows of a biped that stands: base upright, joints in their ranges, all different."""
    joints = 0.01 * (1 + np.arange(columns)) * np.sin(3 * T)[:, None] ** 2
    base = np.tile([0.1, 0.2, 0.9, 0.0, 0.0, np.sin(0.1), np.cos(0.1)], (COUNT, 1))
    return np.hstack([base, joints])


def written(folder, table, name="motion.csv", head=""):
    lines = [",".join(map(repr, row)) for row in np.asarray(table).tolist()]
    (folder / name).write_text("\n".join([*head.split(), *lines]), "utf-8")
    return folder / name


@pytest.mark.parametrize("window", [5, 7, 11])
def test_polynomials_of_degree_4_are_differentiated_exactly(window, tmp_path):
    """On both sides of an impact, where velocities jump: at the impact they are those before it."""
    after, split = T > 0.2, 0.2
    angles = LEG + after[:, None] * (T[:, None] - split) * [5.0, -3.0, 1.0]
    motion = kd.read_motion(
        written(tmp_path, angles), HUMAN, rate=RATE, contact=split, window=window
    )
    np.testing.assert_array_equal(motion.q, angles)
    v = np.column_stack([0.3 + 4 * T**3, -3 * T**2, 2 * T])
    a = np.column_stack([12 * T**2, -6 * T, np.full(COUNT, 2.0)])
    agrees(motion.v, v + after[:, None] * [5.0, -3.0, 1.0], closed_form(RATE))
    agrees(motion.a, a, closed_form(RATE**2))
    assert all(amount < closed_form(RATE) for _, amount, _ in motion.smoothing)
    assert not any("base" in name for name, _, _ in motion.smoothing)


@pytest.mark.parametrize("facing", ["x", "y"])
def test_a_base_that_turns_evenly_has_its_angular_velocity(facing, tmp_path):
    """Polynomials of degree 4 leave an error of the fifth derivative of a sine of w t / 2."""
    file = shipped("urdf") / "biped.urdf"
    robot = kd.Leg.from_urdf(file, "right_foot", base="floating", facing=facing)
    rate, omega = 500.0, np.array([0.3, -0.5, 2.0])
    t = np.arange(60) / rate
    start = pin.exp3(np.array([0.1, 0.2, 0.3]))
    turns = [start @ pin.exp3(omega * time) for time in t]
    place = np.column_stack([t, 0.5 * t**2, 0.9 - 4.9 * t**2])
    quaternions = np.array([pin.Quaternion(turn).coeffs() for turn in turns])
    quaternions[1::2] *= -1.0  # either sign is the same rotation
    table = np.hstack([place, quaternions, np.zeros((len(t), 12))])
    motion = kd.read_motion(written(tmp_path, table), robot, rate=rate)
    assert {name.split(" of ")[-1] for name, _, _ in motion.smoothing} >= {
        "joints", "base position", "base rotation",
    }  # fmt: skip
    error = (np.linalg.norm(omega) / rate) ** 4
    base, model, data = robot.model.jointPlacements[1], robot.model, robot.model.createData()
    for k, time in enumerate(t):
        pin.forwardKinematics(model, data, motion.q[k], motion.v[k], motion.a[k])
        agrees(data.oMi[1].rotation, turns[k], closed_form(10))
        agrees(data.oMi[1].translation, place[k], closed_form(10))
        world = pin.LOCAL_WORLD_ALIGNED
        velocity = pin.getVelocity(model, data, 1, world)
        agrees(velocity.linear, [1.0, time, -9.8 * time], 10 * error)
        agrees(motion.v[k, 3:6], omega, 10 * error)
        change = pin.getClassicalAcceleration(model, data, 1, world)
        agrees(change.linear, [0.0, 1.0, -9.8], 1e3 * error)
        assert np.abs(motion.a[k, 3:6]).max() < 10 * error * rate
    assert facing == "x" or not np.allclose(base.rotation, np.eye(3))


@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_what_a_motion_saves_is_read_back(ending, walking, tmp_path):
    file = tmp_path / f"kick.{ending}"
    walking.save(file, rate=50)
    given = {"rate": 50, "contact": 27 / 50} if ending == "csv" else {}
    motion = kd.read_motion(file, walking.robot, window=5, **given)
    shift = motion.t[27]  # the frame of the impact
    assert motion.contact == pytest.approx(shift)
    for k, time in enumerate(motion.t - shift):
        q = walking.q(time)
        agrees(np.abs(motion.q[k, 3:7]), np.abs(q[3:7]), closed_form(100))
        agrees(np.delete(motion.q[k], range(3, 7)), np.delete(q, range(3, 7)), closed_form(100))


def test_velocities_are_those_of_an_npz_and_its_times_fit_the_rate(make_motion, tmp_path):
    """The splines have degree 3: differences are from where their pieces meet."""
    file = tmp_path / "leg.npz"
    make_motion(HUMAN, HUMAN.joint_names).save(file, rate=500)
    with np.load(file) as arrays:
        agrees(kd.read_motion(file, HUMAN).v, arrays["joint_vel"], 0.01)
        agrees(kd.read_motion(file, HUMAN).t, arrays["time"], closed_form())
    with pytest.raises(kd.InvalidInput, match=r"0\.002 s apart .*at 100 Hz all must be 0\.01 s"):
        kd.read_motion(file, HUMAN, rate=100)


def beyond_mimic(folder, order, **changed):
    """Write the biped that stands with its bodies and its joints in an order."""
    table, model, data = standing(), BIPED.model, BIPED.model.createData()
    places, turns = np.zeros((COUNT, model.njoints - 1, 3)), np.zeros((COUNT, model.njoints - 1, 4))
    for k, q in enumerate(table):
        pin.forwardKinematics(model, data, q)
        for joint in range(1, model.njoints):
            places[k, joint - 1] = data.oMi[joint].translation
            x, y, z, w = pin.Quaternion(data.oMi[joint].rotation).coeffs()
            turns[k, joint - 1] = w, x, y, z
    names = list(BIPED.joint_names[1:])
    joints = table[:, 7:][:, [names.index(name) for name in order]]
    arrays = {"fps": [RATE], "joint_pos": joints, "body_pos_w": places, "body_quat_w": turns}
    np.savez(folder / "mimic.npz", **arrays | changed)
    return folder / "mimic.npz", table


def test_bodies_of_a_file_say_whether_the_joints_have_the_order_of_the_model(tmp_path):
    order = breadth_first(BIPED)
    assert order[:3] == ["left_hip_yaw", "right_hip_yaw", "left_hip_roll"]
    file, table = beyond_mimic(tmp_path, order)
    with pytest.raises(kd.InvalidInput, match="joints='breadth-first' agrees"):
        kd.read_motion(file, BIPED, joints="model")
    for joints in ("breadth-first", order):
        agrees(kd.read_motion(file, BIPED, joints=joints).q, table, closed_form(10))
    named, _ = beyond_mimic(tmp_path, order, joint_names=order)
    agrees(kd.read_motion(named, BIPED).q, table, closed_form(10))
    with pytest.raises(kd.InvalidInput, match="frames at 100 Hz, and rate is 30 Hz"):
        kd.read_motion(named, BIPED, rate=30)
    csv = written(tmp_path, np.hstack([table[:, :7], np.load(file)["joint_pos"]]),
                  head=",".join(["x", "y", "z", "qx", "qy", "qz", "qw", *order]))  # fmt: skip
    agrees(kd.read_motion(csv, BIPED, rate=RATE).q, table, closed_form(10))


def test_joints_out_of_range_and_a_wrong_rate_are_warnings(tmp_path):
    table = standing()
    knee = 7 + BIPED.joint_names.index("left_knee") - 1
    table[5, knee] = 2.3  # 0.1 above its range
    motion = kd.read_motion(written(tmp_path, table), BIPED, rate=RATE, joints="model")
    (line,) = [line for line in motion.warnings if "range" in line]
    assert (
        line == "left_knee is outside its range by 0.1 rad at 0.05 s (frame 5), in 1 of 40 frames"
    )
    swing = 0.4 + 0.3 * np.sin(20 * T)[:, None] * [1, 1, -1]  # 6 rad/s
    assert kd.read_motion(written(tmp_path, swing), HUMAN, rate=RATE).warnings == ()
    (line,) = [line for line in kd.read_motion(tmp_path / "motion.csv", HUMAN, rate=1000).warnings
               if "rate" in line]  # fmt: skip
    assert "instead of 1000 Hz" in line


def spoilt(row, column, value):
    table = standing()
    table[row, column] = value
    return table


WXYZ = standing()[:, [0, 1, 2, 6, 3, 4, 5, *range(7, 19)]]
SWAPPED = standing()
SWAPPED[:, 7:] = 0.1
SWAPPED[:, 7 + breadth_first(BIPED).index("left_knee")] = 1.8  # a hip has only 0.6
BAD = {
    "another robot": (standing(9), {}, r"16 columns: biped .* 19: 7 for .* and 12 for its joints"),
    "no base": (standing()[:, 7:], {}, "12 columns of joints and no base"),
    "quaternion": (spoilt(3, 3, 0.5), {}, r"quaternion of length 1\.1\d+ .* row 4"),
    "order": (WXYZ, {}, "seem to be wxyz, not xyzw; quaternion='wxyz'"),
    "breadth first": (SWAPPED, {}, "not in breadth-first order"),
    "nan": (spoilt(4, 9, np.nan), {}, r"nan in row 5, column 10"),
    "frames": (standing()[:9], {}, "9 frames: a motion needs at least 10"),
    "rate": (standing(), {"rate": None}, "rate is None"),
    "degrees": (spoilt(2, 8, 30.0), {}, "left_hip_roll at 30 in row 3.*in degrees"),
    "window": (standing(), {"window": 6}, "window is 6: it must be odd"),
    "contact": (standing(), {"contact": 0.02}, "3 frames before the impact: a window of 7"),
    "outside": (standing(), {"contact": 9.0}, "contact is 9.0"),
    "joint": (standing(), {"joints": ["left_knee"]}, "joints: lacks left_hip_yaw"),
    "named order": (standing(), {"joints": "x"}, "breadth-first or model"),
}


NO_MOTION = {
    "missing.csv": (None, "no such file"), "a.bvh": (b"", "from .csv, .npz"),
    "words.csv": (b"a,b\n1,x\n", "no table of numbers"), "empty.csv": (b"", "is empty"),
    "text.npz": (b"1,2,3", "no NPZ file"), "ragged.csv": (b"1,2\n1\n", "no table of numbers"),
}  # fmt: skip


@pytest.mark.parametrize("name", [*BAD, *NO_MOTION])
def test_bad_input_is_one_line(name, tmp_path):
    if name in BAD:
        table, options, words = BAD[name]
        name = written(tmp_path, table).name
    else:
        (content, words), options = NO_MOTION[name], {}
        if content is not None:
            (tmp_path / name).write_bytes(content)
    with pytest.raises(kd.InvalidInput, match=words) as error:
        kd.read_motion(tmp_path / name, BIPED, **{"rate": RATE} | options)
    assert "\n" not in str(error.value)


def test_quaternions_wxyz_are_read_if_they_are_named(tmp_path):
    motion = kd.read_motion(written(tmp_path, WXYZ), BIPED, rate=RATE, quaternion="wxyz")
    agrees(motion.q, standing(), closed_form(10))
