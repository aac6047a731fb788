import numpy as np
import pytest
from rich.console import Console

import kickdyn as kd
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.summary import summarize
from kickdyn.sweeps.sweep_report import as_json, extreme_lines, paper_lines, show, table, text

LEG, KICK = kd.Leg.human(), kd.Kick()


def swept(*joints, kick=KICK, leg=LEG, where=None):
    """Return dataset, summary and the lines of best and worst."""
    grid = Grid.of(leg, read_postures(leg, joints))
    data = kd.sweep(leg, grid.axes, kick)
    summary = summarize(data, where)
    return data, summary, extreme_lines(leg, grid, kick, summary)


@pytest.fixture(scope="module")
def lines():
    return [*paper_lines(LEG, KICK), *swept("hip=0:10:10", "knee=10")[2]]


def printed(lines, width):
    console = Console(width=200)
    with console.capture() as captured:
        console.print(table(LEG, KICK, lines, width))
    return captured.get().splitlines()[2:]


def test_a_narrow_screen_has_a_column_per_posture(lines):
    wide, narrow = printed(lines, 200), printed(lines, 80)
    assert max(map(len, wide)) > 80 >= max(map(len, narrow))
    words = " ".join(narrow).split()
    for row in wide[3:]:
        assert set(row.split()) <= set(words), row
    (heads,) = [line.split() for line in narrow if "paper a" in line]
    for joint, values in (("hip", [5, 5, 5, 10, 0]), ("ankle", [-5, 15, 40, 0, 0])):
        (angles,) = [line.split() for line in narrow if line.startswith(f" {joint}, deg")]
        assert angles[-len(lines) :] == [str(value) for value in values]
    (masses,) = [line.split() for line in narrow if "eff. mass, kg" in line]
    assert heads[0] == "posture"
    assert masses[-len(lines) :] == [f"{line.values['effective_mass']:.4g}" for line in lines]


def test_prose_fits_a_screen(lines):
    where = "hip < 5 and " * 9 + "knee > 1"
    _, summary, _ = swept("hip=0:10:10", "knee=10:20:10", where=where)
    summary.counts["out-of-reach"] = 1
    for width, most in ((None, 80), (60, 60)):
        said = text(summary, lines, *([] if width is None else [width]))
        assert most - 12 < max(map(len, said.splitlines())) <= most
        assert "Best and worst are of the 2 that are ok where hip < 5" in said
        assert "5 postures: 4 ok, 1 out-of-reach." in said


def test_a_pipe_has_no_width(lines, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    show(LEG, KICK, swept("hip=0:10:10")[1], lines)
    table, prose = capsys.readouterr().out.split("\nbest (")
    assert max(map(len, table.splitlines())) > 80
    assert 60 < max(map(len, prose.splitlines())) <= 80


def test_best_and_worst_are_the_extremes_of_what_the_leg_can_do():
    data, summary, (best, worst) = swept("hip=0:60:20", "knee=0:60:20", kick=kd.Kick(speed=7.0))
    assert summary.counts["too-fast"] > 0
    possible = data.ball_speed.values[data.status.values == 0]
    assert best.values["ball_speed"] == possible.max()
    assert worst.values["ball_speed"] == possible.min()
    mass = f"{best.values['effective_mass']:.3g} kg"
    assert f"effective mass of the leg is {mass}" in best.explanation
    assert best.outcome.status == worst.outcome.status == "ok"
    at = data.sel({n: np.radians(best.angles[n]) for n in ("hip", "knee")}, method="nearest")
    assert float(at.ball_speed) == best.values["ball_speed"]


def test_none_where_nothing_is_possible():
    kick = kd.Kick(speed=500.0)
    _, summary, lines = swept("knee=0:20:10", kick=kick)
    assert lines == []
    report = as_json(LEG, kick, summary, lines)
    assert report["status"] == {"ok": 0, "too-fast": 3, "out-of-reach": 0}


def test_the_papers_postures_meet_table_2():
    for line in paper_lines(LEG, KICK):
        assert line.values["immovable_impulse"] == pytest.approx(line.paper, rel=0.003)


def test_json_holds_no_nan():
    line = paper_lines(LEG, KICK)[0].as_json()
    assert line["posture"] == "paper a"
    assert line["angles"] == {"hip": 5, "knee": 10, "ankle": -5}
    assert np.linalg.norm(line["impulse_vector"]) == pytest.approx(line["impulse"])


def test_angles_come_back_as_they_were_given():
    data, _, lines = swept("hip=29", "knee=0:60:0.2", "ankle=0.3:0.3:1")
    given = np.arange(301) / 5
    assert (data.knee_deg.values == given).all()
    for line in lines:
        assert (line.angles["hip"], line.angles["ankle"]) == (29, 0.3)
        assert line.angles["knee"] in given
    assert [line.angles["ankle"] for line in paper_lines(LEG, KICK)] == [-5, 15, 40]


def test_a_whole_robot_is_swept_by_its_named_joints():
    robot = kd.Leg.from_robot("bolt", base="floating")
    leg = robot.with_supports(kd.Support("FL_FOOT", point=True))
    kick = kd.Kick(speed=2.0)
    data, _, lines = swept("FR_HFE=-30:30:30", "FR_KFE=-60:0:30", leg=leg, kick=kick)
    assert data.ball_speed.shape == (3, 3)
    assert list(lines[0].angles) == list(leg.joint_names[1:])
    assert str(table(leg, kick, lines).columns[1].header).startswith("FL_HAA /\nFL_HFE")
