import numpy as np
import pytest

from kickdyn.core.mechanics import cross, cross3, largest


@pytest.mark.parametrize("seed", range(5))
def test_cross_product_is_numpys(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    assert (cross(a, b) == np.cross(a, b)).all()
    assert cross3(a.tolist(), b.tolist()) == tuple(cross(a, b).tolist())


def test_largest_is_by_size():
    assert largest(np.array([1.0, -3.0, 2.0])) == 3.0
