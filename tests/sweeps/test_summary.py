import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.opened import Sweep
from kickdyn.sweeps.run import sweep
from kickdyn.sweeps.summary import best_and_worst, counts, paper_lines
from kickdyn.sweeps.sweep_report import table

LEG = kd.Leg.human()


def test_best_and_worst_are_the_extremes_of_what_the_leg_can_do():
    kick = Kick(speed=7.0)
    data = sweep(LEG, grid(LEG, ["hip=0:60:20", "knee=0:60:20"]), kick)
    assert counts(data)["too fast"] > 0
    best, worst = best_and_worst(LEG, Sweep(data), kick)
    possible = data.ball_speed.values[data.status.values == 0]
    assert best.numbers["ball_speed"] == possible.max()
    assert worst.numbers["ball_speed"] == possible.min()
    assert f"weighs {best.numbers['effective_mass']:.3g} kg" in best.why
    assert best.outcome.status == worst.outcome.status == "ok"
    at = data.sel({n: np.radians(best.angles[n]) for n in ("hip", "knee")}, method="nearest")
    assert float(at.ball_speed) == best.numbers["ball_speed"]


def test_none_where_nothing_is_possible():
    kick = Kick(speed=500.0)
    data = sweep(LEG, grid(LEG, ["knee=0:20:10"]), kick)
    assert best_and_worst(LEG, Sweep(data), kick) == []
    assert counts(data) == {"ok": 0, "too fast": 3, "out of reach": 0}


def test_the_papers_postures_meet_table_2():
    for line in paper_lines(LEG, Kick()):
        assert line.numbers["immovable_impulse"] == pytest.approx(line.paper, rel=0.003)


def test_json_holds_no_nan():
    line = paper_lines(LEG, Kick())[0].as_json()
    assert line["posture"] == "paper a"
    assert line["angles"] == {"hip": 5, "knee": 10, "ankle": -5}
    assert np.linalg.norm(line["impulse_vector"]) == pytest.approx(line["impulse"])


def test_angles_come_back_as_they_were_given():
    kick = Kick()
    data = sweep(LEG, grid(LEG, ["hip=29", "knee=0:60:0.2", "ankle=0.3:0.3:1"]), kick)
    given = np.arange(301) / 5
    assert (data.knee_deg.values == given).all()
    for line in best_and_worst(LEG, Sweep(data), kick):
        assert (line.angles["hip"], line.angles["ankle"]) == (29, 0.3)
        assert line.angles["knee"] in given
    assert [line.angles["ankle"] for line in paper_lines(LEG, kick)] == [-5, 15, 40]


def test_a_whole_robot_is_swept_by_its_named_joints():
    robot = kd.Leg.from_robot("bolt", base="floating")
    leg = robot.with_supports(kd.Support("FL_FOOT", point=True))
    kick = Kick(speed=2.0)
    data = sweep(leg, grid(leg, ["FR_HFE=-30:30:30", "FR_KFE=-60:0:30"]), kick)
    assert data.ball_speed.shape == (3, 3)
    lines = best_and_worst(leg, Sweep(data), kick)
    assert list(lines[0].angles) == list(leg.joint_names[1:])
    assert str(table(leg, kick, lines).columns[1].header).startswith("FL_HAA /\nFL_HFE")
