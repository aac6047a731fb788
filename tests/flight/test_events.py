"""Events that end a flight: the ground, planes and functions of a user."""

import math

import numpy as np
import pytest
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.flight.batch import MARCH
from kickdyn.flight.events import CREST, Event

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


@pytest.mark.parametrize("shape", [
    lambda x: x**3, lambda x: 1.0 if x > 0.0 else -1.0, lambda x: math.inf if x > 0.0 else -1e-300,
    lambda x: math.atan(1e6 * x), lambda x: 1e-200 * x if x > 0.0 else 1e200 * x])  # fmt: skip
def test_an_event_is_found_whatever_its_function_is_on_both_sides(shape):
    far = Event("far", lambda state, _: shape(12.0 - state[0]))
    end = kd.fly(KICK, BALL, AIR, ends=[far]).landing.position
    assert end[0] == pytest.approx(KICK.position[0] + 12.0, rel=closed_form(10))


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


def larger(a, b):
    return (a + b + abs(a - b)) / 2.0


def length(*vector):
    return sum(x**2 for x in vector) ** 0.5


def tilted(state, n):  # a slab that turns as the spin decays
    tangent = n[0] * (state[6] - n[3])
    return abs((1 - tangent**2) * (state[0] - n[1]) + 2 * tangent * (state[2] - n[2])) - 0.1


def one_of_two(state, n):
    first, second = state[0] - n[0], state[0] - n[2]
    return ((first**2 + (state[2] - n[1]) ** 2) ** 0.5 - n[3]) * (
        (second**2 + (state[2] - n[1]) ** 2) ** 0.5 - n[3])  # fmt: skip


KINDS = {
    "sphere": (lambda s, n: ((s[0] - n[0]) ** 2 + (s[1] - n[1]) ** 2 + (s[2] - n[2]) ** 2) ** 0.5
               - n[3], lambda p, r, s, draw: (*p, r)),
    "square": (lambda s, n: (s[0] - n[0]) ** 2 + (s[1] - n[1]) ** 2 + (s[2] - n[2]) ** 2 - n[3]
               ** 2, lambda p, r, s, draw: (*p, r)),
    "post": (lambda s, n: ((s[0] - n[0]) ** 2 + (s[1] - n[1]) ** 2) ** 0.5 - n[3],
             lambda p, r, s, draw: (p[0], p[1], 0.0, r)),
    "slab": (lambda s, n: abs(n[0] * s[0] + n[1] * s[1] + n[2] * s[2] - 1.0) - n[3],
             lambda p, r, s, draw: (1 / p[0], 0.1, -0.1 * p[1] / p[2], 0.1 * r)),
    "box": (lambda s, n: larger(larger(abs(s[0] - n[0]), abs(s[1] - n[1])), abs(s[2] - n[2]))
            - n[3], lambda p, r, s, draw: (*p, r)),
    "speed": (lambda s, n: abs((s[3] ** 2 + s[4] ** 2 + s[5] ** 2) ** 0.5 - n[0]) - n[1],
              lambda p, r, s, draw: (length(*s[3:6]), 0.1 * r)),
    "height": (lambda s, n: abs(s[2] - n[0]) - n[1], lambda p, r, s, draw: (p[2], r)),
    "tilted": (tilted, lambda p, r, s, draw: (draw.uniform(-300, 300), p[0], p[2], s[6])),
    "one of two": (one_of_two, lambda p, r, s, draw: (p[0], p[2], p[0] + draw.uniform(-8, 8), r)),
}  # fmt: skip
"""Functions of events, and their numbers near a point of a path, at a distance from it."""


def missed(fly_all, count):
    """Return which of random events are missed that last 1 ms and 1 cm on a path, densely sampled.

    Half of the crossings take less than 25 ms.
    """
    draw, paths, cases = np.random.default_rng(7), [], []
    for velocity, spin in (((20, 0, 9), (0, -20, 0)), ((28, 2, 7), (10, -40, 20)),
                           ((8, 3, 12), (0, 9, 0)), ((33, -4, 3), (0, -80, 30))):  # fmt: skip
        path = kd.fly(kd.BallState((0, 0, 0.11), velocity, spin), BALL, AIR, kd.Ground())
        times = np.arange(0.0, path.duration, 1e-4)
        at = path.sample(times)
        share = at.spin @ path.launch.spin / (path.launch.spin @ path.launch.spin)
        paths.append((path.launch, times, np.vstack([at.position.T, at.velocity.T, share])))
        paths[-1][2][:3] -= path.launch.position[:, None]
    while len(cases) < count:
        kind, (function, numbers_of) = list(KINDS.items())[len(cases) % len(KINDS)]
        launch, times, states = paths[draw.integers(len(paths))]
        state = states[:, draw.integers(500, len(times) - 500)]
        offset = 10.0 ** draw.uniform(-2.5, -0.5) * draw.normal(size=3)
        size = abs(offset).max() * draw.uniform(0.5, 3.0) + 10.0 ** draw.uniform(-2.5, -0.5)
        numbers = numbers_of(state[:3] + offset, size, state, draw)
        below = function(states, numbers) <= 0.0
        falls = np.flatnonzero(~below[:-1] & below[1:])
        if not falls.size or below[-1]:
            continue
        rise = falls[0] + 1 + int(np.argmin(below[falls[0] + 1 :]))
        way = length(*(states[:3, rise] - states[:3, falls[0]]))
        if times[rise] - times[falls[0]] > 1.2e-3 and way > 1.2e-2:
            cases.append((kind, launch, numbers, times[falls[0]]))
    found = np.zeros(count)
    for kind in KINDS:
        rows = [k for k in range(count) if cases[k][0] == kind]
        found[rows] = fly_all(KINDS[kind][0], [cases[k][1:3] for k in rows])
    expected = np.array([case[3] for case in cases])
    return [
        (*cases[k], found[k])
        for k in np.flatnonzero(~((found >= expected - 1e-6) & (found <= expected + 1.01e-4)))
    ]


def by_fly(function, launched):
    return [kd.fly(launch, BALL, AIR, kd.Ground(), ends=[Event("in", function, n)]).duration
            for launch, n in launched]  # fmt: skip


def by_fly_many(function, launched):
    position, velocity, spin = (np.array([getattr(launch, name) for launch, _ in launched])
                                for name in ("position", "velocity", "spin"))  # fmt: skip
    columns = np.zeros((4, len(launched)))
    for k, (_, n) in enumerate(launched):
        columns[: len(n), k] = n
    ends = [Event("in", function, tuple(columns))]
    states = kd.BallState(position, velocity, spin)
    return kd.fly_many(states, BALL, AIR, kd.Ground(), ends=ends).duration.values


@pytest.mark.parametrize(("fly_all", "count"), [(by_fly, 180),
    *(pytest.param(each, 3000, marks=pytest.mark.slow) for each in (by_fly, by_fly_many))
])  # fmt: skip
def test_no_event_of_a_millisecond_is_missed(fly_all, count, monkeypatch):
    monkeypatch.setattr(MARCH, "pays", lambda _: True)
    assert missed(fly_all, count) == []


@pytest.mark.parametrize("radius", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("speed", [3.0, 30.0, 100.0])
def test_a_ball_in_a_vacuum_enters_a_sphere_in_its_way(radius, speed):
    """It flies the parabola of the closed form in two or three steps."""
    centre = np.array([speed / 4, 0.0, 0.3])
    sphere = Event("in", KINDS["sphere"][0], (*centre, radius))
    path = kd.fly(kd.BallState(velocity=(speed, 0, 9.81 / 4)), BALL, None, ends=[sphere])
    assert path.status == "in"
    way = path.landing.position - centre
    assert length(*way) == pytest.approx(radius, abs=integrated(1e-9) * speed)
    assert path.landing.position[0] < centre[0]
    t = path.duration
    agrees(path.landing.position, [speed * t, 0, 9.81 * (t - 2 * t**2) / 4], integrated(1e-9))


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
