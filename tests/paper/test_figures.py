"""Titles, axes and curves of the figures, and the sentences on the apexes of Fig. 9."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from kickdyn.paper import fig_1, fig_8, fig_9, fig_10, fig_15, table_2
from kickdyn.paper.assumptions import DEFAULT
from kickdyn.paper.item import Verdict


def drawn(draw):
    figure = Figure()
    draw(figure)
    return figure.axes


def labels(axes):
    return axes.get_title(), axes.get_xlabel(), axes.get_ylabel()


def test_fig_7_names_the_angle_of_the_foot_and_the_impulse():
    panels = drawn(table_2.draw)
    assert [labels(axes)[1] for axes in panels] == ["X [m]"] * 3
    assert labels(panels[0])[2] == "Y [m]"
    soles = []
    for axes, (name, down, posture) in zip(
        panels, [(n, table_2.ROWS[n][0], p) for n, p in table_2.postures().items()], strict=True
    ):
        total = float(np.linalg.norm(table_2.impact_of(posture).impulse))
        assert axes.get_title() == f"({name}) foot {down:g} deg down: {total:.3f} N s"
        *_, ankle, toe = np.column_stack(axes.lines[0].get_data())  # joints, then the toe
        sole = math.degrees(math.atan2(ankle[1] - toe[1], toe[0] - ankle[0]))
        soles.append(sole - down)
    assert soles == pytest.approx([soles[0]] * 3, abs=0.1)  # each foot points down by its angle


def test_figures_of_flights_have_distance_to_the_right_and_height_up():
    for module, curves in ((fig_8, 4), (fig_9, 3), (fig_10, 3)):
        panels = drawn(module.draw)
        heights = [axes for axes in panels if axes.get_ylabel() == "Y [m]"]
        assert heights
        assert {axes.get_xlabel() for axes in panels} - {""} == {"X [m]"}
        for axes in heights:
            assert len(axes.lines) == curves
            for line in axes.lines:
                x, height = line.get_data()
                assert x[-1] > 5.0
                assert height[0] == pytest.approx(height[-1], abs=1e-6) == 0.0
                assert height.max() > 0.0


def test_fig_9_draws_each_case_with_either_lift():
    panels = drawn(fig_9.draw)
    assert [axes.get_title() for axes in panels] == [
        choice.name for choice in (DEFAULT, fig_9.LIFT_WITHOUT_CRISIS)
    ]
    for axes in panels:
        assert [line.get_label() for line in axes.lines] == ["case 1", "case 2", "case 3"]


def test_fig_9_says_which_case_flies_farthest_and_which_highest(monkeypatch):
    """Ranges and heights in different orders: the sentence names both."""
    paths = [
        SimpleNamespace(range=float(r), height=float(h), warnings=())
        for r, h in ((9, 3), (10, 1), (11, 2))
    ]
    monkeypatch.setattr(fig_9, "flights", lambda choice: paths)
    items = fig_9.varying(DEFAULT)
    assert items[0].why.startswith("case 3 flies farthest and case 1 highest")
    assert {item.verdict for item in items} == {Verdict.NOT_REACHABLE}
    ours = [(item.item.split()[-1], item.ours) for item in items]
    assert ours == [
        ("distance", 9), ("apex", 3), ("distance", 10), ("apex", 1), ("distance", 11), ("apex", 2),
    ]  # fmt: skip


def test_fig_10_is_seen_from_the_side_and_from_above():
    panels = drawn(fig_10.draw)
    assert [axes.get_ylabel() for axes in panels if axes.get_ylabel()] == [
        "Y [m]",
        "to the left [m]",
    ]
    above = next(axes for axes in panels if axes.get_ylabel() == "to the left [m]")
    assert [text.get_text() for text in above.texts] == ["A", "B"]


def test_fig_1_and_fig_15_name_what_they_show():
    left, right = drawn(fig_1.draw)
    assert labels(left) == ("two postures, one contact point", "X [m]", "Y [m]")
    assert labels(right)[1:] == ("knee along the self-motion [deg]", "impulse [N s]")
    assert [line.get_label() for line in right.lines] == ["on a ball", "on an obstacle"]
    panels = drawn(fig_15.draw)
    count = len(fig_15.GOALS)
    assert [axes.get_title() for axes in panels[:count]] == [
        "30 m, 1.5 s",
        "50 m, 2 s",
        "100 m, 3 s",
    ]
    assert [axes.get_xlabel() for axes in panels[count:]] == ["round"] * count
    assert panels[0].get_ylabel() == "error of distance [m]"
    assert panels[count].get_ylabel() == "error of time [s]"
