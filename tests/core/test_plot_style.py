"""Figures have kickdyn's style, whatever settings of matplotlib the caller has."""

import re

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

import kickdyn as kd
from kickdyn.core.plot_style import STYLE, save_figure, styled

FOREIGN = {"text.usetex": True, "figure.facecolor": "red", "font.size": 22, "lines.linewidth": 9}


@styled()
def figure_in_style():
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])
    return figure


def test_a_figure_keeps_the_style_and_the_caller_the_settings():
    with mpl.rc_context(FOREIGN):
        before = dict(mpl.rcParams)
        (axes,) = figure_in_style().axes
        assert dict(mpl.rcParams) == before
    assert not axes.spines["top"].get_visible()
    assert axes.lines[0].get_linewidth() == STYLE["lines.linewidth"]


@pytest.mark.parametrize("name", ["a.bmp", "a", "a.png.txt"])
def test_an_unknown_format_is_refused(tmp_path, name):
    with pytest.raises(kd.InvalidInput, match=rf"{re.escape(name)}.*\.svg"):
        save_figure(figure_in_style(), tmp_path / name)
    assert not list(tmp_path.iterdir())
