import numpy as np
import pytest
from blocks import in_any_order, made_up, number

from kickdyn.sweeps.top import Top, lot


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("most", [1, 8, 200])
def test_any_order_gives_the_first_of_all(seed, most):
    block = made_up(seed)
    found = in_any_order(
        block, lambda: Top(most, number("ball_speed"), ("hip", "launch_angle")), seed
    )
    expected = sorted(range(105), key=lambda i: (-block("ball_speed")[i], i))[:most]
    assert found.numbers.tolist() == expected
    assert found.values.tolist() == block("ball_speed")[expected].tolist()
    rows = np.column_stack([block("hip"), np.degrees(block("ball_speed"))])
    assert found.rows.tolist() == rows[expected].tolist()


def test_a_sample_is_the_same_in_any_order_and_another_for_another_seed():
    block = made_up(0)
    samples = [in_any_order(block, lambda: Top(20, lot(4)), seed).numbers for seed in range(5)]
    assert len({tuple(each) for each in samples}) == 1
    other = in_any_order(block, lambda: Top(20, lot(5)), 0)
    assert set(other.numbers) != set(samples[0])


def test_a_sample_takes_every_value_of_every_joint_alike():
    block = made_up(0)
    hits = np.zeros(105)
    for seed in range(2000):
        sample = Top(21, lot(seed))
        sample.update(block)
        hits[sample.numbers] += 1
    assert np.abs(hits - 400).max() < 4.5 * np.sqrt(400 * 0.8)  # of 105, beyond with p = 7e-4


def test_nan_does_not_count():
    block = made_up(0)
    top = Top(200, number("hip / (knee - 2) * (knee - 2) / (knee - 2)"))
    top.update(block)
    assert top.numbers.size == np.count_nonzero(block("knee") != 2)
