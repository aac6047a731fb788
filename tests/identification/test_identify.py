"""Launch, spin, drag, lift and wind from tracks whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.identification.identify import Free, _Problem, flight_axes

BALL = kd.Ball()


def flown(velocity, spin, air, rate=50.0, longest=1.5, start=(1.0, -2.0, 0.3)):
    """Return a track without noise."""
    path = kd.fly(kd.BallState(start, velocity, spin), BALL, air, tol=1e-11)
    times = np.arange(0.0, min(path.duration, longest), 1.0 / rate)
    return kd.Track(3.0 + times, path.sample(times).position)


STRAIGHT = flown((20, 3, 8), (0, 0, 0), kd.Air())
"""Without spin: lift can accelerate a ball as gravity does in feet."""


def scaled_by(track, factor):
    """Return times and scaled positions of a track."""
    return track.times, factor * track.positions


@pytest.fixture(scope="module")
def curving():
    return flown((20, 3, 8), (5, -50, 20), kd.Air())


def test_a_track_without_noise_gives_the_truth(curving):
    found = kd.identify(curving, BALL, kd.Air(), free=("spin", "drag-scale"))
    assert found.launch.velocity == pytest.approx([20, 3, 8], rel=1e-6)
    assert found.launch.spin == pytest.approx([5, -50, 20], rel=1e-6)
    assert found.launch.position == pytest.approx([1, -2, 0.3], abs=1e-7)
    assert found.launch.time == 3.0
    assert found.values["drag_scale"] == pytest.approx(1.0, rel=1e-6)
    axes = flight_axes(np.array([20.0, 3.0, 8.0]))
    names = ("back_spin", "side_spin", "gyro_spin")
    assert [found.values[n] for n in names] == pytest.approx(axes.T @ [5, -50, 20], rel=1e-6)
    assert found.rms < 1e-7
    assert found.undetermined == {}


def test_times_may_count_from_1970():
    """The clocks of computers do: a time of 1.7e9 s is exact to 2.4e-7 s."""
    late = kd.Track(1.7e9 + STRAIGHT.times, STRAIGHT.positions)
    found = kd.identify(late, BALL, kd.Air(), free=("drag-scale",))
    assert found.launch.velocity == pytest.approx([20, 3, 8], rel=1e-4)
    assert found.launch.time == 1.7e9 + 3.0


def test_drag_wind_and_lift_of_a_flight():
    air = kd.Air(wind=(2.0, -1.0, 0.5), drag=constant(0.25))
    track = flown((20, 3, 8), (0, -60, 20), air)
    found = kd.identify(
        track, BALL, kd.Air(wind=(0, 0, 0.5)), free=("spin", "drag", "lift-scale", "wind")
    )
    for name, value in {"drag": 0.25, "lift_scale": 1.0, "wind_x": 2.0, "wind_y": -1.0}.items():
        assert found.values[name] == pytest.approx(value, rel=1e-5)
    assert found.launch.velocity[0] == pytest.approx(20)


def test_without_spin_the_ball_does_not_turn():
    found = kd.identify(STRAIGHT, BALL, kd.Air(), free=("drag-scale",))
    assert found.values["drag_scale"] == pytest.approx(1.0, rel=1e-6)
    assert "back_spin" not in found.names
    assert not found.launch.spin.any()


def test_outliers_are_left_out_and_named(curving):
    rng = np.random.default_rng(3)
    points = curving.positions + rng.normal(0.0, 0.005, curving.positions.shape)
    points[[10, 30, 50]] += 0.4
    found = kd.identify(kd.Track(curving.times, points), BALL, free=("spin", "drag-scale"))
    assert [*np.flatnonzero(~found.used)] == [10, 30, 50]
    assert found.noise == pytest.approx(0.005, rel=0.2)
    assert any("3 of 75 samples are outliers" in line for line in found.warnings)
    assert "not used" not in str(found)


def test_what_a_short_flight_does_not_determine_is_no_number():
    track = flown((10, 0, 3), (0, 0, 0), kd.Air(), longest=0.3)
    rng = np.random.default_rng(5)
    noisy = kd.Track(track.times, track.positions + rng.normal(0, 0.02, track.positions.shape))
    found = kd.identify(noisy, BALL)
    assert {"drag", "gyro_spin"} <= {*found.undetermined}
    assert "drag" not in found.values
    assert "not determined" in str(found)
    assert found.warnings[0].startswith("not determined by the measurement: ")
    assert "drag" in found.warnings[0]


def test_what_is_less_than_twice_its_deviation_is_no_number(curving):
    """Also the spin along a flight, which has no force; a small deviation of zero is a number."""
    rng = np.random.default_rng(2)
    points = curving.positions + rng.normal(0.0, 0.02, curving.positions.shape)
    found = kd.identify(kd.Track(curving.times, points), BALL, free=("spin", "drag-scale"))
    assert "gyro_spin" in found.undetermined
    assert found.values["drag_scale"] > 2.0 * found.deviations["drag_scale"]
    for name in set(found.values) & {"back_spin", "side_spin"}:
        assert found.deviations[name] < max(0.5 * abs(found.values[name]), 1.0)
    covariance = np.diag([0.9] * len(found.names)) ** 2
    exact = replace(found, estimates=0.1 * found.estimates, covariance=covariance)
    assert {*exact.undetermined} == {"drag_scale"}
    covariance = np.diag([25.0] * len(found.names)) ** 2
    loose = replace(found, estimates=1e3 * found.estimates, covariance=covariance)
    assert {"back_spin", "side_spin", "gyro_spin"} <= {*loose.undetermined}


def test_what_is_no_flight_is_fitted_with_a_warning():
    times = np.linspace(0.0, 2.0, 20)
    rolling = np.column_stack([5.0 * times - times**2, 0.0 * times, 0.0 * times + 0.11])
    found = kd.identify(kd.Track(times, rolling), BALL, free=("drag",))
    assert any("may not be one flight" in line for line in found.warnings)


def test_drag_below_0_is_warned_of():
    times = np.arange(0.0, 1.0, 0.02)
    pushed = np.column_stack([20 * times + times**2, 0.3 * times, 8 * times - 4.905 * times**2])
    found = kd.identify(kd.Track(times, pushed), BALL, kd.Air(lift=None), free=("drag",))
    (line,) = [line for line in found.warnings if "below 0" in line]
    assert line.startswith(f"drag is {found.values['drag']:.2g}, below 0")
    assert all(line in str(found) for line in found.warnings)


def test_the_truth_lies_in_the_region_as_often_as_it_says():
    """Its squared residuals exceed the least ones as chi-squared with 10 degrees of freedom."""
    excesses = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        speed, up, aside = rng.uniform(8, 35), rng.uniform(0.1, 0.8), rng.uniform(0, 6.3)
        velocity = speed * np.array(
            [np.cos(up) * np.cos(aside), np.cos(up) * np.sin(aside), np.sin(up)]
        )
        spin = rng.normal(size=3)
        spin *= rng.uniform(0, 100) / np.linalg.norm(spin)
        true = flown(velocity, spin, kd.Air(drag=constant(rng.uniform(0.15, 0.4))))
        noise = rng.uniform(0.002, 0.03)
        measured = true.positions + rng.normal(0.0, noise, true.positions.shape)
        found = kd.identify(kd.Track(true.times, measured), BALL)
        miss = (true.positions - measured)[found.used]
        excess = (miss**2).sum() - (found.residuals[found.used] ** 2).sum()
        prior = (spin @ spin - found.launch.spin @ found.launch.spin) / 100.0**2
        excesses.append(excess / found.noise**2 + prior)
    assert np.sum(np.array(excesses) < chi2.ppf(0.95, 10)) >= 11
    assert np.mean(excesses) == pytest.approx(10.0, abs=3 * (20 / 12) ** 0.5)


def test_residuals_that_go_together_widen_the_deviations(curving):
    rng = np.random.default_rng(8)
    white = rng.normal(0.0, 0.01, curving.positions.shape)
    smooth = np.apply_along_axis(lambda c: np.convolve(c, np.ones(5) / 5, "same"), 0, white)
    free = ("spin", "drag-scale")
    found = kd.identify(kd.Track(curving.times, curving.positions + smooth), BALL, free=free)
    rows = found.residuals
    assert found.used.all()
    correlation = (rows[1:] * rows[:-1]).sum() / (rows * rows).sum()
    assert correlation > 0.5
    assert found.widening == pytest.approx(((1 + correlation) / (1 - correlation)) ** 0.5)
    assert any("neighbouring residuals" in line for line in found.warnings)
    plain = kd.identify(kd.Track(curving.times, curving.positions + white), BALL, free=free)
    assert plain.widening == 1.0
    ratio = found.noise * found.widening / plain.noise
    for name, deviation in plain.deviations.items():
        assert found.deviations[name] == pytest.approx(ratio * deviation, rel=0.15), name
    smooth[[20, 50]] += 0.3  # outliers have no neighbours that go with them
    other = kd.identify(kd.Track(curving.times, curving.positions + smooth), BALL, free=free)
    assert other.outliers == 2
    assert other.widening == pytest.approx(found.widening, rel=0.1)


def test_the_noise_of_short_flights_is_that_of_their_coordinates():
    """With 21 coordinates and 9 unknowns, the mean square residual is 12 / 21 of the variance."""
    noises = []
    for seed in range(12):
        true = flown((20, 3, 8), (0, 0, 0), kd.Air(lift=None), rate=7.0, longest=1.0)
        rng = np.random.default_rng(seed)
        measured = kd.Track(true.times, true.positions + rng.normal(0, 0.01, true.positions.shape))
        found = kd.identify(measured, BALL, kd.Air(lift=None), free=("drag", "wind"))
        assert found.used.sum() >= 6
        noises.append(found.noise**2)
    assert np.sqrt(np.mean(noises)) == pytest.approx(0.01, rel=0.15)


def test_the_covariance_is_that_of_repeated_measurements():
    """Mahalanobis' distance of the truth is that of chi-squared; a gyro spin has no force."""
    air = kd.Air(drag=0.25)
    true = flown((20, 3, 8), (15, -70, 30), air, rate=100.0, longest=1.0)
    axes = flight_axes(np.array([20.0, 3.0, 8.0]))
    truth = np.array([*true.positions[0], 20, 3, 8, *axes.T @ [15, -70, 30], 0.25])
    rng, estimates, distances = np.random.default_rng(2), [], []
    for _ in range(14):
        points = true.positions + rng.normal(0.0, 0.002, true.positions.shape)
        found = kd.identify(kd.Track(true.times, points), BALL)
        estimates.append(found.estimates)
        error = found.estimates - truth
        distances.append(error @ np.linalg.solve(found.covariance, error))
    deviations = np.sqrt(np.diag(found.covariance))
    assert np.std(estimates, axis=0) == pytest.approx(deviations, rel=0.5)
    assert np.mean(distances) == pytest.approx(10.0, abs=3 * (20 / 14) ** 0.5)
    assert deviations[8] > 5 * max(deviations[6:8])
    assert found.deviations["drag"] == deviations[9]
    sizes = np.outer(deviations, deviations)
    assert found.correlations == pytest.approx(found.covariance / sizes)


def crisis(speed, up, aside, spin, rate, longest, noise):
    """Return a noisy track of a slow ball, whose drag coefficient falls steeply with the speed."""
    level = speed * np.cos(up)
    velocity = level * np.cos(aside), level * np.sin(aside), speed * np.sin(up)
    true = flown(velocity, spin, kd.Air(drag="brazuca"), rate, longest)
    rng = np.random.default_rng(4)
    return kd.Track(true.times, true.positions + rng.normal(0.0, noise, true.positions.shape))


@pytest.mark.parametrize(
    ("track", "curved"),
    [
        (crisis(8.4, 0.45, 3.79, (-4.5, -2.6, -4.7), 240.0, 0.73, 0.0012), ()),
        (crisis(9.5, 0.4, 1.0, (10.0, 8.0, -8.0), 100.0, 0.85, 0.0024), ("drag_scale",)),
    ],
)
def test_a_sum_of_squares_that_is_not_quadratic_gives_no_small_deviation(track, curved):
    """In a linear fit, the scales are 71 and 13 deviations off: a side minimum, a curved valley."""
    found = kd.identify(track, BALL, kd.Air(drag="brazuca"), free=("spin", "drag-scale"))
    deviation = np.sqrt(found.covariance[-1, -1])
    assert abs(found.estimates[-1] - 1.0) < 3.0 * deviation
    assert deviation < 0.5
    assert found.curved == curved
    assert bool(curved) == any("not quadratic" in line for line in found.warnings)


def test_a_profile_does_not_depend_on_the_axes():
    """Deviations of back and side spin are those of the flight, wherever it goes."""
    track = crisis(13.0, 0.5, 2.5, (30.0, 20.0, 10.0), 100.0, 0.5, 0.002)
    turned = kd.Track(track.times, track.positions[:, [1, 0, 2]] * [-1, 1, 1])
    plain, other = (
        kd.identify(flight, BALL, kd.Air(drag="brazuca"), free=("spin", "drag-scale"))
        for flight in (track, turned)
    )
    assert plain.curved == other.curved == ("back_spin",)
    sizes = [np.sqrt(np.diag(found.covariance))[6:] for found in (plain, other)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-3)


def test_a_flight_that_cannot_be_integrated_is_an_error(curving):
    def broken(reynolds, spin_parameter):
        raise ArithmeticError("no coefficient")

    with pytest.raises(kd.KickdynError, match="the flight cannot be integrated: no coefficient"):
        kd.identify(curving, BALL, kd.Air(lift=broken))


def test_a_fit_does_not_go_far_beyond_any_ball(curving):
    air = kd.Air()
    problem = _Problem(curving, BALL, air, (Free.SPIN, Free.DRAG_SCALE))
    start = [*curving.positions[0], 9.0, 1.0, 5.0, 0.0, 0.0, 0.0, 1.0]
    assert problem.evaluate(1e-6, np.array(start))[0].size == curving.positions.size
    for place, value in ((3, 1e5), (5, -1e5), (9, 1e5)):
        far = np.array(start)
        far[place] = value
        with pytest.raises(kd.KickdynError, match="a speed or a coefficient far beyond any ball's"):
            problem.evaluate(1e-6, far)


def test_plot_and_representations(curving):
    found = kd.identify(curving, BALL, free=("spin", "drag-scale"))
    assert len(found.plot().axes) == 3
    html = kd.page(found).html
    assert "positions per flight" in html
    assert "from the first sample" in html
    assert found.flight.launch.velocity == pytest.approx(found.launch.velocity)
    assert found.correlations.shape == (10, 10)
    assert np.diag(found.correlations) == pytest.approx(np.ones(10))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: (t.times[:4], t.positions[:4]), "4 samples: at least 5"),
        (lambda t: (t.times, 1000 * t.positions), "as in millimetres"),
        (lambda t: (1000 * t.times, t.positions), "as in milliseconds"),
        (
            lambda t: ([*t.times[:-1], 1e9], t.positions),
            r"the samples last 1e\+09 s, but no flight takes more than 30 s",
        ),
        (lambda t: (t.times, 0 * t.positions + 1), "the ball stays at"),
        (
            lambda t: (t.times, 100 * t.positions),
            r"as in centimetres \(100 per metre\) or inches \(39.37 per metre\)",
        ),
        (lambda t: scaled_by(STRAIGHT, 1 / 0.3048), "as in feet"),
        (lambda t: (t.times, t.positions / 0.0254), "as in inches"),
    ],
)
def test_what_is_no_flight_in_metres_is_refused(curving, change, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.identify(kd.Track(*change(curving)), BALL)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"free": ("spin", "mass")}, "free is 'mass': it must be one of spin, drag"),
        ({"free": ("drag", "drag-scale")}, "drag and drag-scale"),
        ({"free": 3}, "free is 3"),
        ({"free": ("lift-scale",), "air": kd.Air(lift=None)}, "no lift model"),
        ({"free": ("wind",), "air": kd.Air(wind=lambda z: (0, 0, 0))}, "function of height"),
        ({"air": 1.2}, "air is 1.2"),
    ],
)
def test_wrong_arguments_are_refused(curving, options, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.identify(curving, BALL, **options)


def test_what_is_no_track_is_refused():
    for track in (None, [], [STRAIGHT], "track.csv"):
        with pytest.raises(kd.InvalidInput, match=r"kickdyn\.Track"):
            kd.identify(track, BALL)
