import copy

import numpy as np

import kickdyn as kd


def test_contacts_of_the_same_values_are_equal():
    one, other = kd.Contact((0, 0, 5), 0.8), kd.Contact([0.0, 0.0, 1.0], 0.8, offset=None)
    assert one == other
    assert hash(one) == hash(other)
    assert one != kd.Contact((0, 0, 1), 0.8, offset=(0, 0, 0))
    assert one != kd.Contact((0, 1, 0), 0.8)
    assert one != 0.8


def test_states_of_the_same_values_are_equal():
    one, other = (kd.BallState(velocity=np.ones((2, 3))) for _ in range(2))
    assert one == other == copy.deepcopy(one)
    assert hash(one) == hash(other)
    assert one != kd.BallState(velocity=(1, 1, 1))
    assert kd.BallState((-0.0, 0, 0)) == kd.BallState((0.0, 0, 0))
