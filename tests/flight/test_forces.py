import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath import mp, mpf

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.core.mechanics import GRAVITY
from kickdyn.flight.forces import (
    acceleration_function,
    ballistic,
    downward,
    is_ballistic,
    time_to_fall,
)

BALL = kd.Ball(mass=0.4, radius=0.12)


def acceleration(air, velocity, spin=(0, 0, 0), ball=BALL):
    return np.array(acceleration_function(ball, air)(9.0, *velocity, *spin)[:3])


@pytest.mark.parametrize("seed", range(20))
def test_force_is_that_of_the_vector_formula(seed):
    rng = np.random.default_rng(seed)
    velocity, wind, spin = (rng.normal(size=3) * scale for scale in (20, 5, 60))
    air = kd.Air(density=1.1, viscosity=2e-5, wind=wind)
    u = velocity - wind
    speed = np.linalg.norm(u)
    across = spin - (spin @ u) / speed**2 * u  # spin along the flight lifts nothing
    reynolds = 1.1 * speed * 0.24 / 2e-5
    spin_parameter = 0.12 * np.linalg.norm(across) / speed
    pressure = 0.5 * 1.1 * math.pi * 0.12**2 * speed**2
    drag = -pressure * air.drag(reynolds, spin_parameter) * u / speed
    side = np.cross(spin, u) / np.linalg.norm(np.cross(spin, u))
    lift = pressure * air.lift(reynolds, spin_parameter) * side
    weight = np.array([0, 0, -9.81]) * (0.4 - 1.1 * 4 / 3 * math.pi * 0.12**3)
    expected = (drag + lift + weight) / 0.4
    assert acceleration(air, velocity, spin) == pytest.approx(expected, rel=1e-12)


def test_each_effect_only_if_named():
    still = {"buoyancy": False, "drag": None, "lift": None}
    v, w = (20, 0, 0), (0, -100, 0)
    down = [0, 0, -GRAVITY]
    assert acceleration(kd.Air(**still), v, w).tolist() == down
    assert acceleration(kd.Air(**{**still, "lift": constant(0.3)}), v).tolist() == down
    lifted = acceleration(kd.Air(**{**still, "lift": constant(0.3)}), v, w)
    assert lifted[:2].tolist() == [0, 0]
    assert lifted[2] > -GRAVITY
    dragged = acceleration(kd.Air(**{**still, "drag": constant(0.3)}), v, w)
    assert dragged[1:].tolist() == down[1:]
    assert dragged[0] < 0
    floating = acceleration(kd.Air(**{**still, "buoyancy": True}), v, w)
    assert floating.tolist() == [0, 0, -downward(BALL, kd.Air())]


@pytest.mark.parametrize("velocity", [(0, 0, 0), (1e-200, 0, 0), (5, 0, 0)])
def test_ball_that_rides_the_wind_feels_nothing(velocity):
    air = kd.Air(wind=velocity)
    assert acceleration(air, velocity, (0, 99, 0)).tolist() == [0, 0, -downward(BALL, air)]


def test_spin_along_the_flight_lifts_nothing_but_is_no_error():
    air = kd.Air(buoyancy=False)
    assert acceleration(air, (20, 0, 0), (100, 0, 0)) == pytest.approx(
        acceleration(air, (20, 0, 0)), rel=1e-15
    )


@pytest.mark.parametrize("speed", [1e-90, 1e-30, 1e-3, 1.0, 1e3, 1e30])
def test_rates_are_finite_at_any_speed(speed):
    assert np.isfinite(acceleration(kd.Air(), (speed, speed, -speed), (0, 50, 0))).all()


@pytest.mark.parametrize(
    ("air", "share"),
    [
        (None, 0),
        (kd.Air(buoyancy=False), 0),
        (kd.Air(density=0.0), 0),
        (kd.Air(density=1.2), 1.2 * 4 / 3 * math.pi * 0.12**3 / 0.4),
        (kd.Air(density=1000.0), 1000 * 4 / 3 * math.pi * 0.12**3 / 0.4),
    ],
)
def test_air_carries_its_share(air, share):
    assert downward(BALL, air) == pytest.approx(9.81 * (1 - share), rel=1e-14)


SPIN, STILL = np.array([0.0, 1.0, 0.0]), np.zeros(3)


@pytest.mark.parametrize(
    ("air", "spin", "closed"),
    [
        (None, SPIN, True),
        (kd.Air(density=0.0), SPIN, True),
        (kd.Air(drag=None, lift=None, torque=None), SPIN, True),
        (kd.Air(drag=None, lift=None), SPIN, False),  # the spin decays
        (kd.Air(drag=None), STILL, True),  # lift needs spin
        (kd.Air(drag=None), SPIN, False),
        (kd.Air(lift=None), STILL, False),
    ],
)
def test_closed_form_where_there_is_one(air, spin, closed):
    assert is_ballistic(air, spin) is closed


# --- the vacuum, against 50-digit arithmetic ------------------------------------------------------

SOCCER_BALL = kd.Ball()
SPEED = st.floats(-1e3, 1e3)


def exact_time(rise, drop, g):
    with mp.workdps(50):
        return float((mpf(rise) + mp.sqrt(mpf(rise) ** 2 + 2 * mpf(g) * mpf(drop))) / mpf(g))


@given(rise=SPEED, drop=st.floats(0, 1e4), g=st.floats(1e-3, 1e3))
def test_time_to_fall(rise, drop, g):
    assume(abs(rise) > 1e-100 or drop > 1e-100)  # their squares can be written
    assert time_to_fall(rise, drop, g) == pytest.approx(exact_time(rise, drop, g), rel=1e-14)


@pytest.mark.parametrize(("rise", "drop"), [(-1e3, 1e-9), (-1e8, 1.0)])
def test_fast_fall_is_not_cancelled_away(rise, drop):
    assert time_to_fall(rise, drop, 9.81) == pytest.approx(exact_time(rise, drop, 9.81), rel=1e-14)


@given(vx=SPEED, vy=SPEED, rise=SPEED, drop=st.floats(0, 1e3))
def test_vacuum_flight_is_the_formula(vx, vy, rise, drop):
    assume(rise == 0 or abs(rise) > 1e-100)
    launch = kd.BallState((1, 2, SOCCER_BALL.radius + drop), (vx, vy, rise), (3, 4, 5))
    path = kd.fly(launch, SOCCER_BALL, ground=kd.Ground())
    height = float(launch.position[2]) - SOCCER_BALL.radius
    t = exact_time(rise, height, 9.81)
    assert path.duration == pytest.approx(t, rel=1e-12)
    assert path.range == pytest.approx(math.hypot(vx, vy) * t, rel=1e-12, abs=1e-12)
    assert path.landing.position[2] == pytest.approx(SOCCER_BALL.radius, abs=1e-12)
    assert path.landing.velocity == pytest.approx([vx, vy, rise - 9.81 * t], rel=1e-12, abs=1e-12)
    assert path.height == pytest.approx(max(rise, 0) ** 2 / (2 * 9.81), rel=1e-12, abs=1e-12)
    assert path.apex.time == pytest.approx(max(rise, 0) / 9.81, rel=1e-12)
    assert path.landing.spin.tolist() == [3, 4, 5]
    assert (path.status, path.method, path.evaluations) == ("landed", "closed form", 0)


def test_many_times_at_once():
    t = np.array([0.0, 0.5, 2.0])
    moved = ballistic(np.array([1.0, -2.0, 3.0]), 10.0, t)
    assert moved.tolist() == [
        [0, 0, 0, 1, -2, 3, 1],
        [0.5, -1, 0.25, 1, -2, -2, 1],
        [2, -4, -14, 1, -2, -17, 1],
    ]


def test_energy_is_kept_all_along():
    path = kd.fly(kd.BallState((0, 0, 50), (20, 0, 10)), SOCCER_BALL, ground=kd.Ground())
    states = path.sample(np.linspace(0, path.duration, 50))
    energy = states.speed**2 / 2 + 9.81 * states.position[:, 2]
    assert energy == pytest.approx(np.full(50, energy[0]), rel=1e-14)


def test_whoever_stays_up_past_the_limit_is_aloft():
    path = kd.fly(kd.BallState(velocity=(1, 0, 100)), SOCCER_BALL, time_limit=3.0)
    assert (path.status, path.duration) == ("aloft", 3.0)
    assert path.landing.position == pytest.approx([3, 0, 300 - 9.81 * 4.5])
    assert path.height == path.landing.position[2]


@pytest.mark.parametrize("speed", [1e-150, 1e-160, 1e-200, 1e-300])
def test_speeds_without_a_square_keep_their_digits(speed):
    assert time_to_fall(speed, 0.0, 9.81) == pytest.approx(2 * speed / 9.81, rel=1e-14)
    down = time_to_fall(-speed, speed, 9.81)
    assert down == pytest.approx(math.sqrt(2 * speed / 9.81), rel=1e-14)
    assert time_to_fall(speed, 1.0, -9.81) == math.inf
