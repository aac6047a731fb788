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
        (["wall"], "ends has 'wall': it must have kickdyn.Event"),
        ([kd.Event("landed", lambda state, _: state[2])], "its name none of landed"),
        ([kd.Event("many", lambda state, _: state[2], np.ones(5))], "has 5 numbers: it may have 4"),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            kd.fly(KICK, BALL, AIR, ends=ends)


def test_the_ground_is_an_event_with_a_number_for_each_launch():
    launches = kd.BallState([(0, 0, 1), (0, 0, 2)], (20, 0, 5))
    drop, *normal = ground_event(BALL, kd.Ground()).launched(launches).numbers
    assert drop == pytest.approx([1 - BALL.radius, 2 - BALL.radius])
    assert normal == [0.0, 0.0, 1.0]
