"""Draws of a scene are simulations of the drawn scenes."""

import dataclasses

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.launch_and_end import end_of, fly_scene, strike_scene
from kickdyn.scene.simulate_many import _Draws

SPREAD = {
    "q": 0.01, "v": 0.1, "restitution": 0.02, "friction": 0.03, "normal": 0.02,
    "ball_velocity": 0.1, "ball_spin": 2.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "law"),
    [("free_kick", "newton"), ("free_kick", "stronge"), ("wet_grass_pass", "newton"),
     ("volley", "newton"), ("robocup_carpet", "newton")],
)  # fmt: skip
def test_each_draw_is_a_simulation(name, law):
    scene = kd.load_scene(name).replace(law=law, uncertainty=SPREAD)
    many = kd.simulate_many(scene, 3, tolerance=None, seed=3)
    draws = _Draws.of(scene)
    given = draws.arguments(np.random.default_rng(3).normal(size=(3, draws.size)))
    for i in range(3):
        drawn = scene.replace(
            posture=scene.leg.posture(given["q"][i]), v=given["v"][i], uncertainty=None,
            contact=given["contact"][i],
            incoming=kd.BallState(
                velocity=given["ball_velocity"][i], spin=given["ball_spin"][i]
            ),
        )  # fmt: skip
        struck = strike_scene(drawn).ball_after
        assert many.launch.velocity[i] == pytest.approx(struck.velocity, rel=1e-9, abs=1e-9)
        assert many.launch.spin[i] == pytest.approx(struck.spin, rel=1e-9, abs=1e-9)
        place = many.nominal.launch.position  # where the ball lies, whatever the foot does
        path = fly_scene(scene, kd.BallState(place, struck.velocity, struck.spin))
        assert many.status[i] == path.status
        assert many.end[i] == pytest.approx(end_of(path).position, abs=1e-3)


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


def test_a_seed_is_a_whole_number():
    scene = kd.load_scene("free_kick").replace(uncertainty={"v": 0.1})
    with pytest.raises(kd.InvalidInput, match=r"seed is 0\.5: it must be a whole number"):
        kd.simulate_many(scene, 3, seed=0.5)
