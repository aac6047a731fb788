"""The report of a sweep has the numbers of its postures, and the paper's."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from shown_numbers import numbers_of
from tolerances import closed_form, optimized

import kickdyn as kd
from kickdyn.sweeps import sweep_report
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.queries import pareto_front, summarize
from kickdyn.sweeps.sweep_report import extreme_lines, sweep_figure

LEG, KICK = kd.Leg.human(), kd.Kick()
POSTURES = {"hip": [0.0, 0.2, 0.4], "knee": [0.2, 0.6], "ankle": [-0.2, 0.2]}


def swept(postures, kick=KICK, leg=LEG, where=None):
    """Return grid, dataset, summary and the lines of best and worst."""
    grid = Grid.of(leg, postures)
    data = kd.sweep(leg, grid.axes, kick)
    summary = summarize(data, where)
    return grid, data, summary, sweep_report.extreme_lines(leg, grid, kick, summary)


@pytest.fixture(scope="module")
def report():
    grid, data, summary, lines = swept(POSTURES)
    return grid, data, summary, [*sweep_report.paper_lines(LEG, KICK), *lines]


def printed(leg, lines):
    """Return the cells of a printed table by the names of its rows."""
    console = Console(width=200)
    with console.capture() as captured:
        console.print(sweep_report.table(leg, lines))
    rows = captured.get().splitlines()
    return {row[:30].strip(): row[30:].split() for row in rows if row.strip()}


def test_the_papers_postures_meet_table_2():
    lines = sweep_report.paper_lines(LEG, KICK)
    impulses = [line.values["immovable_impulse"] for line in lines]
    assert impulses == pytest.approx([1.554, 0.944, 0.646], rel=0.003)  # Table 2 of the paper
    feet = [sum(line.angles.values()) - 2 * line.angles["hip"] for line in lines]
    assert [foot - feet[0] for foot in feet] == [0, 20, 45]
    fast = sweep_report.paper_lines(LEG, kd.Kick(speed=50.0))
    assert [line.paper for line in fast] == [None] * 3
    assert printed(LEG, fast)["status"] == ["too-fast"] * 3


def test_the_table_has_the_values_of_each_posture(report):
    lines = report[3]
    cells = printed(LEG, lines)
    assert list(map(float, cells["hip, deg"])) == pytest.approx(
        [line.angles["hip"] for line in lines], rel=1e-3
    )
    for row, name, scale in (
        ("effective mass, kg", "effective_mass", 1), ("impulse on the ball, N s", "impulse", 1),
        ("ball speed / foot speed", "speed_ratio", 1), ("launch angle, deg", "launch_angle", 0),
        ("back spin, rad/s", "back_spin", 1), ("carry distance, m", "carry", 1),
        ("impulse in that joint, N s", "worst_joint_impulse", 1),
        ("impulse on a fixed body, N s", "immovable_impulse", 1),
    ):  # fmt: skip
        shown = [(scale or 180 / math.pi) * line.values[name] for line in lines]
        assert list(map(float, cells[row])) == pytest.approx(shown, rel=2e-3), row  # digits
    worst = [line.outcome.impact.worst_joint[0] for line in lines]
    assert cells["joint of largest impulse"] == worst


def test_best_and_worst_are_the_extremes_of_the_possible_postures():
    kick = kd.Kick(speed=9.0)
    _, data, summary, (best, worst) = swept(POSTURES, kick)
    assert summary.counts["too-fast"] > 0
    possible = data.ball_speed.values[data.status.values == 0]
    assert best.values["ball_speed"] == pytest.approx(possible.max(), rel=closed_form())
    assert worst.values["ball_speed"] == pytest.approx(possible.min(), rel=closed_form())
    assert best.outcome.status == worst.outcome.status == "ok"
    for line in (best, worst):
        mass, ratio, use = (
            line.values[name] for name in ("effective_mass", "speed_ratio", "speed_use")
        )
        shown = [number.value for number in numbers_of(line.explanation)]
        right = [mass, mass / kick.ball.mass, ratio, 1.8, 100 * use]
        assert shown == pytest.approx(right, rel=1e-2)  # digits
    assert swept({"knee": [0.0, 0.2]}, kd.Kick(speed=500.0))[3] == []


def test_the_report_compares_with_pinocchio(report, monkeypatch):
    assert max(sweep_report.pinocchio_differences(report[3])) < closed_form()
    exact, calls, (*_, summary, lines) = sweep_report.strike_by_pinocchio, [], report

    def wrong(*kick):
        calls.append(3e-7 - 1e-8 * (len(calls) % len(lines)))
        return SimpleNamespace(impulse=exact(*kick).impulse * (1 + calls[-1]))

    monkeypatch.setattr(sweep_report, "strike_by_pinocchio", wrong)
    differences = sweep_report.pinocchio_differences(lines)
    assert differences == pytest.approx(calls, rel=closed_form(1 / 3e-7))
    document = sweep_report.as_json(LEG, KICK, summary, lines)
    assert document["pinocchio_difference"] == pytest.approx(3e-7, rel=closed_form(1 / 3e-7))
    assert "1e-05" in sweep_report.text(summary, lines, 200)
    assert sweep_report.pinocchio_differences([]) == []


def test_a_page_shows_the_fastest_foot_that_the_joints_allow():
    grid, data, summary, (best, worst) = swept(POSTURES)
    fast, usual, least, last = sweep_report.page_lines(LEG, grid, KICK, summary, [best, worst])
    assert fast.angles == usual.angles == best.angles
    assert last.angles == worst.angles
    use = np.max(np.abs(fast.outcome.impact.v_before) / LEG.velocity_limit)
    assert use == pytest.approx(1.0, rel=optimized(1e-7))
    speed = best.values["ball_speed"] / best.values["speed_use"]
    assert fast.values["ball_speed"] == pytest.approx(speed, rel=optimized(1e-7))
    loads = data["worst_joint_impulse"].values
    assert least.values["worst_joint_impulse"] == pytest.approx(loads.min())
    for line in (fast, usual):
        assert f"{line.values['ball_speed']:.3g} m/s" in line.explanation
    model = LEG.model
    model.velocityLimit[:] = np.inf
    model.upperVelocityLimit[:] = np.inf
    leg = kd.Leg.from_model(model, "toe")
    grid, _, summary, lines = swept(POSTURES, leg=leg)
    assert (
        len(sweep_report.page_lines(leg, grid, KICK, summary, lines)) == 3
    )  # there is no fastest foot
    assert sweep_report.page_lines(LEG, grid, KICK, summary, []) == []


def test_rotors_and_stiff_joints_have_their_effective_masses():
    leg = LEG.with_armature({"knee": 0.1}).with_stiff_joints("ankle")
    lines = swept({"hip": [0.0, 0.3]}, leg=leg)[3]
    cells, free = printed(leg, lines), leg.with_stiff_joints()
    for row, robot in (
        ("effective mass", leg), ("all joints free", free), ("with rotors", free),
        ("without rotors", LEG),
    ):  # fmt: skip
        postures = [robot.posture(line.outcome.posture.q) for line in lines]
        right = [posture.effective_mass(KICK.direction) for posture in postures]
        assert list(map(float, cells[f"{row}, kg"])) == pytest.approx(right, rel=1e-3), row
    assert cells["with stiff joints, kg"] == ["inf", "inf"]


@pytest.mark.parametrize(("attack", "overlaps"), [(20.0, False), (70.0, True)])
def test_the_text_counts_postures_and_joints_and_names_a_steep_normal(attack, overlaps):
    leg = kd.Leg.from_robot("g1", legs_only=True)
    kick = kd.Kick(speed=3.0, attack=np.radians(attack))
    _, data, summary, lines = swept({"right_knee_joint": [0.3, 0.6, 0.9]}, kick, leg)
    text = sweep_report.text(summary, lines, 10_000)
    assert "The robot's 6 other joints are at 0" in text
    fast = int((data.status == 1).sum())
    assert f"3 postures: {3 - fast} ok{f', {fast} too-fast' if fast else ''}." in text
    assert ("contact_normal_cone" in lines[0].explanation) is overlaps
    none = summarize(data, "right_knee_joint > 90")
    assert "No posture is ok where right_knee_joint > 90." in sweep_report.text(none, [])


PLOTTED = kd.Kick(speed=2.5, attack=0.3, restitution=0.61, friction=0.2)
PLOT_GRID = Grid.of(
    LEG, {"hip": [0.0, 0.2, 0.4, 0.6], "knee": [0.0, 0.3], "ankle": [0.0, 0.2, 0.4]}
)


@pytest.fixture(scope="module")
def small_sweep():
    return kd.sweep(LEG, PLOT_GRID.axes, PLOTTED)


def test_maps_show_the_best_over_the_other_joints(small_sweep):
    summary = summarize(small_sweep)
    lines = extreme_lines(LEG, PLOT_GRID, PLOTTED, summary)
    panels = sweep_figure(summary, lines).axes
    for panel, names, other in zip(panels, (("hip", "knee"), ("hip", "ankle"), ("knee", "ankle")),
                                   ("ankle", "knee", "hip"), strict=False):  # fmt: skip
        mesh = panel.collections[0]
        right = small_sweep.speed_ratio.max(other).transpose(*reversed(names)).values
        assert np.asarray(mesh.get_array()).ravel() == pytest.approx(right.ravel())
        assert (panel.get_xlabel(), panel.get_ylabel()) == tuple(f"{n} [deg]" for n in names)
        assert other in panel.get_title()
    front, *marks = panels[3].lines
    for line, mark in zip(lines, marks, strict=True):
        place = float(mark.get_xdata()[0]), float(mark.get_ydata()[0])
        assert place == (line.values["worst_joint_impulse"], line.values["speed_ratio"])
    dots = panels[3].collections[0]
    shown = np.column_stack([np.asarray(dots.get_offsets()), np.asarray(dots.get_array()) / 100])
    names = ("worst_joint_impulse", "speed_ratio", "speed_use")
    values = np.column_stack([small_sweep[name].values.ravel() for name in names])
    ordered = [rows[np.lexsort(rows.round(9).T)] for rows in (shown, values)]
    assert ordered[0] == pytest.approx(ordered[1])
    best = pareto_front(small_sweep)
    unbeaten = best.worst_joint_impulse.values[::-1], best.ball_speed.values[::-1] / PLOTTED.speed
    assert np.array(front.get_data()) == pytest.approx(np.array(unbeaten))
    assert [panel.collections[0].get_clim()[1] for panel in panels[:3]] == (
        [pytest.approx(small_sweep.speed_ratio.values.max())] * 3)  # fmt: skip


def test_one_joint_is_a_curve():
    small_sweep = kd.sweep(LEG, {"knee": np.radians([0.0, 10.0, 30.0])}, PLOTTED)
    (curve,) = sweep_figure(summarize(small_sweep)).axes[0].lines
    assert curve.get_xdata() == pytest.approx([0, 10, 30])
    assert curve.get_ydata() == pytest.approx(small_sweep.speed_ratio.values)
