import numpy as np
import pytest

import kickdyn as kd
from kickdyn.view.swing_plot import swing_figure

LEG = kd.Leg.human()


@pytest.fixture(scope="module")
def swing():
    plan = kd.plan_kick(LEG, kd.Goal(10, time=1), kd.Ball(), swing=True)
    return kd.plan_swing(LEG, plan, nodes=12)


def test_curves_are_the_swings_over_its_limits(swing):
    figure = swing_figure(swing)
    assert figure.get_suptitle().startswith("leg_human: least squared torque, ")
    speed, torque, power = figure.axes
    way = swing.backswing.fine
    many = len(way.time)
    for joint, name in enumerate(swing.joints):
        lines = [axes.lines[joint] for axes in (speed, torque, power)]
        assert lines[0].get_label() == name
        expected = (
            100 * way.v / LEG.velocity_limit,
            100 * way.torque / LEG.effort_limit,
            way.power,
        )
        for line, values in zip(lines, expected, strict=True):
            assert line.get_xdata()[:many] == pytest.approx(way.time)
            assert line.get_ydata()[:many] == pytest.approx(values[:, joint])
            assert np.isnan(line.get_ydata()[many])  # nothing is drawn across the impact


def test_the_page_shows_all_of_the_backswing(swing):
    plan = swing.plan
    pace = kd.page(swing).pace
    assert pace.times[0] == pytest.approx(-swing.backswing.duration)
    assert pace.times[pace.impact] == pytest.approx(0, abs=1e-12)
    assert len(pace.times) > len(kd.page(plan).pace.times)


def test_a_swing_that_falls_short_is_not_shown_as_this_kick(swing):
    model = LEG.model
    model.effortLimit = np.array([30.0, 210.0, 122.0])
    short = kd.plan_swing(kd.Leg.from_model(model, "toe"), swing.plan, longest=0.1, nodes=12)
    with pytest.raises(kd.InvalidInput, match="does not reach this impact: backswing"):
        kd.page(short)
