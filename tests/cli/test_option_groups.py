"""Groups of options: what their methods make of the words of a command line."""

import math

import click
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.command import Command
from kickdyn.cli.option_groups import (
    AirOptions,
    BallOptions,
    FootOptions,
    OutputOptions,
    PointOptions,
    takes,
)
from kickdyn.cli.plan_command import WindyAirOptions


def received(group, *words):
    """Return the group that a command receives."""
    groups = []

    @click.command("kick", Command)
    @takes(group=group)
    def kick(group):
        groups.append(group)

    ended = CliRunner().invoke(kick, words, standalone_mode=False)
    if ended.exception is not None:
        raise ended.exception
    return groups[0]


@pytest.mark.parametrize(
    ("group", "words", "right"),
    [
        (BallOptions, [], kd.Ball()),
        (BallOptions, ["--ball", "paper"], kd.Ball.paper()),
        (BallOptions, ["--ball", "0.3:0.1"], kd.Ball(0.3, 0.1)),
        (BallOptions, ["--ball", "0.3:0.1:80e3"], kd.Ball(0.3, 0.1, pressure=80e3)),
        (BallOptions, ["--ball", "0.001:0.001"], kd.Ball(0.001, 0.001)),
        (BallOptions, ["--ball", "1000:1"], kd.Ball(1000, 1)),
        (AirOptions, [], kd.Air()),
        (AirOptions, ["--air", "none"], None),
        (AirOptions, ["--air", "paper"], kd.Air.paper()),
        (AirOptions, ["--drag", "0.3"], kd.Air(drag=0.3)),
        (AirOptions, ["--air", "paper", "--drag", "sphere"], kd.Air.paper(drag="sphere")),
        (WindyAirOptions, ["--wind", "2,-1,0.5"], kd.Air(wind=(2, -1, 0.5))),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_options_make_the_object_of_the_library(group, words, right):
    assert received(group, *words).load() == right


def test_a_contact_has_its_restitution_friction_and_offset():
    words = ("--restitution", "5:0.8,20:0.65", "--friction", "0.1", "--offset", "0.1,0,-0.02")
    table = [(5, 0.8), (20, 0.65)]
    right = kd.Contact(None, restitution=table, friction=0.1, offset=(0.1, 0, -0.02))
    assert received(PointOptions, *words).contact() == right


@pytest.mark.parametrize("degrees", [-90.0, -20.0, 30.0, 90.0])
def test_the_attack_is_typed_in_degrees(degrees):
    foot = received(FootOptions, "--attack", str(degrees))
    assert foot.angle == pytest.approx(degrees * math.pi / 180)


def test_outputs_are_written_and_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    output = received(OutputOptions, "--json", "a.json", "--plot", "a.png")
    output.check("a.txt", inputs=["leg.urdf"])
    output.write_json({"speed": 2})
    output.name_written("a.txt", None, output.plot)
    assert (tmp_path / "a.json").read_text() == '{\n  "speed": 2\n}\n'
    assert capsys.readouterr().out == "wrote a.txt\nwrote a.png\nwrote a.json\n"
    quiet = received(OutputOptions, "--json", "-")
    quiet.write_json([1])
    quiet.name_written("a.txt")
    assert capsys.readouterr().out == "[\n  1\n]\n"
