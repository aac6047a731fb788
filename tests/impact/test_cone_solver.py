import numpy as np
import pytest

import kickdyn as kd
from kickdyn.impact.cone_solver import cone_residual, solve_cones
from kickdyn.impact.laws import ContactProblem, newton


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.6, 1.5])
@pytest.mark.parametrize("seed", range(5))
def test_one_contact_is_newtons_law(seed, friction):
    """Against the exact solution of a single contact."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * 0.5
    velocity = np.array([*rng.normal(size=2) * 3, -rng.uniform(1, 3)])
    problem = ContactProblem(
        normal=np.array([0.0, 0.0, 1.0]),
        leg_delassus=root @ root.T,
        ball=kd.Ball(),
        centre_velocity=velocity,
        spin=np.zeros(3),
        restitution=0.0,
        friction=friction,
    )
    found, residual = solve_cones(problem.delassus(), velocity, np.array([friction]))
    exact = newton(problem).impulse
    assert residual < 1e-11
    assert np.abs(found - exact).max() < 1e-10 * np.abs(exact).max()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_units_do_not_matter(scale):
    rng = np.random.default_rng(1)
    root = rng.normal(size=(9, 9))
    delassus, free = root @ root.T, rng.normal(size=9)
    found, residual = solve_cones(scale * delassus, free, np.full(3, 0.4))
    plain, _ = solve_cones(delassus, free, np.full(3, 0.4))
    assert residual < 1e-9
    assert scale * found == pytest.approx(plain, abs=1e-9)


def test_residual_tells_what_is_no_solution():
    delassus, free = np.eye(3), np.array([0.0, 0.0, -1.0])
    assert cone_residual(delassus, free, np.array([0.5]), np.array([0.0, 0.0, 1.0])) == 0.0
    for wrong in ((0.0, 0.0, 1.1), (0.0, 0.0, 0.9), (0.3, 0.0, 1.0), (0.0, 0.0, -1.0)):
        assert cone_residual(delassus, free, np.array([0.5]), np.array(wrong)) > 0.02
    apart = np.array([0.0, 0.0, 1.0])
    assert cone_residual(delassus, apart, np.array([0.5]), np.zeros(3)) == 0.0
    assert np.isnan(cone_residual(delassus, free, np.array([0.5]), np.full(3, np.nan)))
