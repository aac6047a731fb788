"""Sliders move a kick."""

import numpy as np
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd

pytest.importorskip("ipywidgets")

from kickdyn.view.kick_sliders import KickSliders


def test_each_slider_moves_the_kick():
    """A kick that does not exist is explained, and the last one stays."""
    shown = KickSliders()
    values = {"hip": 30.0, "knee": 45.0, "ankle": 10.0, "foot speed": 12.0, "foot direction": 15.0}
    values |= {"normal": 35.0, "restitution": 0.7, "friction": 0.2, "spin": 20.0}
    for name, value in values.items():
        before = shown.impact
        shown.sliders[name].value = value
        assert (shown.impact is before, shown.message) == (False, ""), name
    posture = kd.Leg.human().posture(np.radians([30, 45, 10]))
    foot, normal = (np.array([np.cos(a), 0, np.sin(a)]) for a in np.radians([15, 35]))
    contact, v = kd.Contact(normal, 0.7, 0.2), posture.joint_velocity(12 * foot)
    right = kd.strike(posture, v, kd.Ball(), contact, ball_spin=(0, -20, 0))
    agrees(shown.impact.impulse, right.impulse, closed_form(100))
    agrees(shown.impact.joint_impulses, right.joint_impulses, closed_form(100))
    path = kd.fly(right.ball_after, kd.Ball(), kd.Air())
    assert shown.path.range == pytest.approx(path.range)
    for k, name in enumerate(("hip", "knee", "ankle")):
        ends = np.radians([shown.sliders[name].min, shown.sliders[name].max])
        assert ends == pytest.approx([posture.leg.lower[k], posture.leg.upper[k]])
    shown.sliders["normal"].value = 80.0
    before = shown.impact
    shown.sliders["foot direction"].value = -30.0
    assert shown.message
    assert shown.impact is before
    shown.view.close()
