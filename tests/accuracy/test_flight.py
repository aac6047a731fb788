import json
import subprocess
import sys

import pytest

from kickdyn.accuracy.flight import measure


@pytest.fixture(scope="module")
def rows():
    return measure((1e-4, 1e-8))


def test_every_method_gets_more_exact_with_its_tolerance(rows):
    methods = dict.fromkeys(row.method for row in rows)
    assert list(methods)[:6] == ["RK45", "DOP853", "LSODA", "Radau", "kd.fly", "kd.fly_many"]
    for method in methods:
        coarse, fine = (row for row in rows if row.method == method)
        assert fine.error < coarse.error / 10
        assert fine.error < 1e-3
        assert fine.evaluations > coarse.evaluations
        assert coarse.seconds > 0


def test_fly_and_fly_many_agree_on_the_error(rows):
    fly, many = (
        next(row for row in rows if row.method == name and row.tol == 1e-8)
        for name in ("kd.fly", "kd.fly_many")
    )
    assert many.error == pytest.approx(fly.error, rel=0.9)


def test_the_front_is_what_nothing_beats(rows):
    front = [row for row in rows if row.pareto]
    assert front
    for row in rows:
        beaten = any(o.seconds < row.seconds and o.error < row.error for o in rows)
        assert row.pareto is not beaten


def test_the_door(tmp_path):
    door = [sys.executable, "-m", "kickdyn.tradeoff"]
    ended = subprocess.run(door, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "give --flight" in ended.stderr
    ended = subprocess.run(
        [*door, "--flight", "--json", "no/x.json"], capture_output=True, text=True
    )
    assert (ended.returncode, ended.stdout) == (2, "")


def test_the_door_prints_json():
    door = [sys.executable, "-m", "kickdyn.tradeoff", "--flight", "--json", "-"]
    ended = subprocess.run(door, capture_output=True, text=True)
    rows = json.loads(ended.stdout)
    assert {"method", "tol", "error", "evaluations", "seconds", "pareto"} == set(rows[0])
