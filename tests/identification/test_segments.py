"""Tracks of known courses, cut into flights, rolling and touches."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from tolerances import agrees, closed_form, sampled

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY
from kickdyn.identification.segments import Measured, SegmentKind, Segments, _median, _noise

BALL = kd.Ball()
GROUND = kd.Ground(surface=kd.Surface("test", 0.6, 0.5, 0.8))
FLIGHT, ROLLING, REST = SegmentKind.FLIGHT, SegmentKind.ROLLING, SegmentKind.REST


def tracked(path, times, noise=0.0, seed=1):
    points = path.sample(times).position
    return kd.Track(times, points + np.random.default_rng(seed).normal(0.0, noise, points.shape))


def course(seed):
    """Return a noisy track of a kick, its bounces and a touch in the air, and the cuts' times."""
    rng = np.random.default_rng(seed)
    rate, noise = rng.uniform(40, 120), rng.uniform(0.002, 0.01)
    velocity = rng.uniform(8, 20), rng.uniform(-3, 3), rng.uniform(4, 8)
    kick = kd.BallState((0, 0, BALL.radius), velocity, rng.uniform(-30, 30, 3))
    before = kd.fly(kick, BALL, kd.Air(), GROUND)
    cut = 0.7 * before.duration
    velocity = rng.uniform(-12, -6), rng.uniform(-3, 3), rng.uniform(1, 4)
    header = kd.BallState(before.sample(cut).position, velocity)
    after = kd.follow(header, BALL, kd.Air(), GROUND)
    bounces = [cut + float(b.time) for b in after.bounces[:2]]
    times = np.arange(0.0, min(bounces[1] + 0.25, cut + after.duration), 1 / rate)
    flown = before.sample(np.minimum(times, cut)).position
    later = after.sample(np.clip(times - cut, 0.0, after.duration)).position
    points = np.where(times[:, None] < cut, flown, later)
    return kd.Track(times, points + rng.normal(0.0, noise, points.shape)), [cut, *bounces]


@pytest.mark.parametrize("seed", range(8))
def test_cuts_are_found_within_two_samples(seed):
    """Single spikes cut nothing, and a tracker that smooths over five samples moves no cut."""
    track, cuts = course(seed)
    points = uniform_filter1d(track.positions, 5 if seed in (1, 5) else 1, axis=0)
    points[[20, 40]] += 0.5 * (seed % 2)
    found = kd.segments(kd.Track(track.times, points), BALL, GROUND)
    assert [part.kind for part in found.parts] == [FLIGHT] * 4
    assert [part.begins for part in found.parts] == ["start", "touch", "bounce", "bounce"]
    places = [int(np.searchsorted(track.times, cut)) for cut in cuts]
    assert [part.first for part in found.parts[1:]] == pytest.approx(places, abs=2)
    assert [part.start for part in found.parts[1:]] == pytest.approx(cuts, abs=0.02)
    assert [part.last for part in found.parts[:-1]] == [part.first for part in found.parts[1:]]
    assert found.restitution.median == pytest.approx(0.6, abs=0.05)


def test_rolling_gives_its_deceleration_and_the_surface():
    kick = kd.BallState((0, 0, BALL.radius + 1.0), (6, 0, 0))
    path = kd.follow(kick, BALL, kd.Air(), GROUND)
    found = kd.segments(tracked(path, np.arange(0.0, path.duration, 0.02), 0.003), BALL, GROUND)
    assert found.parts[0].kind is FLIGHT
    assert ROLLING in {part.kind for part in found.parts}
    surface = found.surface
    assert surface.restitution == pytest.approx(0.6, abs=0.03)
    assert surface.rolling_deceleration == pytest.approx(0.8, rel=0.15)
    assert surface.friction == found.friction.median > 0.3
    assert surface.deviations == {
        name: getattr(found, name).deviation for name in ("restitution", "rolling_deceleration")
    }  # a lower bound of friction has none
    assert found.rolling_deceleration.deviation == pytest.approx(0.3)  # of one part
    kd.follow(kick, BALL, None, kd.Ground(surface=surface))


def test_drag_is_no_rolling_deceleration():
    """A light ball that rolls at 4 m/s is slowed more by the air than by the ground."""
    light, air = kd.Ball(0.05), kd.Air(drag=0.4)
    path = kd.follow(kd.BallState((0, 0, light.radius), (6, 0, 0)), light, air, GROUND)
    track = tracked(path, np.arange(0.0, 1.0, 0.02))
    found = [kd.segments(track, light, GROUND, medium) for medium in (air, kd.Air(drag=None))]
    with_air, without = (one.rolling_deceleration.median for one in found)
    assert with_air == pytest.approx(0.8, rel=0.1)
    area, speed = np.pi * light.radius**2, path.sample(0.75).speed
    drag = 0.5 * 1.2 * speed**2 * area * 0.4 / (light.mass + light.inertia / light.radius**2)
    assert without - with_air == pytest.approx(drag, rel=0.1)


@pytest.mark.parametrize(("count", "deviation"), [(41, 0.001), (41, 0.05), (1, 0.05), (2, 0.05)])
def test_the_deviation_of_a_median_is_that_of_simulated_medians(count, deviation):
    """Of many values by their spread, of few by their own deviations."""
    values = np.random.default_rng(3).normal(0.6, 0.05, (1500, count))
    medians = [_median([(value, deviation) for value in row]) for row in values]
    spread = np.std([one.median for one in medians])
    assert np.median([one.deviation for one in medians]) == pytest.approx(spread, rel=sampled(3000))


def bounce_of_a_parabola(down, up, count, height=0.0, braked=0.0):
    """Return times and points of a ball that bounces in the middle of a second, at 5 m/s."""
    times = np.arange(count) / count
    t = times - 0.5
    z = np.where(t < 0.0, -down * t, up * t) - GRAVITY / 2 * t**2 + height + BALL.radius
    return times, np.column_stack([5 * times - braked * np.maximum(t, 0.0), 0 * times, z])


@pytest.mark.parametrize(("rate", "end"), [(50, 1.0), (200, 0.65)])
def test_the_deviation_of_a_restitution_has_the_size_of_its_error(rate, end):
    """Of one bounce with a coordinate's noise of 0.02 m, also of a ball that is soon touched."""
    rng, errors, deviations = np.random.default_rng(5), [], []
    times, points = (rows[: round(end * rate)] for rows in bounce_of_a_parabola(8.45, 5.07, rate))
    for _ in range(60):
        noisy = kd.Track(times, points + rng.normal(0.0, 0.02, points.shape))
        found = kd.segments(noisy, BALL).restitution
        errors.append(found.median - 0.6)
        deviations.append(found.deviation)
    assert np.mean(deviations) == pytest.approx(np.sqrt(np.mean(np.square(errors))),
                                                rel=sampled(120, 3.0))  # fmt: skip


@pytest.mark.parametrize(("height", "braked", "up", "reason"), [
    (0.24, 0.0, 4.0, "bounce"), (0.255, 0.0, 4.0, "touch"), (0.0, 9.9, 4.0, "bounce"),
    (0.0, 10.1, 4.0, "touch"), (0.0, 0.0, 6.1, "bounce"), (0.0, 0.0, 6.5, "touch"),
])  # fmt: skip
def test_a_bounce_is_near_the_ground_with_friction_of_1_at_most(height, braked, up, reason):
    """The height is that of the ball's centre above rest; it rises no faster than it came down."""
    track = kd.Track(*bounce_of_a_parabola(6.0, up, 100, height, braked))
    part = kd.segments(track, BALL).parts[1]
    assert part.begins == reason
    fall = GRAVITY * (part.start - 0.5)
    agrees(part.velocity_before, [5.0, 0.0, -6.0 - fall], closed_form(1e4))
    agrees(part.velocity_after, [5.0 - braked, 0.0, up - fall], closed_form(1e4))


def bouncing(friction, seed, noise=0.002, noises=1):
    """Return a track of a spinning ball through three bounces, at 120 Hz."""
    rng = np.random.default_rng(seed)
    velocity = (rng.uniform(8, 20), rng.uniform(-3, 3), rng.uniform(3, 8))
    kick = kd.BallState((0, 0, 0.6), velocity, rng.uniform(-10, 10, 3))
    ground = kd.Ground(surface=kd.Surface("test", 0.6, friction, 0.8))
    path = kd.follow(kick, BALL, kd.Air(), ground)
    return tracked(path, np.arange(0.0, path.bounces[3].time, 1 / 120), noise, noises)


@pytest.mark.parametrize("seed", range(3))
def test_friction_of_a_ball_that_slides_is_measured(seed):
    friction = kd.segments(bouncing(0.2, seed), BALL).friction
    assert not friction.is_lower_bound
    assert friction.median == pytest.approx(0.2, abs=0.02)
    grass = 0.05 * (1.2533 if friction.samples > 2 else 1.0) / friction.samples**0.5
    assert friction.deviation == pytest.approx(grass, rel=0.2)  # little noise


def thrown(times, up=GRAVITY):
    return np.column_stack([10 * times, 0 * times, 1 + up * times - GRAVITY / 2 * times**2])


@pytest.mark.parametrize(("duration", "margin"), [(2.0, 0.1), (0.5, 0.05)])
def test_flights_leave_out_the_samples_near_their_cuts(duration, margin):
    """0.1 s at each end, of short flights a tenth."""
    times = np.linspace(0.0, duration, round(100 * duration) + 1)
    (flight,) = kd.segments(kd.Track(times, thrown(times, duration * GRAVITY / 2)), BALL).flights
    assert flight.times[[0, -1]] == pytest.approx([margin, duration - margin], abs=0.011)
    assert margin < flight.times[0]
    assert flight.times[-1] < duration - margin


def test_a_gap_of_a_quarter_second_and_a_ball_that_stays_down_begin_a_part():
    seen = np.delete(np.linspace(0.0, 2.0, 201), slice(100, 125))
    times, points = bounce_of_a_parabola(5.0, 0.0, 100)
    points[times > 0.5, 2] = BALL.radius
    for track, begins in (
        (kd.Track(seen, thrown(seen)), ["start", "gap"]),
        (kd.Track(times, points), ["start", "landing"]),
    ):
        found = kd.segments(track, BALL)
        assert [part.begins for part in found.parts] == begins
        assert (found.parts[1].velocity_before is None) == ("gap" in begins)
    assert (found.parts[1].kind, len(found.flights)) == (ROLLING, 1)


def test_the_noise_of_a_track_is_that_of_its_samples():
    times, noise = np.arange(500) / 100, np.random.default_rng(1).normal(0.0, 0.02, (500, 3))
    assert _noise(kd.Track(times, thrown(times) + noise)) == pytest.approx(0.02, rel=sampled(1000))


def test_a_tenth_of_the_samples_may_be_under_the_ground():
    times, shares = np.arange(1000) / 100, (0.98, 1.02)
    few, many = (kd.Track(times, np.outer(times < share, (0, 0, -0.26))) for share in shares)
    kd.segments(few, BALL, GROUND)
    with pytest.raises(kd.InvalidInput, match="under the ground"):
        kd.segments(many, BALL, GROUND)


@pytest.mark.parametrize(("speed", "kind"), [(0.29, REST), (0.31, ROLLING)])
@pytest.mark.parametrize("below", [-0.21, 0.21])
def test_a_ball_on_the_ground_rests_or_rolls(speed, kind, below):
    """A tracker may be off by less than 0.25 m."""
    times = np.arange(0.0, 1.5, 0.01)
    places = np.column_stack([speed * times, 0.0 * times, np.full(150, BALL.radius - below)])
    track = kd.Track(times, places + np.random.default_rng(1).normal(0, 1e-4, places.shape))
    found = kd.segments(track, BALL, GROUND)
    assert ({part.kind for part in found.parts}, found.warnings) == ({kind}, ())


def test_what_is_no_surface_is_refused():
    track, measured = kd.Track([0.0], [(0, 0, 0)]), Measured(0.5, 0.1, 1)
    back = measured._replace(median=-0.5)
    for bounce, rolling, words in (
        (measured, back, "accelerates"), (None, measured, "no bounce"), (measured, None, "no part"),
    ):  # fmt: skip
        with pytest.raises(kd.InvalidInput, match=words):
            _ = Segments(track, (), bounce, bounce, rolling, ()).surface


@pytest.mark.parametrize("turned", [[0, 1, 2], [0, 2, 1], [2, 1, 0]], ids=["z", "y", "x"])
def test_a_track_whose_z_is_not_up_is_named(turned):
    times = np.arange(0.0, 1.0, 0.01)
    warnings = kd.segments(kd.Track(times, thrown(times)[:, turned]), BALL).warnings
    assert any("never falls along z" in line for line in warnings) == (turned != [0, 1, 2])


def test_a_lower_bound_is_two_deviations_below_the_largest():
    bound = Measured(0.5, 0.1, 3, is_lower_bound=True)
    assert str(bound) == "at least 0.3 (of 3 bounces)"
    assert str(bound._replace(deviation=0.3, samples=1)) == "at least 0 (of 1 bounce)"
