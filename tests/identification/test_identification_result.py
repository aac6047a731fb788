"""The numbers of a fit: which of them are given, how they are printed, means over flights."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.identification.identification_result import (
    Identification,
    mean_over_flights,
    weighted_mean,
)

BALL = kd.Ball()


def result(estimates, deviations, speed=20.0, count=4, **changes):
    """Return a fit of a ball that moves straight on, with estimates by name."""
    times = 7.0 + np.arange(count) / 10
    residuals = np.outer(np.arange(count), (0.1, 0.0, 0.0))  # of 1 m/s along the path
    return Identification(**{
        "track": kd.Track(times, np.outer(times, (speed - 1.0, 0, 0))),
        "ball": BALL, "air": kd.Air(), "launch": kd.BallState((0, 0, 1), (speed, 0, 0)),
        "names": tuple(estimates), "estimates": np.array([*estimates.values()], dtype=float),
        "covariance": np.diag(np.square(deviations)), "residuals": residuals,
        "used": np.ones(count, dtype=bool), "noise": 0.01, "widening": 1.0, **changes,
    })  # fmt: skip


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(0.01, 0.5)), min_size=2, max_size=12))
@example([(0.0, 0.5), (0.72, 0.5)])  # just more than their deviations explain
def test_the_scatter_of_a_mean_explains_the_differences(pairs):
    """The equations of Paule & Mandel (1982)."""
    values, deviations = np.array(pairs).T
    mean, deviation, scatter = weighted_mean(values, deviations)
    weights = 1.0 / (deviations**2 + scatter**2)
    assert mean == pytest.approx(np.average(values, weights=weights), abs=closed_form())
    assert deviation == pytest.approx(weights.sum() ** -0.5)
    chi_square = weights @ (values - mean) ** 2
    if scatter > 0.0:
        assert chi_square == pytest.approx(len(values) - 1, rel=optimized())
    else:
        assert chi_square <= (len(values) - 1) * (1.0 + closed_form())


def test_only_flights_that_determine_the_value_count():
    fits = [
        result({"drag": 0.2}, [0.01], 20.0), result({"drag": 0.25}, [0.02], 15.0),
        result({"drag": 0.9}, [0.2], 90.0),  # its deviation is too large
    ]  # fmt: skip
    mean = mean_over_flights(fits, "drag")
    assert mean[:3] == weighted_mean(np.array([0.2, 0.25]), np.array([0.01, 0.02]))
    assert mean[3:] == (2, pytest.approx(15.0), pytest.approx(20.0))
    assert f"{mean.mean:.3f} +- {mean.deviation:.3f}" in str(mean)
    assert mean_over_flights(fits[1:], "drag") is None


def test_the_picture_has_the_fitted_and_the_measured_positions():
    """From the side and from above, with the outliers apart; residuals are in centimetres."""
    measured, residuals = np.random.default_rng(1).normal(size=(2, 4, 3))
    used, track = np.array([True, True, False, True]), kd.Track(np.arange(4) / 10, measured)
    fit = result({"drag": 0.2}, [0.01], track=track, used=used, residuals=residuals)
    *views, rest = fit.plot().axes
    for axes, across in zip(views, (2, 1), strict=True):
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", f"{'xyz'[across]} [m]")
        rows = measured + residuals, measured[used], measured[~used]
        for line, right in zip(axes.lines, rows, strict=True):
            agrees(np.transpose(line.get_data()), right[:, [0, across]], closed_form())
    agrees([line.get_ydata() for line in rest.lines], 100 * residuals.T, closed_form())
    assert all(line.get_xdata().tolist() == track.times.tolist() for line in rest.lines)


@pytest.mark.parametrize(("changes", "words"), [
    (lambda x: {"residuals": np.full((4, 3), x * BALL.radius / 3**0.5)}, "the ball's radius"),
    (lambda x: {"estimates": np.array([0.1 * (1.0 - x)])}, "drag is -.* below 0"),
    (lambda x: {"widening": max(x, 1.0)}, "correlated.* factor of 1"),
    (lambda x: {"used": x < np.array([2.0, 2.0, 1.0, 2.0])}, "^1 of 4 samples"),
    (lambda x: {"curved": ("drag",) * (x > 1)}, "deviations of drag were increased"),
], ids=["distance", "drag", "correlation", "outliers", "curved"])  # fmt: skip
def test_a_fit_warns_on_one_side_of_a_limit(changes, words):
    for x, count in ((0.99, 0), (1.01, 1)):
        lines = replace(result({"drag": 0.2}, [1e-5]), **changes(x)).warnings
        assert sum(bool(re.search(words, line)) for line in lines) == count, lines


@pytest.mark.parametrize(("name", "value", "largest"), [
    ("back_spin", 100.0, 20.0), ("side_spin", 100.0, 20.0), ("gyro_spin", 100.0, 20.0),
    ("drag", 0.25, 0.1), ("drag_scale", 1.2, 0.5), ("lift_scale", 1.2, 0.5),
    ("wind_x", 8.0, 3.0), ("wind_y", -8.0, 3.0),
    ("drag", 0.1, 0.05),  # half the value
    ("wind_x", 0.1, 0.15), ("back_spin", 0.5, 1.0), ("drag", 0.0, 0.005),  # near zero
])  # fmt: skip
def test_a_value_is_given_up_to_a_deviation(name, value, largest):
    """About half of what it usually is; half the value; a twentieth of the first near zero."""
    for share, is_given in ((0.99, True), (1.01, False)):
        fit = result({name: value}, [share * largest])
        assert fit.values == ({name: value} if is_given else {}), share
        assert set(fit.undetermined) == (set() if is_given else {name}), share
