"""The equations of motion against the vector formulas; tolerances against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from references.vector_flight import rates
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight.equations import MAX_SPEED, FlightEquations, drag_length, tolerances

BALL, G = kd.Ball(), 9.81


@settings(max_examples=25)
@given(height=st.floats(0.5, 9), fallen=st.floats(-9, 9), left=st.floats(0.1, 1))
def test_rates_are_those_of_the_vector_formulas(height, fallen, left):
    """The wind is of the height above the ground, and the forces of the spin that is left."""
    air = kd.Air(wind=lambda z: (-2.0 * z, 0.3 * z, 0.0), drag="brazuca")
    spin = np.array([10.0, -40.0, 20.0])
    equations = FlightEquations(kd.BallState((1, 2, height), (20, 3, 9), spin), BALL, air)
    result = equations.rates(0.0, np.array([3.0, 1.0, fallen, 18.0, 2.0, -4.0, left]))
    moved = np.array([3.0, 1.0, fallen, 18.0, 2.0, -4.0, *(left * spin)])
    right = rates(moved, BALL, air, height)
    agrees(result[:6], right[:6], closed_form(1e3))
    assert result[6] * spin == pytest.approx(right[6:], rel=closed_form(1e3))


@pytest.mark.parametrize(("velocity", "spin", "air", "count"), [
    ((10, 3, 5), (0, 0, 0), kd.Air(drag=None, lift=None), 6),  # x and y at constant speed
    ((0, 0, 5), (0, 0, 0), kd.Air(drag=None, lift=None), 2),
    ((10, 0, 5), (0, 9, 0), kd.Air(), 5),
    ((10, 0, 5), (9, 0, 0), kd.Air(torque=None), 6),
])  # fmt: skip
def test_states_that_change_are_counted(velocity, spin, air, count):
    launch = kd.BallState(velocity=velocity, spin=spin)
    assert FlightEquations(launch, BALL, air).count_changing() == count


VACUUM = kd.Air(density=0.0)


@pytest.mark.parametrize(("speed", "drop", "wind", "length", "pace"), [
    (20.0, 0.0, 0.0, 400 / G, 20.0), (0.0, 5.0, 0.0, 10.0, math.sqrt(10 * G)),
    (1.0, 0.0, 10.0, 100 / G, 10.0), (1e-3, 7.0, 0.0, 14.0, math.sqrt(14 * G))])  # fmt: skip
def test_in_a_vacuum_tolerances_are_relative_to_the_parabola(speed, drop, wind, length, pace):
    result = tolerances(speed, drop, wind, BALL, VACUUM, 1e-6)
    assert result == pytest.approx((1e-6, 1e-6 * length, 1e-6 * pace), rel=closed_form())


@pytest.mark.parametrize("speed", [1e-3, 30.0, 1e3, 1e8])
def test_with_drag_they_are_relative_to_the_closed_form_straight_up(speed):
    air = kd.Air(drag=constant(0.2), lift=None, buoyancy=False)
    k = 0.5 * air.density * BALL.cross_section * 0.2 / BALL.mass
    height = math.log1p(k * speed**2 / G) / (2 * k)
    back = speed / math.sqrt(1 + k * speed**2 / G)
    result = tolerances(speed, 0.0, 0.0, BALL, air, 1e-6)
    assert result == pytest.approx((1e-6, 2e-6 * height, 1e-6 * back), rel=closed_form(100))


@pytest.mark.parametrize(("drag", "speed"), [
    *(("brazuca", speed) for speed in (15.0, 60.0, 1e3)), ("stokes", 1e-3), ("sphere", 0.1)
])  # fmt: skip
def test_the_drag_length_is_of_the_least_drag_on_the_way(drag, speed):
    """From a thousandth of the speed up to the next of 8 steps a decade."""
    air = kd.Air(drag=drag)
    reynolds = 2 * BALL.radius * air.density / air.viscosity  # at 1 m/s
    length = float(drag_length(BALL, air)(np.array(speed)))
    low, high = (
        2 * BALL.mass / (air.density * BALL.cross_section * min(map(air.drag, reynolds * speeds)))
        for speeds in (np.geomspace(speed / 1e3, most, 400) for most in (speed, 1.34 * speed))
    )
    assert 0.97 * low <= length <= 1.01 * high


@pytest.mark.parametrize("drag", [lambda *_: 1 / 0, constant(math.inf), lambda *_: -0.1])
def test_a_drag_that_is_not_known_bounds_no_length(drag):
    assert drag_length(BALL, kd.Air(drag=drag))(np.array(20.0)) == math.inf


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e3, 1e5, MAX_SPEED])
def test_a_flight_is_right_relative_to_its_own_length(speed, tol):
    """Straight up and down against the closed form, from a micrometre a second to light."""
    air = kd.Air(drag=constant(0.2), lift=None, buoyancy=False)
    path = kd.fly(kd.BallState(velocity=(0, 0, speed)), BALL, air, tol=tol)
    with mp.workdps(40):
        k = mpf(air.density) * BALL.cross_section * mpf(0.2) / (2 * mpf(BALL.mass))
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
