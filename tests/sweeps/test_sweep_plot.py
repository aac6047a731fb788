import matplotlib.image as image
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.plot_style import save_figure
from kickdyn.sweeps import summary as summaries
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.summary import summarize
from kickdyn.sweeps.sweep_plot import sweep_figure
from kickdyn.sweeps.sweep_report import extreme_lines

LEG, KICK = kd.Leg.human(), kd.Kick(speed=2.0)


def drawn(*joints, where=None, kick=KICK):
    grid = Grid.of(LEG, read_postures(LEG, joints))
    data = kd.sweep(LEG, grid.axes, kick)
    summary = summarize(data, where)
    lines = extreme_lines(LEG, grid, kick, summary)
    return data, lines, sweep_figure(summary, lines)


def test_the_map_shows_the_best_over_the_other_joints():
    data, _, figure = drawn("hip=0:40:10", "knee=0:30:10", "ankle=0:40:20")
    for panel, names, over in zip(
        figure.axes,
        (("hip", "knee"), ("hip", "ankle"), ("knee", "ankle")),
        ("ankle", "knee", "hip"),
        strict=False,
    ):
        mesh = panel.collections[0]
        expected = data.speed_ratio.max(over).transpose(*reversed(names))
        assert np.asarray(mesh.get_array()).ravel() == pytest.approx(expected.values.ravel())
        assert (panel.get_xlabel(), panel.get_ylabel()) == tuple(f"{n} [deg]" for n in names)
        assert panel.get_title().endswith(f"best over {over}")
        lowest = min(data.speed_ratio.max(each).min() for each in data.speed_ratio.dims)
        assert mesh.get_clim() == pytest.approx((float(lowest), float(data.speed_ratio.max())))


def test_the_price_marks_best_and_worst():
    data, lines, figure = drawn("hip=0:40:10", "knee=0:30:10", kick=kd.Kick(speed=2.0))
    right = figure.axes[1]
    assert [text.get_text() for text in right.texts] == ["best", "worst"]
    dots, names = right.collections[0], ("worst_joint_impulse", "speed_ratio", "speed_use")
    shown = np.column_stack([np.asarray(dots.get_offsets()), np.asarray(dots.get_array()) / 100])
    swept = np.column_stack([data[name].values.ravel() for name in names])
    ordered = [rows[np.lexsort(rows.round(9).T)] for rows in (shown, swept)]
    assert ordered[0] == pytest.approx(ordered[1])
    front, *marks = right.lines
    best = [lines[0].values[name] for name in names[:2]]
    assert (front.get_xdata()[-1], front.get_ydata()[-1]) == pytest.approx(best, rel=1e-14)
    for line, mark in zip(lines, marks, strict=True):
        assert mark.get_ydata() == pytest.approx([line.values["speed_ratio"]])
        assert mark.get_xdata() == pytest.approx([line.values["worst_joint_impulse"]])


def test_one_joint_is_a_curve():
    data, _, figure = drawn("knee=0:30:10")
    (curve,) = figure.axes[0].lines
    assert curve.get_xdata() == pytest.approx([0, 10, 20, 30])
    assert curve.get_ydata() == pytest.approx(data.speed_ratio.values)
    assert figure.axes[0].get_xlabel() == "knee [deg]"


def test_the_title_has_the_numbers_of_the_kick():
    ball = kd.Ball(0.41, 0.105)
    kick = kd.Kick(speed=2.5, attack=0.3, restitution=0.61, friction=0.2, ball=ball)
    title = drawn("knee=0:30:10", kick=kick)[2].get_suptitle()
    assert title == (
        f"{LEG.name}: foot 2.5 m/s at {np.degrees(0.3):g}°, restitution 0.61, friction 0.2, "
        "ball 0.41 kg"
    )


def test_conditions_and_large_sweeps_leave_out(monkeypatch):
    monkeypatch.setattr(summaries, "SAMPLE_SIZE", 7)
    monkeypatch.setattr(summaries, "BINS", 2)
    data, _, figure = drawn("hip=0:40:10", "knee=0:30:10", "ankle=0:40:20", where="knee < 10")
    assert "where knee < 10" in figure.get_suptitle()
    *maps, right = figure.axes[:4]
    shown = np.ma.filled(maps[0].collections[0].get_array(), np.nan).reshape(2, 2)
    expected = [data.speed_ratio.values[half, 0].max() for half in (slice(0, 3), slice(3, 5))]
    assert shown[0] == pytest.approx(expected)
    assert np.isnan(shown[1]).all()
    assert len(right.collections[0].get_offsets()) == 7


def test_an_unfinished_sweep_says_its_share():
    data, _, _ = drawn("hip=0:40:10", "knee=0:30:10")
    data.status[2:] = -1
    assert "unfinished: 40% of the postures" in sweep_figure(summarize(data)).get_suptitle()


def test_nothing_possible_is_still_a_picture(tmp_path):
    _, _, figure = drawn("hip=0:40:20", "knee=0:30:15", where="hip < 0")
    save_figure(figure, tmp_path / "none.png")
    assert (tmp_path / "none.png").stat().st_size > 0


def test_saved_pictures_show_something(tmp_path):
    _, _, figure = drawn("hip=0:40:20", "knee=0:30:15")
    save_figure(figure, tmp_path / "sweep.png")
    assert image.imread(tmp_path / "sweep.png")[..., :3].std() > 0.05
    with pytest.raises(kd.InvalidInput, match=r"plots are written as \.png"):
        save_figure(figure, tmp_path / "sweep.bmp")
