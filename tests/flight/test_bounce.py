import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.flight.bounce import bounce, energy, slip
from kickdyn.ground import SURFACES, Surface

BALL = kd.Ball()


def surface(e=0.6, mu=0.5, tangential=0.0):
    return Surface("test", e, mu, 0.75, tangential)


@given(
    motion=st.tuples(*[st.floats(-50, 50)] * 2, st.floats(-50, -1e-3)),
    spin=st.tuples(*[st.floats(-300, 300)] * 3),
    e=st.floats(0, 1),
    mu=st.floats(0, 3),
    tangential=st.floats(-1, 1),
)
@settings(max_examples=500, deadline=None)
def test_energy_never_rises_and_the_laws_hold(motion, spin, e, mu, tangential):
    before = kd.BallState((0, 0, 1), motion, spin)
    after = bounce(before, BALL, surface(e, mu, tangential))
    assert energy(after, BALL) <= energy(before, BALL) * (1 + 1e-12)
    assert after.velocity[2] == pytest.approx(-e * before.velocity[2], rel=1e-12)
    assert after.spin[2] == before.spin[2]
    push = BALL.mass * (after.velocity - before.velocity)
    friction, normal = math.hypot(push[0], push[1]), push[2]
    assert friction <= mu * normal * (1 + 1e-9) + 1e-12
    turn = BALL.inertia * (after.spin - before.spin)
    assert turn == pytest.approx(np.cross((0, 0, -BALL.radius), push), rel=1e-9, abs=1e-9)
    ux, uy = slip(before, BALL)
    if friction < mu * normal * (1 - 1e-9) and mu > 1e-6:  # it gripped
        reversed_slip = (-tangential * ux, -tangential * uy)
        assert slip(after, BALL) == pytest.approx(reversed_slip, abs=1e-9 * (1 + abs(ux) + abs(uy)))


def test_gripping_it_leaves_rolling():
    after = bounce(kd.BallState((0, 0, 1), (5, 0, -5)), BALL, surface(mu=2))
    assert after.velocity == pytest.approx([3, 0, 3])  # 2/5 of the slip is lost
    assert after.spin == pytest.approx([0, 3 / BALL.radius, 0])


def test_slipping_it_loses_mu_times_the_normal_impulse():
    after = bounce(kd.BallState((0, 0, 1), (20, 0, -2)), BALL, surface(e=0.5, mu=0.3))
    assert after.velocity == pytest.approx([20 - 0.3 * 1.5 * 2, 0, 1])


def test_back_spin_checks_and_side_spin_stays():
    before = kd.BallState((0, 0, 1), (5, 0, -5), (0, -200, 40))
    after = bounce(before, BALL, SURFACES["turf"])
    plain = bounce(kd.BallState((0, 0, 1), (5, 0, -5)), BALL, SURFACES["turf"])
    assert after.velocity[0] < plain.velocity[0]
    assert after.spin[2] == 40
