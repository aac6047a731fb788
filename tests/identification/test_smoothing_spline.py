"""The smoothing spline of configurations: limits in closed form, and a prior that grows."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.identification.smoothing_spline import SmoothingSpline

MODEL = kd.Leg.human().model
TIMES = np.linspace(-0.15, 0.0, 76)
DEVIATION = 3e-3


def measured(curve, seed):
    noise = DEVIATION * np.random.default_rng(seed).normal(size=(len(TIMES), 3))
    return np.array([curve(TIMES)] * 3).T + noise


def spline(q, growth=0.0):
    information = np.tile(np.eye(3) / DEVIATION**2, (len(TIMES), 1, 1))
    return SmoothingSpline(MODEL, TIMES, q, information, growth)


def test_a_parabola_is_fitted_as_by_least_squares():
    """Its third derivative is 0, so that the strongest smoothing is the most likely."""
    q = np.array([0.2 + 3.0 * TIMES + 20.0 * TIMES**2] * 3).T
    q[::2] += 0.3 * DEVIATION
    q[1::2] -= 0.3 * DEVIATION  # alternating errors, which no smooth curve follows
    x, v, covariance = spline(q).state(0.0)
    rows = np.vander(TIMES, 3, increasing=True)
    inverse = np.linalg.inv(rows.T @ rows)
    expected = inverse @ rows.T @ q
    assert x == pytest.approx(expected[0], rel=1e-3)
    assert v == pytest.approx(expected[1], rel=1e-3)
    deviations = DEVIATION * np.sqrt(inverse.diagonal()[:2])
    wider = np.sqrt(covariance.diagonal()) / np.repeat(deviations, 3)
    assert (wider > 1.0).all()  # it may be no parabola
    assert (wider < 1.5).all()


def test_a_growing_prior_covers_velocities_that_change_at_the_end():
    def curve(t):
        return np.tanh(t / 0.06)

    scores = {0.0: [], 20.0: []}
    for growth, of_growth in scores.items():
        for seed in range(20):
            _, v, covariance = spline(measured(curve, seed), growth).state(0.0)
            of_growth += [(v - 1 / 0.06) / np.sqrt(covariance.diagonal()[3:])]
    constant, growing = (np.sqrt(np.mean(np.square(values))) for values in scores.values())
    assert growing < 1.25 < constant
