"""Torques during a contact: taken over, checked, pickled."""

import copy
import operator
import pickle

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.impact.joint_torque import acting, own_torque

LEG = kd.Leg.human()
Q = np.radians([5, 10, -5])


def damper(t, q, v):
    return -0.5 * v


def human(torque):
    v = LEG.posture(Q).joint_velocity((14.0, 0.0, 4.0))
    return kd.collide(
        LEG.posture(Q), v, kd.Ball(), kd.Contact((1, 0, 0.3), 0.5), torque=torque, tol=1e-6
    )


def test_numbers_are_copied():
    given = np.array([1.0, 2.0, 3.0])
    ours = own_torque(given, 3)
    given[:] = 9.0
    assert acting(ours, 3)(0.0, Q, Q).tolist() == [1.0, 2.0, 3.0]
    assert own_torque(None, 3).tolist() == [0.0, 0.0, 0.0]
    assert own_torque(damper, 3) is damper


@pytest.mark.parametrize("torque", [lambda t: [0, 0, 0], lambda: None, operator.neg])
def test_it_must_take_time_q_and_v(torque):
    with pytest.raises(kd.InvalidInput, match=r"torque is .* must take three values, t, q, v"):
        human(torque)


def test_functions_of_a_module_can_be_pickled():
    hit = human(damper)
    assert (pickle.loads(pickle.dumps(hit)).impulse == hit.impulse).all()


def test_a_lambda_cannot_but_copies():
    hit = human(lambda t, q, v: -0.5 * v)
    with pytest.raises(kd.InvalidInput, match="to pickle a collision it must be numbers or a func"):
        pickle.dumps(hit)
    assert copy.copy(hit).impulse is copy.deepcopy(hit).impulse is hit.impulse
