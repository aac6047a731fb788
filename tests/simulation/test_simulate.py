"""Answers stay within their tolerance and their own error, and say what they leave out."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.accuracy.random_scenes import random_scene

LEG = kd.Leg.human()
POSTURE = LEG.posture(np.radians([5, 10, -5]))


def kick(speed=10.0, **parts):
    v = POSTURE.joint_velocity([0.9 * speed, 0, 0.4 * speed])
    touch = parts.pop("touch", kd.Contact((2, 0, 1), 0.8, 0.4))
    parts = {"air": kd.Air(), "ground": kd.Ground(-0.9), **parts}
    return kd.Scene(LEG, POSTURE.q, v, kd.Ball(), touch, **parts)


def gap(one, other):
    return float(np.linalg.norm(one.end.position - other.end.position))


def test_random_scenes_stay_within_their_tolerance():
    rng, done, kinds = np.random.default_rng(4), 0, set()
    while done < 20:
        scene = random_scene(rng)
        try:
            reference = kd.simulate(scene, None)
        except (kd.NoImpact, kd.InvalidInput):  # pressed into the ground
            continue
        done += 1
        for tolerance in (0.05, 1.0):
            answer = kd.simulate(scene, tolerance)
            assert answer.error <= tolerance
            assert gap(answer, reference) <= answer.error + 1e-7
            kinds |= set(answer.left_out)
    assert kinds >= {"compliance", "drag", "lift", "wind", "buoyancy", "spin decay", "drag crisis"}


def test_everything_is_strike_and_flight():
    scene = kick()
    answer = kd.simulate(scene, None)
    hit = kd.strike(LEG, scene.q, scene.v, scene.ball, scene.touch)
    path = kd.fly(hit.ball, scene.ball, scene.air, scene.ground)
    np.testing.assert_array_equal(answer.end.position, path.landing.position)
    assert answer.left_out == ()
    assert set(answer.modelled) == {
        "friction", "turning of the ball", "drag", "drag crisis", "lift", "spin decay", "buoyancy"
    }  # fmt: skip
    assert answer.numerical_error == path.error


def test_everything_is_followed_to_rest():
    scene = kick(4, ground=kd.Ground(-0.9, "turf"))
    answer = kd.simulate(scene, None)
    assert isinstance(answer.path, kd.Course)
    assert not answer.end.velocity.any()
    rough = kd.simulate(scene, 0.05)
    assert gap(answer, rough) <= rough.error < 0.05
    assert rough.path is None


def test_a_slow_kick_needs_no_air_at_a_metre():
    answer = kd.simulate(kick(1.5), 1.0)
    assert {"drag", "lift", "buoyancy"} <= set(answer.left_out)
    assert answer.method == "strike, closed form"
    assert answer.evaluations < 50


def test_a_tight_tolerance_leaves_nothing_out():
    answer = kd.simulate(kick(), 1e-6)
    assert answer.left_out == ()
    assert answer.error <= 1e-6
    assert gap(answer, kd.simulate(kick(), None)) <= 1e-6


def test_without_air_nothing_is_flown():
    answer = kd.simulate(kick(air=None), 0.01)
    assert answer.method == "strike, closed form"
    assert answer.modelled == ("friction", "turning of the ball")


def test_drag_that_goes_takes_its_crisis_along():
    answer = kd.simulate(kick(1.5), 1.0)
    bounds = {verdict.effect: verdict.bound for verdict in answer.verdicts}
    assert bounds["drag"] > 0
    assert bounds["drag crisis"] == 0
    assert answer.model_error == math.fsum(bounds[name] for name in answer.left_out)


def test_it_goes_to_the_plane():
    scene = kick(plane=kd.Plane((3, 0, 0), (-1, 0, 0), "centre"))
    answer = kd.simulate(scene, 0.05)
    assert answer.end.position[0] == pytest.approx(3, abs=answer.error)
    assert gap(answer, kd.simulate(scene, None)) <= answer.error


def test_spread_bounds_what_a_change_does():
    scene = kick(spread={"restitution": 0.02})
    answer = kd.simulate(scene, 1e-3)
    other = kick(touch=kd.Contact((2, 0, 1), 0.82, 0.4))
    moved = gap(kd.simulate(other, 1e-3), answer)
    assert 0.9 * moved < answer.spread < 2 * moved
    assert math.isnan(kd.simulate(kick(), 1.0).spread)


def test_it_prints_its_budget():
    said = str(kd.simulate(kick(1.5, spread={"v": 0.1}), 1.0))
    assert "left out" in said
    assert "drag" in said
    assert "standard deviation" in said


@pytest.mark.parametrize("tolerance", [0, -1, math.nan, "1"])
def test_bad_tolerances_are_refused(tolerance):
    with pytest.raises(kd.InvalidInput, match="tolerance"):
        kd.simulate(kick(), tolerance)


def test_what_cannot_be_simulated_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"kickdyn\.Scene"):
        kd.simulate("scene.toml")
    away = kick(touch=kd.Contact((-1, 0, 0), 0.8))
    with pytest.raises(kd.NoImpact):
        kd.simulate(away, 1.0)
