import matplotlib.image as image
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps import sweep_plot as picture
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.opened import Sweep
from kickdyn.sweeps.run import sweep
from kickdyn.sweeps.summary import best_and_worst
from kickdyn.sweeps.sweep_plot import save_figure, sweep_figure

LEG, KICK = kd.Leg.human(), Kick()


def drawn(*joints):
    data = sweep(LEG, grid(LEG, joints), KICK)
    lines = best_and_worst(LEG, Sweep(data), KICK)
    return data, lines, sweep_figure(Sweep(data), lines)


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
        assert mesh.get_clim() == (lowest, data.speed_ratio.max())


def test_the_price_marks_best_and_worst():
    _, lines, figure = drawn("hip=0:40:10", "knee=0:30:10")
    right = figure.axes[1]
    assert [text.get_text() for text in right.texts] == ["best", "worst"]
    front, *marks = right.lines
    assert (front.get_xdata()[-1], front.get_ydata()[-1]) == (
        lines[0].numbers["worst_joint_impulse"],
        lines[0].numbers["speed_ratio"],
    )
    for line, mark in zip(lines, marks, strict=True):
        assert mark.get_ydata() == pytest.approx([line.numbers["speed_ratio"]])
        assert mark.get_xdata() == pytest.approx([line.numbers["worst_joint_impulse"]])


def test_one_joint_is_a_curve():
    data, _, figure = drawn("knee=0:30:10")
    (curve,) = figure.axes[0].lines
    assert curve.get_ydata() == pytest.approx(data.speed_ratio.values)


def test_conditions_and_large_sweeps_leave_out(monkeypatch):
    data, _, _ = drawn("hip=0:40:10", "knee=0:30:10", "ankle=0:40:20")
    monkeypatch.setattr(picture, "DOTS", 7)
    monkeypatch.setattr(picture, "PIXELS", 2)
    figure = Sweep(data).where("knee < 10").plot()
    assert "where knee < 10" in figure.get_suptitle()
    *maps, right = figure.axes[:4]
    shown = np.ma.filled(maps[0].collections[0].get_array(), np.nan).reshape(2, 2)
    expected = [data.speed_ratio.values[half, 0].max() for half in (slice(0, 3), slice(3, 5))]
    assert shown[0] == pytest.approx(expected)
    assert np.isnan(shown[1]).all()
    assert len(right.collections[0].get_offsets()) == 7


def test_nothing_possible_is_still_a_picture(tmp_path):
    data, _, _ = drawn("hip=0:40:20", "knee=0:30:15")
    Sweep(data).where("hip < 0").plot(tmp_path / "none.png")
    assert (tmp_path / "none.png").stat().st_size > 0


def test_saved_pictures_show_something(tmp_path):
    _, _, figure = drawn("hip=0:40:20", "knee=0:30:15")
    save_figure(figure, tmp_path / "sweep.png")
    assert image.imread(tmp_path / "sweep.png")[..., :3].std() > 0.05
    with pytest.raises(kd.InvalidInput, match=r"plots are written as \.png"):
        save_figure(figure, tmp_path / "sweep.bmp")
