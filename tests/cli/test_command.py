"""How a command ends: its exit code, a line for each fault, and nothing else."""

import subprocess
import sys

import click
import pytest

import kickdyn as kd
from kickdyn.cli.command import run


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
