"""One side of a swing, made of accelerations that miss its ends by a solver's rounding."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning.swing_joints import joints_of
from kickdyn.planning.swing_phase import part_of

JOINTS = joints_of(kd.Leg.human())
Q, W, TIME, MANY = np.array([0.2, 0.5, 0.1]), np.array([3.0, 2.0, -1.0]), 0.4, 8
END = Q + W * TIME / 2


def part(sign=1, off=1e-6):
    even = np.tile(-W / TIME, (MANY + 1, 1))
    even[::2] += off
    return part_of(JOINTS, sign, Q, W, even, TIME, END)


@pytest.mark.parametrize("sign", [-1, 1])
def test_both_ends_are_met_exactly(sign):
    way = part(sign).sample([0.0, sign * TIME])
    assert way.q == pytest.approx(np.array([Q, END]), abs=1e-14)
    assert way.v == pytest.approx(np.array([sign * W, 0 * W]), abs=1e-14)
    assert way.a == pytest.approx(np.tile(-W / TIME, (2, 1)), abs=1e-4)


def test_more_nodes_are_the_same_way():
    one = part(off=0.5)
    q, v, a = one.resampled(3 * MANY)
    way = one.sample(np.linspace(0, TIME, 3 * MANY + 1))
    assert q == pytest.approx(way.q)
    assert v == pytest.approx(way.v)
    assert a == pytest.approx(way.a)
    again = part_of(JOINTS, 1, Q, W, a, TIME, q[-1])
    between = np.linspace(0, TIME, 101)
    assert again.sample(between).a == pytest.approx(one.sample(between).a, abs=1e-10)


def test_the_torque_is_looked_for_between_the_nodes():
    w = np.array([9.0, -15.0, 0.0])
    one = part_of(JOINTS, 1, Q, w, np.tile(-w / TIME, (2, 1)), TIME, Q + w * TIME / 2)
    model, data = JOINTS.model, JOINTS.model.createData()
    torques = [
        np.abs(pin.rnea(model, data, *row) / JOINTS.effort).max()
        for row in zip(*one.sample(np.linspace(0, TIME, 2001))[1:4], strict=True)
    ]
    assert one.torque_use == pytest.approx(max(torques), rel=1e-2)
    assert one.torque_use > 1.1 * max(torques[0], torques[-1])
