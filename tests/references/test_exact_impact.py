"""The exact impact satisfies the laws to fifty digits, and its conditions are conditions."""

import numpy as np
import pytest
from chains import random_kick, random_leg
from extremes.extreme_impacts import answers, conditions

import kickdyn as kd
from references.exact_impact import (
    LARGEST,
    Quantity,
    exact_impact,
    given,
)
from references.exact_leg import length, mp, numbers

TINY = mp.mpf(10) ** -40


def struck(seed, friction):
    rng = np.random.default_rng(seed)
    args, options = random_kick(rng, random_leg(rng), friction=friction)
    return kd.strike(*args, **options)


@pytest.mark.parametrize("friction", [0.0, 0.05, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_kickdyn_is_right_to_what_the_condition_allows(seed, friction):
    hit = struck(seed, friction)
    structure, scene = given(hit)
    exact = exact_impact(structure, scene)
    allowed = conditions(structure, scene, exact, samples=2)
    for name, found in answers(hit).items():
        assert exact[name].error(found) < 4e-15 * allowed[name], name
        assert allowed[name] < 1e4


@pytest.mark.parametrize("friction", [0.0, 0.05, 2.0])
def test_restitution_and_the_cone_hold_to_forty_digits(friction):
    structure, scene = given(struck(1, friction))
    exact = exact_impact(structure, scene)
    n = scene["normal"] / length(scene["normal"])
    before = scene["ball_velocity"] - exact["foot velocity"].exact
    moved = scene | {"v": exact["joint velocity"].exact}
    foot_after = exact_impact(structure, moved | {"coefficients": numbers([0, 0])})
    after = exact["ball velocity"].exact - foot_after["foot velocity"].exact
    assert abs(n @ after + scene["coefficients"][0] * (n @ before)) < TINY
    pressing = n @ exact["impulse"].exact
    across = length(exact["impulse"].exact - pressing * n)
    assert across <= scene["coefficients"][1] * pressing + TINY
    if friction == 0.05:
        assert abs(across - scene["coefficients"][1] * pressing) < TINY


def test_energy_lost_is_that_of_leg_and_ball():
    hit = struck(2, 0.05)
    structure, scene = given(hit)
    exact = exact_impact(structure, scene)
    ball, before = hit.ball, hit.ball_before
    kinetic = [
        0.5 * v @ hit.posture.inertia @ v
        + 0.5 * ball.mass * state.velocity @ state.velocity
        + 0.5 * ball.inertia * state.spin @ state.spin
        for v, state in ((hit.v_before, before), (hit.v_after, hit.ball_after))
    ]
    assert float(exact["energy lost"].exact[0]) == pytest.approx(kinetic[0] - kinetic[1], rel=1e-11)


def test_the_condition_is_known_where_it_is():
    # a ball that nearly keeps up: n.(u - w) loses the digits that u and w share
    leg = kd.Leg.human()
    posture = leg.posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity([1, 0, 0])
    contact = kd.Contact((1, 0, 0), 0.5)
    for share in (1e-3, 1e-6):
        hit = kd.strike(posture, v, kd.Ball(), contact, ball_velocity=(1 - share, 0, 0))
        structure, scene = given(hit)
        found = conditions(structure, scene, exact_impact(structure, scene))["impulse"]
        assert 0.3 / share < found < 300 / share


def test_an_error_is_relative_and_out_of_range_is_inf():
    third = Quantity(np.array([mp.mpf(1) / 3]), mp.mpf(1) / 3)
    assert third.error(1 / 3) == pytest.approx(5.55e-17, rel=0.01)
    assert third.error(np.nan) == np.inf
    beyond = Quantity(np.array([mp.mpf(10) ** 400]), mp.mpf(10) ** 400)
    assert beyond.scale > LARGEST
    assert beyond.error(np.inf) == 0
    assert beyond.error(1e300) == np.inf
    below = Quantity(np.array([mp.mpf(10) ** -320]), mp.mpf(10) ** -320)
    assert below.error(0.0) < 1e-11
