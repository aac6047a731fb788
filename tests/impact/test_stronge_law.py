"""Laws of impact: energetic restitution, Coulomb's cone, and what they have in common."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from contacts import (
    BareBody,
    BareContact,
    by_newton,
    by_paper,
    by_stronge,
    planar_attack,
    random_contact,
    random_problem,
    solve_single,
    split,
)
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from tolerances import agrees, closed_form, integrated, optimized

import kickdyn as kd
from kickdyn.impact.laws import LAWS

seeds = st.integers(0, 2**32 - 1)
UNTRACED = [phase for phase in Phase if phase is not Phase.explain]  # which traces every line


def planar(a, b, c, u, w, mu, e):
    """A contact in the x-z plane: a tangential, b coupling, c normal; u sliding, w closing."""
    matrix = np.array([[a, 0.0, b], [0.0, a, 0.0], [b, 0.0, c]])
    return BareContact(matrix, np.array([u, 0.0, -w]), e, mu, np.array([0.0, 0.0, 1.0]))


@given(seed=seeds)
@settings(max_examples=100, phases=UNTRACED)
def test_energy_is_never_created(seed):
    contact = random_contact([seed, 0])
    impulse, sticking, lost, _ = by_stronge(contact)
    jump = contact.matrix @ impulse
    energy = 0.5 * contact.velocity @ np.linalg.solve(contact.matrix, contact.velocity)
    work = -impulse @ (contact.velocity + jump / 2)
    assert work >= -closed_form(10) * energy
    assert lost >= 0.0
    # Rounding where a large impulse along the stiff direction leaves a small jump.
    size = np.linalg.norm(contact.matrix) * np.linalg.norm(impulse)
    size += np.linalg.norm(contact.velocity)
    assert lost == pytest.approx(work, abs=closed_form(10) * size * np.linalg.norm(impulse))
    pressing, friction = split(contact, impulse)
    assert np.linalg.norm(friction) <= contact.friction * pressing + closed_form(10) * pressing * (
        1 + contact.friction
    )
    parting, sliding = split(contact, contact.velocity + jump)
    assert parting >= -closed_form(10) * size
    if sticking:
        np.testing.assert_allclose(sliding, 0.0, atol=closed_form(100) * size)


def integrate(contact, max_step=math.inf):
    """The same impact by an adaptive integrator of velocities, impulse and work.

    Over the normal impulse, which passes in proportion to the sliding while there is any; where
    that ends, the direction in which it can start again is searched on a grid. Returned are the
    impulse and the number of compressions.
    """
    axes = np.linalg.svd(contact.normal.reshape(1, 3))[2][[1, 2, 0]].T
    axes[:, 2] = contact.normal
    g, mu, e2 = axes.T @ contact.matrix @ axes, contact.friction, contact.restitution**2
    u, impulse = axes.T @ contact.velocity, np.zeros(3)
    stored = returned = 0.0
    compressions, due = 1, math.inf
    resting = 1e-11 * np.linalg.norm(u)
    fixed = None if np.hypot(*u[:2]) > resting else after_sliding(g, mu)
    pressing = True

    def rates(_, y):
        pace = np.hypot(*y[:2]) if fixed is None else 1.0
        direction = np.append(-mu * y[:2], pace) if fixed is None else fixed
        return np.concatenate([g @ direction, direction, [pace * y[2]]])

    def turned(_, y):
        return y[2]

    def stopped(_, y):
        return np.hypot(*y[:2]) - resting

    def complete(_, y):
        return y[6] - due

    turned.terminal = stopped.terminal = complete.terminal = True
    stopped.direction = -1
    for _ in range(20):
        due = math.inf if pressing else e2 * stored - returned
        turned.direction = 1 if pressing else -1
        events = [turned, complete, stopped] if fixed is None else [turned, complete]
        options = {"rtol": 1e-11, "atol": 1e-14}
        options["max_step"] = max_step if fixed is None else math.inf
        start = np.concatenate([u, impulse, [0.0]])
        run = solve_ivp(rates, (0, 1e9), start, "DOP853", events=events, **options)
        u, impulse, work = run.y[:3, -1], run.y[3:6, -1], run.y[6, -1]
        stored, returned = (stored - work, returned) if pressing else (stored, returned + work)
        if len(run.t_events[1]):
            break
        if len(run.t_events[0]):
            u[2] = 0.0
            pressing = not pressing
            compressions += pressing
            if not pressing and e2 * stored <= returned:
                break
        elif fixed is None and len(run.t_events[2]):
            u[:2], fixed = 0.0, after_sliding(g, mu)
    return axes @ impulse, compressions


def after_sliding(g, mu):
    """Friction that stops the points, or friction of the one direction in which sliding grows."""
    stop = -np.linalg.solve(g[:2, :2], g[:2, 2])
    if np.linalg.norm(stop) <= mu:
        return np.append(stop, 1.0)

    def growth(angle):
        direction = np.array([np.cos(angle), np.sin(angle)])
        push = g[:2] @ np.append(-mu * direction, 1.0)
        return direction[0] * push[1] - direction[1] * push[0], direction @ push

    angles = []
    for low, high in itertools.pairwise(np.linspace(-math.pi, math.pi, 2001) + 1e-4):
        if growth(low)[0] * growth(high)[0] < 0:
            root = brentq(lambda angle: growth(angle)[0], low, high, xtol=1e-15)
            angles += [root] if growth(root)[1] > 0 else []
    (angle,) = angles
    return np.array([-mu * math.cos(angle), -mu * math.sin(angle), 1.0])


@pytest.mark.parametrize("seed", range(24))
def test_the_sliding_by_an_adaptive_integrator(seed):
    contact = random_contact(seed, decades=2, friction=[0.1, 0.5, 2.0][seed % 3])
    agrees(by_stronge(contact).impulse, integrate(contact)[0], integrated(1e-10))


@pytest.mark.parametrize(("seed", "e", "count"), [
    (405, 0.9, 2), (474, 0.9, 2), (6841, 0.6, None), (11416, 0.3, None)])  # fmt: skip
def test_points_that_turn_or_press_anew_by_an_adaptive_integrator(seed, e, count):
    """A slip that turns makes points approach again, within a step or after it; all work counts."""
    contact = random_contact(seed, decades=3, friction=3.0, restitution=e)
    expected, compressions = integrate(contact, max_step=math.inf if count else 0.1)
    assert count in (None, compressions)
    agrees(by_stronge(contact).impulse, expected, integrated(1e-9))


@given(seed=seeds)
@settings(max_examples=60)
def test_a_central_impact_is_newtons_law(seed):
    """No coupling of sliding and pressing, and the same inertia across the normal all round."""
    rng = np.random.default_rng(seed)
    contact = random_contact(seed)
    n, (tangential, normal) = contact.normal, 10 ** rng.uniform(-3, 3, size=2)
    contact.matrix = tangential * np.eye(3) + (normal - tangential) * np.outer(n, n)
    ours, theirs = by_stronge(contact), by_newton(contact)
    assert ours.sticking == theirs.sticking
    agrees(ours.impulse, theirs.impulse, closed_form(1e4))
    scale = np.linalg.norm(theirs.impulse) * np.linalg.norm(contact.velocity)
    assert ours.energy_lost == pytest.approx(theirs.energy_lost, abs=closed_form(100) * scale)


@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
def test_slip_reverses(e):
    """Sliding stops at p = 1/2; friction 1/2 < 3/4 = |b| / a cannot hold, it turns round.

    du/dp is -mu a + b = -5 first and then mu a + b = -1; dw/dp is 6 + 3/2, then 6 - 3/2.
    """
    a, b, c, mu, u, w = 4.0, -3.0, 6.0, 0.5, 2.5, 6.0
    impulse, sticking, lost, _ = by_stronge(planar(a, b, c, u, w, mu, e))
    stop = u / (a * mu - b)
    closing = w - (c - mu * b) * stop  # 9/4
    second = closing / (c + mu * b)
    stored = stop * (w + closing) / 2 + second * closing / 2
    third = e * math.sqrt(2 * stored / (c + mu * b))
    assert not sticking
    expected = [-mu * stop + mu * (second + third), 0, stop + second + third]
    agrees(impulse, expected, closed_form())
    friction = mu * stop * u / 2 + mu * (-b - mu * a) * (second + third) ** 2 / 2
    assert lost == pytest.approx((1 - e * e) * stored + friction, rel=closed_form())


def test_jamming_presses_harder_before_it_lets_go():
    """mu b > c: while the foot slides, pressing grows with the impulse; it stops at p = 1."""
    a, b, c, u, w, mu, e = 4.0, 3.0, 3.0, 3.0, 1.0, 1.5, 0.5
    impulse, sticking, _, _ = by_stronge(planar(a, b, c, u, w, mu, e))
    stop = u / (a * mu - b)
    closing = w - (c - mu * b) * stop  # 5/2, faster than at first
    rate = c - b * b / a  # friction 3/4 < mu holds
    second = closing / rate
    stored = stop * (w + closing) / 2 + second * closing / 2
    third = e * math.sqrt(2 * stored / rate)
    assert sticking
    expected = [-mu * stop - b / a * (second + third), 0, stop + second + third]
    agrees(impulse, expected, closed_form())


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


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@given(seed=seeds)
@settings(max_examples=40)
def test_energy_lost_is_the_work_of_the_impulse(law, seed):
    """Minus the impulse times the mean of the relative velocities before and after."""
    problem = random_problem(seed)
    impulse, _, lost, _ = solve_single(law.solve, problem)
    before, jump = problem.velocity, problem.delassus() @ impulse
    scale = np.linalg.norm(impulse) * np.abs([before, jump]).max()
    work = -0.5 * impulse @ (2 * before + jump)
    assert lost == pytest.approx(work, abs=closed_form(100) * scale)


@given(seed=seeds)
@settings(max_examples=40)
def test_without_friction_newton_and_stronge_are_eq_10(seed):
    """p = (1 + e) u / (1/M + 1/m) along the normal, which loses p (1 - e) u / 2."""
    problem = random_problem(seed, friction=0.0)
    n, e = problem.normal, problem.restitution
    speed = -problem.centre_velocity @ n
    leg = np.linalg.norm(n @ problem.delassus_factor) ** -2
    size = kd.normal_impulse(speed, e, leg, problem.ball.mass)
    right = (1 + e) * speed / (1 / leg + 1 / problem.ball.mass)
    assert size == pytest.approx(right, rel=closed_form(10))
    for law in (by_newton, by_stronge):
        impulse, sticking, lost, _ = law(problem)
        agrees(impulse, size * n, closed_form())
        assert lost == pytest.approx(0.5 * size * (1 - e) * speed, rel=closed_form(1e4))
        assert not sticking


@pytest.mark.parametrize("factor", [np.eye(3) / np.sqrt(5), np.diag([1 / np.sqrt(5), 0.0, 3.0])])
def test_the_papers_stick_transmits_all_and_spins_by_its_offset(factor):
    """Eq. (10) with the mass along the attack; tan(0.2) < mu; the shell spins by 3/2 sin(0.2)."""
    problem = dataclasses.replace(planar_attack(0.4, 0.2), delassus_factor=factor)
    impulse, sticking, _, tangential = by_paper(problem)
    ball, size = problem.ball, 1.8 * 14 / (1 / 5 + 1 / problem.ball.mass)
    assert sticking
    agrees(impulse, [size, 0, 0], closed_form())
    spin = np.cross(-ball.radius * problem.normal, tangential) / ball.inertia
    expected = -1.5 * size / ball.mass / ball.radius * math.sin(0.2)
    assert spin[1] == pytest.approx(expected, rel=closed_form())


def test_the_papers_slip_transmits_mu_times_the_normal_part():
    """Eqs. (15)-(20): in the plane of F and n, towards F."""
    problem = planar_attack(0.1, 0.2)
    impulse, sticking, _, _ = by_paper(problem)
    normal, friction = split(problem, impulse)
    size = 1.8 * 14 / (1 / 5 + 1 / problem.ball.mass) * math.cos(0.2)
    assert not sticking
    assert normal == pytest.approx(size, rel=closed_form())
    agrees(friction, 0.1 * size * np.array([math.sin(0.2), 0, -math.cos(0.2)]), closed_form(10))


@pytest.mark.parametrize("law", ["newton", "stronge"])
@pytest.mark.parametrize("angle", [0.25, 0.3, 0.4])
def test_a_leg_that_friction_locks_to_an_obstacle_is_refused(law, angle):
    """The toe of a leg with one joint drags behind the hip; no impulse stops it."""
    posture = kd.Leg.human().locked({"knee": 0.1, "ankle": 0.0}).posture([angle])
    v = [np.copysign(5.0, posture.jacobian[2, 0])]
    with pytest.raises(kd.KickdynError, match=f"law '{law}' finds no impulse"):
        kd.strike(posture, v, kd.Ball(mass=math.inf), kd.Contact((0, 0, 1), 0.5, 4.0), law)


@pytest.mark.parametrize(("arguments", "words"), [
    ((-1, 0.5, 1), "approach speed is -1"), ((1, 1.2, 1), r"restitution is 1\.2"),
    ((1, 0.5, 0), "leg mass is 0"), ((1, 0.5, math.nan), "leg mass is nan"),
    ((1, 0.5, 1, -2), "ball mass is -2"), ((1, 0.5, math.inf), "both inf")])  # fmt: skip
def test_bad_input(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.normal_impulse(*arguments)
