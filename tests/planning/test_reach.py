"""The largest launches of a leg: met where the table says, continued after an interruption."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.planning import reach as module
from kickdyn.planning.goal import PlanStatus
from kickdyn.planning.reach import ReachRow, ReachTable

BALL, AIR, HUMAN = kd.Ball(), kd.Air(), kd.Leg.human()
HEIGHT = -0.7042
BINDING = "torque of knee"


def limited(most, share=0.98, motion=None, from_motion=None):
    """Return a planner whose launches are met up to a speed, and the speeds that it tried."""
    tried = []

    def plan(speed, near):
        tried.append((speed, near is not None))
        met = speed <= (most if near is None or from_motion is None else from_motion)
        status = PlanStatus.MET if met else PlanStatus.BEYOND_LIMITS
        reached = 1.0 if met else share if share else most / speed
        return SimpleNamespace(status=status, share=reached, binding=(BINDING,), motion=motion)

    return plan, tried


@pytest.mark.parametrize("share", [1e-3, None], ids=["no hint", "exact share"])
@pytest.mark.parametrize("most", [1.3, 9.8, 17.0, 61.0])
@pytest.mark.parametrize("tolerance", [0.2, 0.01])
def test_the_largest_speed_is_enclosed_within_the_tolerance(most, share, tolerance):
    plan, tried = limited(most, share)
    row = module._largest(plan, (5.0, 10.0), 2.0, tolerance)
    assert row.speed <= most < row.beyond <= (1 + tolerance) * row.speed
    assert (row.azimuth, row.elevation, row.reason) == (5.0, 10.0, BINDING)
    assert len(tried) <= module.MOST_TRIES


def test_a_motion_that_is_met_is_where_larger_ones_start():
    """Planned from rest, motions are met up to 9.8 m/s only; from another one, up to 14 m/s."""
    plan, tried = limited(9.8, motion="planned", from_motion=14.0)
    row = module._largest(plan, (0.0, 10.0), 1.25, 0.05)
    assert tried[0] == (10.0, False)
    assert row.speed <= 14.0 < row.beyond <= 1.05 * row.speed


def launch_of(azimuth, elevation, speed):
    side, height = np.radians([azimuth, elevation])
    level = speed * math.cos(height)
    return np.array([level * math.cos(side), level * math.sin(side), speed * math.sin(height)])


def test_an_interrupted_table_is_continued(tmp_path, monkeypatch):
    file, seen, interrupted = tmp_path / "reach.csv", [], [KeyboardInterrupt]
    options = {"azimuths": 20, "elevations": (0, 10), "ball_position": HEIGHT, "file": file}

    def plan_kick(leg, goal, *_, **__):
        velocity = goal.target / 0.1 + [0, 0, 0.5 * 9.81 * 0.1]
        speed, up = np.linalg.norm(velocity), 10.0 * (goal.target[2] > 0.0)
        agrees(velocity, launch_of(20.0, up, speed), closed_form(10))
        seen.append(goal)
        if goal.target[2] > 0.0 and interrupted:
            raise interrupted.pop()
        return limited(13.0, None)[0](speed, None)

    monkeypatch.setattr(module, "plan_kick", plan_kick)
    with pytest.raises(KeyboardInterrupt):
        kd.reach(HUMAN, BALL, AIR, **options)
    assert len(file.read_text("utf-8").splitlines()) == 3
    before = len(seen)
    whole = kd.reach(HUMAN, BALL, AIR, **options)
    assert all(goal.target[2] > 0.0 for goal in seen[before:])
    assert all(12 < row.speed <= 13.0 for row in whole.rows)
    row, count = whole.rows[1], len(seen)
    for surface, distance in (("carpet", row.carpet), ("turf", row.turf)):
        start = kd.BallState((0, 0, BALL.radius), launch_of(20.0, 10.0, row.speed))
        end = kd.follow(start, BALL, AIR, kd.Ground(surface=surface)).rest.position
        assert np.hypot(*end[:2]) == pytest.approx(distance, rel=closed_form(1e4))
    assert kd.reach(HUMAN, BALL, AIR, **options).rows == whole.rows
    assert len(seen) == count
    with pytest.raises(kd.InvalidInput, match="another options"):
        kd.reach(HUMAN, BALL, AIR, **options | {"ball_position": -0.6})
    head, _, rows = file.read_text("utf-8").partition("\n")
    for damaged in ("azimuth,speed\n1,2\n", f"{head}\n{rows}{'9' * 200_000}"):
        file.write_text(damaged, "utf-8")
        with pytest.raises(kd.InvalidInput, match="is not a table of kickdyn reach"):
            kd.reach(HUMAN, BALL, AIR, **options)


def test_the_plot_by_elevation_has_the_rows():
    rows = [(side, up, 20 - 0.1 * up - side, None, "", 30 - up - side, 25 + up + side)
            for side in (0.0, 15.0) for up in (20.0, 0.0, 45.0)]  # fmt: skip
    table = ReachTable("leg", True, tuple(ReachRow(*row) for row in rows))
    figure = table.plot()
    drawn = [line for axes in figure.axes for line in axes.lines]
    columns = [(0, 2), (15, 2), (0, 5), (0, 6), (15, 5), (15, 6)]
    for line, (side, column) in zip(drawn, columns, strict=True):
        right = sorted((row[1], row[column]) for row in rows if row[0] == side)
        assert np.transpose(line.get_data()).tolist() == [*map(list, right)]


@pytest.mark.parametrize(("options", "words"), [
    ({"elevations": 90}, r"elevations are \[90\.0\]"),
    ({"elevations": (-5, 10)}, r"elevations is -5\.0"),
    ({"azimuths": 200}, r"azimuths are \[200\.0\].*180"), ({"tolerance": 0}, "tolerance is 0"),
    ({"file": "r.txt"}, r"r\.txt.*\.csv"), ({"file": "x" * 5000 + ".csv"}, "cannot be written")
])  # fmt: skip
def test_bad_input(options, words, monkeypatch):
    monkeypatch.setattr(module, "plan_kick", None)
    with pytest.raises(kd.InvalidInput, match=words):
        kd.reach(HUMAN, BALL, AIR, **options)
