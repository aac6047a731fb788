import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.flight.bounce import slip
from kickdyn.flight.roll import roll, slide
from kickdyn.ground import SURFACES, Surface

BALL = kd.Ball()
TURF = SURFACES["turf"]


def on_ground(velocity, spin=(0, 0, 0)):
    return kd.BallState((1, 2, BALL.radius), velocity, spin)


def test_rolling_stops_where_constant_deceleration_says():
    surface = Surface("ramp test", 0.6, 0.7, 0.735)
    path = roll(on_ground((3.43, 0, 0)), BALL, None, surface, 1e-10)
    assert path.end.position[0] - 1 == pytest.approx(8.0, abs=0.005)  # FIFA's longest roll
    assert path.end.position[0] - 1 == pytest.approx(3.43**2 / 2 / 0.735, rel=1e-9)
    assert path.duration == pytest.approx(3.43 / 0.735, rel=1e-9)
    assert path.end.velocity.tolist() == [0, 0, 0]


def test_drag_shortens_the_roll():
    far = [roll(on_ground((9, 3, 0)), BALL, air, TURF, 1e-9).end for air in (None, kd.Air())]
    way = [end.position - [1, 2, BALL.radius] for end in far]
    assert np.linalg.norm(way[1]) < 0.97 * np.linalg.norm(way[0])
    for moved in way:
        assert moved[1] / moved[0] == pytest.approx(1 / 3)


def test_while_it_rolls_its_lowest_point_rests():
    path = roll(on_ground((4, -2, 0)), BALL, kd.Air(), TURF, 1e-9)
    states = path.sample(np.linspace(0, path.duration, 50))
    for velocity, spin in zip(states.velocity, states.spin, strict=True):
        here = kd.BallState((0, 0, 0), velocity, spin)
        assert slip(here, BALL) == pytest.approx((0, 0), abs=1e-12)


def test_sliding_ends_in_rolling():
    state = on_ground((10, 0, 0))
    path = slide(state, BALL, None, TURF)
    assert slip(path.end, BALL) == pytest.approx((0, 0), abs=1e-12)
    assert path.end.velocity[0] == pytest.approx(6)  # 3/5 of it, whatever mu
    assert path.duration == pytest.approx(4 / (0.7 * 9.81))
    assert path.end.position[0] - 1 == pytest.approx((10 + 6) / 2 * path.duration)


def test_what_rolls_does_not_slide():
    rolling = on_ground((3, 0, 0), (0, 3 / BALL.radius, 0))
    assert slide(rolling, BALL, None, TURF) is None
    assert slide(on_ground((3, 0, 0)), BALL, None, Surface("ice", 0.5, 0.0, 0.1)) is None


def test_a_ball_at_rest_rests():
    path = roll(on_ground((0, 0, 0)), BALL, kd.Air(), TURF, 1e-9)
    assert path.duration == 0
    assert path.sample(np.zeros(2)).position.tolist() == [[1, 2, BALL.radius]] * 2


def test_a_tail_wind_does_not_roll_it_for_ever():
    path = roll(on_ground((1, 0, 0)), BALL, kd.Air(wind=(30, 0, 0)), TURF, 1e-6)
    assert math.isfinite(path.duration)
