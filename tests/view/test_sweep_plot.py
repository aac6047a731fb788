import matplotlib.image as image
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweep.grid import grid
from kickdyn.sweep.kick import Kick
from kickdyn.sweep.run import sweep
from kickdyn.sweep.summary import best_and_worst
from kickdyn.view.sweep_plot import save_figure, sweep_figure

LEG, KICK = kd.Leg.human(), Kick()


def drawn(*joints):
    data = sweep(LEG, grid(LEG, joints), KICK)
    lines = best_and_worst(LEG, data, KICK)
    return data, lines, sweep_figure(data, lines)


def test_the_map_shows_the_best_over_the_other_joints():
    data, _, figure = drawn("hip=0:40:10", "knee=0:30:10", "ankle=0:40:20")
    left = figure.axes[0]
    mesh = left.collections[0]
    expected = data.speed_ratio.max("ankle").transpose("knee", "hip")
    assert np.asarray(mesh.get_array()).reshape(4, 5) == pytest.approx(expected.values)
    assert (left.get_xlabel(), left.get_ylabel()) == ("hip [deg]", "knee [deg]")
    assert "best over ankle" in left.get_title()


def test_the_price_marks_best_and_worst():
    _, lines, figure = drawn("hip=0:40:10", "knee=0:30:10")
    right = figure.axes[1]
    assert [text.get_text() for text in right.texts] == ["best", "worst"]
    for line, mark in zip(lines, right.lines, strict=True):
        assert mark.get_ydata() == pytest.approx([line.numbers["speed_ratio"]])
        assert mark.get_xdata() == pytest.approx([line.numbers["worst_joint_impulse"]])


def test_one_joint_is_a_curve():
    data, _, figure = drawn("knee=0:30:10")
    (curve,) = figure.axes[0].lines
    assert curve.get_ydata() == pytest.approx(data.speed_ratio.values)


def test_saved_pictures_show_something(tmp_path):
    _, _, figure = drawn("hip=0:40:20", "knee=0:30:15")
    save_figure(figure, tmp_path / "sweep.png")
    assert image.imread(tmp_path / "sweep.png")[..., :3].std() > 0.05
    with pytest.raises(kd.InvalidInput, match=r"plots are written as \.png"):
        save_figure(figure, tmp_path / "sweep.bmp")
