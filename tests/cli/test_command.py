import subprocess
import sys
from contextlib import nullcontext

import click
import pytest

import kickdyn as kd
from kickdyn.cli.command import Command, check_page_name, run
from kickdyn.cli.option_groups import JsonOptions

INTERRUPTED = """
import os
import signal
import click
from kickdyn.cli.command import Command, run

@click.command("kick")
def kick():
    os.kill(os.getpid(), signal.SIGINT)
    print("it went on")

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run behind a shell
run(kick)
"""


def test_ctrl_c_ends_a_command_in_one_line():
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=3600
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


@click.command("kick", Command)
@click.argument("ball", required=False, metavar="BALL")
@click.option("--speed", default=1.0)
@click.option("--count", type=click.IntRange(1, 9))
@click.option("--first", type=int)
@click.option("--leg", multiple=True)
def kick(**_):
    """Do nothing."""


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--speed", "1,5"], "Invalid value for '--speed': '1,5' is not a valid float."),
        (["--count", "x"], "Invalid value for '--count': 'x' is not a valid integer range."),
        (["--count", "10"], "Invalid value for '--count': 10 is not in the range 1<=x<=9."),
        (["--first", "1.0"], "Invalid value for '--first': '1.0' is not a valid integer."),
        (["--speed="], "Invalid value for '--speed': '' is not a valid float."),
        (["--leg", "left", "--leg", ""], "--leg is empty: it needs a value"),
        ([""], "BALL is empty: it needs a value"),
        (["--sped", "1"], "No such option '--sped'. Did you mean '--speed'?"),
        (["--workers", "1"], "No such option '--workers'."),
        (["-x"], "No such option '-x'."),
    ],
)
def test_what_cannot_be_read_is_refused_in_plain_words(arguments, line, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["kick", *arguments])
    monkeypatch.setattr("click.core._detect_program_name", lambda: "kick")
    with pytest.raises(SystemExit) as ended:
        run(kick)
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"kick: {line}\n"


def test_files_that_will_be_replaced_are_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    JsonOptions("b.json").check("a.png")
    assert capsys.readouterr().err == ""
    for name in ("a.png", "b.json"):
        (tmp_path / name).touch()
    JsonOptions("-").check("a.png")
    JsonOptions("b.json").check("a.png")
    first, second = capsys.readouterr().err.splitlines()
    assert first == "a.png exists and will be replaced"
    assert second == "b.json, a.png exist and will be replaced"


@pytest.mark.parametrize(
    ("name", "refused"),
    [("a.html", False), ("a.HTM", False), ("a.htm", False), ("a.txt", True), ("a", True)],
)
def test_a_page_is_written_under_the_endings_of_html(name, refused):
    with pytest.raises(kd.InvalidInput, match="html") if refused else nullcontext():
        check_page_name(name)
