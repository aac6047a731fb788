"""When a contact begins, from the ball's track, and what its deviation does to the results."""

import numpy as np
import pytest
from kick_motion import HIP, KNEE, LEG, PLACES, track
from tolerances import closed_form, sampled

import kickdyn as kd
from kickdyn.identification.leg_motion import (
    MEAN_TIME,
    MEAN_TIME_DEVIATION,
    ball_side,
    contact_moment,
)

BEFORE, AFTER = np.array([-4.0, 0.5, 0.0]), np.array([20.0, -1.0, 3.0])


def ball_track(force, begin=0.0, duration=2 * MEAN_TIME, noise=0.0, rate=500, seed=1):
    """Track of a ball with a contact force, as a function of the share of its time from 0 to 1."""
    fine = np.linspace(0.0, 1.0, 2001)
    share = np.cumsum(force(fine))
    path = np.cumsum(share / share[-1]) * duration / 2000
    times = np.arange(-0.15, 0.15, 1 / rate)
    inside = (times - begin) / duration
    gained = np.interp(inside, fine, path) + duration * np.maximum(inside - 1.0, 0.0)
    positions = np.outer(times, BEFORE) + np.outer(gained, AFTER - BEFORE) + (0.1, 0.0, 0.11)
    positions[:, 2] -= 0.5 * 9.81 * np.maximum(times - begin, 0.0) ** 2
    rng = np.random.default_rng(seed)
    return kd.Track(times, positions + noise * rng.normal(size=positions.shape))


@pytest.mark.parametrize("force", [np.ones_like, lambda x: np.sin(np.pi * x)], ids=["even", "sine"])
@pytest.mark.parametrize("begin", [0.0, 0.0013])
def test_a_contact_begins_its_mean_time_before_the_paths_meet(force, begin):
    """Half of 3/4 of visible 9 to 14 ms: Ball et al., ISBS 2013; Nunome et al., ISBS 2012."""
    assert pytest.approx(3 / 8 * (0.009 + 0.014) / 2, rel=0.03) == MEAN_TIME
    moment = contact_moment("contact", ball_track(force, begin))
    assert moment.time == pytest.approx(begin, abs=2e-5)
    assert moment.deviation == pytest.approx(MEAN_TIME_DEVIATION, rel=1e-3)
    for duration in (0.0068, 0.0105):
        other = contact_moment("contact", ball_track(force, begin, duration))
        assert abs(other.time - begin) < 2.0 * moment.deviation


def test_the_deviation_contains_the_scatter_by_noise():
    draws = [contact_moment("x", ball_track(np.ones_like, noise=0.03, seed=k)) for k in range(60)]
    measured = np.sqrt(np.mean([m.deviation**2 for m in draws]) - MEAN_TIME_DEVIATION**2)
    assert measured == pytest.approx(np.std([m.time for m in draws]), rel=sampled(120))


def test_the_sides_of_a_contact_are_those_of_polyfit():
    """Positions and velocities with their deviations, of quadratics through the samples."""
    path, moment = ball_track(np.ones_like, noise=2e-3), 0.004
    side = ball_side(path, "after", 0.02, 0.1, moment)
    chosen = (path.times >= 0.02) & (path.times <= 0.1)
    for axis in range(3):
        samples = path.times[chosen] - moment, path.positions[chosen, axis]
        fit, covariance = np.polyfit(*samples, 2, cov=True)
        deviations = np.sqrt(covariance.diagonal())
        right = fit[2], fit[1], deviations[2], deviations[1]
        assert [rows[axis] for rows in side] == pytest.approx(right, rel=closed_form(1e4))


def test_the_deviation_of_the_time_moves_along_the_motion():
    """Against estimates at other times: q changes by v, v by the acceleration."""
    motion = kd.fit_motion(track(500), LEG, PLACES, scale=False)
    h, deviation = 1e-4, 5e-4
    early, late = (motion.at_contact(t) for t in (-h, h))
    sure, unsure = motion.at_contact(0.0), motion.at_contact((0.0, deviation))
    change = deviation * np.concatenate([sure.v, (late.v - early.v) / (2 * h)])
    added = np.sqrt((unsure.covariance - sure.covariance).diagonal())
    knee = LEG.velocity_index("knee")
    assert added[knee] == pytest.approx(abs(change[knee]), rel=1e-3)
    fast = np.abs(change) > 1e-3
    assert added[fast] == pytest.approx(np.abs(change[fast]), rel=0.2)  # another last frame


SIDEWAYS = kd.Track(*(lambda t: (t.times, t.positions[:, [0, 2, 1]]))(ball_track(np.ones_like)))


@pytest.mark.parametrize(("contact", "message"), [
    (-0.2, r"contact is -0\.2 s: the track is from -0\.2 to -0\.02 s"), (0.0001, "track is from"),
    ((0.1, 0.2, 0.3), r"\[0.1, 0.2, 0.3\].*deviation"), ((0.1, -1.0), "deviation .* -1.0"),
    (kd.Track(np.arange(80) / 200 - 0.2, np.zeros((80, 3))), "changes by 0 m/s"),
    (ball_track(np.ones_like)[:70], r"changes by \S+ m/s.* kick"),
    (kd.Track(np.arange(4) / 100, np.zeros((4, 3))), "4 samples: at least 10"),
    (kd.Track(np.arange(10) / 100 - 0.1, np.zeros((10, 3))), "changes by 0 m/s"),
    (SIDEWAYS, r"along y.*z up")], ids=range(9))  # fmt: skip
def test_what_is_no_contact_is_refused(contact, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.fit_motion(track(50), LEG, PLACES, contact=contact)


def test_the_picture_has_the_time_from_the_contact_in_milliseconds():
    """Each line is an angle [deg] or speed [rad/s], in a band of 1.96 standard deviations."""
    motion = kd.fit_motion(track(200, until=0.1), LEG, PLACES, scale=False, contact=-0.02)
    for k, (axes, unit) in enumerate(zip(motion.plot(["knee", "hip"]).axes, (np.degrees(1.0), 1.0),
                                         strict=True)):  # fmt: skip
        *lines, _ = axes.lines  # the last one is the contact
        spans = [span for span in ((-150, -5), (0, 50)) for _ in range(2)]
        for i, (line, band, span) in enumerate(zip(lines, axes.collections, spans, strict=True)):
            column, (time, drawn) = (KNEE, HIP)[i % 2], line.get_data()
            assert time[[0, -1]] == pytest.approx(span, abs=closed_form(1e4))
            edges = band.get_paths()[0].vertices
            for j in (0, 100, -1):
                t = -0.02 + 1e-3 * time[j]
                value = motion.v(t)[column] if k else motion.q(t)[column + 1]  # a quaternion's 4
                low = value - 1.96 * motion.deviations(t)[k][column]
                around = edges[np.isclose(edges[:, 0], time[j]), 1]
                right = unit * np.array([value, low, 2 * value - low])
                assert [drawn[j], around.min(), around.max()] == pytest.approx(right)
