"""The console script: help, completion, its three ways in, and the keys of its JSON documents."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import click
import pytest

import kickdyn as kd
from kickdyn.cli.commands import COMMANDS, run
from kickdyn.paper.reproduce import chosen

ROOT = Path(__file__).resolve().parents[2]
READ = runpy.run_path(str(ROOT / "docs" / "reference_tables.py"))["read"]
PAGE, KEYS, DATASET = map(READ, ["reference/commands", "reference/json", "reference/dataset"])
SCRIPT = "import sys; sys.argv[0] = 'kickdyn'; import kickdyn.cli.commands as c; c.main()"


def started(*words, **variables):
    """Run Python with words in a process of its own."""
    command, environment = [sys.executable, *words], os.environ | variables
    return subprocess.run(command, env=environment, capture_output=True, text=True, cwd=ROOT)


def test_help_is_short_and_imports_nothing_heavy():
    """A quarter of a second instead of seconds."""
    heavy = {"numpy", "scipy", "pinocchio", "matplotlib", "xarray", "rich", "meshcat"}
    seen = f"import atexit, sys; atexit.register(lambda: print({heavy} & sys.modules.keys()))"
    ended = started("-c", f"{seen}; {SCRIPT}", "--help")
    *lines, imported = ended.stdout.splitlines()
    assert imported == "set()"
    assert len(lines) <= 24
    assert all(f"  {name} " in ended.stdout for name in COMMANDS)


@pytest.mark.parametrize(("words", "said"), [
    (["-c", SCRIPT], "Commands:"), (["-m", "kickdyn", "--version"], "kickdyn, version"),
    pytest.param(["-m", "kickdyn.posture_sweep", "--help"], "Example: kickdyn posture-sweep",
                 marks=pytest.mark.slow),
], ids=["script without words", "python -m kickdyn", "kickdyn.posture_sweep"])  # fmt: skip
def test_a_command_can_be_started_in_three_ways(words, said):
    ended = started("-W", "error", *words)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert said in ended.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_an_example_json_and_a_place_on_the_page(name, kickdyn):
    text = " ".join(kickdyn(f"{name} --help").out.split())
    assert f"Example: kickdyn {name} " in text
    assert "--json FILE" in text
    assert f"`kickdyn {name}`" in PAGE
    assert f":prog: kickdyn {name}\n" in PAGE


NAMED = "angles_deg joint_impulses status neglected values deviations effective_mass restitution"
"""Objects whose keys are names of joints, effects and the like."""


def keys(value):
    """Yield the keys of all objects in a document that it does not name itself."""
    if isinstance(value, dict):
        yield from value
    for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
        if key not in NAMED.split() and isinstance(entry, dict | list):
            yield from keys(entry)


@pytest.mark.parametrize("line", [
    "check match.csv", "check-motion swing.csv --rate 50", "posture-sweep --joint hip=0:10:5",
    "reach --elevation 20 --tolerance 0.3",
    "paper --only 'table 2'", "tradeoff --scene paper_kick", "simulate free_kick --exact",
    "view slow.toml", pytest.param("identify match.csv", marks=pytest.mark.slow),
    pytest.param("tune-mujoco robot_chip --timestep 0.005", marks=pytest.mark.slow)])  # fmt: skip
def test_the_page_has_the_keys_of_a_document(line, kickdyn, written, match_ball):
    match_ball(2605, 2760)
    scene = (ROOT / "scenes" / "free_kick.toml").read_text("utf-8")
    written("slow.toml", scene.replace("[contact]", "[contact]\ncontact_time_s = 0.01"))
    written("swing.csv", "\n".join(f"{0.05 * k**2},0.4,-0.1" for k in range(12)))
    document = kickdyn(f"{line} --json -").json
    sections, name = KEYS.split("\n## "), line.split()[0]
    text = sections[0] + next(section for section in sections if section.startswith(name))
    text += DATASET if name == "posture-sweep" else ""
    missing = {key for key in keys(document) if not re.search(rf"\b{key}\b", text)}
    assert missing == set()


def ends(command, capsys):
    """Return the exit code of a command, and the lines on standard error."""
    with pytest.raises(SystemExit) as end:
        run(command)
    return end.value.code, capsys.readouterr().err.strip().splitlines()  # after ^C, a new line


@pytest.mark.parametrize(("error", "code", "lines"), [
    (None, 0, []), (kd.InvalidInput("mass is -1 kg"), 2, ["mass is -1 kg"]),
    (kd.InvalidInput("mass is -1 kg", "e is 2"), 2, ["mass is -1 kg", "e is 2"]),
    (kd.UrdfError("a.urdf", ["no link", "no joint"]), 2, ["a.urdf: no link; no joint"]),
    (kd.SceneError("s.toml", ["a", "b"]), 2, ["s.toml: a", "s.toml: b"]),
    (kd.NoImpact("the foot recedes"), 2, ["the foot recedes"]),
    (click.UsageError("no " + "x" * 999), 2, [f"no {'x' * 100}...{'x' * 100}"]),
    (kd.KickdynError("no\x1b answer"), 1, ["no\\x1b answer"]),
    (FileNotFoundError(2, "No such file", "robot.stl"), 1, ["robot.stl: No such file"]),
    (OSError("the port is taken"), 1, ["the port is taken"]),
    (KeyboardInterrupt(), 1, ["interrupted"]),
], ids=repr)  # fmt: skip
def test_bad_input_ends_with_2_and_any_other_error_with_1(error, code, lines, monkeypatch, capsys):
    @click.command("kick")
    def kick():
        if error is not None:
            raise error

    monkeypatch.setattr(sys, "argv", ["kick"])
    assert ends(kick, capsys) == (code, [f"kick: {line}" for line in lines])


@pytest.mark.slow
def test_output_that_cannot_be_written_ends_with_1():
    command = [sys.executable, "-m", "kickdyn", "paper", "--only", "fig8"]
    with open("/dev/full", "w") as full:  # noqa: PTH123
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (ended.returncode, ended.stderr) == (1, "kickdyn: No space left on device\n")


@pytest.mark.parametrize("only", ["table 2", "fig 8"])
def test_a_section_of_the_paper_has_the_items_of_the_library(only, kickdyn):
    (section,) = chosen(only)
    items, varied = section.compare()
    right = [item.as_json() | {"notes": list(item.notes)} for item in (*items, *varied)]
    assert kickdyn(f"paper --only '{only}' --json -").json == right
