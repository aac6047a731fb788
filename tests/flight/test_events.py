"""Events that end a flight, the ground's and a user's own."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.flight.events import CREST, ground_event

BALL, AIR = kd.Ball(), kd.Air()
KICK = kd.BallState((1, 2, 3), (20, 3, 9), (0, -30, 5))


def over_height(height):
    """The ball sinks below a height, as the ground does, but as a user would write it."""
    return kd.Event(
        "below", lambda state, numbers: numbers[0] + state[2] - height,
        lambda launch: (launch.position[..., 2],),
    )  # fmt: skip


@pytest.mark.parametrize("air", [AIR, None, kd.Air(wind=(3, 4, 0))])
def test_an_event_of_ones_own_ends_a_flight_as_the_ground_does(air):
    path = kd.fly(KICK, BALL, air, kd.Ground(-9), ends=[over_height(1.0)])
    right = kd.fly(KICK, BALL, air, kd.Ground(1.0 - BALL.radius))
    assert path.status == "below"
    assert path.duration == pytest.approx(right.duration, rel=1e-9)
    assert path.landing.position == pytest.approx(right.landing.position, abs=1e-7)
    assert path.landing.position[2] == pytest.approx(1.0, abs=1e-12)
    assert path.height == pytest.approx(right.height, rel=1e-9)
    assert 0 <= path.error < 1e-5


def test_the_first_event_ends_a_flight():
    ends = [over_height(height) for height in (1.0, 2.5, -1.0)]
    for path in (
        kd.fly(KICK, BALL, AIR, kd.Ground(), ends=ends),
        kd.fly(KICK, BALL, AIR, kd.Ground(), ends=ends, plane=kd.Plane((99, 0, 0), (-1, 0, 0))),
    ):
        assert path.landing.position[2] == pytest.approx(2.5, abs=1e-12)  # fmt: skip
    assert kd.fly(KICK, BALL, AIR, kd.Ground(), ends=[over_height(-5)]).status == "landed"


def test_an_event_may_depend_on_the_velocity_and_curve():
    slow = kd.Event("slow", lambda state, _: math.hypot(state[3], state[4], state[5]) - 17.0)
    path = kd.fly(KICK, BALL, AIR, ends=[slow])
    assert path.status == "slow"
    assert path.landing.speed == pytest.approx(17.0, rel=1e-12)
    far = kd.Event(
        "far", lambda state, radius: radius[0] ** 2 - state[0] ** 2 - state[1] ** 2, (12,)
    )
    assert kd.fly(KICK, BALL, AIR, ends=[far]).range == pytest.approx(12.0, rel=1e-12)


def test_a_course_ends_at_an_event_wherever_the_ball_is():
    far = kd.Event(
        "far", lambda state, numbers: numbers[0] - numbers[1] - state[0],
        lambda launch: (30.0, launch.position[..., 0]),
    )  # fmt: skip
    ground = kd.Ground(surface="turf")
    for distance, phase in ((10.0, "flight"), (32.0, "bounce"), (55.0, "roll")):
        start = kd.BallState((30.0 - distance, 0, 3), (20, 0, 5))
        course = kd.follow(start, BALL, AIR, ground, ends=[far])
        assert (course.status, course.rest.position[0]) == ("far", pytest.approx(30.0, abs=1e-6))
        assert bool(course.ground_phases) == (phase == "roll")
        assert bool(course.bounces) == (phase != "flight")


def test_what_ends_no_flight_is_refused():
    for ends, said in (
        ([CREST], "the end 'crest' must be terminal"),
        (["wall"], "ends has 'wall': each entry must be a kickdyn.Event"),
        ([kd.Event("landed", lambda state, _: state[2])], "must not be named as a status: landed"),
        (
            [kd.Event("many", lambda state, _: state[2], np.ones(5))],
            "they must be a sequence of at most 4 finite numbers",
        ),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            kd.fly(KICK, BALL, AIR, ends=ends)


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ([kd.Event("below bar", lambda state, _: state[2])], "a word without spaces"),
        ([kd.Event("", lambda state, _: state[2])], "a word without spaces"),
        ([kd.Event(3, lambda state, _: state[2])], "a word without spaces"),
        ([kd.Event("low", "z")], "cannot be called"),
        ([kd.Event("low", lambda state, _: state[2], 5.0)], "a sequence of at most 4"),
        ([kd.Event("low", lambda state, _: state[2], ("a",))], "a sequence of at most 4"),
        ([kd.Event("low", lambda state, _: state[2], lambda _: None)], "a sequence of at most 4"),
    ],
)
def test_an_end_that_is_no_event_is_refused_in_a_line(ends, message):
    for fly in kd.fly, kd.fly_many:
        with pytest.raises(kd.InvalidInput, match=message):
            fly(kd.BallState(velocity=[[20.0, 0, 10]] if fly is kd.fly_many else (20, 0, 10)),
                kd.Ball(), kd.Air(), ends=ends)  # fmt: skip


def test_the_ground_is_an_event_with_a_number_for_each_launch():
    launches = kd.BallState([(0, 0, 1), (0, 0, 2)], (20, 0, 5))
    drop, *normal = ground_event(BALL, kd.Ground()).launched(launches).numbers
    assert drop == pytest.approx([1 - BALL.radius, 2 - BALL.radius])
    assert normal == [0.0, 0.0, 1.0]


def launches(n):
    draw = np.random.default_rng(2)
    velocity = draw.normal((18, 0, 7), 3, (n, 3))
    return kd.BallState(draw.normal((0, 0, 4), 0.3, (n, 3)), velocity, draw.normal(0, 30, (n, 3)))


@pytest.mark.parametrize("air", [AIR, None])
@pytest.mark.parametrize("curved", [False, True])
def test_many_flights_end_at_the_events_of_one(air, curved):
    """At a plane and at the ground; then at an event of one's own as well."""
    states, ground = launches(60), kd.Ground()
    plane = kd.Plane((21, 0, 0), (-1, 0.2, 0))
    far = kd.Event("far", lambda state, numbers: 21.5**2 - state[0] ** 2 - state[1] ** 2)
    ends = [far] if curved else []
    many = kd.fly_many(states, BALL, air, ground, 1e-10, plane=plane, ends=ends)
    names = many.status.attrs["flag_meanings"].split()
    found = [names[status] for status in many.status.values]
    for i, name in enumerate(found):
        launch = kd.BallState(states.position[i], states.velocity[i], states.spin[i])
        path = kd.fly(launch, BALL, air, ground, 1e-10, plane=plane, ends=ends)
        assert (name, float(many.duration[i])) == (
            path.status,
            pytest.approx(path.duration, abs=1e-8),
        )
        assert many.landing_position.values[i] == pytest.approx(path.landing.position, abs=1e-7)
        assert many.height.values[i] == pytest.approx(path.height, abs=1e-7)
    assert len(set(found)) == 2 + curved


def test_many_that_start_on_a_plane_fly_only_away_from_it():
    plane = kd.Plane((0, 0, 0), (-1, 0, 0), "centre")
    states = kd.BallState((0, 0, 1), [(5, 0, 5), (-5, 0, 5)], (0, -10, 0))
    many = kd.fly_many(states, BALL, AIR, kd.Ground(), plane=plane)
    assert many.status.values.tolist() == [3, 0]
    assert many.duration.values[0] == 0.0 < many.duration.values[1]
    with pytest.raises(kd.InvalidInput, match=r"centre of flight 1 starts 1 m beyond the plane"):
        kd.fly_many(kd.BallState([(-1, 0, 1), (1, 0, 1)], (1, 0, 0)), BALL, AIR, plane=plane)
    starts = [(-1, 0, 1), (-1, 0, 1), (-1, 0, 1), (2, 0, 1), (1, 0, 1)]
    with pytest.raises(kd.InvalidInput, match=r"centre of flight 3 starts 2 m beyond the plane"):
        kd.fly_many(kd.BallState(starts, (1, 0, 0)), BALL, AIR, plane=plane)


def test_an_event_that_numba_cannot_compile_is_named():
    odd = kd.Event("odd", lambda state, _: float(str(state[0])))
    with pytest.raises(kd.InvalidInput, match=r"the end 'odd' .* cannot be compiled"):
        kd.fly_many(launches(3), BALL, AIR, ends=[odd])


def root_of_distance(state, numbers):
    """Defined up to a distance ahead, and positive there."""
    return math.sqrt(numbers[0] - state[0]) + 1.0


def root_of_height(state, numbers):
    """Defined over the ground only, and positive there."""
    return math.sqrt(numbers[0] + state[2]) + 1.0


def nothing(state, numbers):
    return math.nan


@pytest.mark.parametrize(
    ("function", "said"),
    [(root_of_distance, "raised ValueError: math domain error"), (nothing, "gave nan")],
)
def test_an_event_that_is_not_a_number_is_said(function, said):
    ends = [kd.Event("odd", function, (5.0,))]
    states = kd.BallState((0, 0, 1), [(20, 0, 5), (20, 0, 5)], (0, -10, 0))
    for call in (kd.fly, kd.follow):
        with pytest.raises(kd.InvalidInput, match=rf"the function of the event 'odd' {said}, with"):
            call(KICK, BALL, AIR, ends=ends)
    many = kd.fly_many(states, BALL, AIR, kd.Ground(), ends=ends)
    assert many.status.values.tolist() == [2, 2]
    assert many.status.attrs["flag_meanings"].split()[2] == "failed"
    assert np.isnan(many.range.values).all()


def test_an_event_may_be_undefined_where_the_ball_is_not():
    ends = [kd.Event("odd", root_of_height, (1 - BALL.radius,))]
    states = kd.BallState((0, 0, 1), [(20, 0, 5), (20, 0, -5)], (0, -10, 0))
    many = kd.fly_many(states, BALL, AIR, kd.Ground(), ends=ends)
    assert many.status.values.tolist() == [0, 0]
    for velocity, length in zip(states.velocity, many.range.values, strict=True):
        start = kd.BallState((0, 0, 1), velocity, (0, -10, 0))
        path = kd.fly(start, BALL, AIR, kd.Ground(), ends=ends)
        assert (path.status, path.range) == ("landed", pytest.approx(length, rel=1e-7))


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ((math.nan,), "finite numbers"),
        ((1.0, math.inf), "finite numbers"),
        ((np.zeros(5),), "a sequence of at most 4 finite numbers"),
        (lambda launch: 1 / 0, "raised ZeroDivisionError: division by zero"),
    ],
)
def test_bad_numbers_of_an_event_are_named(numbers, said):
    end = kd.Event("odd", root_of_height, numbers)
    with pytest.raises(kd.InvalidInput, match=f"the numbers of the event 'odd' are .*{said}"):
        kd.fly(KICK, BALL, AIR, ends=[end])
    with pytest.raises(kd.InvalidInput, match=f"the numbers of the event 'odd' are .*{said}"):
        kd.fly_many(launches(3), BALL, AIR, ends=[end])
