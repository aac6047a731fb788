"""The door of the trade: what it measures, and what it refuses first."""

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
from kickdyn.cli import function_costs
from kickdyn.cli.tradeoff_command import TOLERANCE, effect_figure, tradeoff
from kickdyn.scene.effects import EffectSize
from kickdyn.scene.simulate import measure_effects

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"
KEYS = (ROOT / "docs" / "reference" / "json.md").read_text("utf-8")


def tried(*arguments):
    return json.loads(CliRunner().invoke(tradeoff, arguments).stdout)


def test_the_functions_are_measured_and_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(function_costs, "_seconds", lambda run: 1e-3)
    monkeypatch.setattr(function_costs, "ROWS", 50)
    plot, rows = tmp_path / "x.svg", tmp_path / "x.json"
    ended = CliRunner().invoke(tradeoff, ["--plot", str(plot), "--json", str(rows)])
    assert ended.exit_code == 0
    document = json.loads(rows.read_text())
    table = {row["function"]: row for row in document["functions"]}
    for name in document["functions"][0]:
        assert f"`functions[].{name}`" in KEYS
    assert set(table) > {"strike", "strike_many", "sweep", "collide", "fly_many", "simulate"}
    for name, most in (("strike", 2e-15), ("strike_many", 1e-13), ("sweep", 1e-12),
                       ("pin.impulseDynamics, bare", 2e-15), ("collide", 1e-7),
                       ("collide_many", 1e-6), ("fly", 1e-8), ("fly_many", 1e-8),
                       ("follow_many", 1e-6)):  # fmt: skip
        assert 0.0 < table[name]["rounding"] < most
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    attack = np.array([math.sqrt(0.75), 0.0, 0.5])
    kick = posture, posture.joint_velocity(10 * attack), kd.Ball.paper()
    contact = kd.Contact(attack, 0.8, 0.4)
    instant, lasting = (solve(*kick, contact).impulse for solve in (kd.strike, kd.collide))
    model = np.linalg.norm(instant - lasting) / np.linalg.norm(lasting)
    assert table["strike"]["model"] == pytest.approx(model, rel=1e-6)
    assert table["collide"]["model"] is None
    assert [table[name]["is_batch"] for name in ("fly", "fly_many")] == [False, True]
    printed = ended.stdout.splitlines()
    for name, row in table.items():
        label = name + (" (per row)" if row["is_batch"] else "")
        errors = ("" if row[kind] is None else f"{row[kind]:.1e}" for kind in ("rounding", "model"))
        cells = f"{1e6 * row['seconds']:12.3g}" + "".join(f"{text:>12}" for text in errors)
        assert f"{label:28}{cells}".rstrip() in printed
    picture = plot.read_text()
    assert "rounding and integration" in picture
    assert "strike_many" in picture


def test_no_function_on_the_front_is_slower_at_equal_error():
    made = [
        ("strike", 4e-5, False, 5e-16, 0.05),
        ("pin.impulseDynamics, bare", 1e-5, False, 5e-16, 0.1),
        ("collide", 2e-2, False, 3e-9, math.nan), ("strike_many", 1e-7, True, 5e-16, 0.05),
        ("sweep", 5e-7, True, 1e-16, 0.05), ("fly", 1e-3, False, 6e-11, math.nan),
    ]  # fmt: skip
    rows = [function_costs.FunctionCost(*row) for row in made]
    rounding, model = (function_costs.on_front(rows, kind) for kind in ("rounding", "model"))
    assert rounding == {"pin.impulseDynamics, bare", "collide", "strike_many", "sweep", "fly"}
    assert model == {"pin.impulseDynamics, bare", "strike", "strike_many"}
    texts = function_costs.cost_figure(rows).axes[1].texts
    grey = {text.get_text() for text in texts if text.get_color() == "gray"}
    assert grey == {"strike"}


@pytest.mark.parametrize("bad", [("--json", "no/x.json"), ("--plot", "x.bmp")])
def test_what_cannot_be_written_is_refused_first(bad):
    door = [sys.executable, "-m", "kickdyn", "tradeoff", "--scene", "paper_kick", *bad]
    ended = subprocess.run(door, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert len(ended.stderr.splitlines()) == 1


def test_the_columns_of_effects_have_their_units():
    ended = CliRunner().invoke(tradeoff, ["--scene", "paper_kick"])
    assert "end moves by [m]" in ended.stdout
    assert "impulse changes by [N s]" in ended.stdout


def test_the_table_begins_with_the_largest():
    ended = CliRunner().invoke(tradeoff, ["--scene", "paper_kick", "--json", "-"])
    ends = [row["end"] for row in json.loads(ended.stdout)["effects"]]
    assert ends == sorted(ends, reverse=True)
    assert ends[0] > 1e-2


def test_every_number_of_a_scene_is_that_of_the_measurement():
    exact = kd.simulate(kd.load_scene("volley"), None)
    sizes = sorted(measure_effects(exact), key=lambda size: -size.end)
    document = tried("--scene", "volley", "--json", "-")
    assert document["end"] == exact.end.position.tolist()
    assert document["impulse"] == exact.impact.impulse.tolist()
    assert (document["scene"], document["status"]) == ("volley", "landed")
    assert min(effect.pop("seconds") for effect in document["effects"]) > 0.0
    assert document["effects"] == [
        {"effect": size.effect, "end": size.end, "impulse": size.impulse, "why_not": ""}
        for size in sizes
    ]
    ended = CliRunner().invoke(tradeoff, ["--scene", "volley"])
    head, *rows = filter(None, ended.stdout.splitlines())
    impulse = float(np.linalg.norm(exact.impact.impulse))
    assert head.startswith(f"volley: impulse {impulse:.4g} N s, {exact.end_text}.")
    table = {row[:14].strip(): row[14:].split() for row in rows[1:]}
    for size in sizes:
        assert table[size.effect] == [f"{size.end:.3g}", f"{size.impulse:.3g}"]
    assert "warning: lift saturating: " in ended.stdout


def test_a_name_is_no_markup(tmp_path):
    bold = tmp_path / "bold.toml"
    text = (SCENES / "paper_kick.toml").read_text()
    bold.write_text(text.replace("the paper's kick", "[bold]x[/bold] [/foo]"))
    ended = CliRunner().invoke(tradeoff, ["--scene", str(bold)])
    assert ended.stdout.startswith("[bold]x[/bold] [/foo]: impulse ")


def test_the_command_writes_json_only_where_asked():
    path = str(SCENES / "paper_kick.toml")
    ended = CliRunner().invoke(tradeoff, ["--scene", path, "--json", "-"])
    document = json.loads(ended.stdout)
    assert document["units"] == {"end": "m", "impulse": "N s"}
    assert {"effect", "end", "impulse", "why_not", "seconds"} == set(document["effects"][0])


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
        (("--plot", "x.bmp"), "no known extension"),
        (("--plot", "x.png", "--json", "x.png"), "named for two outputs"),
    ],
)
def test_what_makes_no_sense_beside_a_scene_is_refused(tmp_path, monkeypatch, more, said):
    monkeypatch.chdir(tmp_path)
    ended = CliRunner().invoke(tradeoff, ["--scene", str(SCENES / "paper_kick.toml"), *more])
    assert said in str(ended.exception)
    assert list(tmp_path.iterdir()) == []


def test_the_line_in_the_picture_is_the_default_tolerance():
    assert inspect.signature(kd.simulate).parameters["tolerance"].default == TOLERANCE


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
