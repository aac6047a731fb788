"""The mean of a value over flights."""

import numpy as np
import pytest
from scipy.stats import chi2

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.identification.identification_result import (
    Identification,
    mean_over_flights,
    weighted_mean,
    with_deviation,
)

BALL = kd.Ball()


def test_the_mean_is_that_of_a_peer():
    """`statsmodels.stats.meta_analysis.combine_effects(..., method_re="pm")` of 0.15.0."""
    values, deviations = np.array([0.2, 0.25, 0.22, 0.30]), np.array([0.01, 0.02, 0.005, 0.03])
    expected = (0.23601825, 0.02032317, 0.03684665)
    assert weighted_mean(values, deviations) == pytest.approx(expected, rel=1e-6)


def test_values_that_differ_less_than_their_deviations_have_no_scatter():
    values, deviations = np.array([0.2, 0.201, 0.19]), np.array([0.01, 0.02, 0.04])
    mean, deviation, scatter = weighted_mean(values, deviations)
    weights = deviations**-2.0
    assert scatter == 0.0
    assert mean == pytest.approx(np.average(values, weights=weights))
    assert deviation == pytest.approx(weights.sum() ** -0.5)


def test_the_standard_error_is_that_of_simulated_means():
    rng = np.random.default_rng(4)
    misses = []
    for _ in range(300):
        deviations = rng.uniform(0.002, 0.05, 20)
        values = rng.normal(0.2, np.hypot(deviations, 0.03))
        mean, deviation, _ = weighted_mean(values, deviations)
        misses.append((mean - 0.2) / deviation)
    low, high = chi2.ppf([0.001, 0.999], 300) / 300
    assert low < np.mean(np.square(misses)) < 1.1 * high  # 20 values estimate the scatter


def test_only_flights_that_determine_the_value_count():
    fits = []
    for drag, longest in ((0.2, 1.2), (0.25, 1.2), (0.2, 0.1)):
        path = kd.fly(
            kd.BallState((0, 0, 0.3), (20, 3, 8)), BALL, kd.Air(drag=constant(drag), lift=None)
        )
        times = np.arange(0.0, longest, 0.02)
        rng = np.random.default_rng(1)
        points = path.sample(times).position + rng.normal(0.0, 0.005, (len(times), 3))
        fits.append(kd.identify(kd.Track(7.0 + times, points), BALL, free=("drag",)))
    assert "drag" in fits[2].undetermined
    found = mean_over_flights(fits, "drag")
    assert found.flights == 2
    assert found.mean == pytest.approx(0.225, abs=0.01)
    assert found.scatter == pytest.approx(0.05 / 2**0.5, rel=0.2)
    assert 15.0 < found.slowest < found.fastest < 22.0
    assert mean_over_flights(fits[1:], "drag") is None
    assert f"{found.mean:.3f} +- {found.deviation:.3f}, mean of 2 flights with" in str(found)
    assert f"from flight to flight it scatters by {found.scatter:.2g}" in str(found)
    assert "differ no more than" in str(found._replace(scatter=0.0))


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (0.19982, 0.0104, "0.200 +- 0.010"),
        (0.25061, 0.00061, "0.25061 +- 0.00061"),
        (-12.2, 58.9, "-12 +- 59"),
        (0.2, 0.0, "0.200 +- 0.000"),
    ],
)
def test_a_value_has_the_digits_that_its_deviation_allows(value, deviation, text):
    assert with_deviation(value, deviation) == text


def test_what_is_printed_is_what_was_found():
    """The wind along the path is hardly determined; two samples are outliers."""
    path = kd.fly(kd.BallState((0, 0, 0.3), (20, 3, 8), (5, -30, 10)), BALL, kd.Air())
    times = np.arange(0.0, 1.0, 0.02)
    points = path.sample(times).position
    points = points + np.random.default_rng(1).normal(0.0, 0.005, points.shape)
    points[[10, 30]] += 0.5
    found = kd.identify(kd.Track(times, points), BALL, free=("spin", "drag", "wind"))
    rows = {
        line[:24].split("  ")[1]: line for line in str(found).splitlines()[1:] if line[2] != " "
    }
    assert "48 of 50 used" in str(found)
    assert found.outliers == 2 == 50 - found.used.sum()
    assert f"{found.rms:.4g} m" in str(found)
    values = found.values
    assert 0 < len(values) < len(found.names)
    for name, value in values.items():
        assert f"{value:.4g} +- {found.deviations[name]:.2g}" in rows[name]
    variances = dict(zip(found.names, np.diag(found.covariance), strict=True))
    for name, reason in found.undetermined.items():
        assert f"not determined: {reason}" in rows[name]
        assert name not in values
        assert variances[name] > 0.0


@pytest.mark.parametrize(
    ("name", "value", "least"),
    [
        ("back_spin", 100.0, 20.0),  # a value of about twice the least deviation that is too large
        ("drag", 0.25, 0.1),
        ("drag_scale", 1.2, 0.5),
        ("lift_scale", 1.2, 0.5),
        ("wind_x", 8.0, 3.0),
        ("wind_y", -8.0, 3.0),
        ("drag", 0.1, 0.05),  # over half the value
        ("wind_x", 0.1, 0.15),  # a value near zero is given with a twentieth of the largest
    ],
)
def test_a_value_is_given_up_to_a_deviation(name, value, least):
    track = kd.Track([0, 0.1, 0.2, 0.3], [(0, 0, 1), (2, 0, 1.5), (4, 0, 2), (6, 0, 2.3)])
    for share, is_given in ((0.99, True), (1.01, False)):
        found = Identification(
            track=track, ball=BALL, air=kd.Air(), launch=kd.BallState((0, 0, 1), (20, 0, 6)),
            names=(name,), estimates=np.array([value]), noise=0.01, widening=1.0,
            covariance=np.array([[(share * least) ** 2]]), residuals=np.zeros((4, 3)),
            used=np.ones(4, dtype=bool),
        )  # fmt: skip
        assert (found.values == {name: value}) == is_given
        assert (name in found.undetermined) != is_given
