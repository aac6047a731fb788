"""The bound on the condition of a joint-space inertia is one."""

import math

import numpy as np
import pytest

from kickdyn.conditioning import factored


@pytest.mark.parametrize("seed", range(40))
def test_the_bound_on_the_condition_is_one(seed):
    """Of random inertias, up to near-singular ones, and of joints as unlike as 1e-6 and 1e3."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 40))
    turn, _ = np.linalg.qr(rng.normal(size=(n, n)))
    inertia = (turn * 10 ** rng.uniform(-rng.uniform(0, 11), 0, size=n)) @ turn.T
    sizes = 10 ** rng.uniform(-3, 1.5, size=n)
    inertia = (inertia + inertia.T) / 2 * sizes * sizes[:, None]
    unit = 1 / np.sqrt(inertia.diagonal())
    exact = np.linalg.cond(inertia * unit * unit[:, None], 1)
    assert factored(inertia)[1] >= 0.999 * exact


def test_an_inertia_that_is_not_positive_definite_has_no_bound():
    assert factored(np.array([[1.0, 2.0], [2.0, 1.0]]))[1] == math.inf
    assert factored(np.array([[1.0, math.nan], [math.nan, 1.0]]))[1] == math.inf
