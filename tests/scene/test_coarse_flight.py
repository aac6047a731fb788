"""Large steps end where the exact engine does, and ever nearer as they shrink."""

from itertools import pairwise

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.coarse_flight import coarse_end
from kickdyn.scene.scene import FlightEnvironment

BALL = kd.Ball()
LAUNCH = kd.BallState((0, 0, 0.5), (18, 2, 7), (3, -30, 15))
AIR = kd.Air(wind=(2, -1, 0))


@pytest.mark.parametrize(
    ("ground", "plane"),
    [
        (None, None),
        (kd.Ground(), None),
        (kd.Ground(), kd.Plane((12, 0, 0), (-1, 0.2, 0.1), "back")),
        (kd.Ground(-5), kd.Plane((100, 0, 0), (-1, 0, 0))),
    ],
)
def test_flights_end_where_they_should(ground, plane):
    path = kd.fly(LAUNCH, BALL, AIR, ground, plane=plane)
    exact, errors = path.landing, []
    for steps in (4, 8, 16, 32):
        end, status, calls, _ = coarse_end(
            LAUNCH, FlightEnvironment(BALL, AIR, ground, plane), steps
        )
        errors.append(float(np.linalg.norm(end.position - exact.position)))
        assert calls < 8 * steps + 20
        assert status == path.status
    assert errors[0] < 0.05
    assert errors[-1] < 2e-5
    np.testing.assert_allclose(end.velocity, exact.velocity, atol=1e-4)
    np.testing.assert_allclose(end.spin, exact.spin, rtol=1e-6)
    assert end.time == pytest.approx(exact.time, abs=1e-5)


def test_a_parabola_is_exact():
    exact = kd.fly(LAUNCH, BALL, None, kd.Ground()).landing
    end, _, _, nodes = coarse_end(LAUNCH, FlightEnvironment(BALL, None, kd.Ground(), None), 4)
    np.testing.assert_allclose(end.position, exact.position, rtol=1e-13)
    assert len(nodes) >= 4


@pytest.mark.parametrize("mass", [0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("radius", [0.05, 0.11, 0.2])
@pytest.mark.parametrize("up", [-3, 2, 15])
def test_light_balls_are_right_or_left_to_the_exact_engine(mass, radius, up):
    ball, air = kd.Ball(mass, radius), kd.Air(drag="sphere", lift=None, torque=None)
    launch = kd.BallState((0, 0, radius + 0.4), (20, 0, up), (0, 0, 0))
    exact = kd.fly(launch, ball, air, kd.Ground()).landing.position
    found = [
        coarse_end(launch, FlightEnvironment(ball, air, kd.Ground(), None), n).state
        for n in (4, 8, 16)
    ]
    for rough, fine in pairwise(found):
        if rough is not None and fine is not None:
            missed = 2 * np.linalg.norm(fine.position - rough.position)
            assert np.linalg.norm(fine.position - exact) <= missed + 1e-9


def test_what_is_not_for_large_steps():
    balloon = FlightEnvironment(kd.Ball(0.001, 0.2), kd.Air(), kd.Ground(), None)
    assert coarse_end(LAUNCH, balloon, 4).state is None
    bouncing = FlightEnvironment(BALL, AIR, kd.Ground(surface="turf"), None)
    assert coarse_end(LAUNCH, bouncing, 4) == (None, "", 0, ())
    for state in (kd.BallState((0, 0, 0), (1, 0, 1)), kd.BallState((0, 0, 1), (4e8, 0, 1))):
        assert coarse_end(state, FlightEnvironment(BALL, AIR, kd.Ground(), None), 4).state is None
        with pytest.raises(kd.InvalidInput):
            kd.fly(state, BALL, AIR, kd.Ground())
    high = kd.BallState((0, 0, 1e7), (1, 0, 1))
    assert coarse_end(high, FlightEnvironment(BALL, None, kd.Ground(), None), 4).state is None
    assert kd.fly(high, BALL, None, kd.Ground()).status == "aloft"


def test_a_ball_on_the_ground_that_does_not_rise_is_there_already():
    down = kd.BallState((1, 0, BALL.radius), (3, 0, -1))
    end, _, calls, _ = coarse_end(down, FlightEnvironment(BALL, AIR, kd.Ground(), None), 4)
    assert (calls, end.time) == (0, 0)
    np.testing.assert_array_equal(end.position, down.position)
