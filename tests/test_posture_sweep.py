"""The main door, as a user opens it."""

import json
import subprocess
import sys

import pytest
import xarray as xr

import kickdyn

SMALL = ["--joint", "hip=0:40:20", "--joint", "knee=10", "--joint", "ankle=0"]


def door(*arguments, cwd=None):
    command = [sys.executable, "-W", "error", "-m", "kickdyn.posture_sweep", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=cwd)


def test_table_and_files(tmp_path):
    files = ["--out", "sweep.nc", "--plot", "sweep.png", "--json", "sweep.json"]
    ended = door(*SMALL, *files, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    for words in ("paper a", "1.557", "1.554", "best (hip ", "worst (hip ", "3 postures: 3 ok."):
        assert words in ended.stdout
    assert "…" not in ended.stdout
    assert {f.name for f in tmp_path.iterdir()} == {"sweep.nc", "sweep.png", "sweep.json"}
    with xr.open_dataset(tmp_path / "sweep.nc") as data:
        assert dict(data.sizes) == {"hip": 3, "knee": 1, "ankle": 1}
    report = json.loads((tmp_path / "sweep.json").read_text())
    assert [line["posture"] for line in report["lines"]][-2:] == ["best", "worst"]


def test_json_on_stdout_stands_alone():
    ended = door(*SMALL, "--json", "-", "--leg", "testbed")
    report = json.loads(ended.stdout)
    assert report["status"]["ok"] == report["postures"] == 3
    assert [line["posture"] for line in report["lines"]] == ["best", "worst"]
    assert ended.stderr == ""


def test_any_urdf(tmp_path):
    urdf = kickdyn.Leg.human().urdf
    (tmp_path / "mine.urdf").write_text(urdf.text.replace('name="leg_human"', 'name="mine"'))
    ended = door("--leg", "mine.urdf", "--frame", "foot", "--joint", "knee=10", cwd=tmp_path)
    assert ended.returncode == 0
    assert "mine: foot 1 m/s" in ended.stdout
    assert "paper a" not in ended.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--leg", "missing.urdf"], "missing.urdf: there is no such file"),
        (["--leg", "page.html"], "not <robot>"),
        (["--leg", "missing"], "neither human, testbed nor a file"),
        (["--frame", "nose"], "frame 'nose' is unknown: leg_human has"),
        (["--joint", "nose=1"], "joint 'nose' is unknown: leg_human has hip, knee, ankle"),
        (["--joint", "hip=0:200:10"], "its range is -15 to 125 deg"),
        (["--restitution", "1.2"], "restitution is 1.2"),
        (["--friction", "-0.1"], "friction is -0.1"),
        (["--speed", "nan"], "foot speed is nan"),
        (["--speed", "fast"], "'fast' is not a valid float"),
        (["--attack", "120"], "attack is 120"),
        (["--air", "thick"], "'thick' is not one of 'standard', 'paper', 'none'"),
        (["--out", "no/where.nc"], "no/where.nc cannot be written"),
        (["--out", "sweep.csv"], "written as .nc"),
        (["--plot", "sweep.exe"], "plots are written as .png"),
        (["--view", "no/where.html"], "no/where.html cannot be written"),
        (["--json", "."], "is a folder"),
        (["--nose"], "No such option"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(tmp_path, arguments, words):
    (tmp_path / "page.html").write_text("<html><body/></html>")
    ended = (
        door(*SMALL, *arguments, "--json", "out.json", cwd=tmp_path)
        if ("--json" not in arguments)
        else door(*SMALL, *arguments, cwd=tmp_path)
    )
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert words in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert [f.name for f in tmp_path.iterdir()] == ["page.html"]


def test_help_shows_an_example():
    ended = door("--help")
    assert ended.returncode == 0
    assert "Example: python -m kickdyn.posture_sweep --joint" in ended.stdout


def test_the_console_script_has_the_same_door():
    command = [sys.executable, "-c", "from kickdyn.cli import main; main()", "posture-sweep"]
    ended = subprocess.run([*command, *SMALL, "--json", "-"], capture_output=True, text=True)
    assert json.loads(ended.stdout)["postures"] == 3
