"""Bounds on what a joint-space inertia loses are bounds."""

import math

import numpy as np
import pytest
from chains import random_leg

from kickdyn.robot.model_validation import cholesky_with_condition


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
    assert cholesky_with_condition(inertia)[1] >= 0.999 * exact


def test_an_inertia_that_is_not_positive_definite_has_no_bound():
    assert cholesky_with_condition(np.array([[1.0, 2.0], [2.0, 1.0]]))[1] == math.inf
    assert cholesky_with_condition(np.array([[1.0, math.nan], [math.nan, 1.0]]))[1] == math.inf


@pytest.mark.parametrize("seed", range(10))
def test_rounding_bounds_what_an_error_of_the_inertia_does(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, joints=4)
    posture = leg.posture(rng.uniform(-2, 2, size=leg.nq))
    size = np.sqrt(posture.inertia.diagonal())
    wrong = posture.inertia + 1e-9 * np.outer(size, size) * rng.choice((-1, 1))
    changed = posture.jacobian @ np.linalg.solve(wrong, posture.jacobian.T)
    gap = np.abs((changed - posture.delassus()).diagonal()) / posture.delassus().diagonal()
    assert gap.max() <= 1.001e-9 * posture.rounding
