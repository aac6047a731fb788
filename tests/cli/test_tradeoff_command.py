"""The door of the trade: what it measures, and what it refuses first."""

import json
import subprocess
import sys

import pytest
from click.testing import CliRunner

from kickdyn.cli.tradeoff_command import tradeoff
from kickdyn.tradeoff import flight_methods as flight
from kickdyn.tradeoff import impact_methods as impact
from kickdyn.tradeoff.measurement import Measurement

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
