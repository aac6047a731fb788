"""The integrator: a closed form, and its order."""

import math

import numpy as np
import pytest
from tolerances import integrated

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight.forces import FINEST, FlightEquations
from kickdyn.flight.integrate import Integration, Tolerance, solve_one

BALL = kd.Ball()


def test_lift_alone_turns_a_ball_in_circles():
    """Neutrally buoyant and without drag: ten circles with the radius 2 m / (rho A C_L)."""
    air = kd.Air(drag=None, lift=constant(0.5), torque=None)
    ball = kd.Ball(air.density * BALL.volume, BALL.radius)
    radius = 2 * ball.mass / (air.density * ball.cross_section * 0.5)
    path = kd.fly(kd.BallState(velocity=(3, 0, 0), spin=(0, 0, 20)), ball, air,
                  kd.Ground(-0.2), 1e-8, time_limit=12.0)  # fmt: skip
    angle = 3.0 / radius * 12.0
    right = radius * np.array([math.sin(angle), 1 - math.cos(angle), 0])
    assert path.landing.position == pytest.approx(right, abs=integrated(1e-8) * 3.0 * 12.0)
    true = np.linalg.norm(path.landing.position - right)
    assert true < path.error < 10 * true


@pytest.mark.parametrize(("velocity", "end", "least"), [
    ((25, 2, 12), 2.5, 7.5),
    ((2, 0.3, 6), 1.2, 6.0),  # through Re 2e4 to 7e4, where formulas join
    ((50, 2, 22), 3.0, 7.0),  # through 35 m/s, where the data end
])  # fmt: skip
def test_the_error_falls_with_about_the_eighth_power_of_the_evaluations(velocity, end, least):
    motion = FlightEquations(kd.BallState((0, 0, 0), velocity, (5, -30, 15)), BALL, kd.Air())

    def arc(tol):
        tolerance = Tolerance(max(tol, FINEST), np.full(7, tol))
        return solve_one(Integration(motion.rates, [], end, tolerance).run(motion.begin))

    exact = arc(1e-14).state
    arcs = [arc(10.0**-k) for k in np.arange(3, 10.6, 0.25)]
    errors = [np.abs(each.state - exact).max() for each in arcs]
    slope, _ = np.polyfit(np.log([each.evaluations for each in arcs]), np.log(errors), 1)
    assert -slope > least
