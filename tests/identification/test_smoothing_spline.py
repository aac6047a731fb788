"""The smoothing spline of configurations: limits in closed form, and a prior that grows."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.identification import smoothing_spline
from kickdyn.identification.smoothing_spline import GROWTH, SmoothingSpline

MODEL = kd.Leg.human().model
TIMES = np.linspace(-0.15, 0.0, 76)
DEVIATION = 3e-3


def measured(curve, seed):
    noise = DEVIATION * np.random.default_rng(seed).normal(size=(len(TIMES), 3))
    return np.array([curve(TIMES)] * 3).T + noise


def spline(q, growth=0.0):
    information = np.tile(np.eye(3) / DEVIATION**2, (len(TIMES), 1, 1))
    return SmoothingSpline(MODEL, TIMES, q, information, growth)


def test_a_quadratic_is_fitted_as_by_least_squares(monkeypatch):
    """Its jerk is 0: smoothing that is as strong as can be leaves it as it is."""
    monkeypatch.setattr(smoothing_spline, "ANGLE_DENSITY", -10.0)
    q = np.array([0.2 + 3.0 * TIMES + 20.0 * TIMES**2] * 3).T
    q[::2] += 0.3 * DEVIATION
    q[1::2] -= 0.3 * DEVIATION  # alternating errors, which no smooth curve follows
    x, v, covariance = spline(q).state(0.0)
    rows = np.vander(TIMES, 3, increasing=True)
    inverse = np.linalg.inv(rows.T @ rows)
    expected = inverse @ rows.T @ q
    assert x == pytest.approx(expected[0], rel=1e-6)
    assert v == pytest.approx(expected[1], rel=1e-6)
    deviations = DEVIATION * np.sqrt(inverse.diagonal()[:2])
    assert np.sqrt(covariance.diagonal()) == pytest.approx(np.repeat(deviations, 3), rel=1e-5)


def test_each_coordinate_is_smoothed_by_its_own_noise():
    """Hinges with independent errors are fitted one by one."""
    sizes = np.array([0.3, 1.0, 4.0]) * DEVIATION
    wave = np.sin(40.0 * TIMES)[:, None]
    q = 0.1 * wave + sizes * np.random.default_rng(2).normal(size=(len(TIMES), 3))
    splines = [
        SmoothingSpline(MODEL, TIMES, q, np.tile(np.diag(1.0 / size**2), (len(TIMES), 1, 1)))
        for size in (sizes, *(np.full(3, size) for size in sizes))
    ]
    x, v, covariance = splines[0].state(-0.02)
    for j, one in enumerate(splines[1:]):
        alone = one.state(-0.02)
        assert (x[j], v[j]) == pytest.approx((alone[0][j], alone[1][j]), rel=1e-9)
        assert covariance[3 + j, 3 + j] == pytest.approx(alone[2][3 + j, 3 + j], rel=1e-9)


def test_a_growing_prior_covers_velocities_that_change_at_the_end():
    def curve(t):
        return np.tanh(t / 0.06)

    scores = {0.0: [], GROWTH: []}
    for growth, of_growth in scores.items():
        for seed in range(20):
            _, v, covariance = spline(measured(curve, seed), growth).state(0.0)
            of_growth += [(v - 1 / 0.06) / np.sqrt(covariance.diagonal()[3:])]
    constant, growing = (np.sqrt(np.mean(np.square(values))) for values in scores.values())
    assert growing < 1.25 < constant
