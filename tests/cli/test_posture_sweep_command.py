"""`kickdyn posture-sweep`: options, files, resuming, and what the table says."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.cli import posture_sweep_command
from kickdyn.cli.leg_options import load_leg
from kickdyn.sweeps.dataset import variables_of
from kickdyn.sweeps.sweep_kick import kick_from

SPEED = Path(__file__).resolve().parents[2] / "docs" / "speed.json"
SWEEP = "posture-sweep --joint hip=0:40:20 --joint knee=10 --joint ankle=0"
GRID = {"hip": np.radians([0, 20, 40]), "knee": [math.radians(10)], "ankle": [0.0]}

OPTIONS = {
    "": {},
    "--speed 3": {"speed": 3.0},
    "--attack 10": {"attack": math.radians(10)},
    "--restitution 0.5": {"restitution": 0.5},
    "--restitution 0.5:0.8,3:0.6": {"restitution": [(0.5, 0.8), (3, 0.6)]},
    "--restitution inflated --ball 0.43:0.11:80e3 --speed 2": {
        "restitution": "inflated", "ball": kd.Ball(0.43, 0.11, pressure=80e3), "speed": 2.0
    },
    "--friction 0.05": {"friction": 0.05},
    "--law stronge": {"law": "stronge"},
    "--ball paper": {"ball": kd.Ball.paper()},
    "--air paper": {"air": kd.Air.paper()},
    "--air none": {"air": None},
    "--air paper --drag sphere": {"air": kd.Air.paper(drag="sphere")},
    "--leg testbed": {"leg": kd.Leg.testbed()},
    "--frame foot": {"leg": load_leg("human", "foot")},
    "--stiff ankle --stiff knee": {"leg": kd.Leg.human().with_stiff_joints("ankle", "knee")},
    "--base-velocity 0.2,0,0.1 --base-angular-velocity 0,0.5,0": {
        "leg": kd.Leg.human().with_base_velocity((0.2, 0, 0.1), (0, 0.5, 0))
    },
}  # fmt: skip
"""Options, and the arguments of `Kick` and the leg that are not those of the default kick."""


@pytest.mark.parametrize("line", OPTIONS)
def test_options_give_the_kicks_of_the_library(line, kickdyn):
    changes = dict(OPTIONS[line])
    leg = changes.pop("leg", kd.Leg.human())
    kick = kd.Kick(**changes)
    document = kickdyn(f"{SWEEP} {line} --tolerance 0 --json -").json
    angles = [{"hip": hip, "knee": math.radians(10)} for hip in GRID["hip"]]
    outcomes = [kick_from(leg.posture(leg.configuration(angle)), kick) for angle in angles]
    speeds = [outcome.impact.ball_after.speed for outcome in outcomes if outcome.status == "ok"]
    assert document["status"]["ok"] == len(speeds) > 1
    best, worst = document["lines"][-2:]
    assert (best["posture"], worst["posture"]) == ("best", "worst")
    assert best["ball_speed"] == pytest.approx(max(speeds), rel=closed_form(1e4))
    assert worst["ball_speed"] == pytest.approx(min(speeds), rel=closed_form(1e4))
    for entry in document["lines"]:
        angles = {name: math.radians(angle) for name, angle in entry["angles_deg"].items()}
        outcome = kick_from(leg.posture(leg.configuration(angles)), kick)
        assert entry["impulse_vector"] == pytest.approx(outcome.impact.impulse, abs=closed_form(10))
        for name, value in variables_of(outcome, kick).items():
            right = pytest.approx(value, rel=integrated(1e-8), abs=closed_form(10))
            assert entry[name] == right, name


def test_a_sweep_is_the_library_s(kickdyn):
    grid = "--joint hip=0:40:2 --joint knee=0:60:2 --joint ankle=0:20:4"
    kickdyn(f"posture-sweep {grid} --speed 2 --tolerance 1e-3 --threads 2 --out s.nc --plot s.png")
    axes = zip(("hip", "knee", "ankle"), ((0, 41, 2), (0, 61, 2), (0, 21, 4)), strict=True)
    axes = {name: np.radians(np.arange(*ends)) for name, ends in axes}
    with xr.open_dataset("s.nc") as data:
        right = kd.sweep(kd.Leg.human(), axes, kd.Kick(speed=2.0))
        assert data.attrs["carry_tolerance_m"] == 1e-3
        assert data.impulse.values == pytest.approx(right.impulse.values, rel=1e-6)
        assert data.carry.values == pytest.approx(right.carry.values, abs=2e-3)
    assert Path("s.png").stat().st_size > 0


def test_a_store_says_what_a_file_says_and_is_resumed(kickdyn, tmp_path):
    line = f"{SWEEP} --speed 4 --where 'hip < 30' --json"
    stored = kickdyn(f"{line} z.json --out s.zarr")
    resumed = kickdyn(f"{line} r.json --out s.zarr --resume")
    filed = kickdyn(f"{line} n.json --out s.nc")
    assert stored.err == resumed.err == filed.err == ""
    documents = [json.loads((tmp_path / f"{name}.json").read_text()) for name in "zrn"]
    lines = [document["lines"][-2:] for document in documents]
    assert documents[0]["chosen"] == 2
    assert lines[0][0]["angles_deg"]["hip"] < 30
    for other in lines[1:]:
        for one, another in zip(lines[0], other, strict=True):
            assert one["ball_speed"] == pytest.approx(another["ball_speed"], rel=closed_form(1e4))
            assert one["angles_deg"] == another["angles_deg"]


def test_a_long_sweep_is_announced_with_its_size(kickdyn, monkeypatch):
    """Four variables of a float64 each, compressed; laws without a kernel take far longer."""

    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(posture_sweep_command, "sweep", stopped)
    grid = "--joint hip=0:60:0.04 --joint knee=0:60:0.04 --joint ankle=0:40:0.025"
    count, minutes = 1501 * 1501 * 1601, {}
    for law in ("newton", "stronge"):
        line = f"posture-sweep {grid} --out s.zarr --variables carry --law {law}"
        announced = kickdyn(line, code=1).err.splitlines()[0]
        assert announced.startswith(f"{count:,} postures")
        minutes[law] = int(re.search(r"about ([\d,]+) min", announced)[1].replace(",", ""))
        gigabytes = float(re.search(r"([\d.]+) GB", announced)[1])
        assert 4 * count < gigabytes * 1e9 < 4 * 8 * count
    measured = json.loads(SPEED.read_text())["functions"]["sweep"]["seconds"]
    assert 0.1 < 60 * minutes["newton"] / (count * measured) < 10  # machines differ
    assert minutes["stronge"] > 100 * minutes["newton"]


def test_the_default_grid_has_steps_of_5_degrees(kickdyn):
    """Hip from -10 to 40 and knee from 0 to 60 deg; the ankle is locked."""
    assert kickdyn("posture-sweep --lock ankle=0 --json -").json["postures"] == 11 * 13
