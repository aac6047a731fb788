"""The end of a path in large steps is as exact as its estimate, and the launch has its share."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.flight_end import EndSlopes, approximate_end, end_slopes, exact_end
from kickdyn.scene.scene import FlightEnvironment

CASES = {
    "little before the last steps": (
        kd.Ball(0.1, 0.2),
        kd.Air(drag="sphere", lift="nathan", torque=None),
        kd.BallState((0, 0, -0.6771), (0.6173, 0.5986, 2.818), (53.91, 7.491, -10.47)),
        kd.Ground(-0.877144),
    ),
    "in position, not in velocity": (
        kd.Ball(0.43, 0.11),
        kd.Air(drag="goff-carre", lift=None, torque=None),
        kd.BallState((0, 0, 0), (0.1, -0.2, 10.7), (-40, 57, 12)),
        kd.Ground(-1),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_ends_that_agree_by_accident_have_an_error(name):
    ball, air, launch, ground = CASES[name]
    environment = FlightEnvironment(ball, air, ground, None)
    end = approximate_end(launch, environment, 0.01)
    assert end.path is None
    moved = np.linalg.norm(end.state.position - exact_end(launch, environment, 1e-9).state.position)
    assert moved <= end.error() <= 0.01


def narrow(reynolds, spin_parameter):
    """A drag coefficient with a dip 880 wide, which large steps pass over."""
    return 0.25 - 60.0 * np.exp(-(((reynolds - 2.2e5) / 440.0) ** 2))


def test_a_coefficient_of_the_users_own_is_left_to_fly():
    environment = FlightEnvironment(kd.Ball(), kd.Air(drag=narrow), kd.Ground(), None)
    launch = kd.BallState((0, 0, 0.2), (20, 0, 8), (0, 0, 0))
    end = approximate_end(launch, environment, 0.5)
    assert isinstance(end.path, kd.Flight)
    assert end.path.tol == 1e-9


def test_the_error_of_a_contact_is_that_of_the_formula():
    slopes = EndSlopes(np.diag([2.0, 1.0, 0.5]), np.diag([0.0, 0.3, 0.1]), 0)
    launch = kd.BallState((0, 0, 0), (3, 0, 4), (0, 0, 6))
    size = 2 * 5 + 0.3 * max(6, 5 / 0.5)
    error = 20 * 1e-4 * (size + 0.5)
    assert slopes.contact_error(launch, 0.5, 1e-4) == pytest.approx(error, rel=1e-12)


def test_a_ball_that_leaves_at_rest_has_no_slopes():
    still = kd.BallState((0, 0, 1))
    slopes = end_slopes(still, FlightEnvironment(kd.Ball(), None, kd.Ground(), None))
    assert slopes.contact_error(still, 0.1, 1e-3) == np.inf
