"""A flight is right relative to its own length, at any speed."""

import pytest
from mpmath import mp, mpf
from tolerances import integrated

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight.equations import MAX_SPEED

BALL, G = kd.Ball(), 9.81


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
