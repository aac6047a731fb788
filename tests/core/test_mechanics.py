import numpy as np
import pytest
from tolerances import closed_form

from kickdyn.core.mechanics import GRAVITY, cross, cross3, largest


@pytest.mark.parametrize("seed", range(3))
def test_cross_product_is_numpys(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    assert cross(a, b) == pytest.approx(np.cross(a, b), rel=closed_form(), abs=closed_form())
    assert cross3(a.tolist(), b.tolist()) == pytest.approx(tuple(cross(a, b)), rel=closed_form())


def test_largest_is_by_size():
    assert largest(np.array([1.0, -3.0, 2.0])) == 3.0


def test_gravity_is_that_of_table_3_of_the_paper():
    assert GRAVITY == 9.81
