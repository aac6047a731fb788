import json
import re

import pytest

import kickdyn as kd
from kickdyn.planning.report import as_json, text, verdict

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
WEAK = kd.plan_kick(LEG, kd.Goal(50, time=2), BALL, AIR)


def test_beyond_limits_names_them_and_where_the_ball_comes_down():
    said = verdict(WEAK)
    assert "speed of knee" in said
    path = kd.fly(WEAK.hit.ball, BALL, AIR)
    down = f"comes down {path.range:.4g} m away after {path.duration:.4g} s"
    assert f"{down}, {50 - path.range:.3g} m from it" in said


@pytest.mark.parametrize("goal", [kd.Goal(50, time=2), kd.Goal((40, 0, 2), time=1.2)])
def test_what_is_said_to_be_within_the_limits_is_met_as_printed(goal):
    said = verdict(kd.plan_kick(LEG, goal, BALL, AIR))
    distance, time = re.search(r"Within them, that way, are (.*) m in (.*) s", said).groups()
    again = kd.plan_kick(LEG, kd.Goal(float(distance), time=float(time)), BALL, AIR)
    assert again.status == "met"


def test_late_and_beside():
    late = kd.plan_kick(LEG, kd.Goal(15, time=0.55), BALL, AIR, surface="carpet")
    assert f"passes it after {late.path.duration:.4g} s, {late.time_error:.3g} s late." in verdict(
        late
    )
    high = kd.plan_kick(LEG, kd.Goal((30, 0, 5), time=1.3), BALL, AIR)
    assert high.path.status == "at plane"
    assert f"late, {high.landing_error:.3g} m from it." in verdict(high)
    stops = kd.plan_kick(kd.Leg.testbed(), kd.Goal(40, time=9), BALL, AIR, surface="turf")
    assert f"stops {stops.path.distance:.4g} m away" in verdict(stops)


def test_lines_and_json():
    lines = text(WEAK)
    assert [line.split()[0] for line in lines] == ["launch", "touch", "leg", *LEG.joint_names]
    assert not any("-0.0 " in line for line in lines)
    said = json.loads(json.dumps(as_json(WEAK), allow_nan=False))
    assert said["status"] == "beyond limits"
    assert said["leg"]["binding"] == list(WEAK.binding)
    assert said["landing_error"] == WEAK.landing_error
    assert said["time_error"] == said["time"] - 2
    assert said["leg"]["v"] == pytest.approx(WEAK.v.tolist())
