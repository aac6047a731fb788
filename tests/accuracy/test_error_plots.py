import math

import pytest

from kickdyn.accuracy.effect_sizes import Worth
from kickdyn.accuracy.error_plots import LOOKS, picture, worth_picture
from kickdyn.accuracy.flight_methods import Measured
from kickdyn.accuracy.impact_methods import MeasuredImpact


def test_a_panel_per_scene_with_every_row_and_the_front():
    impacts = [
        MeasuredImpact("frictionless", "engine", "", 1e-16, 2e-4, True),
        MeasuredImpact("frictionless", "MuJoCo", "a", 1e-2, 1e-4, True),
        MeasuredImpact("frictionless", "MuJoCo", "b", 1e-2, 3e-4),
    ]
    flights = [Measured("vacuum", "closed form", 0.0, 1e-15, 0, 1e-4, True)]
    flights += [Measured("full", name, 1e-3, 1e-3, 9, 1e-3, True) for name in ("RK45", "heyoka")]
    left, right = picture(impacts, flights).axes
    assert left.get_title() == "impact, frictionless"
    assert right.get_title() == "flight, full"
    front, *methods = left.lines
    assert front.get_xdata().tolist() == [1e-4, 2e-4]
    assert [line.get_label() for line in methods] == ["engine", "MuJoCo"]
    assert methods[1].get_xdata().tolist() == [1e-4, 3e-4]


def test_no_two_methods_of_one_panel_look_alike():
    for group in (list(LOOKS)[:2] + list(LOOKS)[3:9], list(LOOKS)[9:]):
        looks = [LOOKS[name] for name in group]
        assert len(set(looks)) == len(looks)


def test_bars_of_what_effects_are_worth_beside_the_tolerance():
    rows = [
        Worth("buoyancy", math.nan, math.nan, "flies off"),
        Worth("drag", 12.3, 0.0),
        Worth("lift", 2e-3, 0.0),
        Worth("wind", 0.0, 0.0),
    ]
    (axes,) = worth_picture("a kick", rows, 0.05).axes
    assert axes.get_xscale() == "log"
    assert [bar.get_x() + bar.get_width() for bar in axes.patches] == pytest.approx([12.3, 2e-3])
    low, high = axes.get_xlim()
    assert low < 2e-3 < 12.3 < high
    assert [tick.get_text() for tick in axes.get_yticklabels()] == [row.effect for row in rows]
    assert [text.get_text() for text in axes.texts] == ["no answer", "12", "0.002", "below 1e-09"]
    (line,) = axes.lines
    assert line.get_xdata() == [0.05, 0.05]
