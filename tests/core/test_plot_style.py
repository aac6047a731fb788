"""Figures have kickdyn's style, whatever settings of matplotlib the caller has."""

import re
from pathlib import Path

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


def test_settings_of_a_matplotlibrc_change_no_picture(tmp_path):
    """A `matplotlibrc` of the working directory may come from anyone, and may run LaTeX."""
    pictures = []
    for settings in ({}, FOREIGN):
        with mpl.rc_context(settings):
            save_figure(figure_in_style(), tmp_path / "a.png")
        pictures.append((tmp_path / "a.png").read_bytes())
    assert pictures[0] == pictures[1]


@pytest.mark.parametrize("name", ["a.bmp", "a", "a.png.txt"])
def test_an_unknown_format_is_refused(tmp_path, name):
    with pytest.raises(kd.InvalidInput, match=rf"{re.escape(name)}.*\.svg"):
        save_figure(figure_in_style(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_every_figure_of_the_package_is_made_in_the_style():
    for file in Path(kd.__file__).parent.rglob("*.py"):
        text = file.read_text("utf-8")
        styles = text.count("@styled()\n") + text.count("with styled():\n")
        assert text.count(" = Figure(") == styles, file.name
