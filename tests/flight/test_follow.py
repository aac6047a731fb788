import math
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.flight.follow import LEAST_REBOUND
from kickdyn.ground import SURFACES, Surface

BALL = kd.Ball(pressure=80e3)
SHOT = kd.BallState((0, 0, BALL.radius), (20, 1, 10), (5, -30, 10))


def test_a_dropped_ball_takes_the_geometric_series():
    """Heights fall by e^2, times by e, until the rebound is too slow to leave the ground."""
    e = 0.6
    drop = kd.BallState((0, 0, 2 + BALL.radius))
    course = kd.follow(drop, BALL, None, kd.Ground(surface=Surface("s", e, 0.5, 0.7)))
    speed = math.sqrt(2 * 9.81 * 2)
    rebounds = [speed * e**k for k in range(1, 40) if speed * e**k >= LEAST_REBOUND]
    assert [b.velocity[2] for b in course.bounces] == pytest.approx(rebounds, rel=1e-12)
    total = speed / 9.81 + sum(2 * v / 9.81 for v in rebounds)
    assert course.duration == pytest.approx(total, rel=1e-12)
    assert (course.status, course.distance) == ("at-rest", 0)
    assert course.flights[1].height == pytest.approx(2 * e**2, rel=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_energy_falls_all_the_way_to_rest(name):
    course = kd.follow(SHOT, BALL, kd.Air(), kd.Ground(surface=name))
    assert course.status == "at-rest"
    states = course.sample(np.linspace(0, course.duration, 3000))
    total = [
        0.5 * (BALL.mass * v @ v + BALL.inertia * w @ w) + BALL.mass * 9.81 * (z - BALL.radius)
        for v, w, z in zip(states.velocity, states.spin, states.position[:, 2], strict=True)
    ]
    assert np.diff(total).max() < 0.02 * BALL.mass * 9.81 * BALL.volume / BALL.mass + 1e-6
    assert total[-1] == pytest.approx(0, abs=1e-9)
    assert course.rest.velocity.tolist() == [0, 0, 0]
    assert states.position[:, 2].min() >= BALL.radius - 1e-9


def test_the_dense_answer_is_continuous_and_meets_the_nodes():
    course = kd.follow(SHOT, BALL, kd.Air(), kd.Ground(surface="turf"))
    for node in course.bounces:
        around = course.sample(node.time + np.array([-1e-7, 1e-7]))
        assert around.position[0] == pytest.approx(node.position, abs=1e-5)
        assert around.position[1] == pytest.approx(node.position, abs=1e-5)
        assert around.velocity[1] == pytest.approx(node.velocity, abs=1e-5)
    end = course.sample(course.duration)
    assert end.position == pytest.approx(course.rest.position, abs=1e-12)
    assert course.distance == pytest.approx(math.hypot(*course.rest.position[:2]))


def test_it_goes_farther_on_a_hard_floor():
    by_name = {
        name: kd.follow(SHOT, kd.Ball(pressure=80e3), kd.Air(), kd.Ground(surface=name)).distance
        for name in SURFACES
    }
    assert by_name["steel"] > by_name["hard-floor"] == sorted(by_name.values())[-2]
    assert by_name["carpet"] < by_name["wet-grass"]


def test_a_ball_that_loses_nothing_is_given_up():
    forever = kd.Ground(surface=Surface("trampoline", 1.0, 0.0, 0.1))
    course = kd.follow(kd.BallState((0, 0, 2)), BALL, None, forever)
    assert course.status == "bouncing"
    assert len(course.bounces) == 200


def test_a_ball_that_stays_aloft_says_so():
    course = kd.follow(SHOT, BALL, kd.Air(wind=(0, 0, 60)), time_limit=5)
    assert course.status == "aloft"
    assert course.duration == pytest.approx(5)


@pytest.mark.parametrize("height", [-3.0, 0.0, 7.0])
def test_without_ground_it_runs_on_turf_under_the_launch(height):
    launch = kd.BallState((0, 0, height), (10, 1, 6), (0, -20, 0))
    course = kd.follow(launch, BALL, kd.Air())
    first = kd.fly(launch, BALL, kd.Air())
    assert course.flights[0].landing.position.tolist() == pytest.approx(first.landing.position)
    assert course.rest.position[2] == pytest.approx(height, abs=1e-12)
    same = kd.follow(launch, BALL, kd.Air(), kd.Ground(height - BALL.radius, "turf"))
    assert course.rest.position.tolist() == same.rest.position.tolist()


def test_mirror_image():
    turf = kd.Ground(surface="turf")
    left, right = (
        kd.follow(kd.BallState((0, 0, 1), (20, y, 8), (0, -30, z)), BALL, kd.Air(), turf)
        for y, z in ((2, 20), (-2, -20))
    )
    assert left.rest.position == pytest.approx(right.rest.position * [1, -1, 1], abs=1e-7)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"ground": kd.Ground()}, "the ground has no surface: name one"),
        ({"ground": kd.Ground(5.0, "turf")}, "inside the ground"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.follow(SHOT, BALL, kd.Air(), **options)


@pytest.mark.parametrize(
    ("t", "words"),
    [([-1.0], "t is -1 s: the course lasts"), (1e9, "t is 1e"), ([[0.0]], "t has shape")],
)
def test_times_outside(t, words):
    course = kd.follow(SHOT, BALL)
    with pytest.raises(kd.InvalidInput, match=words):
        course.sample(t)
    with pytest.raises(kd.InvalidInput, match=words.replace("course", "roll")):
        course.ground_phases[-1].sample(t)
    assert course.ground_phases[-1].sample(0.0).position.shape == (3,)


def test_ground_without_friction_is_refused_where_the_ball_would_slide():
    ice = kd.Ground(surface=kd.Surface("ice", 0.5, 0.0, 0.5))
    with pytest.raises(kd.InvalidInput, match="friction of ice is 0: it must be above 0"):
        kd.follow(kd.BallState((0, 0, 1), (10, 0, 3), (0, -40, 0)), BALL, None, ice)


def test_a_course_warns_of_the_time_in_the_air():
    fast = kd.BallState((0, 0, BALL.radius), (60, 0, 15))
    course = kd.follow(fast, BALL, kd.Air(), kd.Ground(surface="turf"))
    line = next(line for line in course.warnings if line.startswith("drag"))

    def share(lines):
        found = [re.match(r"drag \w+: (\d+) %", line) for line in lines]
        return sum(float(one.group(1)) for one in found if one)

    outside = sum(share(path.warnings) * path.duration for path in course.flights)
    aloft = sum(path.duration for path in course.flights)
    assert share([line]) == pytest.approx(outside / aloft, abs=1)
    assert abs(share([line]) - share(course.flights[0].warnings)) > 5  # not the first alone
    assert f"warning   {line}" in repr(course)
    slow = kd.follow(
        kd.BallState((0, 0, BALL.radius), (5, 0, 0)), BALL, kd.Air(), kd.Ground(surface="turf")
    )
    assert slow.warnings == ()


def test_a_course_can_be_pickled():
    launch = kd.BallState((0, 0, 0.11), (8, 1, 5), (0, 30, 5))
    course = kd.follow(launch, kd.Ball(), kd.Air(), kd.Ground(0, "carpet"), tol=1e-6)
    copy = pickle.loads(pickle.dumps(course))
    assert len(course.bounces) > 1
    assert course.ground_phases
    assert copy.status == course.status
    assert copy.rest == course.rest
    half = 0.5 * course.duration
    assert copy.sample(half) == course.sample(half)


def test_flights_without_a_duration_have_warnings():
    course = kd.follow(
        kd.BallState((0, 0, 1), (9, 0, 3)), kd.Ball(), kd.Air(), kd.Ground(surface=SURFACES["turf"])
    )
    still = [replace(flight, landing=flight.launch) for flight in course.flights]
    assert isinstance(replace(course, flights=tuple(still)).warnings, tuple)


def test_many_states_are_refused():
    many = kd.BallState(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)), [0, 1])
    with pytest.raises(kd.InvalidInput, match=r"launch has shape \(2, 3\): "):
        kd.follow(many, kd.Ball(), kd.Air())
