"""Splines of a motion as linear maps: against differences and the splines themselves."""

import numpy as np
import pytest
from tolerances import agrees, closed_form

from kickdyn.motion.splines import MotionSplines

SPLINES = MotionSplines(0.5, 0.7, (6, 4))
COEFFICIENTS = np.random.default_rng(0).normal(size=(SPLINES.size, 2))


def values(t, order=0):
    sides = [np.array([t]), np.zeros(0)] if t <= 0 else [np.zeros(0), np.array([t])]
    return (SPLINES.values(sides, order) @ COEFFICIENTS)[0]


def test_a_motion_starts_and_ends_at_rest_and_does_not_jump_at_the_impact():
    for t in (-0.5, 0.7):
        for order in (1, 2):
            assert values(t, order) == pytest.approx(np.zeros(2), abs=closed_form(1e4))
    agrees(values(-0.5), COEFFICIENTS[0], closed_form(10))
    agrees(values(0.7), COEFFICIENTS[-1], closed_form(10))
    q, before, jump = SPLINES.at_impact() @ COEFFICIENTS
    first, second = SPLINES.motion(COEFFICIENTS)
    agrees(first(0.0), q, closed_form(10))
    agrees(second(0.0), q, closed_form(10))
    agrees(before, first(0.0, 1), closed_form(10))
    agrees(jump, second(0.0, 1) - first(0.0, 1), closed_form(10))
    assert np.abs(jump).min() > 0.1


@pytest.mark.parametrize("t", [-0.31, -0.04, 0.02, 0.4])
def test_derivatives_are_those_of_differences(t):
    h = 1e-3  # differences of the fourth order are exact for cubics
    for order in (0, 1, 2):
        wide, close = ((values(t + k * h, order) - values(t - k * h, order)) for k in (2, 1))
        agrees(values(t, order + 1), (8 * close - wide) / (12 * h), closed_form(1e4))


def test_coefficients_are_those_of_a_motion():
    agrees(SPLINES.coefficients(*SPLINES.motion(COEFFICIENTS)), COEFFICIENTS, closed_form())
