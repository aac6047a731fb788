from fractions import Fraction

import numpy as np
import pytest
from blocks import SPACE, in_any_order, made_up, number

import kickdyn as kd
from kickdyn.sweeps.marginal import Marginal


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("joints", [("knee",), ("hip", "slide"), ("slide", "hip")])
@pytest.mark.parametrize("of", ["ball_speed", "-worst_joint_impulse"])
def test_any_order_gives_best_and_mean_of_every_value(seed, joints, of):
    block = made_up(seed)
    block = block.pick(block("hip") + block("slide") != 3)
    value = number(of)
    found = in_any_order(block, lambda: Marginal(SPACE, joints, value), seed).dataset()
    assert found.best.dims == joints
    for place in np.ndindex(*(len(SPACE.axes[name]) for name in joints)):
        cell = found.isel(dict(zip(joints, place, strict=True)))
        mask = np.all([block(name) == float(cell[name]) for name in joints], axis=0)
        values, numbers = value(block)[mask], block.numbers[mask]
        assert cell["count"] == mask.sum()
        if not mask.any():
            assert np.isnan(cell["best"])
            assert np.isnan(cell["mean"])
            assert cell["number"] == -1
            continue
        assert cell["best"] == values.max()
        assert cell["number"] == numbers[values.argmax()]
        assert cell["mean"] == float(sum(map(Fraction, values)) / len(values))


def test_bins_take_neighbours_together():
    block = made_up(2)
    binned = Marginal(SPACE, ("hip", "knee"), number("ball_speed"), bins=3)
    binned.update(block)
    data = binned.dataset()
    assert data.hip.values == pytest.approx([1.0, 3.5, 5.5])
    assert data.knee.values == pytest.approx([0.5, 2.5, 4.0])
    mask = (block("hip") <= 2) & (block("knee") >= 4)
    assert data.best.values[0, 2] == block("ball_speed")[mask].max()
    assert data["count"].values.sum() == SPACE.size


@pytest.mark.parametrize("joints", [(), ("nose",), ("hip", "hip"), ("hip", "knee", "slide")])
def test_one_or_two_joints(joints):
    with pytest.raises(kd.InvalidInput, match="name one or two of hip, knee, slide"):
        Marginal(SPACE, joints, number("hip"))
