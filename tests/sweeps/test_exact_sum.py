from fractions import Fraction

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.exact_sum import ExactSum


def summed(cell, values, order, cuts):
    parts = []
    for piece in np.array_split(order, cuts):
        part = ExactSum(3)
        part.add(cell[piece], values[piece])
        parts.append(part)
    total = parts.pop()
    for part in reversed(parts):
        total.merge(part)
    return total


@pytest.mark.parametrize("seed", range(5))
def test_means_are_rounded_once_whatever_the_order(seed):
    random = np.random.default_rng(seed)
    values = random.normal(size=400) * 10.0 ** random.integers(-200, 200, 400)
    values[:200] = random.normal(size=200)
    values[7:10] = 0.0, 5e-324, -1.7e308
    cell = random.integers(0, 2, 400)
    counts = np.bincount(cell, minlength=3)
    expected = [float(sum(map(Fraction, values[cell == k])) / int(counts[k])) for k in range(2)]
    for cuts in (1, 7):
        means = summed(cell, values, random.permutation(400), cuts).mean(counts)
        assert means[:2].tolist() == expected
        assert np.isnan(means[2])


def test_zeros_and_what_is_not_finite():
    total = ExactSum(2)
    total.add(np.array([0, 0]), np.zeros(2))
    assert total.mean(np.array([2, 0]))[0] == 0.0
    with pytest.raises(kd.InvalidInput, match="not finite"):
        total.add(np.array([0]), np.array([np.inf]))
