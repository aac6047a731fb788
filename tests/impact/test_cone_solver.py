"""Against every branch enumerated, law `newton` and Pinocchio's ADMM; the laws at all scales."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from contacts import LegAndBall, by_newton
from scipy.optimize import brentq, root

import kickdyn as kd
from kickdyn.impact.cone_solver import (
    _equations,
    cone_residual,
    newton_iterations,
    solve_cones,
)


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.6, 1.5, 30.0, 1e6])
@pytest.mark.parametrize("seed", range(5))
def test_one_contact_is_newtons_law(seed, friction):
    """Against the exact solution of a single contact."""
    rng = np.random.default_rng(seed)
    root_of = rng.normal(size=(3, 3)) * 0.5
    velocity = np.array([*rng.normal(size=2) * 3, -rng.uniform(1, 3)])
    problem = LegAndBall(
        normal=np.array([0.0, 0.0, 1.0]),
        delassus_factor=root_of,
        ball=kd.Ball(),
        centre_velocity=velocity,
        spin=np.zeros(3),
        restitution=0.0,
        friction=friction,
    )
    found, residual = solve_cones(problem.delassus(), velocity, np.array([friction]))
    exact = by_newton(problem).impulse
    assert residual < 1e-11
    assert np.abs(found - exact).max() < 1e-10 * np.abs(exact).max()


def contacts(seed, count, decades=0.0, frictions=None):
    """Any positive definite matrix, coupled, its rows up to `decades` apart in size."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(3 * count, 3 * count + 2))
    rows *= 10 ** rng.uniform(-decades / 2, decades / 2, size=(3 * count, 1))
    free = rng.normal(size=3 * count) * np.linalg.norm(rows, axis=1)
    some = [0.0, 0.1, 0.5, 1.0, 3.0, 10.0, 100.0, 1e4, 1e6]
    return rows @ rows.T, free, np.array(rng.choice(frictions or some, size=count))


def enumerated(delassus, free, frictions):
    """Every solution: each contact open, sticking or sliding some way, all roots of the ways."""
    found = []
    for modes in itertools.product(("open", "stick", "slip"), repeat=len(frictions)):
        slips = [i for i, mode in enumerate(modes) if mode == "slip"]

        def at(angles, modes=modes, slips=slips):
            """Impulses of a mode whose slips push this way, and how far they slide aside."""
            columns, rows = [], []
            for i, mode in enumerate(modes):
                unit = np.eye(len(free))[3 * i : 3 * i + 3]
                if mode == "stick":
                    columns += list(unit)
                    rows += list(unit)
                elif mode == "slip":
                    a, mu = angles[slips.index(i)], frictions[i]
                    columns.append(mu * (np.cos(a) * unit[0] + np.sin(a) * unit[1]) + unit[2])
                    rows.append(unit[2])
            basis, test = np.array(columns).T, np.array(rows)
            coupled = test @ delassus @ basis
            p = basis @ np.linalg.solve(coupled, -test @ free)
            u = (delassus @ p + free).reshape(-1, 3) * np.linalg.det(coupled)  # no poles
            return p, [
                u[i, 1] * np.cos(a) - u[i, 0] * np.sin(a)
                for i, a in zip(slips, angles, strict=True)
            ]

        if all(mode == "open" for mode in modes):
            found.append(np.zeros(len(free)))
        elif not slips:
            found.append(at([])[0])
        elif len(slips) == 1:
            grid = np.linspace(-np.pi, np.pi, 361)
            aside = [at([a])[1][0] for a in grid]
            for a, b, one, two in zip(grid[:-1], grid[1:], aside[:-1], aside[1:], strict=True):
                if one * two <= 0.0:
                    found.append(at([brentq(lambda x: at([x])[1][0], a, b, xtol=1e-15)])[0])
        else:
            for start in itertools.product(np.linspace(-3, 3, 9), repeat=2):
                way = root(lambda angles: at(angles)[1], start, tol=1e-13)
                if way.success:
                    found.append(at(way.x)[0])
    return [p for p in found if obeys(delassus, free, frictions, p)]


def obeys(delassus, free, frictions, p):
    u, p = (delassus @ p + free).reshape(-1, 3), p.reshape(-1, 3)
    small, slow = 1e-9 * np.abs(p).max(), 1e-9 * np.abs(free).max()
    for (px, py, pn), (ux, uy, un), mu in zip(p, u, frictions, strict=True):
        slides, rubs = np.hypot(ux, uy), np.hypot(px, py)
        if pn < -small or un < -slow or (pn > small and un > slow) or rubs > mu * pn + small:
            return False
        if (
            slides > slow
            and abs(px * ux + py * uy + mu * pn * slides) > small * slides + rubs * slow
        ):
            return False
    return True


@pytest.mark.parametrize("count", [1, 2])
def test_the_answer_is_one_of_all_there_are(count):
    open_, slid = 0, 0
    for seed in range(40 if count == 1 else 12):
        problem = contacts(seed, count, frictions=[0.1, 0.5, 1.0, 3.0])
        found, residual = solve_cones(*problem)
        assert residual < 1e-11
        every = enumerated(*problem)
        apart = [np.abs(found - p).max() for p in every]
        assert min(apart) <= 1e-8 * max(np.abs(found).max(), 1e-300), seed
        sliding = np.abs((problem[0] @ found + problem[1]).reshape(-1, 3)[:, :2]).max(axis=1)
        open_ += (found.reshape(-1, 3)[:, 2] == 0).any()
        slid += ((sliding > 1e-6) & (found.reshape(-1, 3)[:, 2] > 0)).any()
    assert open_ > 2
    assert slid > 2


@pytest.mark.parametrize("count", [1, 3, 5])
@pytest.mark.parametrize("decades", [0, 2, 6])
def test_any_friction_and_any_scale(count, decades):
    for seed in range(12):
        problem = contacts(seed, count, decades)
        found, residual = solve_cones(*problem)
        assert residual <= 1e-9, (seed, residual)
        assert residual == cone_residual(*problem, found)


def test_where_admm_converges_they_agree():
    """Pinocchio's solver, an independent one; its own flag is no proof."""
    agreed = 0
    for seed in range(12):
        delassus, free, frictions = contacts(seed, 3, frictions=[0.0, 0.2, 0.5])
        witness = admm(delassus, free, frictions)
        if cone_residual(delassus, free, frictions, witness) < 1e-9:
            agreed += 1
            found, _ = solve_cones(delassus, free, frictions)
            assert np.abs(found - witness).max() <= 1e-7 * np.abs(witness).max()
    assert agreed > 8


def admm(delassus, free, frictions):
    models, data = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    any_model = pin.Model()
    any_model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "any")
    for friction in frictions:
        here = pin.SE3.Identity()
        point = pin.PointContactConstraintModel(any_model, 1, here, 0, here)
        point.setFriction(float(friction))
        models.append(pin.ConstraintModel(point))
    for model in models:
        data.append(model.createData())
    settings_, result = pin.ADMMSolverSettings(), pin.ADMMSolverResult()
    settings_.max_iterations = 20_000
    for kind in ("feasibility", "complementarity"):
        setattr(settings_, f"absolute_{kind}_tol", 1e-13)
        setattr(settings_, f"relative_{kind}_tol", 1e-13)
    operator = pin.DelassusOperatorDense(np.asfortranarray(delassus))
    pin.ADMMConstraintSolver(len(free)).solve(operator, free, models, data, settings_, result)
    return np.array(result.retrieveConstraintImpulses())


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_units_do_not_matter(scale):
    rng = np.random.default_rng(1)
    root_of = rng.normal(size=(9, 9))
    delassus, free = root_of @ root_of.T, rng.normal(size=9)
    found, residual = solve_cones(scale * delassus, free, np.full(3, 0.4))
    plain, _ = solve_cones(delassus, free, np.full(3, 0.4))
    assert residual < 1e-9
    assert scale * found == pytest.approx(plain, abs=1e-9)


def test_redundant_contacts():
    """Four corners of one block: what they share is open, what they give together is not."""
    corners = np.array([(x, y, -1.0) for x in (-1, 1) for y in (-1, 1)])
    rows = np.vstack([np.hstack([np.eye(3), -pin.skew(corner)]) for corner in corners])
    free = rows @ np.array([0.5, 0.0, -1.0, 0.0, 0.1, 0.3])
    for friction in (0.0, 0.3, 20.0, 1e6):
        found, residual = solve_cones(rows @ rows.T, free, np.full(4, friction))
        assert residual <= 1e-11
        assert (rows.T @ found)[2] > 0.5


def test_residual_tells_what_is_no_solution():
    delassus, free = np.eye(3), np.array([0.0, 0.0, -1.0])
    assert cone_residual(delassus, free, np.array([0.5]), np.array([0.0, 0.0, 1.0])) == 0.0
    for wrong in ((0.0, 0.0, 1.1), (0.0, 0.0, 0.9), (0.3, 0.0, 1.0), (0.0, 0.0, -1.0)):
        assert cone_residual(delassus, free, np.array([0.5]), np.array(wrong)) > 0.02
    sliding = np.array([1.0, 0.0, -1.0])
    assert cone_residual(delassus, sliding, np.array([0.5]), np.array([-0.5, 0.0, 1.0])) == 0.0
    for wrong in ((0.5, 0.0, 1.0), (0.0, 0.0, 1.0), (-0.4, 0.3, 1.0), (-0.6, 0.0, 1.0)):
        assert cone_residual(delassus, sliding, np.array([0.5]), np.array(wrong)) > 0.05
    apart = np.array([0.0, 0.0, 1.0])
    assert cone_residual(delassus, apart, np.array([0.5]), np.zeros(3)) == 0.0
    assert np.isinf(cone_residual(delassus, free, np.array([0.5]), np.full(3, np.nan)))


def test_a_light_contact_beside_a_heavy_one_counts_too():
    """Its impulse is nothing to the other's, but its velocity is not."""
    delassus = np.diag([1.0, 1.0, 1.0, 1e8, 1e8, 1e8])
    free, frictions = np.array([0.0, 0.0, -1.0] * 2), np.zeros(2)
    good = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1e-8])
    assert cone_residual(delassus, free, frictions, good) < 1e-15
    assert cone_residual(delassus, free, frictions, good * [1, 1, 1, 1, 1, 0]) > 0.9


def test_what_has_no_solution_is_told():
    """A contact that nothing can stop."""
    nothing = np.zeros((3, 3))
    nothing[0, 0] = 1.0
    _, residual = solve_cones(nothing, np.array([0.0, 0.0, -1.0]), np.array([0.5]))
    assert residual > 0.1


def cones(seed, count=3):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(3 * count, 3 * count + 1))
    problem = rows @ rows.T, 3 * rng.normal(size=3 * count), rng.uniform(0, 1, size=count)
    return problem, rng


@pytest.mark.parametrize("seed", range(20))
def test_the_derivative_is_that_of_the_equations(seed):
    problem, rng = cones(seed)
    p, way = rng.normal(size=(2, 9))
    lengths = rng.uniform(0.1, 1.0, size=(3, 2))
    h = 1e-6
    _, slope = _equations(*problem, p, lengths)
    ahead, behind = (_equations(*problem, p + k * h * way, lengths)[0] for k in (1, -1))
    assert slope @ way == pytest.approx((ahead - behind) / (2 * h), abs=1e-7)


def test_all_three_states_are_met():
    seen = set()
    for seed in range(20):
        problem, _ = cones(seed)
        start = newton_iterations(*problem, np.zeros(9), np.full((3, 2), 0.1))
        u = (problem[0] @ start + problem[1]).reshape(-1, 3)
        if cone_residual(*problem, start) < 1e-12:
            for p, sliding in zip(start.reshape(-1, 3), np.hypot(u[:, 0], u[:, 1]), strict=True):
                seen.add("open" if p[2] < 1e-12 else "slip" if sliding > 1e-9 else "stick")
    assert seen == {"open", "slip", "stick"}


def test_a_solution_stays_where_it_is():
    problem = np.eye(3), np.array([1.0, 0.0, -1.0]), np.array([0.5])
    solution = np.array([-0.5, 0.0, 1.0])
    assert newton_iterations(*problem, solution, np.ones((1, 2))) == pytest.approx(
        solution, abs=1e-16
    )


def test_redundant_contacts_take_the_least_step():
    """Two contacts at the same point share evenly, from an even start."""
    matrix = np.kron(np.ones((2, 2)), np.eye(3))
    problem = matrix, np.tile([0.1, 0.0, -1.0], 2), np.array([0.5, 0.5])
    found = newton_iterations(*problem, np.zeros(6), np.ones((2, 2)))
    assert found == pytest.approx(np.tile([-0.05, 0.0, 0.5], 2), abs=1e-14)
