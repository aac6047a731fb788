"""Tracks of known courses, cut into flights, rolling and touches."""

import re

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.identification.segments import _median
from kickdyn.identification.segments_result import CutReason, SegmentKind

BALL = kd.Ball()
GROUND = kd.Ground(surface=kd.Surface("test", 0.6, 0.5, 0.8))


def course(seed):
    """Return a noisy track of a kick, its bounces and a touch in the air, and the cuts' times."""
    rng = np.random.default_rng(seed)
    rate, noise = rng.uniform(40, 120), rng.uniform(0.002, 0.01)
    kick = kd.BallState(
        (0, 0, BALL.radius),
        (rng.uniform(8, 20), rng.uniform(-3, 3), rng.uniform(4, 8)),
        rng.uniform(-30, 30, 3),
    )
    first = kd.fly(kick, BALL, kd.Air(), GROUND)
    times, points = [], []
    header = kd.BallState(
        first.sample(0.7 * first.duration).position,
        (rng.uniform(-12, -6), rng.uniform(-3, 3), rng.uniform(1, 4)),
    )
    second = kd.follow(header, BALL, kd.Air(), GROUND)
    cut = 0.7 * first.duration
    bounces = [cut + float(b.time) for b in second.bounces[:2]]
    end = min(bounces[1] + 0.25, cut + second.duration)
    times = np.arange(0.0, end, 1 / rate)
    points = np.where(
        (times < cut)[:, None],
        first.sample(np.minimum(times, cut)).position,
        second.sample(np.clip(times - cut, 0.0, second.duration)).position,
    )
    track = kd.Track(times, points + rng.normal(0.0, noise, points.shape))
    return track, [cut, *bounces]


@pytest.mark.parametrize("seed", range(12))
def test_cuts_are_found_within_two_samples(seed):
    track, cuts = course(seed)
    found = kd.segments(track, BALL, GROUND)
    where = [int(np.searchsorted(track.times, cut)) for cut in cuts]
    assert [part.kind for part in found.parts] == [SegmentKind.FLIGHT] * 4
    assert [part.begins for part in found.parts] == [
        CutReason.START, CutReason.TOUCH, CutReason.BOUNCE, CutReason.BOUNCE,
    ]  # fmt: skip
    assert [part.first for part in found.parts[1:]] == pytest.approx(where, abs=2)
    assert [part.start for part in found.parts[1:]] == pytest.approx(cuts, abs=0.02)
    assert found.restitution.median == pytest.approx(0.6, abs=0.05)


def test_rolling_gives_its_deceleration_and_the_surface():
    kick = kd.BallState((0, 0, BALL.radius + 1.0), (6, 0, 0))
    path = kd.follow(kick, BALL, kd.Air(), GROUND)
    times = np.arange(0.0, path.duration, 0.02)
    rng = np.random.default_rng(2)
    points = path.sample(times).position + rng.normal(0, 0.003, (len(times), 3))
    found = kd.segments(kd.Track(times, points), BALL, GROUND)
    assert found.parts[0].kind is SegmentKind.FLIGHT
    assert SegmentKind.ROLLING in {part.kind for part in found.parts}
    surface = found.surface
    assert surface.restitution == pytest.approx(0.6, abs=0.03)
    assert surface.rolling_deceleration == pytest.approx(0.8, rel=0.15)
    assert surface.deviations.keys() == {"restitution", "rolling_deceleration"}
    assert surface.friction == found.friction.median > 0.3
    assert surface.deviations["restitution"] == found.restitution.deviation
    assert surface.deviations["rolling_deceleration"] == found.rolling_deceleration.deviation
    assert found.rolling_deceleration.deviation == pytest.approx(0.3)  # of one part
    kd.follow(kick, BALL, None, kd.Ground(surface=surface))
    assert re.search(r"restitution: 0.[56].* \(of 2 bounces\)", str(found))
    assert re.search(r"rolling deceleration: .* m/s2 \(of 1 rolling part\)", str(found))


def test_a_ball_that_rolls_faster_and_faster_gives_no_surface():
    path = kd.follow(kd.BallState((0, 0, 0.6), (6, 0, 2)), BALL, kd.Air(), GROUND)
    times = np.arange(0.0, path.duration - 1.0, 0.02)
    points = path.sample(times).position.copy()
    points[:, 0] += 1.5 * np.maximum(times - 2.0, 0.0) ** 2  # downhill
    found = kd.segments(kd.Track(times, points), BALL)
    assert found.rolling_deceleration.median < 0.0
    with pytest.raises(kd.InvalidInput, match=r"accelerates by 2.* m/s2: .* z axis of the track"):
        _ = found.surface


def test_drag_is_no_rolling_deceleration():
    """A light ball that rolls at 4 m/s is slowed more by the air than by the ground."""
    light, air = kd.Ball(0.05), kd.Air(drag=0.4)
    path = kd.follow(kd.BallState((0, 0, light.radius), (6, 0, 0)), light, air, GROUND)
    times = np.arange(0.0, 1.0, 0.02)
    track = kd.Track(times, path.sample(times).position)
    found = kd.segments(track, light, GROUND, air).rolling_deceleration
    without = kd.segments(track, light, GROUND, kd.Air(drag=None)).rolling_deceleration
    assert found.median == pytest.approx(0.8, rel=0.1)
    assert without.median > 1.5 * found.median


@pytest.mark.parametrize(("count", "deviation"), [(41, 0.001), (41, 0.05), (1, 0.05), (2, 0.05)])
def test_the_deviation_of_a_median_is_that_of_simulated_medians(count, deviation):
    """Of many values by their spread, of few by their own deviations."""
    rng = np.random.default_rng(3)
    values = rng.normal(0.6, 0.05, (400, count))
    found = [_median([(value, deviation) for value in row]) for row in values]
    spread = np.std([one.median for one in found])
    assert np.median([one.deviation for one in found]) == pytest.approx(spread, rel=0.12)


def test_the_deviation_of_a_restitution_has_the_size_of_its_error():
    """Bounces of a parabola with 8 m/s downwards, and a coordinate's noise of 0.02 m."""
    rng, errors, deviations = np.random.default_rng(5), [], []
    times = np.arange(0.0, 1.0, 0.02)
    fallen = np.where(times < 0.5, times, times - 0.5)
    height = np.where(
        times < 0.5, 4.2275 - 3.5475 * fallen - 4.905 * fallen**2, 5.07 * fallen - 4.905 * fallen**2
    )
    points = np.column_stack([5 * times, 0 * times, BALL.radius + height - 1.2275 * (times < 0.5)])
    for _ in range(150):
        noisy = kd.Track(times, points + rng.normal(0.0, 0.02, points.shape))
        found = kd.segments(noisy, BALL).restitution
        errors.append(found.median - 5.07 / 8.4525)
        deviations.append(found.deviation)
    assert np.mean(deviations) == pytest.approx(np.std(errors), rel=0.1)


def bouncing(friction, seed, noise=0.002, noises=None):
    """Return a track of a spinning ball through three bounces, at 120 Hz."""
    rng = np.random.default_rng(seed)
    velocity = (rng.uniform(8, 20), rng.uniform(-3, 3), rng.uniform(3, 8))
    kick = kd.BallState((0, 0, 0.6), velocity, rng.uniform(-10, 10, 3))
    ground = kd.Ground(surface=kd.Surface("test", 0.6, friction, 0.8))
    path = kd.follow(kick, BALL, kd.Air(), ground)
    times = np.arange(0.0, path.bounces[3].time, 1 / 120)
    points = path.sample(times).position
    rng = rng if noises is None else np.random.default_rng(noises)
    return kd.Track(times, points + rng.normal(0.0, noise, points.shape))


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_a_low_bounce_is_no_touch(seed):
    """The third bounce is so low that 20 mm of noise hide it in the part after the second one."""
    parts = kd.segments(bouncing(0.5, seed, 0.02), BALL).parts
    assert [part.begins for part in parts[1:3]] == [CutReason.BOUNCE] * 2


@pytest.mark.parametrize("seed", range(3))
def test_friction_of_a_ball_that_slides_is_measured(seed):
    found = kd.segments(bouncing(0.2, seed), BALL).friction
    assert not found.is_lower_bound
    assert found.median == pytest.approx(0.2, abs=0.02)
    assert found.deviation < 0.1


def test_a_light_ball_that_drag_slows_between_two_bounces_gripped():
    """Its second bounce brakes it again, because it rolls faster than it flies."""
    light, air = kd.Ball(0.06), kd.Air(drag=0.3, lift=None)
    ground = kd.Ground(surface=kd.Surface("test", 0.9, 0.9, 0.8))
    path = kd.follow(kd.BallState((0, 0, 1.0), (25, 0, -6)), light, air, ground)
    times = np.arange(0.0, path.bounces[2].time, 0.01)
    noise = np.random.default_rng(1).normal(0.0, 0.002, (len(times), 3))
    found = kd.segments(kd.Track(times, path.sample(times).position + noise), light)
    assert found.friction.is_lower_bound


def test_the_deviation_of_friction_has_the_size_of_its_error():
    """Beside 0.05 of a bounce on grass, which this ground is not."""
    found = [kd.segments(bouncing(0.2, 4, 0.015, noises), BALL).friction for noises in range(9)]
    errors = np.array([one.median for one in found]) - 0.2
    grass = [0.05 * (1.2533 if one.samples > 2 else 1.0) / one.samples**0.5 for one in found]
    expected = np.hypot(np.sqrt(np.mean(errors**2)), np.mean(grass))
    assert not any(one.is_lower_bound for one in found)
    assert np.mean([one.deviation for one in found]) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("friction", [0.5, 0.7])
def test_friction_of_a_ball_that_grips_is_a_lower_bound(friction):
    """A ball that comes rolling to its second bounce has no slip there, and no friction acts."""
    for seed in range(2, 6):
        found = kd.segments(bouncing(friction, seed), BALL)
        bound = found.friction
        if bound.is_lower_bound:
            assert 0.2 < bound.median < friction + 0.03
            assert bound.samples == found.restitution.samples > 1
            assert f"friction: at least {bound.median - 2 * bound.deviation:.2g} (of" in str(found)
            assert "friction may be higher" in found.warnings[0]
        else:
            assert bound.median == pytest.approx(friction, abs=0.03)


@pytest.mark.parametrize(("missing", "cut"), [(0.3, True), (0.2, False)])
def test_a_gap_begins_a_part(missing, cut):
    times = np.linspace(0.0, 2.0, 101)
    points = np.column_stack([10.0 * times, 0.0 * times, 1.0 + 9.81 * times - 4.905 * times**2])
    kept = (times < 0.5) | (times > 0.5 + missing)
    found = kd.segments(kd.Track(times[kept], points[kept]), BALL)
    assert [part.begins for part in found.parts[1:]] == [CutReason.GAP] * cut


def test_single_spikes_cut_nothing():
    track, _ = course(3)
    points = track.positions.copy()
    points[[20, 40]] += 0.5
    found = kd.segments(kd.Track(track.times, points), BALL, GROUND)
    plain = kd.segments(track, BALL, GROUND)
    assert [p.first for p in found.parts] == pytest.approx([p.first for p in plain.parts], abs=1)


def test_flights_leave_out_the_samples_near_their_cuts():
    """The ball flies for 2 s: 0.1 s are left out at each end."""
    times = np.linspace(0.0, 2.0, 101)
    points = np.column_stack([10.0 * times, 0.0 * times, 1.0 + 9.81 * times - 4.905 * times**2])
    (flight,) = kd.segments(kd.Track(times, points), BALL).flights
    assert flight.times[[0, -1]] == pytest.approx([0.12, 1.88])


def test_short_flights_lose_a_tenth_at_each_end():
    times = np.linspace(0.0, 0.5, 51)
    points = np.column_stack([10.0 * times, 0.0 * times, 1.0 + 3.0 * times - 4.905 * times**2])
    (flight,) = kd.segments(kd.Track(times, points), BALL).flights
    assert flight.times[[0, -1]] == pytest.approx([0.06, 0.44])


@pytest.mark.parametrize(("height", "reason"), [(0.2, "bounce"), (0.3, "touch")])
def test_a_bounce_is_near_the_ground(height, reason):
    """The height is that of the ball's centre above rest on the ground."""
    times = np.arange(0.0, 1.0, 0.01)
    t = times - 0.5
    z = np.where(t < 0.0, -6.0 * t, 4.0 * t) - 4.905 * t**2 + height + BALL.radius
    points = np.column_stack([5.0 * times, 0.0 * times, z])
    assert kd.segments(kd.Track(times, points), BALL).parts[1].begins == reason


def test_what_a_track_does_not_show_is_none():
    path = kd.fly(kd.BallState((0, 0, 1), (10, 0, 5)), BALL)
    times = np.arange(0, path.duration, 0.02)
    found = kd.segments(kd.Track(times, path.sample(times).position), BALL)
    assert found.restitution is None
    assert found.rolling_deceleration is None
    with pytest.raises(kd.InvalidInput, match="no bounce"):
        _ = found.surface
    assert len(found.flights) == 1


def test_wrong_arguments_are_refused():
    track = kd.Track([0, 1, 2], np.zeros((3, 3)))
    with pytest.raises(kd.InvalidInput, match="at least 5"):
        kd.segments(track, BALL)
    for arguments in ((None, BALL), (track, 1), (track, BALL, 2)):
        with pytest.raises(kd.InvalidInput, match="it must be a kickdyn"):
            kd.segments(*arguments)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: 1000 * p, "as in millimetres"),
        (lambda p: p / 0.3048, "as in feet"),
        (lambda p: p / 0.0254, "as in inches"),
        (lambda p: p * [1, 1, -1], "under the ground at 0 m"),
    ],
)
def test_a_track_in_other_units_or_under_the_ground_is_refused(change, message):
    path = kd.fly(kd.BallState((0, 0, 1), (15, 2, 6)), BALL)
    times = np.arange(0, path.duration, 0.02)
    with pytest.raises(kd.InvalidInput, match=message):
        kd.segments(kd.Track(times, change(path.sample(times).position)))


@pytest.mark.parametrize("spin", [(0, 0, 0), (0, -30, 10)])
@pytest.mark.parametrize(("columns", "axis"), [([1, 2, 0], "y"), ([2, 0, 1], "x")])
def test_a_track_with_another_axis_up_is_warned_of(columns, axis, spin):
    path = kd.follow(kd.BallState((0, 0, 1), (15, 2, 6), spin), BALL, kd.Air(), GROUND)
    times = np.arange(0, path.duration, 0.02)
    found = kd.segments(kd.Track(times, path.sample(times).position[:, columns]))
    assert found.warnings[0] in str(found)
    turns = re.findall(r"t,(.,.,.) if (.) (?:points|does)", found.warnings[0])
    (named,) = (names for names, up in turns if up == axis)
    turned = found.track.positions[:, ["xyz".index(name) for name in named.split(",")]]
    assert turned == pytest.approx(path.sample(times).position)
    plain = kd.segments(kd.Track(times, path.sample(times).position))
    assert not any("along z" in line for line in plain.warnings)


@pytest.mark.parametrize("columns", [[0, 2, 1], [2, 0, 1]])
def test_a_ball_that_falls_sideways_does_not_roll(columns):
    """It moves in one plane, which is level in the track."""
    path = kd.follow(kd.BallState((0, 0, 1), (15, 0, 6)), BALL, kd.Air(), GROUND)
    times = np.arange(0, path.duration, 0.02)
    found = kd.segments(kd.Track(times, path.sample(times).position[:, columns]))
    assert "the ball never falls along z" in found.warnings[0]
    assert 0.5 < found.rolling_deceleration.median < 1.0  # of the end


def test_a_track_with_times_in_minutes_is_refused():
    path = kd.fly(kd.BallState((0, 0, 1), (15, 2, 6)), BALL)
    times = np.arange(0, path.duration, 0.02)
    with pytest.raises(kd.InvalidInput, match=r"faster than sound, .* times in seconds"):
        kd.segments(kd.Track(times / 60.0, path.sample(times).position))


def test_the_lines_have_the_numbers_of_the_parts():
    track, _ = course(3)
    found = kd.segments(track, BALL, GROUND)
    lines = str(found).splitlines()
    number = r"([-\d.]+)"
    for line, part in zip(lines[1:], found.parts, strict=False):
        words = rf"{part.kind} +{number}-{number} +{number}-{number} +{part.begins} +{number}$"
        shown = [float(text.rstrip("-")) for text in re.match(words, line).groups()]
        ends = track.times[part.first], track.times[part.last - 1]
        speed = np.linalg.norm(part.velocity_after)
        assert shown[:2] == [part.first, part.last]
        assert shown[2:] == pytest.approx([*ends, speed], abs=0.0051)
    values = {
        name: getattr(found, name) for name in ("restitution", "friction", "rolling_deceleration")
    }
    shown = [f"{name.replace('_', ' ')}: {value}" for name, value in values.items() if value]
    assert lines[1 + len(found.parts) :] == shown + [f"warning: {line}" for line in found.warnings]


@pytest.mark.parametrize(("duration", "known"), [(0.45, False), (0.8, True)])
def test_rolling_for_less_than_half_a_second_gives_no_deceleration(duration, known):
    rolling = kd.BallState((0, 0, BALL.radius), (4, 0, 0), (0, 4 / BALL.radius, 0))
    path = kd.follow(rolling, BALL, kd.Air(), GROUND)
    times = np.arange(0.0, duration, 0.01)
    noise = np.random.default_rng(1).normal(0, 1e-4, (len(times), 3))
    found = kd.segments(kd.Track(times, path.sample(times).position + noise), BALL, GROUND)
    assert {part.kind for part in found.parts} == {SegmentKind.ROLLING}
    assert (found.rolling_deceleration is not None) is known


@pytest.mark.parametrize(("speed", "kind"), [(0.1, SegmentKind.REST), (1.5, SegmentKind.ROLLING)])
@pytest.mark.parametrize("below", [0.0, 0.1, 0.4])
def test_a_ball_on_the_ground_rests_or_rolls(speed, kind, below):
    """A tracker may be off by less than 0.25 m, or the ball is under the ground."""
    times = np.arange(0.0, 1.5, 0.01)
    height = np.full(times.size, BALL.radius - below - 0.11)
    places = np.column_stack([speed * times, 0.0 * times, height])
    track = kd.Track(times, places + np.random.default_rng(1).normal(0, 1e-4, places.shape))
    if below > 0.25:
        with pytest.raises(kd.InvalidInput, match="under the ground"):
            kd.segments(track, BALL, GROUND)
    else:
        assert {part.kind for part in kd.segments(track, BALL, GROUND).parts} == {kind}
