"""A ball followed until it rests: bounces by hand, energy, continuity, ends, refusals."""

import math

import numpy as np
import pytest
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.flight.follow import LEAST_REBOUND
from kickdyn.ground import SURFACES, Surface

BALL = kd.Ball(pressure=80e3)
SHOT = kd.BallState((0, 0, BALL.radius), (20, 1, 10), (5, -30, 10))
G = 9.81


def test_a_dropped_ball_takes_the_geometric_series():
    """Heights fall by e^2, times by e, until the rebound is too slow to leave the ground."""
    e, drop = 0.6, kd.BallState((0, 0, 2 + BALL.radius))
    course = kd.follow(drop, BALL, None, kd.Ground(surface=Surface("s", e, 0.5, 0.7)))
    speed = math.sqrt(2 * G * 2)
    rebounds = [speed * e**k for k in range(1, 40) if speed * e**k >= LEAST_REBOUND]
    total = speed / G + sum(2 * v / G for v in rebounds)
    assert [b.velocity[2] for b in course.bounces] == pytest.approx(rebounds, rel=closed_form(10))
    assert course.duration == pytest.approx(total, rel=closed_form(10))
    hop = LEAST_REBOUND**2 / (2 * G)
    assert hop == pytest.approx(1e-3, rel=0.2)
    assert (course.status, course.distance) == ("at-rest", 0)
    assert course.flights[1].height == pytest.approx(2 * e**2, rel=closed_form(10))


def test_a_course_without_bounces_is_a_flight_a_slide_and_a_roll():
    """By hand: after the landing, the shell slides to 3/5 of its speed, and rolls v^2 / (2 a)."""
    surface, launch = Surface("clay", 0.0, 0.1, 0.8), kd.BallState((0, 0, 0), (10, 0, 2))
    course = kd.follow(launch, BALL, None, kd.Ground(-BALL.radius, surface))
    aloft, after = 2 * 2 / G, 10 - 0.1 * 2  # the landing takes mu times the normal impulse
    spin = course.ground_phases[0].start.spin[1]
    slip = after - BALL.radius * spin
    rolling = after - 2 / 5 * slip
    sliding = 2 / 5 * slip / (0.1 * G)
    distance = 10 * aloft + (after + rolling) / 2 * sliding + rolling**2 / 1.6
    assert spin == pytest.approx(3 / 2 * 0.1 * 2 / BALL.radius, rel=closed_form(100))
    assert course.distance == pytest.approx(distance, rel=integrated(1e-9))
    assert course.duration == pytest.approx(aloft + sliding + rolling / 0.8, rel=integrated(1e-9))
    assert [phase.kind for phase in course.ground_phases] == ["slide", "roll"]


@pytest.mark.parametrize("name", SURFACES)
def test_energy_falls_all_the_way_to_rest(name):
    air = kd.Air(buoyancy=False)
    course = kd.follow(SHOT, BALL, air, kd.Ground(surface=name))
    states = course.sample(np.linspace(0, course.duration, 1000))
    kinetic = 0.5 * BALL.mass * states.speed**2
    turning = 0.5 * BALL.inertia * np.einsum("ij,ij->i", states.spin, states.spin)
    total = kinetic + turning + BALL.mass * G * (states.position[:, 2] - BALL.radius)
    assert course.status == "at-rest"
    assert np.diff(total).max() < integrated(1e-10) * total[0]
    assert total[-1] == pytest.approx(0, abs=closed_form(10))
    assert states.position[:, 2].min() >= BALL.radius - integrated(1e-9)


def test_samples_are_continuous_and_meet_the_bounces():
    course = kd.follow(SHOT, BALL, kd.Air(), kd.Ground(surface="turf"))
    for node in course.bounces:
        around = course.sample(node.time + np.array([-1e-7, 1e-7]))
        assert around.position == pytest.approx(np.array([node.position] * 2), abs=1e-7 * 100)
        assert around.velocity[1] == pytest.approx(node.velocity, abs=1e-7 * 100)
    end = course.sample(course.duration)
    agrees(end.position, course.rest.position, closed_form())
    assert end.velocity == pytest.approx(np.zeros(3), abs=closed_form(10))
    assert course.distance == pytest.approx(math.hypot(*course.rest.position[:2]))


@pytest.mark.parametrize("height", [-3.0, 7.0])
def test_without_ground_a_ball_runs_on_turf_under_its_launch(height):
    launch = kd.BallState((0, 0, height), (10, 1, 6), (0, -20, 0))
    course = kd.follow(launch, BALL, kd.Air())
    same = kd.follow(launch, BALL, kd.Air(), kd.Ground(height - BALL.radius, "turf"))
    assert course.rest.position[2] == pytest.approx(height, abs=closed_form(10))
    assert course.rest.position.tolist() == same.rest.position.tolist()


def test_no_flight_takes_longer_than_1000_s_unless_that_is_asked_for():
    up, ball = kd.BallState(velocity=(0, 0, 5000)), kd.Ball()
    flights = kd.fly(up, ball), kd.follow(up, ball), kd.fly(up, ball, time_limit=2e3)
    assert [path.duration for path in flights[:2]] == [1000, 1000]
    assert flights[2].duration == pytest.approx(10_000 / G, rel=closed_form())
    for many in (kd.fly_many, kd.follow_many):
        assert many(kd.BallState(velocity=[up.velocity]), ball).duration.values == [1000]


@pytest.mark.parametrize(("state", "ball", "ground", "words"), [
    (SHOT, BALL, kd.Ground(), "no surface.*turf"),
    (SHOT, BALL, kd.Ground(5.0, "turf"), "inside the ground"),
    (SHOT, kd.Ball(), kd.Ground(surface="steel"), "pressure is None"),
    (SHOT, BALL, kd.Ground(surface=Surface("ice", 0.5, 0.0, 0.5)), "friction of ice is 0"),
    (kd.BallState(np.zeros((2, 3))), BALL, None, r"\(2, 3\).*follow_many")])  # fmt: skip
def test_refusals(state, ball, ground, words):
    with pytest.raises(kd.KickdynError, match=words):
        kd.follow(state, ball, None, ground)
