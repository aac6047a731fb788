import math

import click
import numpy as np
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.leg_options import LEGS, LegOptions, load_leg
from kickdyn.cli.option_groups import takes
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.urdf_file import shipped_urdf

FOURBAR = str(shipped_urdf("leg_fourbar.urdf"))
BOLT = ("--leg", "bolt")
LOOP = "shank_pin:rocker_b_tip"


def loaded(*arguments):
    """The leg of a command line, and what it writes to standard error."""
    legs = []

    @click.command()
    @takes(leg=LegOptions)
    @click.option("--speed", default=1.0)
    def command(leg: LegOptions, speed: float) -> None:
        legs.append(leg.load())

    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    return legs[0], result.stderr


def test_the_human_leg_is_the_default():
    leg, said = loaded()
    assert (leg.name, leg.frame, leg.constraints, said) == ("leg_human", "toe", None, "")


def test_loops_of_an_mjcf_stay_beside_those_of_options(looped_mjcf):
    (own,) = loaded("--leg", str(looped_mjcf), "--frame", "c")[0].loops
    leg, _ = loaded("--leg", str(looped_mjcf), "--frame", "c", "--loop", "a:b")
    assert leg.loops == (own, ("a", "b"))


def test_loops_close_what_a_file_cuts_open():
    leg, said = loaded("--leg", FOURBAR, "--loop", LOOP)
    assert (leg.constraints.loops, said) == ((("shank_pin", "rocker_b_tip"),), "")
    _, said = loaded("--leg", FOURBAR)
    assert said.startswith("warning: shank_pin and rocker_b_tip are at one place at q = 0")
    assert said.endswith(f"(--loop {LOOP})\n")


def test_a_robot_on_a_support_has_both_legs_and_a_floating_base():
    leg, said = loaded("--leg", "bolt", "--support", "FL_FOOT", "--frame", "FR_FOOT")
    assert [s.frame for s in leg.constraints.supports] == ["FL_FOOT"]
    assert said == "".join(f"warning: {line}\n" for line in leg.warnings)
    assert leg.joint_names[0] == "root_joint"
    assert leg.nv == 12


def test_joints_are_locked_in_degrees_or_metres(tmp_path):
    leg, said = loaded("--lock", "ankle=-10", "--lock", "knee=30")
    assert (leg.joint_names, said) == (("hip",), "")
    human = kd.Leg.human()
    q = human.configuration({"knee": math.radians(30), "ankle": math.radians(-10)})
    assert leg.posture([0.0]).contact_point == pytest.approx(human.posture(q).contact_point)
    leg, _ = loaded("--leg", "g1", "--lock", "right_knee_joint=40")
    assert leg.nv == 5
    path = tmp_path / "slide.urdf"
    path.write_text(
        human.file.text.replace('name="ankle" type="revolute"', 'name="ankle" type="prismatic"')
    )
    leg, _ = loaded("--leg", str(path), "--lock", "ankle=0.25")
    assert leg.posture([0.0, 0.0]).contact_point[1] == pytest.approx(0.25)  # its axis is y


def test_stiff_joints():
    assert loaded("--stiff", "ankle", "--stiff", "knee")[0].stiff_joints == ("ankle", "knee")


def test_a_support_has_its_sole_in_a_file(tmp_path):
    file = tmp_path / "left.toml"
    sole = [[0.02, 0.01, 0.0], [0.02, -0.01, 0.0], [-0.02, 0.0, 0.0]]
    file.write_text(f"frame = 'FL_FOOT'\nfriction = 0.6\nsole = {sole}")
    leg, _ = loaded("--leg", "bolt", "--support", str(file), "--frame", "FR_FOOT:heel")
    (support,) = leg.constraints.supports
    assert (support.frame, support.friction, support.sole.tolist()) == ("FL_FOOT", 0.6, sole)
    assert leg.frame == "heel"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "frame = 'FL_FOOT'\nfriciton = 1",
            "support has frame, friciton: .*may have point, fricti",
        ),
        ("friction = 1", "support has friction: it needs frame"),
        ("", "support has no keys: it needs frame"),
        ("frame = 'FL_FOOT'\nsole = [[0, 0, 0], [1, 1, 1]]", r"sole of FL_FOOT has shape \(2, 3\)"),
        (
            "frame = 'FL_FOOT'\nsole = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]",
            "sole of FL_FOOT is .*: its corners must span an area",
        ),
        ("frame = 'FL_FOOT'\nsole = [[0, 0], [1, 0], [1, 1]]", r"has shape \(3, 2\): it must be"),
        ("frame = 'FL_FOOT'\nsole = 'round'", "sole of FL_FOOT is 'round'"),
        ("frame = 'FL_FOOT'\nfriction = -1", "friction under FL_FOOT is -1.*at least 0"),
        ("frame", "left.toml: is not TOML"),
    ],
)
def test_bad_files_of_supports_are_refused_in_a_line(tmp_path, text, said):
    file = tmp_path / "left.toml"
    file.write_text(text)
    with pytest.raises(kd.InvalidInput, match=said) as refused:
        loaded("--leg", "bolt", "--support", str(file))
    assert "\n" not in str(refused.value)


def test_supports_of_a_file_float_its_base():
    with pytest.raises(kd.InvalidInput, match="the base floats and has no mass"):
        loaded("--leg", str(shipped_urdf("leg_human.urdf")), "--support", "base")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--lock", "knee"), r"--lock is 'knee': it must be JOINT=VALUE \[deg; m\]"),
        (("--lock", "=3"), "--lock is '=3': it must be JOINT=VALUE"),
        (("--lock", "knee=x"), "--lock is 'knee=x': it must be JOINT=VALUE"),
        (("--lock", "knee=nan"), "--lock is 'knee=nan': it must be JOINT=VALUE"),
        (("--support", "toe:-1"), "--support is 'toe:-1': .* friction of at least 0"),
        (("--lock", "knee=1", "--lock", "knee=2"), "--lock is 'knee=2': .* once for each joint"),
        (
            ("--lock", "ankle=500"),
            "ankle at 500 deg is outside its range -20 to 50 deg: it cannot be locked there$",
        ),
        (("--lock", "kne=1"), "joint 'kne' is unknown: did you mean 'knee'"),
        (("--loop", "a-b"), "--loop is 'a-b': it must be two frames, A:B"),
        (("--loop", "toe:"), "--loop is 'toe:': it must be two frames, A:B"),
        (("--loop", "toe:foot"), "loop toe - foot joins a body to itself"),
        (("--loop", "toe:tow"), "frame 'tow' is unknown"),
        (("--stiff", "toe"), "joint 'toe' is unknown"),
        ((*BOLT, "--support", "toe"), "support toe is on the kicking limb"),
        ((*BOLT, "--support", "tow"), "frame 'tow' is unknown"),
        (("--support", "left_foot"), "^frame 'left_foot' is unknown: did you mean 'foot'"),
        (("--support", "base"), "inertia of leg_human at this posture is not positive definite"),
    ],
)
def test_bad_options_are_refused(arguments, said):
    with pytest.raises(kd.InvalidInput, match=said):
        loaded(*arguments)


def test_ours_come_first_and_every_robot_is_named_once():
    assert LEGS[:2] == ("human", "testbed")
    assert set(LEGS) == {"testbed", *ROBOTS}
    assert len(LEGS) == len(set(LEGS))


def test_a_name_is_ours_a_robot_or_a_file(tmp_path):
    assert (load_leg("human").model.njoints, load_leg("testbed", "foot").frame) == (4, "foot")
    (tmp_path / "human.urdf").write_text(kd.Leg.testbed().file.text)
    assert load_leg(str(tmp_path / "human.urdf")).name == kd.Leg.testbed().name
    with pytest.raises(kd.InvalidInput, match=r"'hunam' is neither human, testbed, g1, .* nor a f"):
        load_leg("hunam")
    with pytest.raises(kd.InvalidInput, match="nor a file"):
        load_leg("x" * 5000)


def test_a_file_without_our_frame_is_refused(tmp_path):
    (tmp_path / "other.urdf").write_text(kd.Leg.testbed().file.text.replace('"toe"', '"instep"'))
    said = r"^frame 'toe' is unknown: did you mean 'foot'\? leg_testbed has .*instep"
    with pytest.raises(kd.InvalidInput, match=said):
        load_leg(str(tmp_path / "other.urdf"))
    assert load_leg(str(tmp_path / "other.urdf"), "instep").frame == "instep"
    with pytest.raises(kd.InvalidInput, match=r"^frame 'toe' is unknown"):
        load_leg(str(tmp_path / "other.urdf"), "toe")
    with pytest.raises(kd.UrdfError, match="there is no such file"):
        load_leg(str(tmp_path / "none.urdf"))


def test_an_mjcf_file_is_known_by_what_is_in_it(tmp_path):
    body = '<body name="toe"><joint name="hip" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
    for name in ("leg.xml", "leg.urdf"):
        (tmp_path / name).write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        assert load_leg(str(tmp_path / name)).joint_names == ("hip",)
    with pytest.raises(kd.InvalidInput, match=r"^frame 'heel' is unknown"):
        load_leg(str(tmp_path / "leg.xml"), "heel")
    (tmp_path / "leg.xml").write_text(kd.Leg.testbed().file.text)
    assert load_leg(str(tmp_path / "leg.xml")).name == "leg_testbed"
    (tmp_path / "leg.xml").write_text("<mujoco/>")
    with pytest.raises(kd.InvalidInput, match="package-dir is 'share': it is for URDF files"):
        load_leg(str(tmp_path / "leg.xml"), package_dirs=["share"])
    (tmp_path / "leg.xml").write_text("<mujoco")
    with pytest.raises(kd.MjcfError, match="is not well-formed XML"):
        load_leg(str(tmp_path / "leg.xml"))


def test_a_joint_of_an_mjcf_is_locked_in_degrees(tmp_path):
    part = '<joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
    knee = f'<body name="toe" pos="0 0 -1">{part.format("knee")}</body>'
    hip = f"<body>{part.format('hip')}{knee}</body>"
    (tmp_path / "leg.xml").write_text(f"<mujoco><worldbody>{hip}</worldbody></mujoco>")
    leg = load_leg(str(tmp_path / "leg.xml"), locked={"hip": 90.0})
    assert leg.joint_names == ("knee",)
    assert leg.frame == "toe"
    assert leg.posture([0.0]).contact_point == pytest.approx([-1.0, 0.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("name", ["rail", ""], ids=["named", "unnamed"])
def test_joints_of_an_mjcf_are_locked_before_it_is_judged(tmp_path, name):
    # joints of the file that move its root body make a floating base singular
    part = '<joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
    knee = f'<body name="toe" pos="0 0 -1">{part.format("knee")}</body>'
    rail = f'<joint {f"name={name!r}" if name else ""} type="slide" axis="1 0 0"/>'
    body = f'<body name="body">{rail}{part.format("turn")}{knee}</body>'
    tie = '<equality><joint joint1="knee" joint2="turn" polycoef="0 0 1 0 0"/></equality>'
    file = tmp_path / "leg.xml"
    file.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    locked = {name or "body_joint": 0.25, "turn": 90.0}
    with pytest.raises(kd.MjcfError, match="lock them"):
        load_leg(str(file), base="floating")
    leg = load_leg(str(file), base="floating", locked=locked)
    assert leg.joint_names == ("root_joint", "knee")
    point = leg.posture(leg.configuration()).contact_point
    assert point == pytest.approx([0.25 - 1.0, 0.0, 0.0], abs=1e-15)
    scene = tmp_path / "scene.toml"
    locks = ", ".join(f"{joint} = {value}" for joint, value in locked.items())
    scene.write_text(
        f'[leg]\nfile = "leg.xml"\nbase = "floating"\nlocked = {{ {locks} }}\n'
        "[posture]\njoint_velocity_rad_s = { knee = 1.0 }\n"
        "[contact]\nattack_deg = 45.0\nrestitution = 0.8\n"
    )
    assert kd.load_scene(scene).leg.joint_names == ("root_joint", "knee")
    file.write_text(f"<mujoco><worldbody>{body}</worldbody>{tie}</mujoco>")
    with pytest.raises(kd.MjcfError, match=r"lock its joints \(locked=, --lock\)"):
        load_leg(str(file))
    tied = {"turn": 0.0, "knee": 0.0}
    assert load_leg(str(file), locked=tied).joint_names == (name or "body_joint",)


@pytest.mark.parametrize("name", ["human", "g1", "g1_description"])
def test_folders_of_packages_are_not_for_a_robot_by_name(name):
    with pytest.raises(kd.InvalidInput, match=f"it is for .*URDF file.*{name}"):
        load_leg(name, package_dirs=["share"])


def test_of_a_robot_only_what_moves_the_foot_can_move():
    whole, leg = kd.Leg.from_robot("g1", legs_only=True), load_leg("g1")
    assert leg.nv < whole.nv
    assert all(name.startswith("right") for name in leg.joint_names)
    q = whole.configuration({"right_knee_joint": 0.5})
    mine = leg.configuration({"right_knee_joint": 0.5})
    normal = (np.cos(0.5), 0.0, np.sin(0.5))
    weights = [whole.posture(q).effective_mass(normal), leg.posture(mine).effective_mass(normal)]
    assert weights[0] == pytest.approx(weights[1], rel=1e-12)


def test_a_leg_is_loaded_with_locked_joints(tmp_path):
    sliding = kd.Leg.testbed().file.text.replace(
        'name="ankle" type="revolute"', 'name="ankle" type="prismatic"'
    )
    (tmp_path / "slide.urdf").write_text(sliding)
    path, values = tmp_path / "slide.urdf", {"hip": 30.0, "ankle": 0.1}
    leg = load_leg(str(path), locked=values)
    same = kd.Leg.from_urdf(path, locked={"hip": np.radians(30), "ankle": 0.1})
    places = [each.posture([0.2]).contact_point for each in (leg, same)]
    assert places[0] == pytest.approx(places[1], abs=1e-15)
    matched = load_leg(str(path), locked={"[ah]*": 0.1})  # the hip in degrees, the ankle in metres
    named = kd.Leg.from_urdf(path, locked={"hip": np.radians(0.1), "ankle": 0.1})
    places = [each.posture([0.2]).contact_point for each in (matched, named)]
    assert places[0] == pytest.approx(places[1], abs=1e-15)
    with pytest.raises(kd.InvalidInput, match=r"^joint 'hop' is unknown: did you mean 'hip'"):
        load_leg(str(path), locked={"hop": 1.0})
    g1 = load_leg("g1", locked={"right_knee_joint": 30.0})
    assert "right_knee_joint" not in g1.joint_names


def test_corners_of_a_sole_are_part_of_a_support():
    corners = "0.1,0.05,-0.03/0.1,-0.05,-0.03/-0.1,0,-0.03"
    leg, _ = loaded("--leg", "g1", "--support", f"left_ankle_roll_link:0.7:{corners}")
    (support,) = leg.supports
    assert support.friction == 0.7
    assert support.sole.tolist() == [[0.1, 0.05, -0.03], [0.1, -0.05, -0.03], [-0.1, 0, -0.03]]
    for wrong in ("0.1,0.05/0,0/1,1", "0,0,0/1,0,0/2,0,0", "a,b,c"):
        with pytest.raises(kd.InvalidInput, match=r"--support is .*or with corners"):
            loaded("--leg", "g1", "--support", f"left_ankle_roll_link:0.7:{wrong}")


def test_drives_of_a_command_are_a_file_or_none(tmp_path):
    file = tmp_path / "drives.toml"
    file.write_text('[joints]\n"*knee*" = { rotor_inertia_kg_m2 = 0.02 }')
    for arguments, knee in (
        ((), 0.025101925),
        (("--drives", "none"), 0),
        (("--drives", str(file)), 0.02),
    ):
        leg, _ = loaded("--leg", "g1", *arguments)
        assert leg.model.armature[leg.velocity_index("right_knee_joint")] == knee


def test_a_human_leg_of_a_size():
    leg, _ = loaded(
        "--leg", "human:height=1.65,mass=58,sex=female,side=left,model=3d",
        "--frame", "inside", "--lock", "subtalar=10",
    )  # fmt: skip
    size = {"height": 1.65, "mass": 58, "sex": "female", "side": "left", "model": "3d"}
    assert (
        leg.model
        == kd.Leg.human(**size, frame="inside").locked({"subtalar": math.radians(10)}).model
    )
    for wrong in ("human:", "human:height=1.65,height=2", "human:mass=x", "human:age=3"):
        with pytest.raises(
            kd.InvalidInput, match=f"--leg is '{wrong}': '.*' must be height=METRES"
        ):
            loaded("--leg", wrong)
