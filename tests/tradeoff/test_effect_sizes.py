"""Sizes of effects, against strikes and flights made by hand."""

import inspect
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.tradeoff_command import tradeoff
from kickdyn.scene.effects import EffectSize
from kickdyn.scene.simulate import measure_effects
from kickdyn.tradeoff.effect_sizes import TOLERANCE, effect_figure

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def sizes(scene):
    return measure_effects(kd.simulate(scene, None))


@pytest.fixture(scope="module")
def scene():
    return kd.load_scene(SCENES / "paper_kick.toml")


def test_drag_and_friction(scene):
    rows = {row.effect: row for row in sizes(scene)}
    assert set(rows) == {"friction", "ball rotation", "drag", "drag crisis", "lift"}
    hit = kd.strike(scene.posture, scene.v, scene.ball, scene.contact)
    full = kd.fly(hit.ball_after, scene.ball, scene.air, scene.ground).landing.position
    light = kd.Air(scene.air.density, scene.air.viscosity, drag=None, torque=None, buoyancy=False)
    bare = kd.fly(hit.ball_after, scene.ball, light, scene.ground).landing.position
    assert rows["drag"].end == pytest.approx(np.linalg.norm(bare - full), rel=1e-9)
    assert rows["drag"].impulse == 0
    smooth = kd.strike(scene.posture, scene.v, scene.ball, kd.Contact(scene.contact.normal, 0.8))
    difference = float(np.linalg.norm(smooth.impulse - hit.impulse))
    assert rows["friction"].impulse == pytest.approx(difference, rel=1e-12)


def test_the_table_begins_with_the_largest():
    ended = CliRunner().invoke(tradeoff, ["--scene", "paper_kick", "--json", "-"])
    ends = [row["end"] for row in json.loads(ended.stdout)["effects"]]
    assert ends == sorted(ends, reverse=True)
    assert ends[0] > 1


def test_a_contact_that_takes_time_and_a_stance():
    rows = {row.effect: row for row in sizes(kd.load_scene(SCENES / "volley.toml"))}
    assert rows["contact time"].impulse > 0.1
    robot = {row.effect: row for row in sizes(kd.load_scene(SCENES / "robocup_carpet.toml"))}
    assert {"supports", "armature"} <= set(robot)
    assert robot["armature"].end > robot["supports"].end > 0


def test_what_has_no_answer_says_so(scene):
    air = kd.Air(lift=None, torque=None, drag="brazuca")
    floats = kd.Ball(0.003, 0.1)  # lighter than air: drag is all that ends its flight
    plane = kd.Plane((30, 0, 0), (-1, 0, 0))
    parts = (scene.posture, scene.v, floats, kd.Contact((1, 0, 0), 0.8))
    rows = sizes(kd.Scene(*parts, air=air, plane=plane))
    assert {row.effect for row in rows} >= {"drag", "buoyancy"}
    for row in rows:
        assert np.isnan(row.end) == bool(row.why_not)


def test_an_effect_has_no_size_where_the_ball_does_not_end(scene):
    parts = (scene.posture, scene.v, scene.ball, scene.contact)
    rows = sizes(kd.Scene(*parts, ground=kd.Ground(-1e7)))
    assert {row.effect for row in rows} == {"friction", "ball rotation"}
    assert all(np.isnan(row.end) and row.why_not == "no end: aloft" for row in rows)
    assert all(row.impulse > 0 for row in rows)


def test_a_name_is_no_markup(tmp_path):
    bold = tmp_path / "bold.toml"
    text = (SCENES / "paper_kick.toml").read_text()
    bold.write_text(text.replace("the paper's kick", "[bold]x[/bold] [/foo]"))
    ended = CliRunner().invoke(tradeoff, ["--scene", str(bold)])
    assert ended.stdout.startswith("[bold]x[/bold] [/foo]: impulse 6.485 N s, landed at (")


def test_the_command_writes_json_only_where_asked():
    path = str(SCENES / "paper_kick.toml")
    ended = CliRunner().invoke(tradeoff, ["--scene", path, "--json", "-"])
    document = json.loads(ended.stdout)
    assert document["units"] == {"end": "m", "impulse": "N s"}
    assert {"effect", "end", "impulse", "why_not"} == set(document["effects"][0])


def test_the_command_names_every_fault_of_a_scene(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("[leg]\nmodle = 'human'\n")
    command = [sys.executable, "-m", "kickdyn", "tradeoff", "--scene", str(bad)]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "did you mean model?" in ended.stderr
    lines = ended.stderr.splitlines()
    assert len(lines) == 4
    assert all(line.split(": ", 1)[1].startswith(f"{bad}: ") for line in lines)


def test_the_line_in_the_picture_is_the_default_tolerance():
    assert inspect.signature(kd.simulate).parameters["tolerance"].default == TOLERANCE


def test_the_command_draws_and_writes(tmp_path):
    path, plot, rows = str(SCENES / "paper_kick.toml"), tmp_path / "x.svg", tmp_path / "x.json"
    named = ["--scene", path, "--plot", str(plot), "--json", str(rows)]
    ended = CliRunner().invoke(tradeoff, named)
    assert ended.exit_code == 0
    assert "drag crisis" in ended.stdout
    assert json.loads(rows.read_text())["effects"][0]["effect"] in ended.stdout
    assert "<svg" in plot.read_text()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--impact",), "--scene measures effects"),
        (("--flight",), "--scene measures effects"),
        (("--plot", "x.bmp"), "no known ending"),
        (("--plot", "x.png", "--json", "x.png"), "named for two outputs"),
    ],
)
def test_what_makes_no_sense_beside_a_scene_is_refused(tmp_path, monkeypatch, more, said):
    monkeypatch.chdir(tmp_path)
    ended = CliRunner().invoke(tradeoff, ["--scene", str(SCENES / "paper_kick.toml"), *more])
    assert said in str(ended.exception)
    assert list(tmp_path.iterdir()) == []


def test_bars_of_effect_sizes_beside_the_tolerance():
    rows = [
        EffectSize("buoyancy", math.nan, math.nan, "flies off"),
        EffectSize("drag", 12.3, 0.0),
        EffectSize("lift", 2e-3, 0.0),
        EffectSize("wind", 0.0, 0.0),
    ]
    (axes,) = effect_figure("a kick", rows, 0.05).axes
    assert axes.get_xscale() == "log"
    assert [bar.get_x() + bar.get_width() for bar in axes.patches] == pytest.approx([12.3, 2e-3])
    low, high = axes.get_xlim()
    assert low < 2e-3 < 12.3 < high
    assert [tick.get_text() for tick in axes.get_yticklabels()] == [row.effect for row in rows]
    assert [text.get_text() for text in axes.texts] == ["no answer", "12", "0.002", "below 1e-09"]
    (line,) = axes.lines
    assert line.get_xdata() == [0.05, 0.05]
