import sys

import numpy as np
import pytest
from rich.console import Console

import kickdyn as kd
from kickdyn.impact import pinocchio_engine
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.summary import summarize
from kickdyn.sweeps.sweep_kick import kick_from
from kickdyn.sweeps.sweep_report import (
    as_json,
    extreme_lines,
    page_lines,
    paper_lines,
    pinocchio_differences,
    show,
    table,
    text,
)

strike_module = sys.modules["kickdyn.impact.strike"]
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


def printed(leg, lines):
    console = Console(width=200)
    with console.capture() as captured:
        console.print(table(leg, lines))
    return captured.get().splitlines()


def test_the_table_has_a_column_for_each_posture_and_fits_a_screen(lines):
    rows = printed(LEG, lines)
    assert max(map(len, rows)) <= 80
    cells = {row[:30].strip(): row[30:].split() for row in rows}
    labels = " ".join(cells["posture"])
    assert labels == "Table 2 a Table 2 b Table 2 c best worst"
    assert cells["hip, deg"] == ["5", "5", "5", "10", "0"]
    assert cells["ankle, deg"] == ["-5", "15", "40", "0", "0"]
    for row, name, scale in (
        ("effective mass, kg", "effective_mass", 1), ("impulse on the ball, N s", "impulse", 1),
        ("ball speed / foot speed", "speed_ratio", 1),
        ("launch angle, deg", "launch_angle", 57.29578),
        ("back spin, rad/s", "back_spin", 1), ("carry distance, m", "carry", 1),
        ("impulse in that joint, N s", "worst_joint_impulse", 1),
        ("impulse on a fixed body, N s", "immovable_impulse", 1),
    ):  # fmt: skip
        shown = [scale * line.values[name] for line in lines]
        assert list(map(float, cells[row])) == pytest.approx(shown, rel=2e-3)
    assert cells["joint of largest impulse"] == ["ankle"] * 5
    assert cells["the same in the paper, N s"] == ["1.554", "0.944", "0.646"]
    assert "status" not in cells


def test_prose_fits_a_screen(lines):
    where = "hip < 5 and " * 9 + "knee > 1"
    _, summary, _ = swept("hip=0:10:10", "knee=10:20:10", where=where)
    summary.counts["out-of-reach"] = 1
    for width, most in ((None, 80), (60, 60)):
        said = text(summary, lines, *([] if width is None else [width]))
        assert most - 12 < max(map(len, said.splitlines())) <= most
        assert "Best and worst are among the 2 with status ok where hip < 5" in said
        assert "5 postures: 4 ok, 1 out-of-reach." in said


@pytest.mark.parametrize(("residual", "power"), [(3e-15, "-13"), (2e-16, "-14"), (0.0, "-16")])
def test_residuals_are_rounded_up_with_a_digit_to_spare(lines, residual, power):
    summary = swept("hip=0:10:10")[1]
    summary.residual = residual
    said = text(summary, lines)
    assert f"\nThe relative residuals of restitution and momentum are below 1e{power}.\n" in said


def test_the_report_compares_with_pinocchio(lines, monkeypatch):
    assert 0.0 <= max(pinocchio_differences(lines)) < 1e-14
    exact = pinocchio_engine.solve_by_pinocchio

    def wrong(approach, law):
        solution, ball, response = exact(approach, law)
        return solution._replace(impulses=solution.impulses * (1 + 3e-7)), ball, response

    monkeypatch.setattr(strike_module, "solve_by_pinocchio", wrong)
    assert max(pinocchio_differences(lines)) == pytest.approx(3e-7)
    said = text(swept("hip=0:10:10")[1], lines, 200)
    assert "pin.impulseDynamics gives the impulses of all 5 postures above" in said
    assert said.endswith("the relative difference is below 1e-05.")
    assert pinocchio_differences([]) == []


def test_a_pipe_has_80_columns(lines, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    show(LEG, KICK, swept("hip=0:10:10")[1], lines)
    said = capsys.readouterr().out
    assert said.startswith(
        "leg_human: foot 1 m/s at 30 deg, restitution 0.8, friction 0.4, ball 0.43 kg,\n"
    )
    assert 70 < max(map(len, said.splitlines())) <= 80


def test_best_and_worst_are_the_extremes_of_what_the_leg_can_do():
    data, summary, (best, worst) = swept("hip=0:60:20", "knee=0:60:20", kick=kd.Kick(speed=7.0))
    assert summary.counts["too-fast"] > 0
    possible = data.ball_speed.values[data.status.values == 0]
    assert best.values["ball_speed"] == possible.max()
    assert worst.values["ball_speed"] == possible.min()
    mass, ratio = best.values["effective_mass"], best.values["speed_ratio"]
    assert best.explanation == (
        f"the effective mass of the leg is {mass:.3g} kg, {mass / 0.43:.3g} times the ball's mass;"
        f" the ball leaves at {ratio:.3g} times the foot's speed (1.8 if the leg were infinitely "
        f"heavy); its joints need {100 * best.values['speed_use']:.0f}% of their speed limits"
    )
    assert best.outcome.status == worst.outcome.status == "ok"
    at = data.sel({n: np.radians(best.angles[n]) for n in ("hip", "knee")}, method="nearest")
    assert float(at.ball_speed) == best.values["ball_speed"]


def test_none_where_nothing_is_possible():
    kick = kd.Kick(speed=500.0)
    _, summary, lines = swept("knee=0:20:10", kick=kick)
    assert lines == []
    report = as_json(LEG, kick, summary, lines)
    assert report["status"] == {
        "ok": 0, "too-fast": 3, "out-of-reach": 0, "not-closed": 0,
    }  # fmt: skip


def test_the_papers_postures_meet_table_2():
    for line in paper_lines(LEG, KICK):
        assert line.values["immovable_impulse"] == pytest.approx(line.paper, rel=0.003)


def test_json_holds_no_nan():
    line = paper_lines(LEG, KICK)[0].as_json()
    assert line["posture"] == "Table 2 a"
    assert line["angles_deg"] == {"hip": 5, "knee": 10, "ankle": -5}
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
    joints = ["FR_HFE=-30:30:30", "FR_KFE=-60:0:30"]
    data, summary, lines = swept(*joints, leg=leg, kick=kick)
    assert data.ball_speed.shape == (3, 3)
    assert list(lines[0].angles) == list(leg.joint_names[1:])
    # shown are the joints of the kicking limb, and others where they are not at 0
    limb = ["FR_HAA", "FR_HFE", "FR_KFE"]
    assert [row.split(",")[0].strip() for row in printed(leg, lines)[3:7]] == [
        *limb,
        "effective mass",
    ]
    said = text(summary, lines, 1000)
    assert "The robot's 3 other joints are at 0; --json lists all." in said
    assert "FL_" not in said
    _, summary, lines = swept(*joints, "FL_KFE=30", leg=leg, kick=kick)
    assert "FL_KFE" in [row.split(",")[0].strip() for row in printed(leg, lines)]
    assert "The robot's 2 other joints are at 0" in text(summary, lines)


def test_a_normal_that_a_foot_cannot_have_is_named():
    overlap = "with this normal, a ball at instep can overlap with the foot"
    leg = kd.Leg.from_robot("g1", "instep", legs_only=True)
    for attack, is_named in ((10, True), (40, False)):  # the foot points 30 degrees down
        kick = kd.Kick(attack=np.radians(attack))
        best = swept("right_knee_joint=30", "right_ankle_pitch_joint=0", leg=leg, kick=kick)[2][0]
        assert (overlap in best.explanation) == is_named


def test_both_effective_masses_of_stiff_joints():
    leg = LEG.with_stiff_joints("ankle")
    _, _, lines = swept("knee=10:20:10", leg=leg)
    for line in lines:
        free = kick_from(LEG.posture(line.outcome.posture.q), KICK).impact.effective_mass
        assert line.as_json()["free_effective_mass"] == pytest.approx(free, rel=1e-12)
        assert line.as_json()["effective_mass"] > free
    (row,) = (row for row in printed(leg, lines) if "all joints free, kg" in row)
    assert float(row.split()[-1]) == pytest.approx(free, rel=1e-3)
    plain = swept("knee=10")[2][0].as_json()
    assert plain["free_effective_mass"] == plain["effective_mass"]


def of_the_page(*joints, kick=KICK, leg=LEG, where=None):
    data, summary, lines = swept(*joints, kick=kick, leg=leg, where=where)
    grid = Grid.of(leg, read_postures(leg, joints))
    return data, lines, page_lines(leg, grid, kick, summary, lines)


def test_a_page_starts_with_the_best_posture_and_the_fastest_foot_of_its_joints():
    data, (best, worst), shown = of_the_page("hip=0:40:20", "knee=10:30:20", "ankle=-20:20:20")
    fast, usual, least, last = shown
    assert [line.label for line in shown] == [
        f"best, fastest foot {1 / best.values['speed_use']:.3g} m/s",
        "best, foot 1 m/s",
        "least joint impulse",
        "worst",
    ]
    assert fast.angles == usual.angles == best.angles
    assert last.angles == worst.angles
    velocity = fast.outcome.impact.v_before
    assert np.max(np.abs(velocity) / LEG.velocity_limit) == pytest.approx(1.0, abs=1e-8)
    assert fast.values["ball_speed"] * best.values["speed_use"] == pytest.approx(
        best.values["ball_speed"]
    )
    loads = data["worst_joint_impulse"].values
    assert least.values["worst_joint_impulse"] == pytest.approx(loads.min())
    assert f"ball leaves at {fast.values['ball_speed']:.3g} m/s" in fast.explanation
    assert f"{fast.values['carry']:.3g} m until" in fast.explanation
    assert f"flies {best.values['carry']:.3g} m" in usual.explanation
    assert best.explanation in usual.explanation


def test_a_page_of_joints_without_speed_limits_has_no_fastest_foot():
    model = LEG.model
    model.velocityLimit[:] = np.inf
    model.upperVelocityLimit[:] = np.inf
    leg = kd.Leg.from_model(model, "toe")
    *_, shown = of_the_page("hip=0:10:10", "knee=10", leg=leg)
    assert [line.label for line in shown] == ["best, foot 1 m/s", "least joint impulse", "worst"]


def test_a_page_of_no_posture_is_none():
    assert of_the_page("hip=0:10:10", "knee=10", where="hip > 90")[2] == []
