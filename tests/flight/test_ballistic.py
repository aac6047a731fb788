"""The vacuum, against 50-digit arithmetic."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath import mp, mpf

import kickdyn as kd
from kickdyn.flight.ballistic import ballistic, time_to_fall

BALL = kd.Ball()
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
    launch = kd.BallState((1, 2, BALL.radius + drop), (vx, vy, rise), (3, 4, 5))
    path = kd.fly(launch, BALL, ground=kd.Ground())
    height = float(launch.position[2]) - BALL.radius
    t = exact_time(rise, height, 9.81)
    assert path.duration == pytest.approx(t, rel=1e-12)
    assert path.range == pytest.approx(math.hypot(vx, vy) * t, rel=1e-12, abs=1e-12)
    assert path.landing.position[2] == pytest.approx(BALL.radius, abs=1e-12)
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
    path = kd.fly(kd.BallState((0, 0, 50), (20, 0, 10)), BALL, ground=kd.Ground())
    states = path.sample(np.linspace(0, path.duration, 50))
    energy = states.speed**2 / 2 + 9.81 * states.position[:, 2]
    assert energy == pytest.approx(np.full(50, energy[0]), rel=1e-14)


def test_whoever_stays_up_past_the_limit_is_aloft():
    path = kd.fly(kd.BallState(velocity=(1, 0, 100)), BALL, time_limit=3.0)
    assert (path.status, path.duration) == ("aloft", 3.0)
    assert path.landing.position == pytest.approx([3, 0, 300 - 9.81 * 4.5])
    assert path.height == path.landing.position[2]


@pytest.mark.parametrize("speed", [1e-150, 1e-160, 1e-200, 1e-300])
def test_speeds_without_a_square_keep_their_digits(speed):
    assert time_to_fall(speed, 0.0, 9.81) == pytest.approx(2 * speed / 9.81, rel=1e-14)
    down = time_to_fall(-speed, speed, 9.81)
    assert down == pytest.approx(math.sqrt(2 * speed / 9.81), rel=1e-14)
    assert time_to_fall(speed, 1.0, -9.81) == math.inf
