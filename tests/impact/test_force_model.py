"""The force of a compliant contact alone: two masses, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import EPSILON, closed_form, integrated

import kickdyn as kd
from kickdyn.impact.force_model import (
    HERTZ,
    LINEAR,
    ForceModel,
    contact_stiffness,
    contact_time_of,
)


@pytest.mark.parametrize("e", [1.0, 0.7, 0.2, 0.01])
def test_contact_times_and_stiffness_by_closed_forms(e):
    """Johnson 1985, Eqs. 11.23, 11.24, with 2.9432 as gamma functions; half a period for n = 1.

    Restitution lasts e times as long as compression.
    """
    k, m, speed = 3e5, 0.37, 12.0
    crush = (5 * m * speed**2 / (4 * k)) ** 0.4
    hertz = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9) * crush / speed
    assert hertz == pytest.approx(2.9432 * crush / speed, rel=1e-4)  # digits
    time = contact_time_of(ForceModel(k, e), m, speed)
    assert time == pytest.approx((1 + e) / 2 * hertz, rel=closed_form())
    assert contact_stiffness(time, m, speed, e) == pytest.approx(k, rel=closed_form())
    linear = contact_time_of(ForceModel(5e4, e, LINEAR), m, speed)
    assert linear == pytest.approx((1 + e) / 2 * math.pi * math.sqrt(m / 5e4), rel=closed_form())


@given(
    e=st.floats(0.05, 1.0),
    exponent=st.sampled_from([LINEAR, HERTZ, 1.3]),
    largest=st.floats(1e-3, 1.0),
    share=st.floats(0.1, 0.9),
)
@settings(max_examples=50)
def test_hysteresis_returns_the_square_of_the_restitution(e, exponent, largest, share):
    """e^2 of the work of compression; in restitution the force is the slope of what is stored."""
    model, k = ForceModel(5e4, e, exponent), 5e4
    work = k * largest ** (exponent + 1) / (exponent + 1)
    assert model.force(largest) == pytest.approx(k * largest**exponent, rel=closed_form())
    peak = pytest.approx(model.force(largest), rel=closed_form(1e3))
    assert model.force(largest, largest) == peak
    assert model.stored(largest) == pytest.approx(e * e * work, rel=closed_form())
    end = (1 - e * e) * largest
    assert model.separation(largest) == pytest.approx(end, rel=closed_form(), abs=EPSILON)
    assert model.force(end - 1e-6, largest) == 0.0
    deflection = end + share * (largest - end)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    forces = [model.force(end + 0.5 * (deflection - end) * (1 + x), largest) for x in nodes]
    returned = 0.5 * (deflection - end) * weights @ forces
    assert model.stored(deflection, largest) == pytest.approx(returned, rel=integrated(1e-7))


@pytest.mark.parametrize(("arguments", "words"), [
    ((0.0, 1, 1), "contact time is 0"), ((10, 1, 1), r"contact time is 10.* at most 0\.1"),
    ((0.01, -1, 1), "mass is -1"), ((0.01, 1, math.nan), "approach speed is nan"),
    ((0.01, 1, 1, 0.0099), r"restitution is 0\.0099: .*at least 0\.01"),
    ((0.01, 1, 1, np.array([0.5])), "restitution is"), ((1e-300, 1, 1), "contact time is")
])  # fmt: skip
def test_bad_input(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        contact_stiffness(*arguments)
