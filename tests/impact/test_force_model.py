"""The force of a compliant contact alone: two masses, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.impact.force_model import (
    HERTZ,
    LINEAR,
    ForceModel,
    contact_time_of,
)


def test_hertzs_contact_time():
    """2.9432 d_max / speed, d_max = (5 m v^2 / (4 k))^(2/5) (Johnson 1985, Eqs. 11.23, 11.24)."""
    k, m, speed = 3e5, 0.37, 12.0
    crush = (5 * m * speed**2 / (4 * k)) ** 0.4
    assert contact_time_of(ForceModel(k), m, speed) == pytest.approx(
        2.94328 * crush / speed, rel=1e-5
    )


def test_the_contact_time_of_a_linear_spring():
    """Half a period of the two masses."""
    time = contact_time_of(ForceModel(5e4, exponent=LINEAR), 0.37, 12.0)
    assert time == pytest.approx(math.pi * math.sqrt(0.37 / 5e4), rel=1e-14)


@pytest.mark.parametrize("e", [1.0, 0.7, 0.2])
def test_stiffness_and_contact_time_are_inverse(e):
    k = kd.contact_stiffness(0.01, 0.4, 15.0, e)
    assert contact_time_of(ForceModel(k, e), 0.4, 15.0) == pytest.approx(0.01, rel=1e-13)


@given(
    e=st.floats(0.01, 1.0),
    exponent=st.sampled_from([LINEAR, HERTZ]),
    largest=st.floats(1e-6, 1.0),
    share=st.floats(0.0, 1.0),
)
def test_hysteresis_returns_the_square_of_the_restitution(e, exponent, largest, share):
    """Of the work of compression; along the way back the force is the slope of what is stored."""
    model = ForceModel(5e4, e, exponent)
    work = 5e4 * largest ** (exponent + 1) / (exponent + 1)
    assert model.stored(largest) == pytest.approx(e * e * work, rel=1e-12)
    assert model.force(largest) == pytest.approx(model.force(largest, largest))
    end = model.separation(largest)
    assert model.force(end, largest) == pytest.approx(0.0, abs=1e-9 * work / largest / e**2)
    assert model.force(end / 2, largest) == 0.0 or e == 1.0
    at = end + (0.01 + 0.98 * share) * (largest - end)
    step = 1e-3 * (largest - end)
    rise = model.stored(at + step, largest) - model.stored(at - step, largest)
    assert rise / (2 * step) == pytest.approx(model.force(at, largest), rel=1e-2)


@pytest.mark.parametrize("e", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("exponent", [LINEAR, HERTZ])
def test_the_hysteretic_pulse_has_the_same_peak_over_mean_for_every_restitution(e, exponent):
    """pi/2, a half sine, of a linear spring, and 1.8396 of Hertz's (5/4 times 2.9433 / 2)."""
    m, k, u = 0.37, 5e4, 12.0
    largest = ((exponent + 1) * m * u * u / (2 * k)) ** (1 / (exponent + 1))
    model = ForceModel(k, e, exponent)
    ratio = model.force(largest) * contact_time_of(model, m, u) / (m * u * (1 + e))
    assert ratio == pytest.approx({LINEAR: math.pi / 2, HERTZ: 1.25 * 2.943275 / 2}[exponent], 1e-6)


def test_the_least_restitution_has_a_stiffness():
    assert kd.contact_stiffness(0.01, 0.4, 15.0, 0.01) < kd.contact_stiffness(0.01, 0.4, 15.0)
    with pytest.raises(kd.InvalidInput, match=r"restitution is 0\.0099: .*at least 0\.01"):
        kd.contact_stiffness(0.01, 0.4, 15.0, 0.0099)


def test_the_contact_pushes_only():
    contact = ForceModel(1e5)
    assert contact.force(0.01) == contact.returned(0.01) == pytest.approx(100.0)
    assert contact.force(-0.01) == 0.0


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
    assert kd.ForceModel(1.0).force(1e300) == np.inf
