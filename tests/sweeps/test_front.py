import numpy as np
import pytest
from blocks import in_any_order, made_up, number

from kickdyn.sweeps.front import Front


def fresh():
    return Front(number("ball_speed"), number("worst_joint_impulse"))


def by_force(more, less):
    """Return what no other beats: as good in one, better in the other; of equals, the first."""
    kept = []
    for i in range(len(more)):
        as_good = (more >= more[i]) & (less <= less[i])
        better = as_good & ((more > more[i]) | (less < less[i]))
        equal = as_good & ~better
        if not better.any() and np.flatnonzero(equal)[0] == i:
            kept.append(i)
    return sorted(kept, key=lambda i: -more[i])


@pytest.mark.parametrize("seed", range(20))
def test_any_order_gives_what_no_other_beats(seed):
    block = made_up(seed)
    found = in_any_order(block, fresh, seed)
    expected = by_force(block("ball_speed"), block("worst_joint_impulse"))
    assert found.points[:, 2].tolist() == expected
    assert (found.points[:, 0] == block("ball_speed")[expected]).all()
    assert (found.points[:, 1] == block("worst_joint_impulse")[expected]).all()


def test_nan_is_on_no_front():
    block = made_up(0)
    one = Front(number("ball_speed / (hip - hip)"), number("hip"))
    one.update(block.pick(block("ball_speed") == 0.0))
    two = Front(number("0 / (hip - 3)"), number("knee"))
    two.update(block)
    assert len(one.points) == 0
    assert two.points.tolist() == [[0.0, 0.0, 0.0]]
