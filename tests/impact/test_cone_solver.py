"""Impulses at several contacts: the laws themselves, and law `newton`."""

import numpy as np
import pytest
from contacts import LegAndBall, by_newton
from tolerances import agrees, optimized

from kickdyn.impact.cone_solver import cone_residual, solve_cones

FRICTIONS = [0.0, 0.1, 0.5, 1.0, 3.0, 10.0, 100.0, 1e4, 1e6]


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.6, 1.5, 30.0, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_one_contact_is_newtons_law(seed, friction):
    rng = np.random.default_rng(seed)
    factor, n = rng.normal(size=(3, 3)) * 0.5, np.array([0.0, 0.0, 1.0])
    velocity = np.array([*rng.normal(size=2) * 3, -rng.uniform(1, 3)])
    problem = LegAndBall(n, factor, velocity, 0.0, friction)
    impulse, residual = solve_cones(problem.delassus(), velocity, np.array([friction]))
    assert residual < optimized(1e-12)
    agrees(impulse, by_newton(problem).impulse, optimized(1e-10))


def contacts(seed, count, decades=0.0):
    """Any positive definite matrix, coupled, its rows up to `decades` apart in size."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(3 * count, 3 * count + 2))
    rows *= 10 ** rng.uniform(-decades / 2, decades / 2, size=(3 * count, 1))
    free = rng.normal(size=3 * count) * np.linalg.norm(rows, axis=1)
    return rows @ rows.T, free, np.array(rng.choice(FRICTIONS, size=count))


def obeys(delassus, free, frictions, p):
    """Signorini's and Coulomb's laws in words: no pull, no penetration, friction opposes."""
    u, p = (delassus @ p + free).reshape(-1, 3), p.reshape(-1, 3)
    small, slow = optimized(1e-10) * np.array([np.abs(p).max(), np.abs(free).max()])
    for (px, py, pn), (ux, uy, un), mu in zip(p, u, frictions, strict=True):
        sliding, friction = np.hypot(ux, uy), np.hypot(px, py)
        if pn < -small or un < -slow or (pn > small and un > slow) or friction > mu * pn + small:
            return False
        opposed = abs(px * ux + py * uy + mu * pn * sliding)
        if sliding > slow and opposed > small * sliding + friction * slow:
            return False
    return True


@pytest.mark.parametrize("count", [1, 3, 5])
@pytest.mark.parametrize("decades", [0, 2, 6])
def test_any_friction_and_any_scale(count, decades):
    states = set()
    for seed in range(6):
        problem = contacts(seed, count, decades)
        impulses, residual = solve_cones(*problem)
        assert residual <= optimized(1e-10), seed
        assert residual == cone_residual(*problem, impulses)
        assert decades or obeys(*problem, impulses), seed
        u = (problem[0] @ impulses + problem[1]).reshape(-1, 3)
        for p, sliding in zip(impulses.reshape(-1, 3), np.hypot(u[:, 0], u[:, 1]), strict=True):
            opens = p[2] <= 1e-9 * np.abs(impulses).max()
            states.add("open" if opens else "slip" if sliding > 1e-6 else "stick")
    assert decades or count == 1 or states == {"open", "slip", "stick"}


@pytest.mark.parametrize(("free", "solution", "others"), [
    ((0, 0, -1), (0, 0, 1), [(0, 0, 1.1), (0, 0, 0.9), (0.3, 0, 1), (0, 0, -1)]),
    ((1, 0, -1), (-0.5, 0, 1), [(0.5, 0, 1), (0, 0, 1), (-0.4, 0.3, 1), (-0.6, 0, 1)]),
    ((0, 0, 1), (0, 0, 0), [(0, 0, 0.1)])])  # fmt: skip
def test_the_residual_is_0_at_the_solution_alone(free, solution, others):
    """A unit mass with friction 1/2 that is stopped, slides, or recedes."""
    problem = np.eye(3), np.array(free, float), np.array([0.5])
    assert cone_residual(*problem, np.array(solution, float)) == 0.0
    for impulse in others:
        assert cone_residual(*problem, np.array(impulse, float)) > 0.02, impulse
    assert np.isinf(cone_residual(*problem, np.full(3, np.nan)))
