"""Hertz's contact alone: two masses, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import kickdyn as kd
from kickdyn.impact.hertz import HertzContact, expected_contact_time, matched_damping


@given(e=st.floats(0.01, 1.0))
def test_damping_takes_the_energy_that_restitution_says(e):
    """The integrals of w dw / (1 + s w) over the way in and the way out are equal."""
    s = matched_damping(e)
    inward = quad(lambda w: w / (1 + s * w), 0, 1)[0]
    if s * e < 1 - 1e-6:  # closer to 1 the outward integral has no digits
        contact_normal_cone = quad(lambda w: w / (1 - s * w), 0, e, limit=200)[0]
        assert contact_normal_cone == pytest.approx(inward, rel=1e-7)
    assert 0 <= s * e <= 1


def test_damping_is_continuous_where_its_series_takes_over():
    near, far = matched_damping(1 - 0.99e-5), matched_damping(1 - 1.01e-5)
    assert near / 0.99e-5 == pytest.approx(far / 1.01e-5, rel=1e-5)
    assert matched_damping(1.0) == 0.0


def test_hertzs_contact_time():
    """2.9432 d_max / speed, d_max = (5 m v^2 / (4 k))^(2/5) (Johnson 1985, Eqs. 11.23, 11.24)."""
    k, m, speed = 3e5, 0.37, 12.0
    crush = (5 * m * speed**2 / (4 * k)) ** 0.4
    assert expected_contact_time(k, m, speed) == pytest.approx(2.94328 * crush / speed, rel=1e-5)


@pytest.mark.parametrize("e", [1.0, 0.7, 0.2])
def test_stiffness_and_contact_time_are_inverse(e):
    k = kd.contact_stiffness(0.01, 0.4, 15.0, e)
    assert expected_contact_time(k, 0.4, 15.0, e) == pytest.approx(0.01, rel=1e-13)


def test_the_least_restitution_has_a_stiffness():
    assert kd.contact_stiffness(0.01, 0.4, 15.0, 0.01) > kd.contact_stiffness(0.01, 0.4, 15.0, 0.02)
    with pytest.raises(kd.InvalidInput, match=r"restitution is 0\.0099: .*at least 0\.01"):
        kd.contact_stiffness(0.01, 0.4, 15.0, 0.0099)


def test_the_contact_pushes_only():
    contact = HertzContact(1e5, 0.1)
    assert contact.force(0.01, 0.0) == contact.spring(0.01) == pytest.approx(100.0)
    assert contact.force(0.01, 2.0) == pytest.approx(120.0)
    assert contact.force(0.01, -20.0) == 0.0
    assert contact.force(-0.01, 1.0) == 0.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.0, 1, 1), "contact time is 0"),
        ((0.01, -1, 1), "mass is -1"),
        ((0.01, 1, math.nan), "approach speed is nan"),
        ((0.01, 1, 1, 0.0), r"restitution is 0\.0: .*at least 0\.01"),
    ],
)
def test_bad_input(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.contact_stiffness(*arguments)


@pytest.mark.parametrize("wrong", [(1e-300, 1, 1), (1e300, 1, 1), (0.01, 1, 1, np.array([0.5]))])
def test_no_stiffness_beyond_the_floats(wrong):
    with pytest.raises(kd.InvalidInput, match=r"(contact time|restitution) is"):
        kd.contact_stiffness(*wrong)


def test_a_force_beyond_double_precision_is_inf():
    assert kd.HertzContact(1.0, 0.0).force(1e300, 0.0) == np.inf
