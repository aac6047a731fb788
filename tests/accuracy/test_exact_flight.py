"""Landing points to 20 digits: a closed form, kd.fly at its finest, and a finer step."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.accuracy import exact_flight
from kickdyn.accuracy.exact_flight import extrapolated, landing, mp
from kickdyn.accuracy.flight_methods import kicks
from kickdyn.accuracy.taylor import taylor

BALL, AIR = kd.Ball(), kd.Air()


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
    flown = kd.fly(state, BALL, kd.Air(lift=None), tol=1e-13).landing.position
    assert landing(state, BALL, AIR) == pytest.approx(flown, abs=1e-11)


def test_heyoka_lands_there_too():
    pytest.importorskip("heyoka")
    state = kicks(1)[0]
    one = kd.BallState(*(part[None] for part in (state.position, state.velocity, state.spin)), [0])
    landed, _ = taylor(BALL, AIR, 1e-15)(one)
    assert np.abs(landed[0] - landing(state, BALL, AIR)).max() < 1e-13
