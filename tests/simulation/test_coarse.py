"""Large steps end where the exact engine does, and ever nearer as they shrink."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.simulation.coarse import Way, coarse_end, coarse_path

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
    exact = kd.fly(LAUNCH, BALL, AIR, ground, plane=plane).landing
    errors = []
    for steps in (4, 8, 16, 32):
        end, calls = coarse_end(LAUNCH, Way(BALL, AIR, ground, plane), steps)
        errors.append(float(np.linalg.norm(end.position - exact.position)))
        assert calls < 8 * steps + 20
    assert errors[0] < 0.05
    assert errors[-1] < 2e-5
    np.testing.assert_allclose(end.velocity, exact.velocity, atol=1e-4)
    np.testing.assert_allclose(end.spin, exact.spin, rtol=1e-6)
    assert end.time == pytest.approx(exact.time, abs=1e-5)


@pytest.mark.parametrize("air", [None, AIR, kd.Air(lift=None)])
@pytest.mark.parametrize("surface", ["turf", "wet grass", "carpet"])
def test_courses_come_to_rest_where_they_should(air, surface):
    ground = kd.Ground(surface=surface)
    exact = kd.follow(LAUNCH, BALL, air, ground).rest
    end, _ = coarse_end(LAUNCH, Way(BALL, air, ground, None), 16)
    np.testing.assert_allclose(end.position, exact.position, atol=2e-3)
    assert end.time == pytest.approx(exact.time, abs=2e-3)


def test_a_parabola_is_exact():
    exact = kd.fly(LAUNCH, BALL, None, kd.Ground()).landing
    end, nodes, _ = coarse_path(LAUNCH, Way(BALL, None, kd.Ground(), None), 4)
    np.testing.assert_allclose(end.position, exact.position, rtol=1e-13)
    assert len(nodes) >= 4


def test_what_is_not_for_large_steps():
    way = Way(BALL, AIR, kd.Ground(surface="turf"), kd.Plane((5, 0, 0), (-1, 0, 0)))
    assert coarse_end(LAUNCH, way, 4) == (None, 0)
    balloon = Way(kd.Ball(0.001, 0.2), kd.Air(), kd.Ground(), None)
    assert coarse_end(LAUNCH, balloon, 4)[0] is None


def test_a_ball_on_the_ground_that_does_not_rise_is_there_already():
    down = kd.BallState((1, 0, BALL.radius), (3, 0, -1))
    end, calls = coarse_end(down, Way(BALL, AIR, kd.Ground(), None), 4)
    assert (calls, end.time) == (0, 0)
    np.testing.assert_array_equal(end.position, down.position)
