"""One side of a swing, made of accelerations that miss its ends by a solver's rounding."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning import swing_phase
from kickdyn.planning.swing_phase import make_phase, swing_chain

CHAIN = swing_chain(kd.Leg.human())
Q, W, TIME, MANY = np.array([0.2, 0.5, 0.1]), np.array([3.0, 2.0, -1.0]), 0.4, 8
END = Q + W * TIME / 2


def part(sign=1, off=1e-6):
    even = np.tile(-W / TIME, (MANY + 1, 1))
    even[::2] += off
    return make_phase(CHAIN, sign, Q, W, even, np.linspace(0.0, TIME, MANY + 1), END)


@pytest.mark.parametrize("sign", [-1, 1])
def test_both_ends_are_met_exactly(sign):
    way = part(sign).sample([0.0, sign * TIME])
    assert way.q == pytest.approx(np.array([Q, END]), abs=1e-14)
    assert way.v == pytest.approx(np.array([sign * W, 0 * W]), abs=1e-14)
    assert way.a == pytest.approx(np.tile(-W / TIME, (2, 1)), abs=1e-4)


def test_the_torque_is_looked_for_between_the_nodes():
    w = np.array([9.0, -15.0, 0.0])
    one = make_phase(
        CHAIN, 1, Q, w, np.tile(-w / TIME, (2, 1)), np.array([0.0, TIME]), Q + w * TIME / 2
    )
    model, data = CHAIN.model, CHAIN.model.createData()
    torques = [
        np.abs(pin.rnea(model, data, *row) / CHAIN.effort_limit).max()
        for row in zip(*one.sample(np.linspace(0, TIME, 2001))[1:4], strict=True)
    ]
    assert one.torque_use == pytest.approx(max(torques), rel=1e-2)
    assert one.torque_use > 1.1 * max(torques[0], torques[-1])


@pytest.mark.parametrize(("what", "named"), [("velocityLimit", "speed"), ("effortLimit", "torque")])
def test_a_joint_without_limits_is_refused(what, named):
    model = kd.Leg.human().model
    limits = getattr(model, what)
    limits[1] = np.inf
    setattr(model, what, limits)
    with pytest.raises(kd.InvalidInput, match=f"^{named} limit of knee is inf: a swing needs one"):
        swing_chain(kd.Leg.from_model(model, "toe"))


def test_a_floating_base_is_refused():
    with pytest.raises(kd.InvalidInput, match="more than one coordinate"):
        swing_chain(kd.Leg.from_robot("g1", base="floating"))


def test_without_casadi_it_says_how_to_install_it(monkeypatch):
    monkeypatch.setattr(swing_phase, "find_spec", lambda name: None)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[swing\]"'):
        kd.plan_kick(kd.Leg.human(), kd.Goal(15, time=1), kd.Ball(), swing=True)
