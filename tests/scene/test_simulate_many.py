"""Draws of a scene are simulations of the drawn scenes."""

import dataclasses

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.simulate_many import _Draws

SPREAD = {"v": 0.1, "restitution": 0.02, "friction": 0.03}


@pytest.mark.parametrize("name", ["free_kick", "wet_grass_pass", "volley"])
def test_each_draw_is_a_simulation(name):
    scene = kd.load_scene(name).replace(uncertainty=SPREAD)
    many = kd.simulate_many(scene, 4, tolerance=None, seed=3)
    draws = _Draws.of(scene)
    given = draws.arguments(np.random.default_rng(3).normal(size=(4, draws.size)))
    for i in range(4):
        drawn = scene.replace(v=given["v"][i], contact=given["contact"][i], uncertainty=None)
        one = kd.simulate(drawn, None)
        assert many.status[i] == one.status
        assert many.launch.velocity[i] == pytest.approx(one.launch.velocity, abs=5e-3)
        assert np.linalg.norm(many.end[i] - one.end.position) < 0.1


def test_the_spread_is_that_of_the_sources():
    """To first order the covariance of the end follows from the slopes."""
    scene = kd.load_scene("paper_kick").replace(uncertainty={"v": 0.05})
    many = kd.simulate_many(scene, 4000)
    step, slopes = 1e-4, []
    for k in range(scene.leg.nv):
        v = scene.v.copy()
        v[k] += step
        one = kd.simulate(scene.replace(v=v, uncertainty=None), None)
        slopes.append((one.end.position - many.nominal.end.position) / step)
    matrix = np.array(slopes).T
    expected = 0.05**2 * np.trace(matrix @ matrix.T)
    assert many.deviation == pytest.approx(np.sqrt(expected), rel=0.05)
    assert many.mean == pytest.approx(many.nominal.end.position, abs=0.1 * many.deviation)


def test_one_draw_and_a_drawn_normal():
    """A single draw is drawn too; restitution that depends on the speed stays as it is."""
    scene = kd.load_scene("free_kick").replace(uncertainty={"normal": 0.02, "friction": 0.05})
    scene = scene.replace(
        contact=dataclasses.replace(scene.contact, restitution=[[2.0, 0.8], [30.0, 0.5]])
    )
    many = kd.simulate_many(scene, 1, tolerance=None, seed=4)
    draws = _Draws.of(scene)
    given = draws.arguments(np.random.default_rng(4).normal(size=(1, draws.size)))
    contact = given["contact"][0]
    assert contact.restitution == scene.contact.restitution
    assert 0.0 < np.linalg.norm(contact.normal - scene.contact.normal) < 0.1
    assert contact.friction != scene.contact.friction
    one = kd.simulate(scene.replace(contact=contact, uncertainty=None), None)
    assert many.launch.velocity[0] == pytest.approx(one.launch.velocity, abs=1e-9)


def test_supports_hold_in_every_draw():
    scene = kd.load_scene("robocup_carpet").replace(uncertainty={"v": 0.05})
    many = kd.simulate_many(scene, 3)
    assert np.isfinite(many.end).all()


@pytest.mark.parametrize(
    ("spread", "draws", "words"),
    [
        ({}, 10, "the scene has no uncertainty: draws need one"),
        ({"ball_mass": 0.01}, 10, "uncertainty of ball_mass is not drawn: simulate_many draws q,"),
        ({"v": 0.1}, 0, r"draws is 0\.0: it must be a finite number at least 1"),
        ({"v": 0.1}, 1.5, "draws is 1.5: it must be a whole number"),
    ],
)
def test_bad_input(spread, draws, words):
    scene = kd.load_scene("free_kick").replace(uncertainty=spread)
    with pytest.raises(kd.InvalidInput, match=words):
        kd.simulate_many(scene, draws)
