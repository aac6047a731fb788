"""Newton's law with Coulomb's cone: its conditions, and all solutions by root finding."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from contacts import BareBody, BareContact, by_newton, random_contact, random_problem, split
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from tolerances import agrees, closed_form, optimized

from kickdyn.impact.newton_law import meet_circle, slip_conic, slip_impulse
from kickdyn.impact.strike_kernel import slip_batch, solve_newton_batch

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("draw", [random_problem, random_contact])
@given(seed=seeds)
@settings(max_examples=150)
def test_restitution_and_coulombs_cone(draw, seed):
    problem = draw(seed)
    impulse, sticking, _, _ = by_newton(problem)
    before, jump = problem.velocity, problem.delassus() @ impulse
    scale = np.linalg.norm(problem.delassus()) * np.linalg.norm(impulse) + np.abs(before).max()
    rounding = closed_form(10) * scale
    u_before, _ = split(problem, before)
    u_after, sliding = split(problem, before + jump)
    pressing, friction = split(problem, impulse)
    assert u_after == pytest.approx(-problem.restitution * u_before, abs=rounding)
    assert pressing > 0
    size, cone = np.linalg.norm(friction), problem.friction * pressing
    if sticking:
        assert size <= cone * (1 + closed_form(10))
        np.testing.assert_allclose(sliding, 0.0, atol=rounding)
    else:
        assert size == pytest.approx(cone, rel=closed_form(10), abs=closed_form() * pressing)
        opposed = -np.linalg.norm(sliding) * size
        rounding *= size + 1e-3 * pressing
        assert float(sliding @ friction) == pytest.approx(opposed, abs=rounding)


def solutions(contact):
    """Every impulse that meets the law's conditions, by scanning the cone and root finding."""
    axes = np.linalg.svd(contact.normal.reshape(1, 3))[2][[1, 2, 0]].T
    axes[:, 2] = contact.normal
    g, mu = axes.T @ contact.matrix @ axes, contact.friction
    free = axes.T @ contact.velocity
    free[2] *= 1 + contact.restitution
    stick = -np.linalg.solve(g, free)
    impulses = [axes @ stick] if np.hypot(*stick[:2]) <= mu * stick[2] else []

    def slip(angle):
        direction = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = g[2] @ direction
        return direction, resistance, resistance * free[:2] - free[2] * (g @ direction)[:2]

    def sideways(angle):
        direction, _, sliding = slip(angle)
        return direction[0] * sliding[1] - direction[1] * sliding[0]

    grid = np.linspace(0.0, 2 * math.pi, 361) + 1e-4
    values = [sideways(angle) for angle in grid]
    for (low, one), (high, two) in itertools.pairwise(zip(grid, values, strict=True)):
        if one * two <= 0:
            direction, resistance, sliding = slip(brentq(sideways, low, high, xtol=1e-15))
            if resistance > 0 and sliding @ direction[:2] <= 0:
                impulses.append(axes @ (-free[2] / resistance * direction))
    return impulses


@pytest.mark.parametrize(("friction", "decades", "sticks"), [
    (5.0, 6, True), (3.0, 4, False)], ids=["stick", "slip"])  # fmt: skip
def test_of_several_solutions_sticking_or_the_one_that_loses_most_is_taken(
    friction, decades, sticks
):
    """Contacts with three solutions are rare; those whose losses differ by 10 % are counted."""
    choices = 0
    for seed in itertools.chain(range(100, 160), range(5180, 5200)):
        contact = random_contact(seed, decades, friction)
        _, sticking, lost, _ = by_newton(contact)
        if sticking is not sticks:
            continue
        losses = [-p @ (contact.velocity + contact.matrix @ p / 2) for p in solutions(contact)]
        if len(losses) > 1 and np.ptp(losses) > 0.1 * np.abs(losses).min():
            choices += 1
            assert sticking or lost == pytest.approx(max(losses), rel=optimized(1e-9)), seed
    assert choices > 0


def test_of_a_batch_those_with_one_direction_of_slip_are_solved_at_once():
    """Coupling and friction are strong: others have up to three directions."""
    rng, n = np.random.default_rng(0), 2000
    factor = rng.normal(size=(n, 3, 3)) * 10.0 ** rng.uniform(-2.0, 2.0, (n, 1, 3))
    g = np.einsum("nij,nkj->ikn", factor, factor)[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    u, e, mu = rng.normal(0.0, 9.0, (3, n)), rng.uniform(0, 1, n), rng.uniform(0.1, 3.0, n)
    u[2] = -0.1 * np.abs(u[2])
    blank = {name: np.zeros(n) for name in ("energy_lost", "slips", "doubt")}
    state = SimpleNamespace(delassus=g, impulse=np.zeros((3, n)), **blank)
    solve_newton_batch(state, (0.0, 0.0), u, (e, mu), 1e-12)
    with np.errstate(all="ignore"):  # of contacts that remain
        slips = state.slips > 0.0
        slip_batch(state, (0.0, 0.0), u, (e, mu))
    solved = np.flatnonzero(slips & (state.slips == 0.0))
    assert len(solved) > 0.5 * slips.sum()
    for i in solved:
        contact = tuple(g[:, i]), tuple(u[:, i]), e[i], mu[i]
        impulse, lost = slip_impulse(*contact, meet_circle(slip_conic(*contact)))
        agrees(state.impulse[:, i], impulse, optimized(1e-9))
        assert state.energy_lost[i] == pytest.approx(lost, rel=optimized(1e-9))


@pytest.mark.parametrize(("mobility", "across", "sticks"), [
    (1e-8, 2e-9, True), (0.0, 0.0, True), (0.0, 1e-6, False)])  # fmt: skip
def test_an_obstacle_at_a_point_that_hardly_moves_one_way(monkeypatch, mobility, across, sticks):
    """Friction stops what moves that way, unless nothing can move it."""
    monkeypatch.setattr(BareBody, "is_free", False)
    for turn in Rotation.random(10, random_state=1).as_matrix():
        matrix, before = turn @ np.diag([1.0, mobility, 1.0]) @ turn.T, turn @ (0.1, across, -1.0)
        impulse, sticking, _, _ = by_newton(BareContact(matrix, before, 0.5, 1.0, turn[:, 2]))
        assert sticking is sticks
        if sticks:
            agrees(impulse, turn @ (-0.1, -across / (mobility or 1.0), 1.5), optimized(1e-8))


def test_it_can_create_energy():
    """The leg's coupling turns friction into speed along the normal: 21 / 500 J come from nothing.

    Sticking takes the relative velocity from (0.3, -1) to (0, 1).
    """
    matrix = np.array([[4.0, 0.0, -3.0], [0.0, 4.0, 0.0], [-3.0, 0.0, 6.0]])
    contact = BareContact(matrix, np.array([0.3, 0.0, -1.0]), 1.0, 0.8, np.array([0.0, 0.0, 1.0]))
    impulse, sticking, lost, _ = by_newton(contact)
    assert sticking
    agrees(impulse, [0.28, 0, 71 / 150], closed_form())
    assert lost == pytest.approx(-0.28 * 0.3 / 2, rel=closed_form(10))
