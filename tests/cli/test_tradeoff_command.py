"""The door of the trade: what it measures, and what it refuses first."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.tradeoff_command import tradeoff
from kickdyn.scene.simulate import measure_effects
from kickdyn.tradeoff import flight_methods as flight
from kickdyn.tradeoff import impact_methods as impact
from kickdyn.tradeoff.measurement import Measurement

SCENES = Path(__file__).resolve().parents[2] / "scenes"
IMPACTS = [
    Measurement("frictionless", "Pinocchio impulseDynamics", "", 1e-16, 2e-4),
    Measurement("frictionless", "MuJoCo", "dt 0.001 s", 1e-2, 1e-4, pareto=True),
]
FLIGHTS = [
    Measurement("full", "RK45", "tol 0.001", 1e-2, 1e-3, 20),
    Measurement("full", "heyoka", "tol 0.001", 1e-4, 1e-5, 6, True),
]


@pytest.fixture(autouse=True)
def measured(monkeypatch):
    monkeypatch.setattr(impact, "measure_impacts", lambda report: IMPACTS)
    monkeypatch.setattr(flight, "measure_flights", lambda report: FLIGHTS)


def test_it_measures_both_unless_one_is_named():
    assert list(tried("--json", "-")) == ["impact", "flight"]
    assert [len(rows) for rows in tried("--json", "-").values()] == [2, 2]
    assert [len(rows) for rows in tried("--impact", "--json", "-").values()] == [2, 0]
    assert [len(rows) for rows in tried("--flight", "--json", "-").values()] == [0, 2]


def tried(*arguments):
    return json.loads(CliRunner().invoke(tradeoff, arguments).stdout)


def test_the_tables_mark_the_front_and_compare_with_the_fastest():
    lines = CliRunner().invoke(tradeoff).stdout.splitlines()
    pinocchio = next(line for line in lines if "Pinocchio" in line)
    assert pinocchio.split() == ["Pinocchio", "impulseDynamics", "1.0e-16", "200", "2"]
    assert [line.split() for line in lines].index(["frictionless"]) < lines.index(pinocchio)
    assert next(line for line in lines if "heyoka" in line).split()[-1] == "*"


def test_files_are_written(tmp_path):
    plot, rows = tmp_path / "x.png", tmp_path / "x.json"
    ended = CliRunner().invoke(tradeoff, ["--plot", str(plot), "--json", str(rows)])
    assert ended.exit_code == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert json.loads(rows.read_text())["impact"][1]["method"] == "MuJoCo"


@pytest.mark.parametrize("bad", [("--json", "no/x.json"), ("--plot", "x.bmp")])
def test_what_cannot_be_written_is_refused_first(bad):
    door = [sys.executable, "-m", "kickdyn", "tradeoff", *bad]
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
    assert document["effects"] == [
        {"effect": size.effect, "end": size.end, "impulse": size.impulse, "why_not": ""}
        for size in sizes
    ]
    ended = CliRunner().invoke(tradeoff, ["--scene", "volley"])
    head, *rows = filter(None, ended.stdout.splitlines())
    impulse = float(np.linalg.norm(exact.impact.impulse))
    assert head.startswith(f"volley: impulse {impulse:.4g} N s, {exact.end_text}.")
    table = {row[:14].strip(): row[14:].split() for row in rows[2:]}
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
