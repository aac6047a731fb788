import json

import pytest

import kickdyn as kd
from kickdyn.planning.report import as_json, text, verdict

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
WEAK = kd.plan_kick(LEG, kd.Goal(50, time=2), BALL, AIR)


def test_beyond_limits_names_them_and_what_can_be_had():
    said = verdict(WEAK)
    assert "speed of knee" in said
    path = kd.fly(WEAK.hit.ball, BALL, AIR)
    assert f"comes down {path.range:.4g} m away after {path.duration:.4g} s" in said
    again = kd.plan_kick(LEG, kd.Goal(path.range * 0.999, time=path.duration), BALL, AIR)
    assert again.status == "met"


def test_lines_and_json():
    lines = text(WEAK)
    assert [line.split()[0] for line in lines] == ["launch", "touch", "leg", *LEG.joint_names]
    assert not any("-0.0 " in line for line in lines)
    said = json.loads(json.dumps(as_json(WEAK), allow_nan=False))
    assert said["status"] == "beyond limits"
    assert said["leg"]["binding"] == list(WEAK.binding)
    assert said["landing_error"] == WEAK.landing_error
    assert said["leg"]["v"] == pytest.approx(WEAK.v.tolist())
