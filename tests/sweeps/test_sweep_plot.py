"""The plot of a sweep shows the best over other joints, the front and the report's postures."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.queries import pareto_front, summarize
from kickdyn.sweeps.sweep_plot import sweep_figure
from kickdyn.sweeps.sweep_report import extreme_lines

LEG, KICK = kd.Leg.human(), kd.Kick(speed=2.5, attack=0.3, restitution=0.61, friction=0.2)
GRID = Grid.of(LEG, {"hip": [0.0, 0.2, 0.4, 0.6], "knee": [0.0, 0.3], "ankle": [0.0, 0.2, 0.4]})


@pytest.fixture(scope="module")
def data():
    return kd.sweep(LEG, GRID.axes, KICK)


def test_maps_show_the_best_over_the_other_joints(data):
    summary = summarize(data)
    lines = extreme_lines(LEG, GRID, KICK, summary)
    panels = sweep_figure(summary, lines).axes
    for panel, names, other in zip(panels, (("hip", "knee"), ("hip", "ankle"), ("knee", "ankle")),
                                   ("ankle", "knee", "hip"), strict=False):  # fmt: skip
        mesh = panel.collections[0]
        right = data.speed_ratio.max(other).transpose(*reversed(names)).values
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
    swept = np.column_stack([data[name].values.ravel() for name in names])
    ordered = [rows[np.lexsort(rows.round(9).T)] for rows in (shown, swept)]
    assert ordered[0] == pytest.approx(ordered[1])
    best = pareto_front(data)
    unbeaten = best.worst_joint_impulse.values[::-1], best.ball_speed.values[::-1] / KICK.speed
    assert np.array(front.get_data()) == pytest.approx(np.array(unbeaten))
    assert [panel.collections[0].get_clim()[1] for panel in panels[:3]] == (
        [pytest.approx(data.speed_ratio.values.max())] * 3)  # fmt: skip


def test_one_joint_is_a_curve():
    data = kd.sweep(LEG, {"knee": np.radians([0.0, 10.0, 30.0])}, KICK)
    (curve,) = sweep_figure(summarize(data)).axes[0].lines
    assert curve.get_xdata() == pytest.approx([0, 10, 30])
    assert curve.get_ydata() == pytest.approx(data.speed_ratio.values)
