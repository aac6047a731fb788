"""`kickdyn check`: what it says of a file, by Pinocchio, MuJoCo and numpy, and what comes next."""

import re
from pathlib import Path
from xml.etree import ElementTree

import ezc3d
import gymnasium
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from tolerances import closed_form

import kickdyn as kd

ROOT = Path(__file__).resolve().parents[2]
HUMANOID = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
ROBOTS = sorted((ROOT / "urdf").glob("*.urdf"))
SCENES = sorted((ROOT / "scenes").glob("*.toml"))
SHOWN = 1e-3
"""Numbers in texts have four digits."""


def rows(file, *folders):
    """Return value and unit by name, of a file without problems."""
    found = kd.check(file, folders)
    assert found.problems == ()
    return {name: (value, unit) for name, value, unit in found.rows}


def numbers(text):
    return [float(word) for word in re.findall(r"-?[\d.]+(?:e[+-]\d+)?|-?inf", text)]


@pytest.mark.parametrize("file", ROBOTS, ids=lambda file: file.stem)
def test_a_urdf_has_the_masses_and_the_joints_of_pinocchio(file):
    seen, model = rows(file), pin.buildModelFromUrdf(str(file))
    links = ElementTree.parse(file).iter("link")
    links = {link.get("name"): float(mass.get("value")) for link in links
             if (mass := link.find("inertial/mass")) is not None}  # fmt: skip
    assert seen["mass"] == (pytest.approx(sum(links.values()), rel=closed_form()), "kg")
    for foot in seen["feet"][0].split(", "):
        side = foot.partition("_")[0] if "_" in foot else ""
        moved = sum(mass for name, mass in links.items() if name.startswith(side))
        if not side:  # all but what is fixed
            moved = pin.computeTotalMass(model)
        assert seen[f"mass of the leg of {foot}"][0] == pytest.approx(moved, rel=closed_form())
    for k, name in enumerate(list(model.names)[1:]):
        ends = np.degrees([model.lowerPositionLimit[k], model.upperPositionLimit[k]])
        right = [*ends, model.effortLimit[k], model.velocityLimit[k]]
        assert numbers(seen[f"joint {name}"][0]) == pytest.approx(right, rel=SHOWN), name
    assert (seen["faces"][0], seen["drives"][0][:4]) == ("x", "none")
    leg = kd.Leg.from_urdf(file, seen["feet"][0].split(", ")[-1])
    moves = abs(leg.posture(leg.configuration()).jacobian[0])
    speed = dict(zip(leg.joint_names, moves, strict=True))
    ranges = re.findall(r"--joint (\w+)=(-?\d+):(-?\d+):10", kd.check(file).commands[-1])
    assert {name for name, *_ in ranges} == set(sorted(speed, key=speed.get)[-2:])
    for name, *ends in ranges:  # whole degrees within its range, up to 40 to either side
        low, high = np.clip(np.degrees(leg.joint_range(name)), -40.0, 40.0)
        assert [float(end) for end in ends] == [np.ceil(low - 1e-6), np.floor(high + 1e-6)]


def test_of_a_leg_with_a_loop_no_kick_is_proposed():
    found = kd.check(ROOT / "urdf" / "leg_fourbar.urdf")
    assert any("legs without loops" in value for name, value, _ in found.rows if name == "note")
    (command,) = found.commands
    assert command.startswith("kickdyn posture-sweep")
    assert "--loop shank_pin:rocker_b_tip" in command


def test_an_mjcf_has_the_masses_and_the_rotors_of_mujoco():
    seen, model = rows(HUMANOID), mujoco.MjModel.from_xml_path(str(HUMANOID))
    assert seen["mass"][0] == pytest.approx(mujoco.mj_getTotalmass(model), rel=closed_form())
    for foot in ("left_foot", "right_foot"):
        hip = model.body(foot.replace("foot", "thigh")).id
        assert seen[f"mass of the leg of {foot}"][0] == pytest.approx(model.body_subtreemass[hip])
    assert numbers(seen["drives"][0]) == [np.count_nonzero(model.dof_armature)]
    assert (seen["kicks with"][0], seen["stands on"][0]) == ("right_foot:toe", "left_foot")
    low, high, *_ = numbers(seen["joint right_knee"][0])
    assert np.radians([low, high]) == pytest.approx(model.joint("right_knee").range, rel=SHOWN)


def turned(name, root, yaw):
    """Return the text of a shipped robot that is turned in its file by an angle [deg]."""
    joint = (f'<link name="ground"/><joint name="turn" type="fixed"><parent link="ground"/><child '
             f'link="{root}"/><origin rpy="0 0 {np.radians(yaw)}"/></joint></robot>')  # fmt: skip
    return (ROOT / "urdf" / name).read_text("utf-8").replace("</robot>", joint)


@pytest.mark.parametrize(("axis", "yaw"), [("x", 0), ("y", 90), ("-x", 180), ("-y", -90)])
def test_a_robot_that_is_turned_in_its_file_faces_another_axis(axis, yaw, kickdyn, written):
    """The commands turn it back, and the same foot kicks."""
    found = kd.check(written("biped.urdf", turned("biped.urdf", "trunk", yaw)))
    assert {name: value for name, value, _ in found.rows}["faces"] == axis
    option = [] if axis == "x" else [f"--facing {axis}"]
    assert len(found.problems) == len(option)
    assert all(word in line for word, line in zip(option, found.problems, strict=True))
    feet = f"--frame right_foot:toe {' '.join(option)}".strip()
    assert all(feet in command for command in found.commands)
    assert "--support left_foot:0.7" in found.commands[0]
    kickdyn("check biped.urdf", code=2 if option else 0)


@pytest.mark.parametrize(("axis", "yaw"), [("x", 0), ("y", 90), ("-x", 180), ("-y", -90)])
def test_the_root_of_an_mjcf_may_be_turned(axis, yaw, written, tmp_path):
    """The toe that kicks, on the base of the commands, is ahead of the ankle."""
    file = as_mjcf(written, tmp_path)
    half = np.radians(yaw / 2)
    turn = f'name="trunk" quat="{np.cos(half)} 0 0 {np.sin(half)}"'
    file.write_text(file.read_text("utf-8").replace('name="trunk"', turn), "utf-8")
    found = kd.check(file)
    assert {name: value for name, value, _ in found.rows}["faces"] == axis
    for base in ("fixed", "floating"):
        leg = kd.Leg.from_mjcf(file, "right_foot", base=base, facing=axis)
        toe = kd.kick_with(leg, "toe")
        ahead, *_ = toe.posture(toe.configuration()).contact_point
        assert ahead > leg.posture(leg.configuration()).contact_point[0] + 0.05


def test_missing_meshes_are_one_problem_whose_remedy_works(kickdyn, written, tmp_path):
    text = (ROOT / "urdf" / "leg_human.urdf").read_text("utf-8")
    written("leg.urdf", text.replace('filename="meshes/', 'filename="package://urdf/meshes/'))
    ended = kickdyn("check leg.urdf", code=2)
    assert ended.err.count("\n") == 1
    assert "--package-dir" in ended.err
    again = kickdyn("check leg.urdf --package-dir", ROOT)
    assert f"--package-dir {ROOT}" in again.out


def test_mimic_joints_and_legs_without_a_foot_to_stand_on_say_so(written):
    text = (ROOT / "urdf" / "biped.urdf").read_text("utf-8")
    follows = '<mimic joint="left_hip_pitch" multiplier="-0.5"/><axis xyz="0 1 0"/>'
    before, joint, after = text.partition('<joint name="left_knee" type="revolute">')
    after = after.replace('<axis xyz="0 1 0"/>', follows, 1)
    seen = rows(written("mimic.urdf", before + joint + after))
    assert seen["joint left_knee"][0].endswith("moves -0.5 times as left_hip_pitch")
    assert "--lock left_hip_pitch=VALUE" in seen["does not stand on"][0]
    after = after.replace('multiplier="-0.5"', 'multiplier="-0.5" offset="0.1"')
    found = kd.check(written("mimic.urdf", before + joint + after.replace("left_hip", "right_hip")))
    text = next(value for name, value, _ in found.rows if name == "joint left_knee")
    assert text.endswith("moves -0.5 times as right_hip_pitch from 5.73 deg")
    assert [command.split()[1] for command in found.commands] == ["posture-sweep"]
    assert any(
        "--lock right_hip_pitch=" in value for name, value, _ in found.rows if name == "note"
    )


ANKLE = 'lower="-0.3490658503988659" upper="0.8726646259971648"'


@pytest.mark.parametrize(("old", "new"), [
    ('name="hip"', 'name="ns/hip"'), ('xyz="0 1 0"/>', 'xyz="1 0 0"/>'),
    (ANKLE, 'lower="-0.9" upper="-0.83776"'), (ANKLE, 'lower="0.83776" upper="0.9"'),
])  # fmt: skip
def test_the_sweep_that_is_printed_runs(old, new, kickdyn, written):
    """No dataset has a variable with a slash; legs may move along y only, and never through 0."""
    text = (ROOT / "urdf" / "leg_testbed.urdf").read_text("utf-8")
    assert old in text
    text = text.replace(old, new)
    text = text.replace("0 -1 0", "1 0 0") if "xyz" in new else text
    command = kd.check(written("leg.urdf", text)).commands[-1]
    assert "--joint" in command
    kickdyn(command.removeprefix("kickdyn "))


def test_markers_of_a_c3d_file():
    file = ROOT / "data" / "kick_instep.c3d"
    seen, content = rows(file), ezc3d.c3d(str(file))
    points, parameters = content["data"]["points"][:3], content["parameters"]["POINT"]
    labels, rate = parameters["LABELS"]["value"], parameters["RATE"]["value"][0]
    assert seen["markers"][0] == ", ".join(labels)
    assert seen["unit in the file"][0] == parameters["UNITS"]["value"][0]
    assert seen["rate"] == (pytest.approx(rate), "Hz")
    gaps = dict(zip(labels, np.isnan(points).any(axis=0).sum(axis=1), strict=True))
    counted = {name: seen.get(f"gaps of {name}", (0,))[0] for name in labels}
    assert counted == gaps
    marker, speed = seen["fastest marker of the body"][0].split(", ")
    assert marker in ("RTOE", "RMT5")
    foot_speed, contact = 15.16, 0.2007  # true values in data/README.md
    assert numbers(speed) == pytest.approx([foot_speed, contact], rel=0.1)


def test_markers_and_angles_of_text_files(written):
    """The toe moves by 3 t^2 m, whose central difference is exact."""
    times = np.arange(41) / 200.0
    lines = ["PathFileType\t4", "DataRate\tUnits", "200\tmm", "Frame#\tTime\tRTOE\t\t\tball"]
    for k, t in enumerate(times):
        toe = "\t\t" if k in (3, 4) else f"{3000.0 * t * t}\t1000\t0"
        lines.append(f"{k}\t{t}\t{toe}\t0\t100\t0")
    seen = rows(written("kick.trc", "\n".join([*lines[:4], "\t\tX1", *lines[4:]])))
    assert seen["unit in the file"][0] == "mm"
    assert seen["rate"] == (pytest.approx(200.0), "Hz")
    assert seen["gaps of RTOE"] == (2, "frames, 0.015 to 0.02 s")
    speed = 3.0 * (times[-1] ** 2 - times[-2] ** 2) * 200.0
    fastest = numbers(seen["fastest marker of the body"][0])
    assert fastest == pytest.approx([speed, times[-1]], rel=SHOWN)

    angles = ["" if k in (3, 4, 9) else -60.0 * t for k, t in enumerate(times)]
    table = "".join(f"{t}\t{a}\t{t}\n" for t, a in zip(times, angles, strict=True))
    head = "inDegrees=yes\nendheader\ntime\tknee_angle_r\tpelvis_tx\n"
    seen = rows(written("kick.mot", head + table))
    assert seen["rate"] == (pytest.approx(200.0), "Hz")
    assert seen["coordinate knee_angle_r"] == (pytest.approx([-12.0, 0.0]), "deg")
    assert seen["gaps of knee_angle_r"] == (3, "rows")
    assert seen["coordinate pelvis_tx"] == (pytest.approx([0.0, 0.2]), "m")
    head = "inDegrees=no\nendheader\ntime\tknee_angle_r\tground_force_vy\n"
    file = written("kick.mot", head + table.replace("0.2\t-12.0", "0.2\t-38"))
    found = kd.check(file)
    assert ["as in degrees" in line for line in found.problems] == [True]
    assert found.rows[-2][:2] == ("column ground_force_vy", pytest.approx([0.0, 0.2]))


def test_drives_and_scenes_say_what_they_have(written):
    """The inertia of a rotor counts at its joint with the square of the gear ratio."""
    drive = "{ rotor_inertia_kg_m2 = 2e-5, gear = 30 }"
    seen = rows(written("drives.toml", f"[joints]\nknee = {drive}\n"))
    assert seen["knee"] == (pytest.approx(30**2 * 2e-5), "kg m2 at the joint")
    scene = kd.check(SCENES[0])
    assert list(map(str, scene.rows)) == list(map(str, kd.load_scene(SCENES[0])._rows()))
    assert [command.split()[1] for command in scene.commands] == ["simulate", "view"]


def test_a_ball_track_has_the_rate_and_the_flights_of_the_match(match_ball):
    file = match_ball(1, 500)
    seen, table = rows(file), np.genfromtxt(file, delimiter=",", skip_header=1)
    assert seen["samples"][0] == len(table)
    assert seen["rate"] == (pytest.approx(1.0 / np.median(np.diff(table[:, 0]))), "Hz")
    flights = kd.segments(kd.Track(table[:, 0], table[:, 1:]), kd.Ball()).flights
    assert seen["flights"][0] == len(flights)
    assert seen["longest flight"][0] == max(flight.duration for flight in flights)


def thrown(header, scale=1.0, without=()):
    """Return the text of a track of a ball thrown to 1 m above the ground, in vacuum, at 50 Hz."""
    rows = [header]
    for t in np.arange(40) / 50.0:
        if t not in without:
            heights = scale * np.array([8.0 * t, 0.0, 0.2 + 4.0 * t - 9.81 / 2.0 * t**2])
            rows.append(",".join(map(str, [t, *heights])))
    return "\n".join(rows)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("header", [
    "time,X,Y,Z", "Time (s),X [m],Y [m],Z [m]", "t_s,ball_x_m,ball_y_m,ball_z_m",
    "t,x_mm,y_mm,z_mm",
])  # fmt: skip
def test_usual_names_of_columns_are_found(header, separator, kickdyn, written):
    scale = 1000.0 if "_mm" in header else 1.0
    text = thrown(header, scale, without=[0.4, 0.42])
    file = written("track.csv", text.replace(",", separator))
    seen = rows(file)
    assert kd.check(file).problems == ()
    assert seen["highest corner"][0][0] == pytest.approx(8.0 * 39 / 50)
    assert seen["columns"][0].split(", ") == header.split(",")
    assert seen["gaps in time"] == (1, "the longest 0.06 s, from 0.38 s")
    (command,) = kd.check(file).commands
    kickdyn(command.removeprefix("kickdyn ").removesuffix(" --plot flight.png"))


FREE_BODY = """<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>"""
XACRO = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:leg/></robot>'
BAD = [
    ("missing.urdf", None, "no such file"), ("robot.txt", "<robot/>", ".urdf"),
    ("empty.urdf", "", "empty"), ("empty.c3d", "", "not a C3D"), ("empty.csv", "", "--columns"),
    ("a.urdf.xacro", XACRO, "xacro FILE > robot.urdf"), ("a.xml", "<mujoco/>", "no moving joint"),
    ("a.xml", FREE_BODY, "no moving joint"),
    ("a.urdf", '<robot name="a"><link name="b"/></robot>', "no moving joint"),
    ("table.trc", "t,x,y,z", "PathFileType"), ("table.mot", "t,x,y,z", "endheader"),
    ("table.toml", "t,x,y,z", "not TOML"), ("words.csv", "a;b;c;d\n0;1;2;3", "--columns"),
    ("named.csv", thrown("when,east,north,up"), "'when', 'east'"),
    ("large.csv", thrown("t,x,y,z", 1000.0), "millimetres"),
    ("yards.csv", thrown("t,x,y,z", 1.0936), "yards"),
    ("one.csv", "t,x,y,z\n0,1,2,3", "at least 5"),
    *((f"binary.{ending}", b"\xff\x00\x9d" * 99, f"binary.{ending}: ")
      for ending in ("urdf", "xml", "csv", "trc", "sto", "toml", "c3d")),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "said"), BAD, ids=[name for name, *_ in BAD])
def test_a_bad_file_is_one_line(name, content, said, kickdyn, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    ended = kickdyn(f"check {name}", code=2)
    assert ended.err.startswith(f"kickdyn: {name}: ")
    assert ended.err.count("\n") == 1
    assert said in ended.err
    assert kickdyn(f"check {name} --json -", code=2).json["problems"]


def test_folders_and_names_that_no_file_has_are_refused(tmp_path):
    for name in (tmp_path, "nul\0.csv", "x" * 5000 + ".csv", "/dev/zero"):
        assert len(kd.check(name).problems) == 1, name
    with pytest.raises(kd.InvalidInput, match="path is None"):
        kd.check(None)


def run_printed(file, kickdyn):
    """Check that the printed commands are those of `kd.check`, and run them."""
    commands = re.findall("^next: (.*)$", kickdyn("check", file).out, re.MULTILINE)
    assert (*commands,) == kd.check(file).commands != ()
    for command in commands:
        kickdyn(command.removeprefix("kickdyn "))


@pytest.mark.slow
@pytest.mark.parametrize("file", [*ROBOTS, *SCENES, *(ROOT / "data").glob("*.c*")],
                         ids=lambda file: file.name)  # fmt: skip
def test_every_command_that_is_printed_runs(file, kickdyn):
    run_printed(file, kickdyn)


def as_mjcf(written, tmp_path):
    """The biped, as MuJoCo writes it."""
    settings = '<mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco></robot>'
    text = (ROOT / "urdf" / "biped.urdf").read_text("utf-8").replace("</robot>", settings)
    model = mujoco.MjModel.from_xml_path(str(written("biped.urdf", text)))
    mujoco.mj_saveLastXML(str(tmp_path / "biped.xml"), model)
    return tmp_path / "biped.xml"


@pytest.mark.slow
def test_the_commands_for_an_mjcf_run(kickdyn, written, tmp_path):
    seen = rows(as_mjcf(written, tmp_path))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "biped.xml"))
    assert seen["mass"][0] == pytest.approx(mujoco.mj_getTotalmass(model))
    assert seen["stands on"][0] == "left_foot"
    run_printed(tmp_path / "biped.xml", kickdyn)


T = np.arange(30) / 50.0
SWING = np.column_stack([0.5 * np.sin(4 * T), 0.6 + 0.5 * np.cos(5 * T), -0.2 + 0.1 * np.cos(T)])


@pytest.fixture
def swing(written):
    return written("swing.csv", "\n".join(",".join(map(repr, row)) for row in SWING.tolist()))


def test_the_document_has_the_numbers_of_the_functions(swing, kickdyn):
    ended = kickdyn("check-motion swing.csv --rate 50 --friction 0.3 --json -")
    motion = kd.read_motion(swing, kd.Leg.human(), rate=50)
    check = kd.check_motion(motion, kd.Leg.human(), kd.Ball(), kd.Contact(friction=0.3))
    assert ended.json == check.to_json()
    assert ended.json["best"]["time"] == pytest.approx(T[check.best])
    missing = int(check.launches.ball_speed.isnull().sum())
    assert ended.json["launches"]["ball_speed"].count(None) == missing


def test_plot_and_page_are_written_and_broken_limits_are_no_failure(swing, kickdyn, tmp_path):
    words = "--plot swing.png --view swing.html --json swing.json"
    ended = kickdyn(f"check-motion swing.csv --rate 200 {words}")
    assert "torque of hip is beyond its limit" in " ".join(ended.out.split())
    for file in ("swing.png", "swing.html", "swing.json"):
        assert f"wrote {file}" in ended.out
        assert (tmp_path / file).stat().st_size > 1000
    for text in ("0 to 0.145 s, 200 frames per second", "broken: torque of hip is beyond"):
        assert text in (tmp_path / "swing.html").read_text("utf-8")


@pytest.mark.parametrize(("words", "said"), [
    ("swing.csv", "rate is None"), ("none.csv --rate 50", "no such file"),
    ("swing.csv --rate 50 --leg testbed --joints hip,knee", "joints: lacks"),
    ("swing.csv --rate 50 --leg bolt", "3 columns"), ("swing.csv --rate -1", "rate is -1"),
])  # fmt: skip
def test_bad_input_is_one_line(words, said, swing, kickdyn):
    ended = kickdyn(f"check-motion {words}", code=2)
    lines = [line for line in ended.err.splitlines() if not line.startswith("warning: ")]
    assert len(lines) == 1
    assert said in lines[0]
