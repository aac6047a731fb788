"""Sliders move a kick."""

import sys

import numpy as np
import pytest

import kickdyn as kd

pytest.importorskip("ipywidgets")

from kickdyn.view.kick_sliders import KickSliders


@pytest.fixture
def sliders():
    made = KickSliders()
    yield made
    made.view.close()


def test_each_slider_moves_the_kick(sliders):
    values = {"hip": 30.0, "knee": 45.0, "ankle": 10.0, "foot speed": 12.0, "foot direction": 15.0}
    values |= {"normal": 35.0, "restitution": 0.7, "friction": 0.2, "spin": 20.0}
    assert set(values) == set(sliders.sliders)
    for name, value in values.items():
        before = sliders.impact
        sliders.sliders[name].value = value
        assert sliders.impact is not before, name
        assert sliders.message == ""
    posture = kd.Leg.human().posture(np.radians([30, 45, 10]))
    direction, normal = (
        np.array([np.cos(angle), 0, np.sin(angle)]) for angle in np.radians([15, 35])
    )
    by_hand = kd.strike(
        posture, posture.joint_velocity(12 * direction), kd.Ball(), kd.Contact(normal, 0.7, 0.2),
        ball_spin=(0, -20, 0),
    )  # fmt: skip
    np.testing.assert_allclose(sliders.impact.impulse, by_hand.impulse, rtol=1e-12)
    np.testing.assert_allclose(sliders.impact.joint_impulses, by_hand.joint_impulses, atol=1e-12)
    assert sliders.path.range == pytest.approx(
        kd.fly(by_hand.ball_after, kd.Ball(), kd.Air()).range
    )


def test_a_kick_that_does_not_exist_is_explained_and_the_last_one_stays(sliders):
    sliders.sliders["normal"].value = 80.0
    shown = sliders.impact
    sliders.sliders["foot direction"].value = -30.0
    assert "\n" not in sliders.message
    assert "away" in sliders.message or "approach" in sliders.message
    assert sliders.impact is shown
    sliders.sliders["foot direction"].value = 60.0
    assert sliders.message == ""


def test_in_jupyter_it_is_a_widget_with_the_view(sliders):
    bundle = sliders._repr_mimebundle_()
    bundle = bundle[0] if isinstance(bundle, tuple) else bundle
    assert "application/vnd.jupyter.widget-view+json" in bundle


def test_a_leg_with_many_joints_and_missing_ipywidgets_are_refused_in_one_line(monkeypatch):
    with pytest.raises(kd.InvalidInput, match=r"the leg has 12 joints: sliders take 1 to 8"):
        KickSliders(kd.Leg.from_robot("g1", legs_only=True))
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(
        kd.InvalidInput, match=r'^sliders need .* pip install "kickdyn\[notebooks\]"$'
    ):
        KickSliders()
