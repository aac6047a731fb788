"""The largest launches of a leg: met where the table says, resumed after an interruption."""

import json
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.reach_command import reach as reach_command
from kickdyn.planning import reach as module
from kickdyn.planning.goal import PlanStatus

BALL, AIR = kd.Ball(), kd.Air()
HEIGHT = -0.7042


@cache
def table():
    return kd.reach(
        kd.Leg.human(), BALL, AIR, elevations=(0, 10), ball_position=HEIGHT, tolerance=0.2
    )


def planned(row, speed, **options):
    """Return the plan of a launch of a row's direction, by its velocity in the vacuum."""
    angle, time = np.radians(row.elevation), 0.2
    launch = speed * np.array([np.cos(angle), 0, np.sin(angle)])
    goal = kd.Goal(time * launch - [0, 0, 0.5 * 9.80665 * time**2], time=time)
    return kd.plan_kick(kd.Leg.human(), goal, BALL, **options)


@pytest.mark.parametrize("number", [0, 1])
def test_the_speed_of_a_row_is_met_and_a_larger_one_is_not(number):
    row = table().rows[number]
    assert planned(row, row.speed, ball_position=HEIGHT).status == "met"
    assert planned(row, row.beyond, ball_position=HEIGHT).status != "met"
    assert row.speed < row.beyond <= 1.2 * row.speed
    assert row.reason == "speed of hip"


def test_distances_are_those_of_the_launch_on_each_surface():
    row = table().rows[1]
    angle = np.radians(10)
    velocity = row.speed * np.array([np.cos(angle), 0, np.sin(angle)])
    launch = kd.BallState((0, 0, BALL.radius), velocity)
    for surface, distance in (("carpet", row.carpet), ("turf", row.turf)):
        end = kd.follow(launch, BALL, AIR, kd.Ground(surface=surface)).rest.position
        assert np.hypot(*end[:2]) == pytest.approx(distance, rel=1e-9)
    assert row.carpet > row.turf


def test_limits_of_the_motion_leave_less():
    pytest.importorskip("casadi")
    within = kd.reach(kd.Leg.human(), BALL, AIR, elevations=(10,), motion=True, tolerance=0.2)
    row = within.rows[0]
    assert within.motion
    assert planned(row, row.speed, motion=True).status == "met"
    assert row.speed < table().rows[1].beyond


def test_an_interrupted_table_is_continued(tmp_path, monkeypatch):
    file, seen, plan_kick = tmp_path / "reach.csv", [], kd.plan_kick
    arguments = kd.Leg.human(), BALL, AIR
    options = {"elevations": (0, 10), "ball_position": HEIGHT, "tolerance": 0.2, "file": file}

    def interrupted(leg, goal, *rest, **settings):
        if goal.target[2] > 0.0:
            raise KeyboardInterrupt
        return plan_kick(leg, goal, *rest, **settings)

    monkeypatch.setattr(module, "plan_kick", interrupted)
    with pytest.raises(KeyboardInterrupt):
        kd.reach(*arguments, **options)
    assert len(file.read_text("utf-8").splitlines()) == 3
    monkeypatch.undo()
    whole = kd.reach(*arguments, **options, progress=seen.append)
    assert whole.rows == table().rows
    assert {line[:6] for line in seen} == {"2 of 2"}
    kd.reach(*arguments, **options, progress=seen.clear)  # nothing is left to do
    assert len(seen) > 0
    with pytest.raises(
        kd.InvalidInput, match="contains the table of another options: name another"
    ):
        kd.reach(*arguments, **options | {"ball_position": -0.6})
    head, _, rows = file.read_text("utf-8").partition("\n")
    for damaged in ("azimuth,speed\n1,2\n", f"{head}\n{rows}{'9' * 200_000}"):
        file.write_text(damaged, "utf-8")
        with pytest.raises(kd.InvalidInput, match="is not a table of kickdyn reach"):
            kd.reach(*arguments, **options)
    file.write_text(f"[]\n{rows}", "utf-8")
    with pytest.raises(kd.InvalidInput, match="contains the table of another air and ball and"):
        kd.reach(*arguments, **options)


def test_a_file_that_cannot_be_written_is_refused_first(monkeypatch):
    monkeypatch.setattr("kickdyn.planning.reach.plan_kick", None)
    with pytest.raises(kd.InvalidInput, match=r"cannot be written \(File name too long"):
        kd.reach(kd.Leg.human(), BALL, AIR, file="x" * 5000 + ".csv")


def test_bad_input():
    leg = kd.Leg.human()
    with pytest.raises(kd.InvalidInput, match=r"elevations are \[90\.0\]: they must be"):
        kd.reach(leg, BALL, AIR, elevations=90)
    with pytest.raises(kd.InvalidInput, match=r"elevations is -5\.0: it must be"):
        kd.reach(leg, BALL, AIR, elevations=(-5, 10))
    with pytest.raises(kd.InvalidInput, match="tolerance is 0"):
        kd.reach(leg, BALL, AIR, tolerance=0)
    with pytest.raises(kd.InvalidInput, match=r"file is 'r\.txt': a table of launches is written"):
        kd.reach(leg, BALL, AIR, file="r.txt")


def test_a_motion_that_is_met_is_where_larger_ones_start():
    """Planned from rest, motions are met up to 9.8 m/s only; from another one, up to 14 m/s."""
    tried = []

    def plan(speed, near):
        tried.append((speed, near is not None))
        met = speed <= (9.8 if near is None else 14.0)
        return SimpleNamespace(
            status=PlanStatus.MET if met else PlanStatus.BEYOND_LIMITS,
            share=1.0 if met else 0.98, binding=("torque of knee",), motion="planned",
        )  # fmt: skip

    row = module._largest(plan, (0.0, 10.0), 1.25, 0.05)
    assert tried[0] == (10.0, False)
    assert 14.0 / 1.05 < row.speed <= 14.0 < row.beyond
    assert row.reason == "torque of knee"


def test_a_row_says_that_no_larger_speed_was_tried(monkeypatch):
    monkeypatch.setattr(module, "LARGEST_SPEED", 12.0)
    row = kd.reach(kd.Leg.human(), BALL, AIR, elevations=10, ball_position=HEIGHT).rows[0]
    assert (row.speed, row.beyond) == (12.0, None)
    assert row.reason == "the largest speed that is tried"


def test_a_line_of_the_table_has_the_numbers_of_its_row():
    heads, units, *lines = table().table()
    assert heads.split() == ["azimuth", "elevation", "speed", "carpet", "turf"]
    assert units.split() == ["[deg]", "[deg]", "[m/s]", "[m]", "[m]"]
    assert len(lines) == len(table().rows) == 2
    for line, row in zip(lines, table().rows, strict=True):
        numbers = row.azimuth, row.elevation, row.speed, row.carpet, row.turf
        assert line.split()[:5] == [f"{number:.3g}" for number in numbers]
        assert line.endswith(row.reason)


def test_the_command_prints_and_keeps_the_table(tmp_path):
    file, picture, numbers = (tmp_path / name for name in ("r.csv", "r.png", "r.json"))
    arguments = ["--leg", "human", "--elevation", "10", "--tolerance", "0.1"]
    outputs = ["--out", str(file), "--plot", str(picture), "--json", str(numbers)]
    ended = CliRunner().invoke(reach_command, [*arguments, *outputs])
    assert ended.exit_code == 0, ended.output
    assert "upper bounds" in ended.output
    row = json.loads(numbers.read_text("utf-8"))["rows"][0]
    assert row["speed"] == pytest.approx(table().rows[1].speed, rel=0.1)
    assert picture.stat().st_size > 10_000
    assert f"wrote {file}" in ended.output
