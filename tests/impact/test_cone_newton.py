"""Newton's method on the contact laws: its derivative, and what it does from near and far."""

import numpy as np
import pytest

from kickdyn.impact.cone_newton import Cones, _equations, polished
from kickdyn.impact.cone_solver import cone_residual


def cones(seed, count=3):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(3 * count, 3 * count + 1))
    return Cones(rows @ rows.T, 3 * rng.normal(size=3 * count), rng.uniform(0, 1, size=count)), rng


@pytest.mark.parametrize("seed", range(20))
def test_the_derivative_is_that_of_the_equations(seed):
    problem, rng = cones(seed)
    p, way = rng.normal(size=(2, 9))
    lengths = rng.uniform(0.1, 1.0, size=(3, 2))
    h = 1e-6
    _, slope = _equations(problem, p, lengths)
    ahead, behind = (_equations(problem, p + k * h * way, lengths)[0] for k in (1, -1))
    assert slope @ way == pytest.approx((ahead - behind) / (2 * h), abs=1e-7)


def test_all_three_states_are_met():
    seen = set()
    for seed in range(20):
        problem, _ = cones(seed)
        start = polished(problem, np.zeros(9), np.full((3, 2), 0.1))
        u = (problem.delassus @ start + problem.free).reshape(-1, 3)
        if cone_residual(*problem, start) < 1e-12:
            for p, sliding in zip(start.reshape(-1, 3), np.hypot(u[:, 0], u[:, 1]), strict=True):
                seen.add("open" if p[2] < 1e-12 else "slip" if sliding > 1e-9 else "stick")
    assert seen == {"open", "slip", "stick"}


def test_a_solution_stays_where_it_is():
    problem = Cones(np.eye(3), np.array([1.0, 0.0, -1.0]), np.array([0.5]))
    solution = np.array([-0.5, 0.0, 1.0])
    assert polished(problem, solution, np.ones((1, 2))) == pytest.approx(solution, abs=1e-16)


def test_redundant_contacts_take_the_least_step():
    """Two contacts at the same point share evenly, from an even start."""
    matrix = np.kron(np.ones((2, 2)), np.eye(3))
    problem = Cones(matrix, np.tile([0.1, 0.0, -1.0], 2), np.array([0.5, 0.5]))
    found = polished(problem, np.zeros(6), np.ones((2, 2)))
    assert found == pytest.approx(np.tile([-0.05, 0.0, 0.5], 2), abs=1e-14)
