"""When a contact begins, from the ball's track, and what its deviation does to the results."""

import numpy as np
import pinocchio as pin
import pytest
from kick_motion import LEG, PLACES, state, track, velocity

import kickdyn as kd
from kickdyn.identification.contact_moment import MEAN_TIME, ball_side, contact_moment
from kickdyn.impact.leg_response import leg_response

BEFORE, AFTER = np.array([-4.0, 0.5, 0.0]), np.array([20.0, -1.0, 3.0])


def ball_track(force, begin=0.0, duration=2 * MEAN_TIME, noise=0.0, rate=500):
    """Track of a ball whose velocity changes in a contact, by the share of it at x from 0 to 1."""
    fine = np.linspace(0.0, 1.0, 2001)
    share = np.cumsum(force(fine))
    moved = np.cumsum(share / share[-1]) * duration / 2000
    times = np.arange(-0.15, 0.15, 1 / rate)
    inside = (times - begin) / duration
    gained = np.interp(inside, fine, moved) + duration * np.maximum(inside - 1.0, 0.0)
    positions = np.outer(times, BEFORE) + np.outer(gained, AFTER - BEFORE) + (0.1, 0.0, 0.11)
    positions[:, 2] -= 0.5 * 9.81 * np.maximum(times - begin, 0.0) ** 2
    rng = np.random.default_rng(1)
    return kd.Track(times, positions + noise * rng.normal(size=positions.shape))


@pytest.mark.parametrize("force", [np.ones_like, lambda x: np.sin(np.pi * x)])
@pytest.mark.parametrize("begin", [0.0, 0.0013])
def test_it_begins_half_a_contact_before_the_paths_meet(force, begin):
    found = contact_moment("contact", ball_track(force, begin, noise=1e-3))
    assert abs(found.time - begin) < 1e-4
    assert found.deviation == pytest.approx(7e-4, rel=0.02)


def test_contacts_of_other_durations_are_within_the_deviations():
    for duration in (0.0068, 0.0105):
        found = contact_moment("contact", ball_track(np.ones_like, duration=duration))
        assert abs(found.time) < 1.96 * found.deviation


def test_the_deviation_of_the_time_moves_along_the_motion():
    """Against estimates at other times: q changes by v, v by the acceleration."""
    motion = kd.fit_motion(track(500), LEG, PLACES)
    h = 1e-4
    early, late = (motion.at_contact(t) for t in (-h, h))
    deviation = 5e-4
    sure, unsure = motion.at_contact(0.0), motion.at_contact((0.0, deviation))
    change = deviation * np.concatenate([sure.v, (late.v - early.v) / (2 * h)])
    added = np.sqrt((unsure.covariance - sure.covariance).diagonal())
    knee = LEG.velocity_index("knee")
    assert added[knee] == pytest.approx(abs(change[knee]), rel=1e-3)
    fast = np.abs(change) > 1e-3
    assert added[fast] == pytest.approx(np.abs(change[fast]), rel=0.2)  # another last frame


def test_deviations_cover_contacts_of_unknown_time():
    motion = kd.fit_motion(track(500, 1e-3, 5), LEG, PLACES)
    rng, deviation, scores = np.random.default_rng(3), 2e-3, []
    for _ in range(20):
        at = motion.at_contact((deviation * rng.normal() - 0.004, deviation))
        scores.append((at.v - velocity(-0.004))[[6, 9]] / at.v_deviations[[6, 9]])
    assert np.abs(scores).max() < 4.0
    assert np.sqrt(np.mean(np.square(scores))) < 1.4


def test_joint_impulses_against_monte_carlo():
    """Deviations to first order, against 6,000 draws of all that is measured: within 3 %."""
    motion = kd.fit_motion(track(500, 1e-3, 2), LEG, PLACES)
    at, ball = motion.at_contact((0.0, 7e-4)), kd.Ball()
    path = ball_track(np.ones_like, noise=1e-3)
    found = kd.infer_impact(motion, path, contact=(0.0, 7e-4))
    rng, draws = np.random.default_rng(4), 6000
    root = np.linalg.cholesky(at.covariance + 1e-14 * np.eye(2 * LEG.nv))
    leg, names, sizes = motion.leg, list(found.joint_sizes), []
    sides = ball_side(path, "", -0.1, 0.0, 0.0), ball_side(path, "", 0.015, 0.115, 0.0)
    spread = ball.mass * np.hypot(*(side.velocity_deviation for side in sides))
    for _ in range(draws):
        change = root @ rng.normal(size=2 * LEG.nv)
        posture = leg.posture(pin.integrate(leg.model, at.posture.q, change[: LEG.nv]))
        impulse = found.impulse + spread * rng.normal(size=3)
        joints = leg_response(posture, at.v + change[LEG.nv :], impulse).joint_impulses
        sizes.append(np.linalg.norm(joints[1:, :3], axis=1))
    deviations = np.std(sizes, axis=0)
    assert [found.joint_deviations[name] for name in names] == pytest.approx(deviations, rel=0.03)


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        ((0.1, 0.2, 0.3), r"contact is \[0.1, 0.2, 0.3\]: it must be a time \[s\], \(time, its"),
        ((0.1, -1.0), "deviation of contact is -1.0: it must be"),
        ("x", "contact"),
        (kd.Track(np.arange(80) / 200 - 0.2, np.zeros((80, 3))), "changes by 0 m/s at most"),
        (ball_track(np.ones_like, noise=1e-3)[:70],
         r"changes by 0\.\d+ m/s at most in its track, from -0.15 to -0.012 s: a kick changes it"),
        (kd.Track(np.arange(4) / 100, np.zeros((4, 3))), "has 4 samples: at least 10"),
        (kd.Track(*(lambda t: (t.times, 1000 * t.positions))(ball_track(np.ones_like))),
         "faster than sound, as with positions in millimetres or centimetres: positions must"),
        (kd.Track(*(lambda t: (t.times, t.positions[:, [0, 2, 1]]))(ball_track(np.ones_like))),
         "the ball falls along y after the contact, with 9.8 m/s2: positions of its track must "),
    ],
)  # fmt: skip
def test_refused(contact, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.fit_motion(track(50), LEG, PLACES, contact=contact)


def test_the_motion_names_the_contact_of_the_track():
    motion = kd.fit_motion(track(240, until=0.1), LEG, PLACES, contact=ball_track(np.ones_like))
    assert abs(motion.contact.time) < 1e-4
    assert "contact" in str(motion)
    assert motion.at_contact().moment == motion.contact
    assert np.abs(motion.q(-0.1)[7:] - state(-0.1)[7:]).max() < 1e-5
