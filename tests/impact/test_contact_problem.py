import numpy as np
import pytest
from chains import random_kick, random_leg
from extremes.extreme_impacts import chain
from references.exact_impact import exact_impact, given

import kickdyn as kd
from kickdyn.impact.contact_problem import tangents
from kickdyn.impact.laws import LAWS


@pytest.mark.parametrize("decade", range(14))
def test_tangents_and_normal_are_a_rotation_however_little_slides(decade):
    rng = np.random.default_rng(decade)
    for _ in range(50):
        normal, aside = rng.normal(size=(2, 3))
        normal /= np.linalg.norm(normal)
        aside -= normal * (aside @ normal)
        moving = normal + 10.0**-decade * aside / np.linalg.norm(aside)
        first, second = tangents(normal, rng.uniform(1e-3, 1e3) * moving)
        axes = np.column_stack([first, second, normal])
        assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        if decade < 12:  # below, what slides is taken for rounding
            assert axes[:, 0] @ moving > 0.9 * 10.0**-decade


@pytest.mark.parametrize("mu", [0.05, 0.15, 3.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_foot_that_comes_centrally_but_for_rounding_has_its_digits(seed, mu):
    leg = random_leg(np.random.default_rng(seed), 5, last=1e-5)
    normal = np.array([0.8, 0.0, 0.6])
    posture = leg.posture(np.linspace(0.2, 1.2, 5))
    hit = kd.strike(
        posture, posture.joint_velocity(3.0 * normal), kd.Ball(), kd.Contact(normal, 0.6, mu)
    )
    error = exact_impact(*given(hit))["impulse"].error(hit.impulse)
    assert error < 10**-hit.digits
    if not hit.sticking:  # which takes the inverse of the whole matrix
        assert error < 2e-14


@pytest.mark.parametrize("last", [1e-3, 1e-6])
@pytest.mark.parametrize("knee", [-0.4, 0.2, 0.7])
def test_a_foot_that_gives_way_across_the_normal_takes_no_digits(knee, last):
    leg, normal = chain((0.4, 0.3, 0.3 * last), (2.0, 1.0, last)), np.array([0.8, 0.0, 0.6])
    posture = leg.posture((0.3, knee, -0.9))
    v = posture.joint_velocity(3.0 * normal)
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact(normal, 0.6, 0.15))
    assert not hit.sticking
    assert exact_impact(*given(hit))["impulse"].error(hit.impulse) < 2e-15


@pytest.mark.parametrize("law", LAWS)
def test_the_problem_of_a_strike_is_what_its_law_was_given(law):
    rng = np.random.default_rng(5)
    kick, options = random_kick(rng, random_leg(rng), friction=0.3)
    hit = kd.strike(*kick, law, **options)
    solution = LAWS[law].solve(hit.approach.contact_problem())
    assert (solution.impulses[0] == hit.impulse).all()
    assert (solution.sticking[0], solution.energy_lost) == (hit.sticking, hit.energy_lost)
