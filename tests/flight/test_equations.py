"""As many states as the scene needs, and the same flight whichever they are."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.flight.equations import FlightEquations

BALL = kd.Ball()


def states(velocity, spin, **air):
    launch = kd.BallState(velocity=velocity, spin=spin)
    return len(FlightEquations(launch, BALL, kd.Air(**air)).begin)


def test_only_what_the_scene_needs():
    assert states((9, 0, 9), (0, 0, 0)) == 4
    assert states((9, 0, 9), (0, 30, 0), torque=None) == 4
    assert states((9, 0, 9), (0, 30, 0)) == 5
    assert states((9, 1, 9), (0, 0, 0)) == 6
    assert states((9, 0, 9), (0, 0, 0), wind=(0, 1, 0)) == 6
    assert states((9, 0, 9), (0, 0, 0), wind=lambda z: (z, 0.0, 0.0)) == 6  # who knows
    assert states((9, 0, 9), (1, 30, 0)) == 7


def test_a_flight_does_not_depend_on_its_plane():
    flat = kd.fly(kd.BallState(velocity=(20, 0, 9), spin=(0, -40, 0)), BALL, kd.Air(), tol=1e-13)
    c, s = math.cos(0.7), math.sin(0.7)
    turned = kd.BallState(velocity=(20 * c, 20 * s, 9), spin=(40 * s, -40 * c, 0))
    path = kd.fly(turned, BALL, kd.Air(), tol=1e-13)
    assert path.range == pytest.approx(flat.range, abs=1e-8)
    assert path.duration == pytest.approx(flat.duration, abs=1e-10)
    assert np.linalg.norm(path.landing.spin) == pytest.approx(abs(flat.landing.spin[1]), rel=1e-10)


def test_spin_decays_as_the_law_says():
    """At constant speed, exponentially: I omega' = -(rho A R^2 beta v + 8 pi mu R^3) omega."""
    air = kd.Air(drag=None, lift=None, buoyancy=False)
    path = kd.fly(kd.BallState(velocity=(25, 0, 1e-3), spin=(0, 60, 20)), BALL, air)
    t = path.duration
    tau = 2 * BALL.mass / (3 * air.density * BALL.cross_section * 0.010 * 25)
    assert tau == pytest.approx(25.1, abs=0.1)  # for m 0.43, C 0.69
    creep = 8 * math.pi * air.viscosity * BALL.radius**3 / BALL.inertia
    left = math.exp(-t * (1 / tau + creep))
    assert path.landing.spin == pytest.approx(left * np.array([0, 60, 20]), rel=1e-9)


def test_no_torque_no_decay():
    path = kd.fly(kd.BallState(velocity=(25, 0, 9), spin=(0, 60, 0)), BALL, kd.Air(torque=None))
    assert path.landing.spin.tolist() == [0, 60, 0]


def test_wind_may_depend_on_height():
    shear = kd.Air(wind=lambda z: (-2.0 * z, 0.0, 0.0))
    still, steady = kd.Air(), kd.Air(wind=(-2.0, 0.0, 0.0))
    launch = kd.BallState(velocity=(20, 0, 9))
    ranges = [kd.fly(launch, BALL, air).range for air in (still, steady, shear)]
    assert ranges == sorted(ranges, reverse=True)
    constant = kd.Air(wind=lambda z: (-2.0, 0.0, 0.0))
    assert kd.fly(launch, BALL, constant).range == pytest.approx(ranges[1], rel=1e-8)
