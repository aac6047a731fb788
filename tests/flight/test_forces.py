import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.core.vectors import GRAVITY
from kickdyn.flight.forces import downward, forces, is_ballistic

BALL = kd.Ball(mass=0.4, radius=0.12)


def acceleration(air, velocity, spin=(0, 0, 0), ball=BALL):
    return np.array(forces(ball, air)(9.0, *velocity, *spin)[:3])


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
