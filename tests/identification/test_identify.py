"""Launch, spin, drag, lift and wind from tracks of known truth; how a fit's numbers are given."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, integrated, optimized, sampled

import kickdyn as kd
from kickdyn.aerodynamics.coefficient_model import ScaledCoefficient
from kickdyn.aerodynamics.drag import constant
from kickdyn.core.mechanics import GRAVITY
from kickdyn.identification.identification_result import (
    Identification,
    mean_over_flights,
    weighted_mean,
)
from kickdyn.identification.identify import SPIN_SPREAD, flight_axes

BALL = kd.Ball()
SPINS = ("back_spin", "side_spin", "gyro_spin")
VELOCITY, SPIN = np.array([20.0, 3.0, 8.0]), np.array([5.0, -50.0, 20.0])


def flown(velocity=VELOCITY, spin=SPIN, air=None, rate=50.0, longest=1.5, noise=0.0, seed=0):
    """Return a track with noise."""
    start = (1.0, -2.0, 0.3)
    path = kd.fly(kd.BallState(start, velocity, spin), BALL, air or kd.Air(), tol=1e-11)
    times = np.arange(0.0, min(path.duration, longest), 1.0 / rate)
    positions = path.sample(times).position
    rng = np.random.default_rng(seed)
    return kd.Track(3.0 + times, positions + rng.normal(0.0, noise, positions.shape))


STRAIGHT = flown(spin=(0, 0, 0), rate=20.0)
"""Without spin: lift can accelerate a ball as gravity does in feet."""

NOISY = flown(noise=0.005, seed=1)


@pytest.fixture(scope="module")
def fitted():
    return kd.identify(NOISY, BALL, kd.Air(), free=("spin", "drag-scale"))


def test_a_track_without_noise_gives_the_truth():
    result = kd.identify(flown(rate=20.0), BALL, kd.Air(), free=("spin", "drag-scale"))
    for name, right in (("velocity", VELOCITY), ("spin", SPIN), ("position", [1, -2, 0.3])):
        agrees(getattr(result.launch, name), right, optimized())
    values = [result.values[name] for name in (*SPINS, "drag_scale")]
    assert values == pytest.approx([*flight_axes(VELOCITY).T @ SPIN, 1.0], rel=optimized())
    assert result.rms < optimized() * np.ptp(result.track.positions)
    assert (result.launch.time, result.undetermined) == (3.0, {})
    assert result.flight.launch.velocity == pytest.approx(result.launch.velocity)


@pytest.mark.parametrize(("free", "wind"), [
    (("spin", "drag", "lift-scale"), (2.0, -1.0, 0.5)), (("drag", "wind"), (0, 0, 0.5))
], ids=["lift", "wind"])  # fmt: skip
def test_drag_lift_and_wind_of_a_flight(free, wind):
    air = kd.Air(wind=(2.0, -1.0, 0.5), drag=constant(0.25))
    track = flown(spin=(0, -60, 20) if "spin" in free else (0, 0, 0), air=air, rate=20.0)
    result = kd.identify(track, BALL, kd.Air(wind=wind), free=free)
    expected = {"drag": 0.25, "lift_scale": 1.0, "wind_x": 2.0, "wind_y": -1.0}
    expected = {name: value for name, value in expected.items() if name in result.names}
    assert len(expected) > 1
    values = {name: result.values[name] for name in expected}
    assert values == pytest.approx(expected, rel=10 * optimized())
    agrees(result.air.wind, [2.0, -1.0, 0.5], 10 * optimized())


@pytest.mark.parametrize("velocity", [(20, 3, 8), (-12, 9, -4), (0, -15, 1)], ids=str)
def test_back_spin_lifts_and_side_spin_bends_to_the_left(velocity):
    """Lift acts along the cross product of spin and velocity."""
    along = np.array(velocity) / np.linalg.norm(velocity)
    left = np.cross((0, 0, 1), along) / np.linalg.norm(along[:2])
    axes = flight_axes(np.array(velocity, dtype=float))
    agrees(axes.T @ axes, np.eye(3), closed_form())
    lifts = np.cross(axes.T, along)  # of back, side and gyro spin
    agrees(lifts, [np.cross(along, left), left, np.zeros(3)], closed_form())


def test_the_covariance_is_that_of_the_derivatives_of_the_flight(fitted):
    """By central differences, with the prior of the spin; the noise by the degrees of freedom."""
    times, columns = NOISY.times - NOISY.times[0], []
    launch = fitted.launch
    unknowns = np.array([*launch.position, *launch.velocity, *launch.spin, fitted.estimates[-1]])

    def positions(p):
        air = kd.Air(drag=ScaledCoefficient(kd.Air().drag, p[9]))
        return kd.fly(kd.BallState(p[:3], p[3:6], p[6:9]), BALL, air, tol=1e-12).sample(times)

    for step in np.diag(1e-4 * np.array([1, 1, 1, 20, 20, 20, 100, 100, 100, 1.0])):
        change = positions(unknowns + step).position - positions(unknowns - step).position
        columns.append(change.ravel() / (2 * step.sum()))
    jacobian = np.array(columns).T
    residuals = positions(unknowns).position - NOISY.positions
    agrees(fitted.residuals + NOISY.positions, residuals + NOISY.positions, integrated(1e-7))
    assert fitted.used.all()
    assert (fitted.widening, fitted.curved) == (1.0, ())
    noise = np.sqrt((residuals**2).sum() / (residuals.size - 10))
    assert fitted.noise == pytest.approx(noise, rel=optimized(1e-5))
    assert noise == pytest.approx(0.005, rel=sampled(2 * residuals.size))
    prior = np.diag([*6 * [0], *3 * [(noise / SPIN_SPREAD) ** 2], 0])
    along = launch.velocity / np.linalg.norm(launch.velocity)
    left = np.cross((0, 0, 1), along) / np.linalg.norm(along[:2])
    turn = np.eye(10)
    turn[6:9, 6:9] = -left, np.cross(along, left), along
    covariance = turn @ np.linalg.inv(jacobian.T @ jacobian + prior) @ turn.T * noise**2
    sizes = np.sqrt(np.outer(covariance.diagonal(), covariance.diagonal()))
    np.testing.assert_allclose(fitted.covariance / sizes, covariance / sizes, atol=1e-3)
    np.testing.assert_allclose(fitted.correlations, covariance / sizes, atol=1e-3)
    assert fitted.estimates[6:9] == pytest.approx(turn[6:9, 6:9] @ launch.spin)
    slope = jacobian.T @ residuals.ravel() + prior @ unknowns  # at the minimum by robust noise
    assert np.abs(slope * np.sqrt(covariance.diagonal())).max() < 0.1 * noise**2


def test_outliers_are_left_out_and_named():
    points = NOISY.positions.copy()
    points[[10, 30]] += 0.4
    points[50] = flown().positions[50] + (0, 0, 6.5 * 0.005)
    points[60] = flown().positions[60] + (0, 0, 3 * 0.005)  # which is no outlier
    result = kd.identify(kd.Track(NOISY.times, points), BALL, free=("spin", "drag-scale"))
    assert [*np.flatnonzero(~result.used)] == [10, 30, 50]
    assert result.noise == pytest.approx(0.005, rel=sampled(2 * 3 * 72))
    squares = (result.residuals[result.used] ** 2).sum(axis=1)
    assert result.rms == pytest.approx(np.sqrt(squares.mean()))
    assert any("3 of 75 samples are outliers" in line for line in result.warnings)


def test_an_axis_with_more_noise_counts_less():
    track, exact = flown(noise=0.005, seed=1, spin=0 * SPIN), flown(spin=0 * SPIN).positions
    points = track.positions + 5 * (track.positions - exact) * (1, 0, 0)
    tracks = track, kd.Track(track.times, points)
    equal, other = (kd.identify(track, BALL, free=()).deviations for track in tracks)
    ratios = [other[name] / equal[name] for name in ("x", "vx", "y", "vy", "z", "vz")]
    assert ratios == pytest.approx([6, 6, 1, 1, 1, 1], rel=0.2)


def test_residuals_that_go_together_widen_the_deviations(fitted):
    """By the correlation of neighbours; outliers have no neighbours that go with them."""
    noise = NOISY.positions - flown().positions
    smooth = np.apply_along_axis(lambda c: np.convolve(c, np.ones(5) / 5, "same"), 0, noise)
    smooth[[20, 50]] += 0.3
    track = kd.Track(NOISY.times, flown().positions + smooth)
    result = kd.identify(track, BALL, free=("spin", "drag-scale"))
    assert result.outliers == 2
    rows = np.where(result.used[:, None], result.residuals, 0.0)
    correlation = (rows[1:] * rows[:-1]).sum() / (rows * rows).sum()
    assert correlation > 0.5
    assert result.widening == pytest.approx(((1 + correlation) / (1 - correlation)) ** 0.5)
    ratio = result.noise * result.widening / fitted.noise
    for name in ("vx", "vz", "drag_scale"):
        assert result.deviations[name] == pytest.approx(ratio * fitted.deviations[name], rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [-1, 1])
def test_where_the_sum_of_squares_is_not_quadratic_the_deviation_is_that_of_its_profile(sign):
    """Two deviations away, the sum of squares is larger by about four variances of the noise."""
    up, aside = 0.4, 1.0
    velocity = 9.5 * np.cos(up) * np.array([np.cos(aside), np.sin(aside), np.tan(up)])
    brazuca = kd.Air(drag="brazuca")
    track = flown(velocity, (10.0, 8.0, -8.0), brazuca, 100.0, 0.85, 0.0024, 4)
    result = kd.identify(track, BALL, brazuca, free=("spin", "drag-scale"))
    deviation = np.sqrt(result.covariance[-1, -1])
    assert result.curved == ("drag_scale",)
    assert result.estimates[-1] == pytest.approx(1.0, abs=3.0 * deviation)
    drag = ScaledCoefficient(brazuca.drag, result.estimates[-1] + sign * 2 * deviation)
    other = kd.identify(track, BALL, replace(brazuca, drag=drag), free=("spin",))
    squares = [
        (fit.residuals**2).sum() / result.noise**2 + (fit.launch.spin**2).sum() / SPIN_SPREAD**2
        for fit in (result, other)
    ]
    assert squares[1] - squares[0] > 2.0


@pytest.mark.parametrize(("options", "message"), [
    ({"free": ("spin", "mass")}, r"'mass'.*spin, drag"), ({"free": 3}, "free is 3"),
    ({"free": ("drag", "drag-scale")}, "drag and drag-scale"),
    ({"free": ("lift-scale",), "air": kd.Air(lift=None)}, "no lift model"),
    ({"free": ("wind",), "air": kd.Air(wind=lambda z: (0, 0, 0))}, "function of height"),
    ({"track": STRAIGHT[:4]}, "4 samples"), ({"track": [STRAIGHT]}, r"kickdyn\.Track"),
    ({"track": kd.Track(STRAIGHT.times, STRAIGHT.positions / 0.3048)}, "feet"),
    ({"track": kd.Track(1000 * STRAIGHT.times, STRAIGHT.positions)}, "milliseconds"),
    ({"track": kd.Track([*STRAIGHT.times[:-1], 1e9], STRAIGHT.positions)}, r"1e\+09 s.*30 s"),
    ({"track": kd.Track(STRAIGHT.times, 0 * STRAIGHT.positions + (1, 2, 3))}, "stays at")
], ids=range(11))  # fmt: skip
def test_wrong_arguments_are_refused(options, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.identify(**{"track": STRAIGHT, "ball": BALL, **options})


DATA = Path(__file__).resolve().parents[2] / "data"
DOCS = DATA.parent / "docs" / "how-to" / "measured-impacts.md"
measured_kicks = pytest.importorskip("measured_kicks", reason="tools come with the checkout only")
pytest.importorskip("ezc3d")


@pytest.mark.parametrize("number", [0, 1])
def test_files_are_those_of_the_script_and_the_truth_is_beside_them(number):
    surface = list(measured_kicks.KICKS)[number]
    track = kd.BodyTrack.from_c3d(DATA / f"kick_{surface}.c3d")
    assert track.markers == (*measured_kicks.MARKERS, "ball")
    made = measured_kicks.record(surface, np.random.default_rng(number))  # in millimetres
    assert track.positions == pytest.approx(made, abs=1e-6, nan_ok=True)
    assert np.diff(track.times) == pytest.approx(1 / measured_kicks.RATE)
    ball = kd.Track.from_c3d(DATA / f"kick_{surface}.c3d", "ball")
    np.testing.assert_array_equal(ball.positions, track.positions[:, -1])
    np.testing.assert_array_equal(ball.times, track.times)
    turned = kd.BodyTrack.from_c3d(DATA / f"kick_{surface}.c3d", up="y").positions[0, -1]
    assert turned.tolist() == (track.positions[0, -1, [0, 2, 1]] * (1, -1, 1)).tolist()
    with pytest.raises(kd.InvalidInput, match=r"'head'.*RASI"):
        kd.Track.from_c3d(DATA / f"kick_{surface}.c3d", "head")
    hit = measured_kicks.impact(surface)
    places = [hit.posture.leg.joint_names.index(joint) for joint in ("hip", "knee", "ankle")]
    truth = [np.linalg.norm(hit.foot_velocity), hit.ball_after.speed]
    truth += np.linalg.norm(hit.joint_impulses[places, :3], axis=1).tolist()
    rows = re.findall(r"\| (\d+\.\d+) \| (\d+\.\d+) \|", (DATA / "README.md").read_text("utf-8"))
    assert [float(row[number]) for row in rows] == pytest.approx(truth, rel=1e-3)  # digits


def test_the_ground_of_a_measured_match_is_as_fifa_requires():
    """A rebound of 0.6 to 1.0 m from 2 m, and a roll of 4 to 10 m from a ramp 1 m high."""
    track = kd.Track.from_csv(DATA / "match_ball.csv")[:1500]
    found = kd.segments(track)
    low, high = np.sqrt([0.6 / 2.0, 1.0 / 2.0])
    assert found.restitution.deviation < 0.075
    longest, shortest = GRAVITY * 1.0 / (1.0 + 2.0 / 3.0) / np.array([10.0, 4.0])  # of a shell
    limits = (found.restitution, low, high), (found.rolling_deceleration, longest, shortest)
    for measured, least, most in limits:
        spread = 2.0 * measured.deviation
        assert least - spread < measured.median < most + spread


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
    ("drag", 0.25, 0.1), ("drag_scale", 1.2, 0.5), ("lift_scale", 1.2, 0.5), ("wind_x", 8.0, 3.0),
    ("wind_y", -8.0, 3.0), ("drag", 0.1, 0.05),  # half the value
    ("wind_x", 0.1, 0.15), ("back_spin", 0.5, 1.0), ("drag", 0.0, 0.005),  # near zero
])  # fmt: skip
def test_a_value_is_given_up_to_a_deviation(name, value, largest):
    """About half of what it usually is; half the value; a twentieth of the first near zero."""
    for share, is_given in ((0.99, True), (1.01, False)):
        fit = result({name: value}, [share * largest])
        assert fit.values == ({name: value} if is_given else {}), share
        assert set(fit.undetermined) == (set() if is_given else {name}), share
