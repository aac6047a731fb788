"""Bounces, slides and rolls by closed forms and scipy; balls followed until they rest."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.flight.follow import LEAST_REBOUND, bounce, roll, rolling_share, slide, slip
from kickdyn.ground import SURFACES, Surface

BALL, HEAVY = kd.Ball(), kd.Ball(0.6, 0.2, 0.4)
TURF = SURFACES["turf"]


def on_ground(velocity, spin=(0, 0, 0), ball=BALL):
    return kd.BallState((1, 2, ball.radius), velocity, spin)


@settings(max_examples=100)
@given(motion=st.tuples(*[st.floats(-50, 50)] * 2, st.floats(-50, -0.1)),
    spin=st.tuples(*[st.floats(-300, 300)] * 3), e=st.floats(0, 1), mu=st.floats(0.01, 3),
    tangential=st.floats(-0.9, 1))  # fmt: skip
def test_a_bounce_keeps_newton_coulomb_and_the_angular_momentum(motion, spin, e, mu, tangential):
    """Sticking turns the slip u into -e_t u; sliding takes mu times the normal impulse."""
    ball, surface = HEAVY, Surface("test", e, mu, 0.75, tangential)
    before = on_ground(motion, spin, ball)
    after = bounce(before, ball, surface)
    u = np.array([motion[0] - ball.radius * spin[1], motion[1] + ball.radius * spin[0]])
    assert slip(before, ball) == pytest.approx(u, rel=closed_form(), abs=closed_form(100))
    push = ball.mass * (after.velocity - before.velocity)
    turn = ball.inertia * (after.spin - before.spin)
    normal, scale = push[2], 1 + np.abs(motion).max() + np.abs(spin).max()
    near = closed_form(100) * scale
    assert after.velocity[2] == pytest.approx(-e * motion[2], rel=closed_form())
    assert turn == pytest.approx(np.cross((0, 0, -ball.radius), push), abs=near)
    size = math.hypot(*u)
    assume(size > 1e-6)
    sticking = (1 + tangential) * size / (1 / ball.mass + ball.radius**2 / ball.inertia)
    friction = min(sticking, mu * normal)
    assert push[:2] == pytest.approx(-friction * u / size, abs=near)
    if sticking < 0.999 * mu * normal:
        assert slip(after, ball) == pytest.approx(-tangential * u, abs=near)


@pytest.mark.parametrize("pressure", [60e3, 110e3])
def test_on_steel_the_speed_and_the_pressure_of_the_ball_decide(pressure):
    ball, contact = kd.Ball(pressure=pressure), kd.Contact((0, 0, 1), "inflated")
    for speed in (6.26, 18.8):
        after = bounce(on_ground((0, 0, -speed)), ball, SURFACES["steel"])
        e = contact.restitution_at(speed, ball)
        assert after.velocity[2] == pytest.approx(e * speed, rel=closed_form())


@pytest.mark.parametrize(("ball", "share"), [(BALL, 3 / 5), (HEAVY, 5 / 7)])
@pytest.mark.parametrize("air", [None, kd.Air(density=4.0, drag=None, lift=None, torque=None)])
def test_sliding_ends_in_rolling(ball, share, air):
    """At 3/5 of the speed of a thin shell, 5/7 of a solid ball; buoyancy takes friction from it."""
    buoyancy = 0 if air is None else 4.0 * ball.volume / ball.mass
    deceleration = TURF.friction * 9.81 * (1 - buoyancy)
    path = slide(on_ground((10, 0, 0), ball=ball), ball, air, TURF)
    assert slip(path.end, ball) == pytest.approx((0, 0), abs=closed_form(100))
    assert path.end.velocity[0] == pytest.approx(10 * share, rel=closed_form())
    assert path.duration == pytest.approx(10 * (1 - share) / deceleration, rel=closed_form())
    moved = path.end.position[0] - 1
    assert moved == pytest.approx(5 * (1 + share) * path.duration, rel=closed_form())
    half = path.sample(path.duration / 2)
    assert half.velocity[0] == pytest.approx(5 * (1 + share), rel=closed_form())


def test_a_rolling_ball_does_not_slide_and_a_ball_at_rest_rests():
    assert slide(on_ground((3, 0, 0), (0, 3 / BALL.radius, 0)), BALL, None, TURF) is None
    path = roll(on_ground((0, 0, 0)), BALL, kd.Air(), TURF, 1e-9)
    assert path.duration == 0
    assert path.sample(np.zeros(2)).position.tolist() == [[1, 2, BALL.radius]] * 2


@pytest.mark.parametrize("wind", [(0, 0, 0), (0, 2.5, 0), (-3, 1, 0)])
@pytest.mark.parametrize("tol", [1e-2, 1e-10])
def test_a_ball_rolls_in_the_wind_as_scipy_rolls_it(wind, tol):
    """Against resistance and drag, whose share moves a ball that also turns."""
    air = kd.Air(wind=wind, drag=0.4, lift=None, torque=None)
    path = roll(on_ground((4, 1, 0)), BALL, air, TURF, tol)
    k = 0.5 * air.density * BALL.cross_section * 0.4 / (BALL.mass + BALL.inertia / BALL.radius**2)
    assert rolling_share(BALL) == pytest.approx(3 / 5, rel=closed_form())

    def rates(t, y):
        u, v = y[2] - wind[0], y[3] - wind[1]
        pull, brake = k * math.hypot(u, v), TURF.rolling_deceleration / math.hypot(y[2], y[3])
        return [y[2], y[3], -pull * u - brake * y[2], -pull * v - brake * y[3]]

    def slow(t, y):
        return math.hypot(y[2], y[3]) - 1e-5

    slow.terminal = True
    y = [0, 0, 4, 1]
    end = solve_ivp(rates, (0, 100), y, "DOP853", rtol=1e-12, atol=1e-14, events=slow)
    moved = path.end.position - path.start.position
    agrees(moved[:2], end.y[:2, -1], integrated(1e-9))
    assert path.duration == pytest.approx(end.t[-1], abs=1e-4)  # the last 1e-5 m/s
    states = path.sample(np.linspace(0, path.duration, 50))
    assert slip(states, BALL) == pytest.approx(np.zeros((50, 2)), abs=closed_form(10))  # it rolls
    assert path.end.velocity.tolist() == [0, 0, 0]


@pytest.mark.parametrize(("velocity", "turns"), [
    ((1, 0, 0), False), ((0, 0, 0), True), ((0, -2, 0), True)])  # fmt: skip
def test_a_strong_wind_does_not_let_a_ball_rest(velocity, turns):
    """The phase ends at the time limit, or where the ball would turn."""
    path = roll(on_ground(velocity), BALL, kd.Air(wind=(0, 30, 0)), TURF, 1e-9, time_limit=60.0)
    assert path.blown
    assert (path.duration < 60.0) == turns
    speed = math.hypot(*path.end.velocity)
    assert speed == pytest.approx(0.0, abs=integrated(1e-8)) if turns else speed > 5


FIRM = kd.Ball(pressure=80e3)
SHOT = kd.BallState((0, 0, FIRM.radius), (20, 1, 10), (5, -30, 10))
G = 9.81


def test_a_dropped_ball_takes_the_geometric_series():
    """Heights fall by e^2, times by e, until the rebound is too slow to leave the ground."""
    e, drop = 0.6, kd.BallState((0, 0, 2 + FIRM.radius))
    course = kd.follow(drop, FIRM, None, kd.Ground(surface=Surface("s", e, 0.5, 0.7)))
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
    course = kd.follow(launch, FIRM, None, kd.Ground(-FIRM.radius, surface))
    aloft, after = 2 * 2 / G, 10 - 0.1 * 2  # the landing takes mu times the normal impulse
    spin = course.ground_phases[0].start.spin[1]
    slip = after - FIRM.radius * spin
    rolling = after - 2 / 5 * slip
    sliding = 2 / 5 * slip / (0.1 * G)
    distance = 10 * aloft + (after + rolling) / 2 * sliding + rolling**2 / 1.6
    assert spin == pytest.approx(3 / 2 * 0.1 * 2 / FIRM.radius, rel=closed_form(100))
    assert course.distance == pytest.approx(distance, rel=integrated(1e-9))
    assert course.duration == pytest.approx(aloft + sliding + rolling / 0.8, rel=integrated(1e-9))
    assert [phase.kind for phase in course.ground_phases] == ["slide", "roll"]


@pytest.mark.parametrize("name", SURFACES)
def test_energy_falls_all_the_way_to_rest(name):
    air = kd.Air(buoyancy=False)
    course = kd.follow(SHOT, FIRM, air, kd.Ground(surface=name))
    states = course.sample(np.linspace(0, course.duration, 1000))
    kinetic = 0.5 * FIRM.mass * states.speed**2
    turning = 0.5 * FIRM.inertia * np.einsum("ij,ij->i", states.spin, states.spin)
    total = kinetic + turning + FIRM.mass * G * (states.position[:, 2] - FIRM.radius)
    assert course.status == "at-rest"
    assert np.diff(total).max() < integrated(1e-10) * total[0]
    assert total[-1] == pytest.approx(0, abs=closed_form(10))
    assert states.position[:, 2].min() >= FIRM.radius - integrated(1e-9)


def test_samples_are_continuous_and_meet_the_bounces():
    course = kd.follow(SHOT, FIRM, kd.Air(), kd.Ground(surface="turf"))
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
    course = kd.follow(launch, FIRM, kd.Air())
    same = kd.follow(launch, FIRM, kd.Air(), kd.Ground(height - FIRM.radius, "turf"))
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
    (SHOT, FIRM, kd.Ground(), "no surface.*turf"),
    (SHOT, FIRM, kd.Ground(5.0, "turf"), "inside the ground"),
    (SHOT, kd.Ball(), kd.Ground(surface="steel"), "pressure is None"),
    (SHOT, FIRM, kd.Ground(surface=Surface("ice", 0.5, 0.0, 0.5)), "friction of ice is 0"),
    (kd.BallState(np.zeros((2, 3))), FIRM, None, r"\(2, 3\).*follow_many")])  # fmt: skip
def test_refusals(state, ball, ground, words):
    with pytest.raises(kd.KickdynError, match=words):
        kd.follow(state, ball, None, ground)
