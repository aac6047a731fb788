import dataclasses
import math

import pytest

import kickdyn as kd


@pytest.mark.parametrize("height", [math.nan, math.inf, "0", None, True, [0.0]], ids=repr)
def test_ground_refuses(height):
    with pytest.raises(kd.InvalidInput, match=r"ground height is .*finite number \[m\]"):
        kd.Ground(height)


@pytest.mark.parametrize("height", [0, -3.5, 8848])
def test_ground_is_level_and_frozen(height):
    ground = kd.Ground(height)
    assert ground.height == height
    with pytest.raises(dataclasses.FrozenInstanceError):
        ground.height = 0.0


def test_ground_is_at_zero_unless_named():
    assert kd.Ground() == kd.Ground(0.0)
