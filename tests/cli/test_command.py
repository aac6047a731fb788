import subprocess
import sys

import click
import pytest

import kickdyn as kd
from kickdyn.cli.command import run

INTERRUPTED = """
import os
import signal
import click
from kickdyn.cli.command import run

@click.command("kick")
def kick():
    os.kill(os.getpid(), signal.SIGINT)
    print("it went on")

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run behind a shell
run(kick)
"""


def test_ctrl_c_ends_a_command_in_one_line():
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.strip() == "kick: interrupted"


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (None, 0, ""),
        (kd.InvalidInput("mass is -1 kg"), 2, "kick: mass is -1 kg"),
        (kd.InvalidInput("mass is -1 kg", "e is 2"), 2, "kick: mass is -1 kg\nkick: e is 2"),
        (kd.UrdfError("a.urdf", ["no link", "no joint"]), 2, "kick: a.urdf: no link; no joint"),
        (kd.NoImpact("the foot recedes"), 2, "kick: the foot recedes"),
        (kd.SceneError("s.toml", ["a", "b"]), 2, "kick: s.toml: a\nkick: s.toml: b"),
        (kd.KickdynError("no\x1b answer"), 1, "kick: no\\x1b answer"),
        (FileNotFoundError(2, "No such file", "robot.stl"), 1, "kick: robot.stl: No such file"),
        (click.UsageError("no " + "x" * 999), 2, f"kick: no {'x' * 100}...{'x' * 100}"),
        (OSError("the port is taken"), 1, "kick: the port is taken"),
    ],
)
def test_how_a_command_ends(error, code, line, monkeypatch, capsys):
    @click.command("kick")
    def kick():
        if error is not None:
            raise error

    monkeypatch.setattr(sys, "argv", ["kick"])
    with pytest.raises(SystemExit) as ended:
        run(kick)
    assert ended.value.code == code
    assert capsys.readouterr().err.strip() == line
