"""Options that describe the leg: its name or file, locked joints, loops, supports, drives."""

import math

import numpy as np
import pytest
from click.testing import CliRunner
from tolerances import closed_form

import kickdyn as kd
from kickdyn.cli.leg_options import LEGS, LegOptions, load_leg
from kickdyn.cli.option_groups import command
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.urdf_file import shipped_urdf

FOURBAR = str(shipped_urdf("leg_fourbar.urdf"))
BOLT = ("--leg", "bolt", "--frame", "FR_FOOT")
CORNERS = [[0.1, 0.05, -0.03], [0.1, -0.05, -0.03], [-0.1, 0.0, -0.03]]


def loaded(*words):
    """Return the leg of a command line, and what it writes to standard error."""
    legs = []

    @command("load")
    def load(leg: LegOptions) -> None:
        legs.append(leg.load())

    result = CliRunner().invoke(load, words, catch_exceptions=False)
    return legs[0], result.stderr


KNEE = {"right_knee_joint": math.radians(40)}


@pytest.mark.parametrize(("locks", "values"), [
    ("hip=30 ankle=0.1", {"hip": math.radians(30), "ankle": 0.1}),
    ("[ah]*=0.1", {"hip": math.radians(0.1), "ankle": 0.1}), ("right_knee_joint=40", None)
])  # fmt: skip
def test_joints_are_locked_in_degrees_or_metres(locks, values, tmp_path):
    """The ankle is prismatic; the knee is that of a robot by name."""
    file, text = tmp_path / "slide.urdf", kd.Leg.human().file.text
    file.write_text(text.replace('name="ankle" type="revolute"', 'name="ankle" type="prismatic"'))
    words = [word for lock in locks.split() for word in ("--lock", lock)]
    leg, _ = loaded("--leg", "g1" if values is None else str(file), *words)
    if values is None:
        robot = kd.Leg.from_robot("g1")
        posture, right = leg.posture(leg.configuration()), robot.posture(robot.configuration(KNEE))
    else:
        q = np.linspace(0.2, 0.1, leg.nq)
        posture, right = leg.posture(q), kd.Leg.from_urdf(file, locked=values).posture(q)
    assert posture.contact_point == pytest.approx(right.contact_point, abs=closed_form(10))


def test_a_human_leg_of_a_size():
    size = {"height": 1.65, "mass": 58, "sex": "female", "side": "left", "model": "3d"}
    word = ",".join(f"{key}={value}" for key, value in size.items())
    leg, _ = loaded("--leg", f"human:{word}", "--frame", "inside", "--lock", "subtalar=10")
    right = kd.Leg.human(**size, frame="inside").locked({"subtalar": math.radians(10)})
    assert leg.model == right.model


@pytest.mark.parametrize(("words", "rotor"), [
    ((), None), (("--drives", "none"), 0.0), (("--drives", "drives.toml"), 0.02)
], ids=["the robot's own", "none", "a file"])  # fmt: skip
def test_drives_are_the_robot_s_own_none_or_those_of_a_file(words, rotor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drives.toml").write_text('[joints]\n"*knee*" = { rotor_inertia_kg_m2 = 0.02 }')
    leg, robot = loaded("--leg", "g1", *words)[0], kd.Leg.from_robot("g1")
    if rotor is None:
        rotor = robot.model.armature[robot.velocity_index("right_knee_joint")]
        assert rotor > 0
    assert leg.model.armature[leg.velocity_index("right_knee_joint")] == rotor


def test_loops_close_what_a_file_cuts_open():
    loop = "shank_pin:rocker_b_tip"
    leg, warnings = loaded("--leg", FOURBAR, "--loop", loop)
    assert (leg.constraints.loops, warnings) == ((("shank_pin", "rocker_b_tip"),), "")
    assert f"--loop {loop}" in loaded("--leg", FOURBAR)[1]


@pytest.mark.parametrize("by", ["words", "file", "friction alone"])
def test_a_robot_on_a_support_has_both_legs_and_a_floating_base(by, tmp_path):
    file, corners = tmp_path / "left.toml", "/".join(",".join(map(str, c)) for c in CORNERS)
    file.write_text(f"frame = 'FL_FOOT'\nfriction = 0.7\nsole = {CORNERS}")
    word = {"words": f"FL_FOOT:0.7:{corners}", "file": str(file)}.get(by, "FL_FOOT:0.7")
    leg, warnings = loaded(*BOLT, "--support", word)
    (support,) = leg.supports
    assert (support.frame, support.friction) == ("FL_FOOT", 0.7)
    assert support.sole is None if by == "friction alone" else support.sole.tolist() == CORNERS
    assert warnings == "".join(f"warning: {line}\n" for line in leg.warnings)
    assert (leg.joint_names[0], leg.nv) == ("root_joint", 6 + 2 * 3)


def test_a_name_is_one_of_kickdyn_a_robot_or_a_file(tmp_path):
    assert set(LEGS) == {"testbed", *ROBOTS}
    assert len(LEGS) == len(set(LEGS))
    assert load_leg("testbed", "foot").frame == "foot"
    (tmp_path / "human.urdf").write_text(kd.Leg.testbed().file.text)
    assert load_leg(str(tmp_path / "human.urdf")).name == kd.Leg.testbed().name
    described = tmp_path / "own_description"
    described.write_text(kd.Leg.testbed().file.text)
    assert load_leg(str(described)).name == kd.Leg.testbed().name


@pytest.mark.parametrize("name", ["rail", ""], ids=["named", "unnamed"])
def test_joints_of_an_mjcf_are_locked_before_it_is_judged(name, tmp_path):
    """Joints of the file that move its root body make a floating base singular."""
    joint = '<joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
    knee = f'<body name="toe" pos="0 0 -1">{joint.format("knee")}</body>'
    rail = f'<joint {f"name={name!r}" if name else ""} type="slide" axis="1 0 0"/>'
    body = f'<body name="body">{rail}{joint.format("turn")}{knee}</body>'
    file = tmp_path / "leg.urdf"  # it is recognized by its content
    file.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(kd.MjcfError, match="lock them"):
        load_leg(str(file), base="floating")
    leg = load_leg(str(file), base="floating", locked={name or "body_joint": 0.25, "turn": 90.0})
    assert leg.joint_names == ("root_joint", "knee")
    point = leg.posture(leg.configuration()).contact_point
    assert point == pytest.approx([0.25 - 1.0, 0.0, 0.0], abs=closed_form(10))


@pytest.mark.parametrize(("words", "value", "valid"), [
    (["--lock", "knee=x"], "'knee=x'", "JOINT=VALUE"),
    (["--lock", "knee=1", "--lock", "knee=2"], "'knee=2'", "once"),
    (["--lock", "ankle=500"], "500 deg", "-20 to 50 deg"), (["--lock", "kne=1"], "'kne'", "'knee'"),
    (["--loop", "a-b"], "'a-b'", "A:B"), (["--stiff", "toe"], "'toe'", "hip, knee, ankle"),
    ([*BOLT, "--support", "FL_FOOT:much"], "much", "FRAME:FRICTION"),
    ([*BOLT, "--support", "FL_FOOT:0.7:0.1,0.05/0,0/1,1"], "(3, 2)", "corners"),
    (["--leg", "hunam"], "'hunam'", "human, testbed"),
    (["--leg", "human:height=x"], "'height=x'", "height=METRES"),
    (["--facing", "y", "--leg", "g1"], "'y'", "faces x"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")  # fmt: skip
def test_a_bad_option_is_named_with_what_is_valid(words, value, valid):
    with pytest.raises(kd.InvalidInput) as refusal:
        loaded(*words)
    text = str(refusal.value)
    assert value in text
    assert valid in text
    assert "\n" not in text
