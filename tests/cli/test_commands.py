"""The console script: help, completion, and the keys of what `--json` writes."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import BashComplete
from click.testing import CliRunner

from kickdyn.cli import commands
from kickdyn.cli.commands import kickdyn_command

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "reference" / "commands.md").read_text("utf-8")
KEYS = (ROOT / "docs" / "reference" / "json.md").read_text("utf-8")
COMMANDS = list(commands.COMMANDS)
SCRIPT = [
    sys.executable,
    "-c",
    "import sys; sys.argv[0] = 'kickdyn'; import kickdyn.cli.commands as c; c.main()",
]


def script(*arguments, **variables):
    environment = os.environ | variables
    return subprocess.run(
        [*SCRIPT, *arguments], env=environment, capture_output=True, text=True, timeout=3600
    )


def test_help_fits_a_screen():
    output = CliRunner().invoke(kickdyn_command, ["--help"]).output
    assert len(output.splitlines()) <= 24
    assert all(f"  {name} " in output for name in COMMANDS)
    assert "..." not in output.split("Commands:")[1]


def test_help_loads_no_more_than_it_needs():
    """A quarter of a second instead of seconds; completion of commands as well."""
    heavy = ("numpy", "scipy", "pinocchio", "matplotlib", "xarray", "rich", "meshcat")
    seen = f"import atexit, sys; atexit.register(lambda: print({heavy} & sys.modules.keys()))"
    code = f"{seen.replace(str(heavy), repr(set(heavy)))}; {SCRIPT[-1]}"
    ended = subprocess.run([*SCRIPT[:-1], code, "--help"], capture_output=True, text=True)
    assert ended.stdout.splitlines()[-1] == "set()"


def test_python_runs_the_commands_too():
    ended = subprocess.run(
        [sys.executable, "-m", "kickdyn", "--version"], capture_output=True, text=True, cwd=ROOT
    )
    assert (ended.returncode, ended.stdout.split()[0]) == (0, "kickdyn,")


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_are_alike(name):
    output = " ".join(CliRunner().invoke(kickdyn_command, [name, "--help"]).output.split())
    assert f"Example: kickdyn {name} " in output
    assert "--json FILE" in output
    assert "- is stdout" in output


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_on_the_page(name):
    assert f"`kickdyn {name}`" in PAGE
    assert f":prog: kickdyn {name}\n" in PAGE


def test_click_completes_commands_options_and_files(monkeypatch):
    def completed(words, at):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(at))
        return BashComplete(kickdyn_command, {}, "kickdyn", "_KICKDYN_COMPLETE").complete()

    assert completed("kickdyn pos", 1).split() == ["plain,posture-sweep"]
    assert "--restitution" in completed("kickdyn plan --rest", 2)
    assert completed("kickdyn view sce", 2).split() == ["file,sce"]
    assert completed("kickdyn plan --leg ./h", 3).split() == ["file,./h"]


def test_the_script_of_the_page_completes():
    (line,) = re.findall(r'eval "\$\((_KICKDYN_COMPLETE=bash_source) kickdyn\)"', PAGE)
    name, value = line.split("=")
    assert "_KICKDYN_COMPLETE=bash_complete" in script(**{name: value}).stdout


@pytest.mark.parametrize(
    ("word", "hint"),
    [
        ("simulat", "Did you mean 'simulate'?"),
        ("posture_sweep", "Did you mean 'posture-sweep'?"),
        ("x", "No such command 'x'."),
    ],
)
def test_an_unknown_command_is_refused_with_a_suggestion(word, hint):
    ended = script(word)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(f"kickdyn: No such command {word!r}. ".rstrip())
    assert ended.stderr.endswith(f"{hint}\n")


def test_no_colour_in_a_pipe():
    ended = script("paper", "--only", "table 2", FORCE_COLOR="", NO_COLOR="1")
    assert ended.returncode == 0
    assert "\x1b" not in ended.stdout + ended.stderr


def keys(value, name=""):
    """Return the names of all that a JSON value holds, as the page writes them."""
    if isinstance(value, dict):
        named = {
            **{"angles_deg": "JOINT", "joint_impulses": "JOINT", "status": "STATUS"},
            **{"neglected": "EFFECT", "values": "UNKNOWN", "deviations": "UNKNOWN"},
            **dict.fromkeys(("restitution", "friction", "rolling_deceleration", "drag"), "VALUE"),
        }.get(name.split(".")[-1])
        parts = [(named or key, part) for key, part in value.items()]
        return {k for key, part in parts for k in keys(part, f"{name}.{key}".lstrip("."))}
    if isinstance(value, list):
        return {k for part in value or [None] for k in keys(part, f"{name}[]")}
    return {name}


@pytest.mark.parametrize(
    ("section", "arguments"),
    [
        ("posture-sweep", ["--joint", "hip=0:10:5"]),
        ("reach", ["--leg", "human", "--elevation", "20", "--tolerance", "0.3"]),
        ("paper", ["--only", "table 2"]),
        ("tradeoff", ["--scene", str(ROOT / "scenes" / "paper_kick.toml")]),
        ("simulate", [str(ROOT / "scenes" / "free_kick.toml"), "--exact"]),
        ("view", ["slow.toml"]),
        ("identify", ["track.csv"]),
        ("tune-mujoco", [str(ROOT / "scenes" / "robot_chip.toml"), "--timestep", "0.005"]),
    ],
)
def test_the_page_names_every_key(section, arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (ROOT / "data" / "match_ball.csv").read_text("utf-8").splitlines()
    Path("track.csv").write_text("\n".join([rows[0], *rows[2605:2760]]), "utf-8")
    scene = (ROOT / "scenes" / "free_kick.toml").read_text("utf-8")
    slow = scene.replace("[contact]", "[contact]\ncontact_time_s = 0.01")
    Path("slow.toml").write_text(slow, "utf-8")
    ended = CliRunner().invoke(kickdyn_command, [section, *arguments, "--json", "-"])
    assert ended.exit_code == 0
    common = named_in(KEYS.split("\n## ")[0])
    named = named_in(KEYS.split(f"## {section}\n")[1].split("\n## ")[0])
    named = {name for name in named if not name.startswith("functions[]")}  # without --scene
    written = keys(json.loads(ended.stdout))
    assert written - common == named - {"drag_scale.VALUE"} - common  # in place of drag
    assert named <= written | {"drag_scale.VALUE"}


def named_in(text):
    """Return the keys in the first column of the tables."""
    rows = re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)}
