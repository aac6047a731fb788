"""What acts on a ball against the vector formulas; the vacuum against 50-digit arithmetic."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from references.vector_flight import rates
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight.forces import (
    MAX_SPEED,
    acceleration_function,
    brakes,
    downward,
    is_ballistic,
    reynolds_number,
    time_to_fall,
)

BALL = kd.Ball(mass=0.4, radius=0.12, inertia_factor=0.5)


def vectors(size):
    return st.tuples(*[st.floats(-size, size)] * 3)


@settings(max_examples=60)
@given(velocity=vectors(30), wind=vectors(8), shear=vectors(1), spin=vectors(80),
    models=st.tuples(*(st.sampled_from([None, *package.MODELS]) for package in
    (drag, lift, spin_decay))), density=st.floats(0.5, 20.0), buoyancy=st.booleans())  # fmt: skip
def test_forces_are_those_of_the_vector_formulas(
    velocity, wind, shear, spin, models, density, buoyancy
):
    """Of any models, in a wind that depends on the height."""

    def blowing(height):
        return tuple(w + s * height for w, s in zip(wind, shear, strict=True))

    air = kd.Air(density, 2e-5, blowing, *models, buoyancy=buoyancy)
    u = np.array(velocity) - blowing(3.5)
    assume(math.hypot(*u) > 1.0)
    assume(np.linalg.norm(np.cross(spin, u)) > 1e-3 or not any(spin))
    *acceleration, decay = acceleration_function(BALL, air)(3.5, *velocity, *spin)
    right = rates(np.array([0, 0, 0.5, *velocity, *spin]), BALL, air, 3.0)
    agrees(acceleration, right[3:6], closed_form(1e3))
    agrees(-decay * np.array(spin), right[6:], closed_form(1e3))
    reynolds = density * 0.24 * math.hypot(*u) / 2e-5
    assert reynolds_number(BALL, air)(3.5, *velocity) == pytest.approx(reynolds, rel=closed_form())


@pytest.mark.parametrize("velocity", [(0, 0, 0), (1e-200, 0, 0), (5, 0, 0)])
def test_a_ball_that_moves_with_the_wind_feels_neither_drag_nor_lift(velocity):
    """The torque of creeping flow is left: 8 pi mu r^3 / I."""
    air = kd.Air(wind=velocity)
    *acceleration, decay = acceleration_function(BALL, air)(0.0, *velocity, 0, 99, 0)
    assert acceleration == [0, 0, -downward(BALL, air)]
    creep = 8 * math.pi * air.viscosity * BALL.radius**3 / BALL.inertia
    assert decay == pytest.approx(creep, rel=closed_form())


SPIN, STILL = np.array([0.0, 1.0, 0.0]), np.zeros(3)
SPEED = st.floats(-1e3, 1e3)


@pytest.mark.parametrize(("air", "spin", "closed", "braked"), [
    (None, SPIN, True, False),
    (kd.Air(density=0.0), SPIN, True, False),
    (kd.Air(drag=None, lift=None, torque=None), SPIN, True, False),
    (kd.Air(0.5, drag=None, lift=None), SPIN, False, True),
    (kd.Air(drag=None), STILL, True, False),  # lift needs spin
    (kd.Air(drag=None, torque=None), SPIN, False, False),
    (kd.Air(lift=None), STILL, False, False),
])  # fmt: skip
def test_a_closed_form_answers_where_only_weight_acts(air, spin, closed, braked):
    assert is_ballistic(air, spin) is closed
    assert brakes(air, spin) is braked


@pytest.mark.parametrize(("rise", "drop", "g", "time"), [
    (-1e8, 1.0, 9.81, 1e-8 / (1 + 9.81e-16 / 2)),  # without cancellation
    (1e-200, 0.0, 9.81, 2e-200 / 9.81),  # its square is 0 in float64
    (1.0, 1.0, -9.81, math.inf),  # a balloon
    (1.0, 1.0, 0.0, math.inf),
    (-2.0, 1.0, 0.0, 0.5),
    (-2.0, 1.0, -1.0, 2 - math.sqrt(2)),  # slowed, it still comes down
    (-1.0, 1.0, -1.0, math.inf),  # slowed, it turns before
])  # fmt: skip
def test_time_to_fall_of_special_falls(rise, drop, g, time):
    assert time_to_fall(rise, drop, g) == pytest.approx(time, rel=closed_form())
    many = time_to_fall(np.full(2, rise), np.full(2, drop), np.full(2, g))
    assert many.tolist() == [time_to_fall(rise, drop, g)] * 2


@settings(max_examples=40)
@given(vx=SPEED, vy=SPEED, rise=SPEED, drop=st.floats(0.01, 1e3))
def test_a_flight_in_a_vacuum_is_the_formula(vx, vy, rise, drop):
    assume(rise == 0 or abs(rise) > 1e-6)
    launch = kd.BallState((1, 2, BALL.radius + drop), (vx, vy, rise), (3, 4, 5))
    path = kd.fly(launch, BALL, ground=kd.Ground(), time_limit=1e9)
    fall, g = mpf(float(launch.position[2]) - BALL.radius), mpf(9.81)
    with mp.workdps(50):
        t = float((mpf(rise) + mp.sqrt(mpf(rise) ** 2 + 2 * g * fall)) / g)
    exact = {"rel": closed_form(10), "abs": closed_form(10)}
    assert path.duration == pytest.approx(t, rel=closed_form(10))
    assert path.range == pytest.approx(math.hypot(vx, vy) * t, **exact)
    assert path.landing.position[2] == pytest.approx(BALL.radius, abs=closed_form(10))
    assert path.landing.velocity == pytest.approx([vx, vy, rise - 9.81 * t], **exact)
    assert path.height == pytest.approx(max(rise, 0) ** 2 / (2 * 9.81), **exact)
    assert path.apex.time == pytest.approx(max(rise, 0) / 9.81, rel=closed_form(10))
    assert path.landing.spin.tolist() == [3, 4, 5]
    assert (path.status, path.evaluations) == ("landed", 0)


SIZE5, G = kd.Ball(), 9.81


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e3, 1e5, MAX_SPEED])
def test_a_flight_is_right_relative_to_its_own_length(speed, tol):
    """Straight up and down against the closed form, from a micrometre a second to light."""
    air = kd.Air(drag=constant(0.2), lift=None, buoyancy=False)
    path = kd.fly(kd.BallState(velocity=(0, 0, speed)), SIZE5, air, tol=tol)
    with mp.workdps(40):
        k = mpf(air.density) * SIZE5.cross_section * mpf(0.2) / (2 * mpf(SIZE5.mass))
        g, v = mpf(G), mpf(speed)
        height = mp.log1p(k * v**2 / g) / (2 * k)
        climb = mp.atan(v * mp.sqrt(k / g)) / mp.sqrt(g * k)
        fall = mp.asinh(mp.sqrt(mp.expm1(2 * k * height))) / mp.sqrt(g * k)
        back = v / mp.sqrt(1 + k * v**2 / g)
    near = integrated(tol)
    assert path.height == pytest.approx(float(height), rel=near)
    assert path.apex.time == pytest.approx(float(climb), rel=near)
    assert path.duration == pytest.approx(float(climb + fall), rel=near)
    assert path.landing.velocity[2] == pytest.approx(-float(back), rel=near)
