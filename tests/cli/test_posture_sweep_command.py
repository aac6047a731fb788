"""The main door, as a user opens it."""

import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr

import kickdyn
from kickdyn.air import AIRS
from kickdyn.cli import posture_sweep_command
from kickdyn.cli.command import run
from kickdyn.cli.leg_options import load_leg
from kickdyn.cli.posture_sweep_command import posture_sweep
from kickdyn.core import compilation
from kickdyn.robot.leg import NO_DRIVES
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.sweep_kick import kick_from

SMALL = ["--joint", "hip=0:40:20", "--joint", "knee=10", "--joint", "ankle=0"]


def door(*arguments, cwd="."):
    """Run the command in this process, as `python -m kickdyn.posture_sweep` does."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["posture-sweep", *arguments])
        patch.chdir(cwd)
        with pytest.raises(SystemExit) as ended:
            run(posture_sweep)
    code = ended.value.code
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def started(*arguments, cwd):
    """Run the command in a process of its own."""
    noise = "ignore:zmq.eventloop.ioloop is deprecated"  # meshcat's
    strict = [sys.executable, "-W", "error", "-W", noise]
    command = [*strict, "-m", "kickdyn.posture_sweep", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=3600, cwd=cwd)


def interruptible():
    """Heed Ctrl-C, which what a shell runs in the background does not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_table_and_files(tmp_path):
    files = ["--out", "sweep.nc", "--plot", "sweep.png", "--json", "sweep.json"]
    ended = started(*SMALL, *files, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    for words in ("Table 2 a", "1.557", "1.554", "best (hip ", "worst (hip ", "3 postures: 3 ok."):
        assert words in ended.stdout
    assert "…" not in ended.stdout
    assert {f.name for f in tmp_path.iterdir()} == {"sweep.nc", "sweep.png", "sweep.json"}
    with xr.open_dataset(tmp_path / "sweep.nc") as data:
        assert dict(data.sizes) == {"hip": 3, "knee": 1, "ankle": 1}
    report = json.loads((tmp_path / "sweep.json").read_text())
    assert [line["posture"] for line in report["lines"]][-2:] == ["best", "worst"]


def test_a_zarr_store_says_what_a_file_says(tmp_path):
    speed = ("--speed", "4", "--air", "none")
    stored = door(*SMALL, *speed, "--out", "s.zarr", "--threads", "2", cwd=tmp_path)
    written = door(*SMALL, *speed, "--out", "s.nc", cwd=tmp_path)
    assert (stored.returncode, stored.stderr) == (0, "")
    rows = [each.stdout.split("The relative residuals")[0] for each in (stored, written)]
    assert rows[0] == rows[1]
    assert "wrote s.zarr" in stored.stdout
    again = door(*SMALL, *speed, "--out", "s.zarr", "--resume", cwd=tmp_path)
    assert again.stdout == stored.stdout
    assert again.stderr == ""
    for arguments, words in (
        (("--out", "s.zarr"), "s.zarr exists and is not replaced: add --resume"),
        (("--out", "t.nc", "--resume"), "--resume needs a Zarr store"),
    ):
        ended = door(*SMALL, *speed, *arguments, cwd=tmp_path)
        assert ended.returncode == 2
        assert words in ended.stderr


def test_every_option_of_the_kick_counts():
    options = ("--speed", "3", "--attack", "10", "--restitution", "0.5", "--friction", "0.05")
    ended = door(*SMALL, *options, "--air", "paper", "--frame", "foot", "--json", "-")
    report = json.loads(ended.stdout)
    leg, air = load_leg("human", "foot"), AIRS["paper"]
    kick = kickdyn.Kick(speed=3.0, attack=np.radians(10), restitution=0.5, friction=0.05, air=air)
    for line in report["lines"]:
        q = leg.configuration({k: np.radians(v) for k, v in line["angles_deg"].items()})
        outcome = kick_from(leg.posture(q), kick)
        assert line["impulse_vector"] == pytest.approx(outcome.impact.impulse.tolist(), rel=1e-12)
        assert line["carry"] == pytest.approx(outcome.carry, rel=1e-9)


def test_a_restitution_over_speed_is_taken_at_the_foots_speed():
    reports = []
    for e in ("0.7", "1:0.8,3:0.6"):
        ended = door(*SMALL, "--speed", "2", "--restitution", e, "--json", "-")
        reports.append(json.loads(ended.stdout))
    assert [report["restitution"] for report in reports] == pytest.approx([0.7, 0.7])
    assert [report["restitution_given"] for report in reports] == [0.7, [[1, 0.8], [3, 0.6]]]
    speeds = [report["best"]["ball_speed"] for report in reports]
    assert speeds[0] == pytest.approx(speeds[1], rel=1e-14)
    assert reports[0]["warnings"] == []
    ball = ("--ball", "0.43:0.11:80e3")
    ended = door(*SMALL, *ball, "--speed", "2", "--restitution", "inflated", "--json", "-")
    inflated = json.loads(ended.stdout)
    assert inflated["restitution_given"] == "inflated"
    wanted = kickdyn.Contact((1, 0, 0), "inflated").restitution_at(
        2.0, kickdyn.Ball(0.43, 0.11, pressure=80e3)
    )
    assert inflated["restitution"] == pytest.approx(wanted, abs=1e-15)
    ended = door(*SMALL, "--speed", "2", "--restitution", "peacock-ball", "--json", "-")
    assert "9.1 to 21.2 m/s, and the foot approaches at 2 m/s" in ended.stderr
    (line,) = json.loads(ended.stdout)["warnings"]
    assert "9.1 to 21.2 m/s" in line


def test_the_tolerance_of_carries_counts(tmp_path):
    grid = ("--joint", "hip=0:40:2", "--joint", "knee=0:60:2", "--joint", "ankle=0:20:4")
    door(*grid, "--tolerance", "1e-3", "--out", "s.nc", cwd=tmp_path)
    with xr.open_dataset(tmp_path / "s.nc") as data:
        assert data.attrs["carry_tolerance_m"] == 1e-3


def test_conditions_choose_best_and_worst(tmp_path):
    asked = ("--where", "hip < 30 and ankle == 0", "--json", "j.json")
    told = []
    for out in ("s.nc", "s.zarr"):
        ended = door(*SMALL, *asked, "--out", out, "--plot", "p.png", cwd=tmp_path)
        replaced = "j.json, p.png exist and will be replaced\n" if out == "s.zarr" else ""
        assert (ended.returncode, ended.stderr) == (0, replaced)
        assert "among the 2 with status ok where hip < 30 and ankle == 0." in ended.stdout
        assert (tmp_path / "p.png").stat().st_size > 10_000
        told.append(json.loads((tmp_path / "j.json").read_text()))
    for report in told:
        assert (report["where"], report["chosen"], report["postures"]) == (asked[1], 2, 3)
        best = report["lines"][-2]
        assert best["posture"] == "best"
        assert best["angles_deg"]["hip"] in (0, 20)
    assert told[0]["lines"][-2]["ball_speed"] == pytest.approx(told[1]["lines"][-2]["ball_speed"])


def test_a_condition_that_nothing_fulfils_is_a_line_and_an_empty_table(tmp_path):
    files = ("--out", "s.nc", "--json", "j.json", "--plot", "p.png", "--view", "v.html")
    ended = door("--leg", "testbed", *SMALL, "--where", "hip > 90", *files, cwd=tmp_path)
    assert ended.returncode == 0
    assert ended.stderr == "no posture is ok where hip > 90: there is nothing to view\n"
    assert "3 postures: 3 ok.\nNo posture is ok where hip > 90.\n" in ended.stdout
    assert "best" not in ended.stdout
    assert re.search(r"hip, deg *\n", ended.stdout)
    report = json.loads((tmp_path / "j.json").read_text())
    assert (report["lines"], report["chosen"], report["status"]["ok"]) == ([], 0, 3)
    assert {f.name for f in tmp_path.iterdir()} == {"s.nc", "j.json", "p.png"}


def test_of_more_than_a_million_without_a_store_the_answers_are_kept(tmp_path):
    large = ["--joint", "hip=0:40:0.4", "--joint", "knee=10:60:0.5", "--joint", "ankle=0:20:0.2"]
    asked = ("--where", "knee < 20", "--json", "j.json", "--plot", "p.png", "--view", "v.html")
    ended = door(*large, *asked, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    report = json.loads((tmp_path / "j.json").read_text())
    assert report["postures"] == 101 * 101 * 101
    assert max(report["best"]["angles_deg"]["knee"] + report["front"]["angles_deg"]["knee"]) < 20
    best = report["lines"][-2]
    assert best["angles_deg"]["hip"] == pytest.approx(report["best"]["angles_deg"]["hip"][0])
    assert best["ball_speed"] == pytest.approx(report["best"]["ball_speed"][0], rel=1e-12)
    assert {f.name for f in tmp_path.iterdir()} == {"j.json", "p.png", "v.html"}
    ended = door(*large, "--out", "s.nc", cwd=tmp_path)
    assert ended.returncode == 2
    assert "name a store, --out DIR.zarr" in ended.stderr


def test_ctrl_c_says_how_to_go_on(tmp_path):
    """A terminal sends it to all processes of the command."""
    large = ["--joint", "hip=0:40:0.1", "--joint", "knee=10:60:0.05", "--joint", "ankle=0:20:0.05"]
    command = [sys.executable, "-m", "kickdyn.posture_sweep", *large, "--out", "my s.zarr"]
    colours = {**os.environ, "FORCE_COLOR": "1"}
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=colours,
                          stdout=subprocess.PIPE, preexec_fn=interruptible,
                          start_new_session=True) as stopped:  # fmt: skip
        while not list(tmp_path.glob("*/status/c/*")) and stopped.poll() is None:
            time.sleep(0.05)
        os.killpg(stopped.pid, signal.SIGINT)
        out, said = stopped.communicate()
    assert (stopped.returncode, out) == (1, "")
    assert said.count("\n") == 1
    stored = r"interrupted: [\d,]+ of [\d,]+ postures are stored in my s\.zarr; to continue, run "
    assert re.search(rf"{stored}it again with --resume \(resume=True in Python\)$", said)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_the_progress_says_what_is_compiled(monkeypatch):
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    with posture_sweep_command._progress_bar(10):
        compilation.log.info("compiling a kernel")
    compilation.log.info("compiling for someone else")
    assert "compiling a kernel; later runs read it from disk" in terminal.getvalue()
    assert "someone else" not in terminal.getvalue()


def test_json_on_stdout_stands_alone():
    ended = door(*SMALL, "--json", "-", "--leg", "testbed")
    report = json.loads(ended.stdout)
    assert report["status"]["ok"] == report["postures"] == 3
    assert [line["posture"] for line in report["lines"]] == ["best", "worst"]
    assert ended.stderr == ""


def test_a_locked_joint_of_the_default_leg():
    """The paper's postures have three angles, and are left out."""
    ended = door("--lock", "ankle=0", "--joint", "hip=0:40:20", "--joint", "knee=10")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "3 postures: 3 ok." in ended.stdout
    assert "Table 2" not in ended.stdout
    default = door("--lock", "ankle=0", "--json", "-")
    assert json.loads(default.stdout)["postures"] == 11 * 13  # hip and knee in steps of 5 deg


def test_any_urdf(tmp_path):
    urdf = kickdyn.Leg.human().file
    (tmp_path / "mine.urdf").write_text(urdf.text.replace('name="leg_human"', 'name="mine"'))
    ended = door("--leg", "mine.urdf", "--frame", "foot", "--joint", "knee=10", cwd=tmp_path)
    assert ended.returncode == 0
    assert "mine: foot 1 m/s" in ended.stdout
    assert "Table 2 a" not in ended.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--leg", "missing.urdf"], "missing.urdf: there is no such file"),
        (["--leg", "page.html"], "not <robot>"),
        (["--leg", "missing"], "neither human, testbed, g1, talos"),
        (["--frame", "nose"], "frame 'nose' is unknown: leg_human has"),
        (["--joint", "nose=1"], "joint 'nose' is unknown: leg_human has hip, knee, ankle"),
        (["--joint", "hip=0:200:10"], "its range is -30 to 125 deg"),
        (["--restitution", "1.2"], "restitution is 1.2"),
        (["--friction", "-0.1"], "friction is -0.1"),
        (["--joint", "hip=5"], "joint 'hip' is given twice"),
        (["--where", "kne<30"], "names 'kne', which is unknown: there are hip [deg], knee [deg]"),
        (["--where", "knee=30"], "'knee=30' cannot be read: it consists of comparisons"),
        (["--where", "knee"], "is a number: compare it"),
        (["--out", "file.zarr"], "file.zarr exists and is not replaced: add --resume"),
        (["--out", "file.zarr", "--resume"], "file.zarr cannot be read as a sweep"),
        (["--out", "no/where.zarr"], "no/where.zarr cannot be written"),
        (["--out", "s.zarr", "--plot", "p.exe"], "plots are written as .png"),
        (["--speed", "nan"], "foot speed is nan"),
        (["--speed", "fast"], "'fast' is not a valid float"),
        (["--attack", "120"], "attack is 120"),
        (["--air", "thick"], "'thick' is not one of 'standard', 'paper', 'none'"),
        (["--out", "no/where.nc"], "no/where.nc cannot be written"),
        (["--out", "sweep.csv"], "written as .nc"),
        (["--plot", "sweep.exe"], "plots are written as .png"),
        (["--view", "no/where.html"], "no/where.html cannot be written"),
        (["--json", "."], "is a folder"),
        (["--nose"], "No such option '--nose'"),
        (["--resume"], "--resume needs a Zarr store"),
        (["--tolerance", "-1"], "tolerance is -1"),
        (["--threads", "0"], "0 is not in the range 1<=x<=1024"),
        (["--view", "page.txt"], "page.txt has no known extension: a page is written as .html"),
        (["--leg", "page.html", "--json", "page.html"], "page.html is an input"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(tmp_path, arguments, words):
    (tmp_path / "page.html").write_text("<html><body/></html>")
    (tmp_path / "file.zarr").write_text("no store")
    ended = (
        door(*SMALL, *arguments, "--json", "out.json", cwd=tmp_path)
        if ("--json" not in arguments)
        else door(*SMALL, *arguments, cwd=tmp_path)
    )
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert words in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert {f.name for f in tmp_path.iterdir()} == {"page.html", "file.zarr"}


def test_help_shows_an_example():
    ended = door("--help")
    assert ended.returncode == 0
    assert "Example: kickdyn posture-sweep --joint" in ended.stdout


def test_the_console_script_has_the_same_door():
    command = [
        sys.executable,
        "-c",
        "from kickdyn.cli.commands import main; main()",
        "posture-sweep",
    ]
    ended = subprocess.run([*command, *SMALL, "--json", "-"], capture_output=True, text=True)
    assert json.loads(ended.stdout)["postures"] == 3


def urdf_of(tmp_path, **changes):
    text = kickdyn.Leg.human().file.text
    for old, new in changes.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    (tmp_path / "mine.urdf").write_text(text)
    return "mine.urdf"


@pytest.mark.parametrize("name", ["carry", "status", "speed_ratio", "a/b", "."])
def test_a_joint_must_not_hide_a_result(tmp_path, name):
    leg = urdf_of(tmp_path, hip=name)
    ended = door("--leg", leg, "--joint", f"{name}=0:10:5", "--out", "x.nc", cwd=tmp_path)
    assert ended.returncode == 2
    assert f"joint '{name}' cannot be swept" in ended.stderr
    assert not (tmp_path / "x.nc").exists()


def test_odd_names_are_just_names(tmp_path):
    odd = r"$\frac$ [red]"
    leg = urdf_of(tmp_path, hip=odd)
    shutil.copytree(shipped_urdf("meshes"), tmp_path / "meshes")
    files = ["--drives", "none", "--out", "x.nc", "--plot", "x.png", "--view", "x.html"]
    ended = door("--leg", leg, "--joint", f"{odd}=0:10:5", *files, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert odd in ended.stdout


def test_table_2_stands_only_beside_the_kick_it_is_for():
    assert "in the paper" in door(*SMALL).stdout
    assert "in the paper" not in door(*SMALL, "--speed", "2").stdout
    assert "in the paper" not in door(*SMALL, "--restitution", "0.7").stdout
    assert "in the paper" not in door(*SMALL, "--attack", "20").stdout
    assert "in the paper" not in door(*SMALL, "--frame", "foot").stdout


def test_what_the_leg_cannot_do_is_said(tmp_path):
    ended = door(*SMALL, "--speed", "60")
    assert "too-fast" in ended.stdout
    assert "3 too-fast" in ended.stdout
    ended = door(*SMALL, "--speed", "60", "--view", "x.html", "--out", "x.nc", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "no posture is ok: there is nothing to view\n")
    assert [file.name for file in tmp_path.iterdir()] == ["x.nc"]


def test_a_missing_mesh_costs_no_result(tmp_path):
    text = kickdyn.Leg.testbed().file.text
    box = '<box size="0.1 0.14 0.08" />'
    assert box in text
    (tmp_path / "mine.urdf").write_text(text.replace(box, '<mesh filename="no.stl"/>'))
    files = ["--out", "x.nc", "--json", "x.json", "--view", "x.html"]
    ended = door("--leg", "mine.urdf", *SMALL, *files, cwd=tmp_path)
    assert ended.returncode == 0
    no_drives, warning = ended.stderr.splitlines()
    assert no_drives == f"warning: {NO_DRIVES}"
    assert warning.startswith(
        "warning: 1 of 7 visuals of leg_testbed is not drawn: mesh 'no.stl' is"
    )
    assert {"x.nc", "x.json", "x.html"} < {file.name for file in tmp_path.iterdir()}
    assert "mesh &#x27;no.stl&#x27; is missing" in (tmp_path / "x.html").read_text()


def test_a_ros_package_is_drawn_from_the_folder_that_is_named(tmp_path):
    """Three meshes: two of the package that the file is in, and one of another."""
    text = re.sub(r"<visual>.*?</visual>", "", kickdyn.Leg.human().file.text, flags=re.DOTALL)
    names = {
        "thigh": "package://my_robot/meshes/thigh.stl",
        "shank": "../meshes/shank.stl",
        "foot": "package://my_foot/foot.stl",
    }
    for link, name in names.items():
        mesh = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{mesh}')
    robot, foot = tmp_path / "src/robot", tmp_path / "other/my_foot"
    for folder in (robot / "urdf", robot / "meshes", foot):
        folder.mkdir(parents=True)
    (robot / "urdf/my.urdf").write_text(text)
    (robot / "package.xml").write_text("<package><name>my_robot</name></package>")
    for file in (robot / "meshes/thigh.stl", robot / "meshes/shank.stl", foot / "foot.stl"):
        trimesh.creation.box((0.1, 0.1, 0.3)).export(file)
    command = ["--leg", "src/robot/urdf/my.urdf", *SMALL, "--drives", "none", "--view", "x.html"]
    ended = door(*command, "--package-dir", "src", "--package-dir", "other", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    ended = door(*command, cwd=tmp_path)
    assert ended.returncode == 0
    replaced, warning = ended.stderr.splitlines()
    assert replaced == "x.html exists and will be replaced"
    assert warning.startswith(
        "warning: 1 of 3 visuals of leg_human is not drawn: mesh 'package://m"
    )
    assert "package 'my_foot' is unknown" in warning
    assert "--package-dir" in warning


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--package-dir", "gone"], "Directory 'gone' does not exist"),
        (["--package-dir", "."], "it is for a URDF file, not human"),
    ],
)
def test_a_package_dir_that_is_of_no_use(arguments, reason, tmp_path):
    ended = door(*SMALL, *arguments, cwd=tmp_path)
    assert ended.returncode == 2
    assert reason in ended.stderr


def test_a_page_that_fails_comes_after_the_results(tmp_path, monkeypatch):
    """What is written first is what took the time."""

    def fail(*_, **__):
        raise kickdyn.InvalidInput("no page")

    monkeypatch.setattr("kickdyn.view.page.page", fail)
    monkeypatch.chdir(tmp_path)
    files = ["--out", "x.nc", "--json", "x.json", "--view", "x.html"]
    with pytest.raises(kickdyn.InvalidInput, match="no page"):
        posture_sweep.main([*SMALL, *files], standalone_mode=False)
    assert {file.name for file in tmp_path.iterdir()} == {"x.nc", "x.json"}


def test_two_outputs_are_two_files(tmp_path):
    ended = door(*SMALL, "--plot", "x.png", "--json", "x.png", cwd=tmp_path)
    assert ended.returncode == 2
    assert "x.png is named for two outputs" in ended.stderr


def test_a_page(tmp_path):
    ended = door(*SMALL, "--view", "kick.html", cwd=tmp_path)
    assert ended.returncode == 0
    assert "<title>leg_human: ball at" in (tmp_path / "kick.html").read_text()


def test_output_that_cannot_be_shown():
    command = [sys.executable, "-m", "kickdyn.posture_sweep", *SMALL]
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == 1
    assert ended.stderr == "posture-sweep: No space left on device\n"


def test_bare_console_script_shows_its_help():
    command = [sys.executable, "-c", "from kickdyn.cli.commands import main; main()"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0
    assert "Commands:\n" in ended.stdout


def test_a_robot_is_swept_by_name():
    sweep = ("--leg", "g1", "--joint", "right_knee_joint=0:40:20", "--speed", "2")
    ended = door(*sweep)
    assert ended.returncode == 0, ended.stderr
    assert "right_knee_joint" in ended.stdout
    assert "left" not in ended.stdout
    whole = kickdyn.Leg.from_robot("g1")
    q = whole.configuration({"right_knee_joint": np.radians(40)})
    weight = whole.posture(q).effective_mass((np.cos(np.pi / 6), 0, 0.5))
    assert f"{weight:.4g}" in ended.stdout
    ended = door(*sweep, "--frame", "nose")
    assert ended.returncode == 2
    assert "frame 'nose' is unknown: did you mean 'instep'? g1 has" in ended.stderr


def test_ball_and_law():
    ended = door(*SMALL, "--ball", "0.3:0.09", "--law", "stronge", "--json", "-")
    assert (ended.returncode, ended.stderr) == (0, "")
    found = json.loads(ended.stdout)
    assert found["impact_law"] == "stronge"
    assert (found["ball_mass_kg"], found["ball_radius_m"]) == (0.3, 0.09)
    assert "law stronge, restitution 0.8, friction 0.4, ball 0.45 kg, radius 0.1 m" in " ".join(
        door(*SMALL, "--ball", "paper", "--law", "stronge").stdout.split()
    )


@pytest.mark.parametrize(
    ("ball", "words"),
    [
        ("inf:0.1", "ball mass is inf: it must be a finite number at least 0.001 and at most 1000"),
        ("0.4:1e100", "ball radius is 1e+100: it must be a finite number at least 0.001"),
        ("tennis", "--ball is 'tennis': it must be size-5, paper, or MASS:RADIUS"),
        ("1:2:3:4", "--ball is '1:2:3:4': it must be"),
        ("0:1", "ball mass is 0.0"),
        ("nan:1", "ball mass is nan"),
    ],
)
def test_what_is_no_ball_for_a_sweep(ball, words):
    ended = door(*SMALL, "--ball", ball)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(f"posture-sweep: {words}")
    assert ended.stderr.count("\n") == 1


def test_named_variables_and_those_of_the_table_are_kept(tmp_path):
    where = ("--where", "carry > 0.1")
    for file in ("x.nc", "x.zarr"):
        ended = door(*SMALL, "--variables", "carry, impulse", *where, "--out", file, cwd=tmp_path)
        assert (ended.returncode, ended.stderr) == (0, "")
        with kickdyn.open_sweep(tmp_path / file) as data:
            names = ["impulse", "ball_speed", "worst_joint_impulse", "speed_use", "carry", "status"]
            assert list(data.data_vars) == names


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--variables", "cary", "--out", "x.nc"], "variable 'cary' is unknown: did you mean 'car"),
        (
            ["--variables", "carry,", "--out", "x.nc"],
            "variable '' is unknown: a sweep has eff",
        ),
        (
            ["--variables", "carry"],
            "--variables selects what --out writes: add --out FILE.nc or",
        ),
        (
            ["--variables", "carry", "--out", "x.nc", "--where", "impulse > 1"],
            "names 'impulse', which this sweep does not keep: there are hip [deg], knee [deg]",
        ),
    ],
)
def test_variables_that_cannot_be_kept(arguments, words, tmp_path):
    ended = door(*SMALL, *arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert words in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_long_sweep_says_first_what_it_takes(tmp_path, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(posture_sweep_command, "sweep", stopped)
    axes = [f"--joint={name}=0:60:{step}" for name, step in (("hip", 0.04), ("knee", 0.04))]
    store = ("--joint", "ankle=0:40:0.025", "--out", "s.zarr", "--variables", "carry")
    ended = door(*axes, *store, cwd=tmp_path)
    said = r"^3,607,054,601 postures take about 18 minutes of processor time and 36 GB in s\.zarr\n"
    assert re.match(said, ended.stderr)
    ended = door(*axes, *store, "--law", "stronge", cwd=tmp_path)
    assert "take about 120,235 minutes" in ended.stderr


@pytest.mark.parametrize(
    "option", ["--out", "--joint", "--leg", "--where", "--plot", "--variables"]
)
def test_a_name_of_5000_letters_is_one_line(tmp_path, option):
    value = "x" * 5000 + {"--out": ".zarr", "--joint": "=1", "--plot": ".png"}.get(option, "")
    out = ("--out", "s.nc") if option == "--variables" else ()
    ended = door(*SMALL, option, value, *out, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.count("\n") == 1
    assert len(ended.stderr) < 600
    assert not list(tmp_path.iterdir())
