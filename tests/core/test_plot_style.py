from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt

from kickdyn.cli.tradeoff_command import effect_figure
from kickdyn.core.plot_style import STYLE, save_figure
from kickdyn.scene.effects import EffectSize

ROOT = Path(__file__).parents[2]


def test_matplotlib_knows_every_setting():
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots()
        axes.plot([0, 1], [0, 1])
        figure.canvas.draw()
        assert figure.get_layout_engine() is not None
        assert not axes.spines["top"].get_visible()
    plt.close(figure)


def test_a_figure_keeps_the_style_and_the_caller_his_settings():
    before = dict(mpl.rcParams)
    figure = effect_figure("a kick", [EffectSize("drag", 12.3, 0.0)], 0.05)
    assert dict(mpl.rcParams) == before
    figure.draw_without_rendering()
    (axes,) = figure.axes
    assert not axes.spines["top"].get_visible()
    assert {line.get_alpha() for line in axes.get_xgridlines()} == {STYLE["grid.alpha"]}


def test_settings_of_others_have_no_say(tmp_path):
    """A `matplotlibrc` of the working directory is obeyed by matplotlib, and may run LaTeX."""
    foreign = {
        "text.usetex": True,
        "figure.facecolor": "red",
        "font.size": 22,
        "savefig.facecolor": "red",
    }
    pictures = []
    for settings in ({}, foreign):
        with mpl.rc_context(settings):
            save_figure(
                effect_figure("a kick", [EffectSize("drag", 12.3, 0.0)], 0.05), tmp_path / "a.png"
            )
        pictures.append((tmp_path / "a.png").read_bytes())
    assert pictures[0] == pictures[1]


def test_every_figure_of_the_library_is_made_in_it():
    texts = [file.read_text("utf-8") for file in (ROOT / "kickdyn").rglob("*.py")]
    styles = ("@styled()\n", "with styled():\n")
    made = [(text.count(" = Figure("), sum(map(text.count, styles))) for text in texts]
    assert sum(figures for figures, _ in made) >= 4
    assert all(figures == dressed for figures, dressed in made)
