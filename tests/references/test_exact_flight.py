"""Landing points to 20 digits: a closed form, kd.fly at its finest, and a finer step."""

import pytest
from flight_methods import kicks

import kickdyn as kd
from references import exact_flight
from references.exact_flight import extrapolated, landing, mp

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")


def test_a_step_is_right_to_twenty_digits():
    after = extrapolated(lambda y: [y[1], -y[0]], [mp.zero, mp.one], mp.mpf("0.2"))
    assert abs(after[0] - mp.sin(mp.mpf("0.2"))) < mp.mpf(10) ** -25
    assert abs(after[1] - mp.cos(mp.mpf("0.2"))) < mp.mpf(10) ** -25


@pytest.mark.parametrize("state", kicks(2))
def test_it_is_where_fly_lands_and_does_not_depend_on_the_step(state, monkeypatch):
    exact = landing(state, BALL, AIR)
    assert exact == pytest.approx(kd.fly(state, BALL, AIR, tol=1e-13).landing.position, abs=1e-11)
    monkeypatch.setattr(exact_flight, "STEP", 0.13)
    assert landing(state, BALL, AIR) == pytest.approx(exact, abs=1e-14)


def test_without_spin_there_is_drag_only():
    state = kd.BallState(velocity=(24, 1, 9))
    flown = kd.fly(state, BALL, kd.Air(drag="brazuca", lift=None), tol=1e-13).landing.position
    assert landing(state, BALL, AIR) == pytest.approx(flown, abs=1e-11)
