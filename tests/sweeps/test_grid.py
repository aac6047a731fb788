import math

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.grid import IN_MEMORY, LARGEST, Chunks, Grid, check_size, read_postures

LEG = kd.Leg.human()


def grid(leg, joints):
    return Grid.of(leg, read_postures(leg, joints))


def test_ends_are_included_and_degrees_become_radians():
    axes = grid(LEG, ["hip=-10:60:5", "knee=0:1:0.1", "ankle=7"]).axes
    assert list(axes) == ["hip", "knee", "ankle"]
    assert np.degrees(axes["hip"]) == pytest.approx(np.arange(-10, 61, 5))
    assert len(axes["knee"]) == 11
    assert np.degrees(axes["ankle"]) == pytest.approx([7])


def test_a_step_that_does_not_divide_stops_below_the_end():
    assert np.degrees(grid(LEG, ["knee=0:10:4"]).axes["knee"]) == pytest.approx([0, 4, 8])


def test_configurations_run_the_last_axis_fastest():
    small = grid(LEG, ["hip=0:10:10", "ankle=0:20:20"])
    degrees = [np.degrees(small.configuration(LEG, number)) for number in range(small.size)]
    expected = [[0, 0, 0], [0, 0, 20], [10, 0, 0], [10, 0, 20]]
    assert np.array(degrees) == pytest.approx(np.array(expected))
    assert small.size == 4


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        ([], r"name the joints of leg_human to sweep, .* --joint hip=0:30:5 \(there are hip, knee"),
        (["hip"], "'hip' cannot be read: write NAME=LOW:HIGH:STEP"),
        (["hip=1:2"], "cannot be read"),
        (["hip=a:b:c"], "write plain numbers"),
        (["hip=nan"], "joint hip is nan"),
        (["hip=0:inf:1"], "joint hip is inf"),
        (["toe=1"], "joint 'toe' is unknown: leg_human has hip, knee, ankle"),
        (["hip=0:10:0"], "STEP must be above 0"),
        (["hip=0:10:-1"], "STEP must be above 0"),
        (["hip=10:0:1"], "LOW must not exceed HIGH: did you mean hip=0:10:1"),
        (["hip=0:10:nan"], "joint hip is nan"),
        (["hip=-0.5:1.5rad:0.1"], "write plain numbers"),
        (["knee=30 deg"], "write plain numbers"),
        (["=1"], "joint '' is unknown"),
        ([""], "joint '' cannot be read"),
        (["hip=-40:20:10"], "joint hip is swept -40 deg: its range is -30 to 125 deg"),
        (["knee=-1"], "its range is 0 to 140 deg"),
        (["hip=1", "hip=2"], "'hip' is given twice"),
        (["hip=0:100:1e-9"], "take a larger step"),
    ],
)
def test_bad_grids(joints, words):
    with pytest.raises(kd.InvalidInput, match=words):
        grid(LEG, joints)


def test_a_joint_that_is_not_named_must_allow_0():
    model = LEG.model
    model.lowerPositionLimit = np.array([0.1, 0.0, 0.0])
    leg = kd.Leg.from_model(model, "toe")
    with pytest.raises(kd.InvalidInput, match="joint hip is not named, so at 0 deg"):
        grid(leg, ["knee=10"])


def test_prismatic_joints_are_in_metres_and_continuous_ones_turn_freely():
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelRUBY(), pin.SE3.Identity(), "turn")
    body = pin.Inertia(1.0, np.array([0.1, 0, 0]), np.eye(3))
    model.appendBodyToJoint(first, body, pin.SE3.Identity())
    limits = [np.array([x]) for x in (10.0, 5.0, -0.2, 0.3)]
    second = model.addJoint(first, pin.JointModelPX(), pin.SE3.Identity(), "slide", *limits)
    model.appendBodyToJoint(second, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", second, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    leg = kd.Leg.from_model(model, "toe")
    axes = grid(leg, ["slide=0:0.2:0.1", "turn=-170:170:170"]).axes
    assert axes["slide"] == pytest.approx([0, 0.1, 0.2])
    assert axes["turn"] == pytest.approx(np.radians([-170, 0, 170]))
    with pytest.raises(kd.InvalidInput, match=r"range is -0\.2 to 0\.3 m"):
        grid(leg, ["slide=1"])
    q = leg.configuration({"turn": math.pi / 2, "slide": 0.1})
    assert leg.joint_values(q) == pytest.approx({"turn": math.pi / 2, "slide": 0.1})


@pytest.mark.parametrize(
    ("largest", "step", "words"),
    [
        (IN_MEMORY, 0.1, r"2,004,002 postures \(1001 x 1001 x 2, in a store 0.1 GB\): at most "
         r"1,000,000 are kept in memory: name a store, --out DIR\.zarr"),
        (LARGEST, 0.001, r"in a store 640.0 GB\): at most 10,000,000,000 can be swept, or take"),
    ],
)  # fmt: skip
def test_too_many_postures_say_what_they_would_need(largest, step, words):
    steps = round(100 / step) + 1
    with pytest.raises(kd.InvalidInput, match=words):
        check_size((steps, steps, 2), largest)


@pytest.mark.parametrize(
    ("postures", "words"),
    [
        ({}, "must map joint names to values"),
        (["hip=3"], "must map joint names to values"),
        ({"toe": 0.0}, "joint 'toe' is unknown"),
        ({"hip": [0.2, 0.1]}, "joint hip has .*values must be ascending"),
        ({"hip": []}, "must be ascending"),
        ({"hip": [[0.1, 0.2]]}, "must be ascending"),
        ({"hip": [0.1, math.nan]}, "hip"),
        ({"hip": "fast"}, "hip"),
        ({"knee": [0.0, 30.0]}, "joint knee is swept 1718.87 deg: its range is 0 to 140 deg"),
    ],
)
def test_bad_postures(postures, words):
    with pytest.raises(kd.InvalidInput, match=words):
        Grid.of(LEG, postures)


def test_a_single_value_is_an_axis_of_one():
    assert Grid.of(LEG, {"hip": 0.2, "knee": [0.1, 0.3]}).shape == (1, 2)


@pytest.mark.parametrize(
    ("shape", "chunk"),
    [((7, 7, 6), (1, 7, 6)), ((10, 10, 300), (1, 1, 50)), ((3, 4), (3, 4)), ((100,), (50,)),
     ((51,), (26,)), ((9, 30), (1, 30)), ((4, 12), (4, 12)), ((5, 12), (3, 12))],
)  # fmt: skip
def test_chunks_are_consecutive_postures_of_like_size(shape, chunk):
    chunks = Chunks.of(shape, 50)
    assert chunks.shape == chunk
    number = np.arange(np.prod(shape)).reshape(shape)
    seen = []
    for k in range(len(chunks)):
        first, count = chunks.span(k)
        here = number[chunks.region(k)].ravel().tolist()
        assert here == list(range(first, first + count))
        seen += here
    assert seen == list(range(number.size))


FOURBAR = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
LOOPED = FOURBAR.with_loops(("shank_pin", "rocker_b_tip"))


def test_loops_are_closed_at_each_point():
    grid = Grid.of(LOOPED, {"rocker_b": np.radians([0.0, 30.0, 60.0]), "hip": [0.1, 0.2]})
    for number in range(grid.size):
        q = grid.configuration(LOOPED, number)
        named = {"rocker_b": grid.axes["rocker_b"][number // 2], "hip": (0.1, 0.2)[number % 2]}
        assert {name: LOOPED.joint_values(q)[name] for name in named} == pytest.approx(
            named, abs=1e-15
        )
        LOOPED.posture(q)  # refuses open loops
        assert LOOPED.outside_range(q) == []
    assert grid.configuration(FOURBAR, 5)[1:].tolist() == [0, 0, 0, grid.axes["rocker_b"][2]]


def test_points_that_cannot_be_closed_are_refused():
    grid = Grid.of(LOOPED, {"rocker_a": [0.41]})
    with pytest.raises(kd.InvalidInput, match=r"loop shank_pin - rocker_b_tip stays open"):
        grid.configuration(LOOPED, 0)
    grid = Grid.of(LOOPED, {"shank_pin_a": [1.89]})
    with pytest.raises(kd.InvalidInput, match=r"with the loops closed, rocker_b at 74\.\d+ deg is"):
        grid.configuration(LOOPED, 0)


def test_all_faults_come_at_once():
    leg = kd.Leg.human()
    with pytest.raises(kd.InvalidInput) as caught:
        Grid.of(leg, {"hipp": [0], "knee": [0, 9.0], "ankle": [1, 0]})
    assert [fault[:14] for fault in str(caught.value).split("; ")] == [
        "joint 'hipp' i",
        "joint knee is ",
        "joint ankle ha",
    ]
    with pytest.raises(kd.InvalidInput) as caught:
        read_postures(leg, ["hip=5:0:1", "knee=x", "knee=0", "ankle=0", "ankle=1"])
    assert [fault[:21] for fault in str(caught.value).split("; joint ")] == [
        "joint 'hip=5:0:1': LO",
        "'knee=x' cannot be re",
        "'ankle' is given twic",
    ]


GEARED = """<robot name="geared"><link name="base"/>{}</robot>"""
PART = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{0}_link"/>'
    '<origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" '
    'velocity="9"/>{2}</joint><link name="{0}_link"><inertial><origin xyz="0 0 -0.2"/>'
    '<mass value="3"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
    "</link>"
)


def test_mimic_joints_follow_in_a_sweep(tmp_path):
    gear = '<mimic joint="hip" multiplier="-2" offset="0.1"/>'
    parts = [PART.format("hip", "base", ""), PART.format("knee", "hip_link", gear)]
    parts += [PART.format("ankle", "knee_link", ""), PART.format("toe", "ankle_link", "")]
    path = tmp_path / "geared.urdf"
    path.write_text(GEARED.format("".join(parts)))
    leg = kd.Leg.from_urdf(path, "toe_link")
    grid = Grid.of(leg, {"hip": [0.1, 0.2], "ankle": [0.5]})
    assert grid.configuration(leg, 1) == pytest.approx([0.2, -0.3, 0.5, 0])
    table = kd.sweep(leg, {"hip": [0.1, 0.2], "ankle": [0.5]}, kd.Kick(speed=1.0))
    posture = leg.posture([0.2, 0.5, 0.0])
    mass = posture.effective_mass(kd.Kick().direction)
    assert float(table.effective_mass[1, 0]) == pytest.approx(mass, rel=1e-12)
    with pytest.raises(kd.InvalidInput, match="joint knee mimics hip: sweep hip instead"):
        Grid.of(leg, {"knee": [0.1]})
    said = r"joint knee is moved by hip, which it mimics, to -63\.\d+ deg: its range is -57"
    with pytest.raises(kd.InvalidInput, match=said):
        Grid.of(leg, {"hip": [0.1, 0.6]})
