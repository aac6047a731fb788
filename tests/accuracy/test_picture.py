from kickdyn.accuracy.flight import Measured
from kickdyn.accuracy.impact import MeasuredImpact
from kickdyn.accuracy.picture import STYLES, picture


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
    for group in (list(STYLES)[:2] + list(STYLES)[3:9], list(STYLES)[9:]):
        looks = [STYLES[name] for name in group]
        assert len(set(looks)) == len(looks)
