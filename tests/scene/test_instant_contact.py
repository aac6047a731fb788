"""A contact that takes time, taken as an instant: what that moves the end is said."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.instant_contact import simulate_as_instant
from kickdyn.view.scene_page import numbers, scene_page


@pytest.mark.parametrize("name", ["free_kick", "volley"])
def test_the_error_covers_what_the_instant_leaves_out(name):
    scene = kd.load_scene(name)
    answer, whole = simulate_as_instant(scene), kd.simulate(scene, None)
    apart = np.linalg.norm(answer.end.position - whole.end.position)
    assert apart > 0.1
    assert apart <= answer.error <= apart * 1.001
    assert answer.left_out == ("compliance",)
    said = str(answer)
    assert "all is modelled" not in said
    assert f"error {answer.error:.2g} m, all modelled but compliance;" in said
    x, y, z = whole.end.position.round(3) + 0.0
    assert f"with it landed at ({x:.3f}, {y:.3f}, {z:.3f}) m" in said


def test_a_contact_of_an_instant_leaves_nothing_out():
    scene = kd.load_scene("paper_kick")
    answer = simulate_as_instant(scene)
    assert answer.left_out == ()
    assert "m, all modelled;" in str(answer)
    assert answer.end.position.tolist() == kd.simulate(scene, None).end.position.tolist()


def test_where_the_contact_cannot_be_computed_the_error_is_not_known():
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    v, contact = posture.joint_velocity([10, 0, 5]), kd.Contact((2, 0, 1), restitution=0.8)
    ball, ground = kd.Ball(), kd.Ground(-2)
    scene = kd.Scene(posture.leg, posture.q, v, ball, contact, ground=ground, contact_time=0.5)
    with pytest.raises(kd.InvalidInput, match="beyond its radius"):
        kd.simulate(scene, None)
    answer = simulate_as_instant(scene)
    assert answer.error == math.inf
    assert not answer.met
    assert "all modelled but compliance, NOT MET" in str(answer)
    assert "not known: stiffness is" in str(answer)
    assert "its contact shown as an instant: it ends nobody knows how far off" in scene_page(answer)
    assert numbers(answer)["left_out"] == {"compliance": None}
