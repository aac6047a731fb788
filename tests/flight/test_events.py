"""Events that end a flight: the ground, planes and functions of a user."""

import math

import numpy as np
import pytest
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.flight.events import CREST, Event, end_at_launch, ground_event

BALL, AIR = kd.Ball(), kd.Air()
KICK = kd.BallState((1, 2, 3), (20, 3, 9), (0, -30, 5))


def below(height):
    """Return the event that the ball sinks below a height [m], as a user would write it."""
    return Event("below", lambda state, numbers: numbers[0] + state[2] - height,
                 lambda launch: (launch.position[..., 2],))  # fmt: skip


@pytest.mark.parametrize(("heights", "plane", "status", "z"), [
    ((1.0, 2.5, -1.0), None, "below", 2.5),
    ((1.0, 2.5, -1.0), kd.Plane((99, 0, 0), (-1, 0, 0)), "below", 2.5),
    ((-5.0,), None, "landed", BALL.radius)])  # fmt: skip
def test_the_first_event_ends_a_flight(heights, plane, status, z):
    path = kd.fly(KICK, BALL, AIR, kd.Ground(), plane=plane, ends=[below(z) for z in heights])
    assert path.status == status
    assert path.landing.position[2] == pytest.approx(z, abs=closed_form(10))


def test_an_event_may_depend_on_the_velocity_on_the_spin_and_on_numbers():
    slow = Event("slow", lambda state, _: math.hypot(state[3], state[4], state[5]) - 17.0)
    spent = Event("spent", lambda state, share: state[6] - share[0], (0.95,))
    far = Event("far", lambda state, radius: radius[0] ** 2 - state[0] ** 2 - state[1] ** 2, (12,))
    ends = {end.name: kd.fly(KICK, BALL, AIR, ends=[end]) for end in (slow, spent, far)}
    assert [path.status for path in ends.values()] == list(ends)
    assert ends["slow"].landing.speed == pytest.approx(17.0, rel=closed_form(10))
    assert ends["far"].range == pytest.approx(12.0, rel=closed_form(10))
    assert ends["spent"].landing.spin == pytest.approx(0.95 * KICK.spin, rel=closed_form(10))


@pytest.mark.parametrize(("distance", "bounced", "on_ground"),
    [(10.0, False, False), (32.0, True, False), (55.0, True, True)])  # fmt: skip
def test_a_course_ends_at_an_event_wherever_the_ball_is(distance, bounced, on_ground):
    """The numbers are computed anew at every bounce."""
    far = Event("far", lambda state, numbers: numbers[0] - numbers[1] - state[0],
                lambda launch: (30.0, launch.position[..., 0]))  # fmt: skip
    start = kd.BallState((30.0 - distance, 0, 3), (20, 0, 5))
    course = kd.follow(start, BALL, AIR, kd.Ground(surface="turf"), ends=[far])
    assert course.status == "far"
    assert course.rest.position[0] == pytest.approx(30.0, rel=integrated(1e-10))
    assert (bool(course.bounces), bool(course.ground_phases)) == (bounced, on_ground)


@pytest.mark.parametrize(("velocity", "rates", "ends"), [
    ((1, 0, -1), (0, 0, -9.81), True),
    ((1, 0, 1), (0, 0, -9.81), False),
    ((1, 0, 0), (0, 0, -9.81), True),  # level: the weight pulls it down
    ((1, 0, 0), (0, 0, 9.81), False),
    ((0, 0, 0), (0, 0, 0), True),  # at rest on the ground
])  # fmt: skip
def test_an_event_that_is_zero_at_the_launch_ends_unless_it_rises(velocity, rates, ends):
    ground = ground_event(BALL, None).launched(kd.BallState())
    state, rate = np.array([0, 0, 0, *velocity, 1.0]), np.array([*velocity, *rates, 0.0])
    assert (end_at_launch([CREST, ground], state, rate) is ground) == ends


@pytest.mark.parametrize(("function", "words"), [
    (lambda state, numbers: math.sqrt(5.0 - state[0]) + 1.0, "ValueError"),
    (lambda state, numbers: math.nan, "nan")])  # fmt: skip
@pytest.mark.parametrize("call", [kd.fly, kd.follow])
def test_an_event_that_is_not_a_number_on_the_way_is_named(call, function, words):
    with pytest.raises(kd.InvalidInput, match=f"event 'odd' .*{words}"):
        call(KICK, BALL, AIR, ends=[Event("odd", function)])


def sinking(state, numbers):
    return state[2]


REFUSED = [(CREST, "crest.*terminal"), ("wall", "'wall'.*kickdyn.Event"),
    *((Event(name, sinking), f"{name!r}.*without spaces") for name in ("below bar", "", 3)),
    (Event("landed", sinking), "'landed'.*at-plane"), (Event("low", "z"), "'low' cannot be called"),
    *((Event("low", sinking, numbers), "'low'.*at most 4") for numbers in
    (5.0, ("a",), lambda _: None, np.ones(5), (math.nan,), (1.0, math.inf), (np.zeros(5),))),
    (Event("low", sinking, lambda launch: 1 / 0), "'low'.*ZeroDivisionError")]  # fmt: skip


@pytest.mark.parametrize(("end", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_refusals(end, words):
    for fly, velocity in ((kd.fly, (20, 0, 10)), (kd.fly_many, [(20, 0, 10)] * 2)):
        with pytest.raises(kd.InvalidInput, match=words):
            fly(kd.BallState(velocity=velocity), BALL, AIR, ends=[end])
