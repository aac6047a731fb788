"""Groups of options: what a command receives, and what is refused."""

import re
from dataclasses import dataclass

import click
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.command import Command
from kickdyn.cli.option_groups import (
    AirOptions,
    BallOptions,
    FootOptions,
    Numbers,
    OutputOptions,
    PointOptions,
    option,
    takes,
)


def received(group, *arguments):
    """The group that a command receives for arguments."""
    groups = []

    @click.command("kick", Command)
    @takes(group=group)
    def kick(group):
        groups.append(group)

    ended = CliRunner().invoke(kick, arguments, standalone_mode=False)
    if ended.exception is not None:
        raise ended.exception
    return groups[0]


def test_a_command_receives_groups_beside_its_own_options():
    @click.command("kick", Command)
    @takes(foot=FootOptions)
    @click.option("--law", default="newton")
    @takes(ball=BallOptions, air=AirOptions)
    def kick(foot, law, ball, air):
        click.echo(f"{foot.speed:g} {law} {ball.ball} {air.air}")

    words = ["--speed", "3", "--air", "paper", "--law", "stronge"]
    assert CliRunner().invoke(kick, words).output == "3 stronge size-5 paper\n"
    text = CliRunner().invoke(kick, ["--help"]).output
    names = re.findall(r"^  (?:-h, )?(--\w+)", text, re.MULTILINE)
    assert names == ["--speed", "--attack", "--law", "--ball", "--air", "--drag", "--help"]


def test_a_foot_that_cannot_be_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"attack is 91.0: .* at most 90 \[deg\]"):
        _ = received(FootOptions, "--attack", "91").angle


def test_a_ball_is_a_name_or_two_numbers():
    assert received(BallOptions).load() == kd.Ball()
    assert received(BallOptions, "--ball", "paper").load() == kd.Ball.paper()
    assert received(BallOptions, "--ball", "0.3:0.1").load() == kd.Ball(0.3, 0.1)
    with pytest.raises(kd.InvalidInput, match="--ball is 'tennis': it must be size-5, paper, or"):
        received(BallOptions, "--ball", "tennis").load()


def test_the_drag_is_that_of_the_option_or_of_the_air():
    assert received(AirOptions).load() == kd.Air()
    assert received(AirOptions, "--air", "none").load() is None
    assert received(AirOptions, "--drag", "0.3").load() == kd.Air(drag=0.3)
    assert received(AirOptions, "--air", "paper", "--drag", "sphere").load() == kd.Air.paper(
        drag="sphere"
    )


def test_a_contact_has_all_its_options():
    words = ("--restitution", "5:0.8,20:0.65", "--friction", "0.1", "--offset", "0.1,0,-0.02")
    contact = received(PointOptions, *words).contact()
    table = [(5, 0.8), (20, 0.65)]
    assert contact == kd.Contact(None, restitution=table, friction=0.1, offset=(0.1, 0, -0.02))


@dataclass(frozen=True)
class Point:
    at: tuple[float, float] | None = option("--point", type=Numbers("X:Z"))


@pytest.mark.parametrize("text", ["1", "1:2:3", "1:x", "1:nan", "inf:0", "1,2", ":"])
def test_numbers_that_are_none_are_refused(text):
    finite = "every number of X:Z must be finite"
    with pytest.raises(click.BadParameter, match=rf"is not X:Z, such as 0.1:0.2\.$|{finite}"):
        received(Point, "--point", text)


def test_numbers_in_one_word():
    assert received(Point, "--point", "-1:2e3").at == (-1.0, 2000.0)
    assert received(Point).at is None


def test_outputs_are_checked_written_and_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    output = received(OutputOptions, "--json", "a.json", "--plot", "a.png")
    output.check("a.txt", inputs=["leg.urdf"])
    output.write_json({"speed": 2})
    output.name_written("a.txt", None, output.plot)
    assert (tmp_path / "a.json").read_text() == '{\n  "speed": 2\n}\n'
    assert capsys.readouterr().out == "wrote a.txt\nwrote a.png\nwrote a.json\n"
    quiet = received(OutputOptions, "--json", "-")
    assert output.prints
    assert not quiet.prints
    quiet.write_json([1])
    quiet.name_written("a.txt")
    assert capsys.readouterr().out == "[\n  1\n]\n"
    for words, message in (
        (("--plot", "a.exe"), "a.exe has no known extension"),
        (("--view", "a.exe"), "a.exe has no known extension"),
        (("--json", "a.txt"), "a.txt is named for two outputs"),
        (("--view", "leg.html"), "leg.html is an input"),
    ):
        (tmp_path / "leg.html").touch()
        with pytest.raises(kd.InvalidInput, match=message):
            received(OutputOptions, *words).check("a.txt", inputs=["leg.html"])


@pytest.mark.parametrize(
    ("ball", "message"),
    [
        ("0.43:1.01", "ball radius is 1.01: .* at least 0.001 and at most 1 "),
        ("0.43:0.0009", "ball radius is 0.0009"),
        ("1001:0.1", "ball mass is 1001.0: .* at least 0.001 and at most 1000 "),
        ("0.0009:0.1", "ball mass is 0.0009"),
    ],
)
def test_a_ball_from_a_gram_and_a_millimetre_to_a_tonne_and_a_metre_is_taken(ball, message):
    with pytest.raises(kd.InvalidInput, match=message):
        received(BallOptions, "--ball", ball).load()
    for ends in ("0.001:0.001", "1000:1"):
        received(BallOptions, "--ball", ends).load()
