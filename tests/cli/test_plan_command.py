"""`kickdyn plan`: every option reaches the library, and the document has its numbers."""

import json
import math

import numpy as np
import pytest
from tolerances import agrees, optimized

import kickdyn as kd
from kickdyn.cli.leg_options import load_leg
from kickdyn.cli.plan_command import height_of_ball

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
HEIGHT = -(0.371 + 0.443) + BALL.radius
"""Height of a ball beside the foot of the straight leg: thigh and shank of the paper's Table 1."""

ROLLS = kd.BallState((2, 0, HEIGHT), (-2.5, 0, 0), (0, -20, 0))
MOVING = f"--ball-position 2,0,{HEIGHT} --ball-velocity=-2.5,0,0 --ball-spin=0,-20,0"

TO = "--distance 10 --time 1"
GOAL = kd.Goal(10, time=1)


def contact(**changes):
    return kd.Contact(None, **{"restitution": 0.8, "friction": 0.4} | changes)


OPTIONS = {
    TO: {},
    "--distance 8 --apex 2": {"goal": kd.Goal(8, apex=2)},
    "--distance 8 --launch-speed 12": {"goal": kd.Goal(8, speed=12)},
    "--distance 12 --over 6:2": {"goal": kd.Goal(12, over=(6, 2))},
    "--distance 12 --wall 6:1.5": {"goal": kd.Goal(12, over=(6, 1.6))},
    "--distance 10 --left 2 --height 0.5 --time 1": {"goal": kd.Goal((10, 2, 0.5), time=1)},
    f"{TO} --receiver-velocity 1,0,0": {"goal": kd.Goal(10, time=1, receiver_velocity=(1, 0, 0))},
    f"{TO} --spin 0,0,0": {"goal": kd.Goal(10, time=1, spin=(0, 0, 0))},
    "--distance 8 --time 2 --pass carpet": {"goal": kd.Goal(8, time=2), "surface": "carpet"},
    f"{TO} --leg testbed --no-limits --ball-height -0.5": {
        "leg": kd.Leg.testbed(), "limits": False, "ball_position": -0.5
    },
    f"{TO} --ball-at 0.3,0,-0.65": {"ball_position": (0.3, 0, -0.65)},
    f"{TO} --objective foot-speed": {"objective": "foot-speed"},
    f"{TO} --restitution 0.6": {"contact": contact(restitution=0.6)},
    f"{TO} --friction 0.1": {"contact": contact(friction=0.1)},
    f"{TO} --offset 0.02,0,0.01 --ball-height -0.65": {
        "contact": contact(offset=(0.02, 0, 0.01)), "ball_position": -0.65
    },
    f"{TO} --ball 0.3:0.1 --ball-height -0.65": {"ball": kd.Ball(0.3, 0.1), "ball_position": -0.65},
    f"{TO} --air none": {"air": None},
    f"{TO} --drag 0.35": {"air": kd.Air(drag=0.35)},
    f"{TO} --wind 2,0,0": {"air": kd.Air(wind=(2, 0, 0))},
    f"{TO} --base-velocity 2,0,0": {"leg": LEG.with_base_velocity((2, 0, 0))},
}  # fmt: skip
"""Options, and the arguments of `plan_kick` that are not those of a plain kick over 10 m."""


@pytest.mark.parametrize("line", OPTIONS)
def test_options_give_the_plan_of_the_library(line, kickdyn):
    arguments = {"leg": LEG, "goal": GOAL, "ball": BALL, "air": AIR, "contact": contact(),
                 "ball_position": HEIGHT} | OPTIONS[line]  # fmt: skip
    plan = kd.plan_kick(**arguments)
    document = kickdyn(f"plan {line} --json -").json
    leg, velocity = document["leg"], plan.launch.velocity
    near = {"rel": optimized(), "abs": optimized()}
    assert document["launch"]["velocity"] == pytest.approx(velocity, **near)
    assert document["impact"]["impulse"] == pytest.approx(plan.impact.impulse, **near)
    assert leg["v"] == pytest.approx(plan.v, rel=1e-3, abs=1e-3)
    assert leg["q_deg"] == pytest.approx(plan.leg.angles_deg(plan.q), rel=1e-3, abs=1e-2)
    assert leg["heading_deg"] == pytest.approx(np.degrees(plan.heading), abs=optimized(1e-7))
    assert leg["speed_use"] == pytest.approx(plan.speed_use, rel=1e-3)
    assert document["status"] == plan.status
    assert document["time"] == pytest.approx(plan.path.duration, rel=optimized(1e-7))


def test_the_surface_is_chosen_for_the_goal_on_the_line(kickdyn, monkeypatch):
    asked = []

    def choose(*values, **options):
        asked.append((values[1].target.tolist(), options["contact"].friction))
        return kd.kick_with(LEG, "instep")

    monkeypatch.setattr("kickdyn.cli.plan_command.choose_surface", choose)
    printed = kickdyn(f"plan {TO} --friction 0.3 --choose-surface").out
    assert asked == [([10.0, 0.0, 0.0], 0.3)]
    assert "struck with the instep" in printed


def test_a_ball_lies_at_the_foot_of_a_straight_leg_or_of_a_robot_with_hips_10_percent_lower():
    robot, offset = load_leg("g1"), (0.0, 0.0, 0.01)
    foot = robot.posture(robot.configuration()).contact_point[2]
    assert height_of_ball(robot, BALL, None) == pytest.approx(0.9 * foot + BALL.radius)
    assert height_of_ball(LEG, BALL, offset) == pytest.approx(HEIGHT + 0.01)
    assert height_of_ball(kd.Leg.from_robot("bolt", base="floating"), BALL, None) is None


def test_a_ball_is_trapped(kickdyn, tmp_path):
    plan = kd.plan_trap(LEG, kd.IncomingBall(ROLLS, meet_at=0.7), BALL, AIR, velocity=(0.5, 0, 0),
                        contact=contact())  # fmt: skip
    kickdyn(f"plan {MOVING} --meet-at 0.7 --trap 0.5,0,0 --json t.json --plot t.png")
    document = json.loads((tmp_path / "t.json").read_text())
    assert document["launch"]["velocity"] == pytest.approx([0.5, 0, 0], abs=optimized(1e-7))
    agrees(document["impact"]["impulse"], plan.impact.impulse, optimized(1e-5))
    assert len(document["meetings"]) == len(plan.meetings)
    assert document["sensitivity_to_ball"] is plan.sensitivity_to_ball is None


def test_a_free_kick_over_a_wall_into_the_corner(kickdyn, tmp_path, monkeypatch):
    """Distances to post, bar and wall follow from the goal of 7.32 by 2.44 m and the ball."""
    where, drawn = "--distance 20 --left 3.4 --height 2.1 --wall 9.15:1.9 --goal", []
    for name in ("goal_boxes", "wall_boxes"):
        drawer = f"kickdyn.view.wall_and_goal.{name}"
        monkeypatch.setattr(drawer, lambda *values: drawn.append(np.hstack(values)[2:]) or [])
    ended = kickdyn(f"plan {where} --view free.html --json free.json")
    document = json.loads((tmp_path / "free.json").read_text())
    floor, ahead = HEIGHT - BALL.radius, np.array([20.0, 3.4, 0.0]) / math.hypot(20.0, 3.4)
    for values, right in zip(drawn, ([floor, *ahead, 9.15, 1.9, 2.5], [floor, 20.0]), strict=True):
        assert values == pytest.approx(right)
    post, bar = 7.32 / 2 - 3.4 - BALL.radius, 2.44 - 2.1 - 2 * BALL.radius
    assert document["goal_mouth"]["end"] == "in"
    assert document["goal_mouth"]["post"] == pytest.approx(post, abs=optimized(1e-7))
    assert document["goal_mouth"]["bar"] == pytest.approx(bar, abs=optimized(1e-7))
    assert document["wall"]["above"] == pytest.approx(0.1, abs=optimized(1e-7))
    heading = math.degrees(math.atan2(3.4, 20))
    assert document["leg"]["heading_deg"] == pytest.approx(heading, abs=0.5)
    for number in (f"{post:.3g} m", f"{bar:.3g} m", "0.1 m"):
        assert number in ended.out
    page = (tmp_path / "free.html").read_text()
    assert f"{post:.3g} m" in page
    assert "still aloft" not in page
    assert "ball displaced across" in page


@pytest.mark.parametrize(("line", "limit", "nearest"), [
    ("--distance 20 --launch-speed 5", "least-speed", lambda reached: reached["speed"] > 5),
    ("--distance 20 --time 60 --pass turf", "rolling", lambda reached: 0 < reached["time"] < 60)
])  # fmt: skip
def test_an_unreachable_goal_ends_with_2_and_the_nearest_one(line, limit, nearest, kickdyn):
    document = kickdyn(f"plan {line} --json -", code=2).json
    assert (document["status"], document["limit"]) == ("unreachable", limit)
    assert document["goal"]["target_m"] == [20, 0, 0]
    assert nearest(document["nearest"])


@pytest.mark.slow
def test_a_motion_begins_and_ends_at_rest_and_has_the_velocity_of_the_impact(kickdyn, tmp_path):
    line = "--distance 10 --time 1 --motion --view kick.html --plot m.svg --json kick.json"
    ended = kickdyn(f"plan {line} --out m.csv")
    document = json.loads((tmp_path / "kick.json").read_text())
    motion = document["motion"]
    at_impact = motion["time"].index(0.0)
    assert motion["v"][at_impact] == pytest.approx(document["leg"]["v"], abs=optimized(1e-10))
    assert motion["v"][0] == pytest.approx([0, 0, 0], abs=optimized(1e-10))
    assert motion["v"][-1] == pytest.approx([0, 0, 0], abs=optimized(1e-10))
    assert f"{-motion['time'][0]:.3g} s" in ended.out
    assert (tmp_path / "m.svg").stat().st_size > 10_000
    assert (tmp_path / "m.csv").exists()


@pytest.mark.slow
def test_reach_has_the_rows_of_the_library(kickdyn, tmp_path):
    """Each of the options of its own: directions, accuracy, file and plot."""
    where = "--azimuth 10 --elevation 20 --tolerance 0.3 --drag 0.3 --friction 0.2"
    ended = kickdyn(f"reach {where} --out r.csv --plot r.png --json r.json")
    table = kd.reach(LEG, BALL, kd.Air(drag=0.3), azimuths=10.0, elevations=20.0, tolerance=0.3,
                     contact=contact(friction=0.2), ball_position=HEIGHT)  # fmt: skip
    near = optimized(1e-7)
    (row,), (entry,) = table.rows, json.loads((tmp_path / "r.json").read_text())["rows"]
    assert {name: entry[name] for name in ("azimuth", "elevation", "speed", "carpet", "turf")} == {
        "azimuth": 10.0, "elevation": 20.0, "speed": pytest.approx(row.speed, rel=near),
        "carpet": pytest.approx(row.carpet, rel=near), "turf": pytest.approx(row.turf, rel=near),
    }  # fmt: skip
    for file in ("r.csv", "r.png", "r.json"):
        assert f"wrote {file}" in ended.out
        assert (tmp_path / file).stat().st_size > 0
