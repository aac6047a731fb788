"""Energetic restitution: its energy, and an integration of the sliding by other means."""

import itertools
import math

import numpy as np
import pytest
from contacts import BareContact, by_newton, by_stronge, random_contact, random_problem, split
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import kickdyn as kd

seeds = st.integers(0, 2**32 - 1)
UNTRACED = [phase for phase in Phase if phase is not Phase.explain]  # which traces every line
UP = np.array([0.0, 0.0, 1.0])


def planar(a, b, c, u, w, mu, e):
    """A contact in the x-z plane: a tangential, b coupling, c normal; u sliding, w closing."""
    matrix = np.array([[a, 0.0, b], [0.0, a, 0.0], [b, 0.0, c]])
    return BareContact(matrix, np.array([u, 0.0, -w]), e, mu, UP)


@given(seed=seeds)
@settings(max_examples=300, derandomize=True, deadline=None, phases=UNTRACED)
def test_energy_is_never_created(seed):
    check_energy(random_contact([seed, 0]))


@pytest.mark.parametrize("friction", [1e8, 1e300])
def test_however_strong_the_friction(friction):
    """Energy holds, and beyond some friction more of it changes nothing."""
    for seed in range(100):
        ours = by_stronge(random_contact(seed, decades=2, friction=friction))
        limit = by_stronge(random_contact(seed, decades=2, friction=1e9))
        assert 0.0 <= ours[2] == pytest.approx(limit[2], rel=1e-4)
        assert ours[0] == pytest.approx(limit[0], abs=1e-4 * np.linalg.norm(limit[0]))


def check_energy(contact):
    impulse, sticking, lost, _ = by_stronge(contact)
    jump = contact.matrix @ impulse
    energy = 0.5 * contact.velocity @ np.linalg.solve(contact.matrix, contact.velocity)
    taken = -impulse @ (contact.velocity + jump / 2)
    assert taken >= -1e-12 * energy
    assert lost >= 0.0
    # What rounding can do where a large impulse along the stiff direction leaves a small jump.
    size = np.linalg.norm(contact.matrix) * np.linalg.norm(impulse)
    size += np.linalg.norm(contact.velocity)
    assert lost == pytest.approx(taken, abs=1e-12 * size * np.linalg.norm(impulse))
    pressing, friction = split(contact, impulse)
    assert np.linalg.norm(friction) <= contact.friction * pressing * (1 + 1e-12) + 1e-13 * pressing
    parting, sliding = split(contact, contact.velocity + jump)
    assert parting >= -1e-12 * size
    if sticking:
        assert np.abs(sliding).max() <= 1e-11 * size


def followed(contact, max_step=math.inf):
    """The same impact by an adaptive integrator of velocities, impulse and work.

    Over the normal impulse, which passes in proportion to the sliding while there is any; where
    that ends, the direction in which it can start again is searched on a grid.
    """
    axes = np.linalg.svd(contact.normal.reshape(1, 3))[2][[1, 2, 0]].T
    axes[:, 2] = contact.normal
    g, mu, e2 = axes.T @ contact.matrix @ axes, contact.friction, contact.restitution**2
    u, impulse = axes.T @ contact.velocity, np.zeros(3)
    stored = returned = 0.0
    compressions = 1
    tiny = 1e-11 * np.linalg.norm(u)

    def rates(_, y):
        pace = np.hypot(*y[:2]) if held is None else 1.0
        way = np.append(-mu * y[:2], pace) if held is None else held
        return np.concatenate([g @ way, way, [pace * y[2]]])

    def turned(_, y):
        return y[2]

    def stopped(_, y):
        return np.hypot(*y[:2]) - tiny

    def full(_, y):
        return y[6] - due

    turned.terminal = stopped.terminal = full.terminal = True
    stopped.direction = -1
    held, pressing = None, True
    if np.hypot(*u[:2]) <= tiny:
        held = after_sliding(g, mu)
    for _ in range(20):
        due = math.inf if pressing else e2 * stored - returned
        turned.direction = 1 if pressing else -1
        start = np.concatenate([u, impulse, [0.0]])
        events = [turned, full] if held is not None else [turned, full, stopped]
        options = {"rtol": 1e-11, "atol": 1e-14, "max_step": max_step if held is None else math.inf}
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
        elif held is None and len(run.t_events[2]):
            u[:2], held = 0.0, after_sliding(g, mu)
    return axes @ impulse, compressions


def after_sliding(g, mu):
    """Friction that holds, or that of the one direction in which sliding grows."""
    hold = -np.linalg.solve(g[:2, :2], g[:2, 2])
    if np.linalg.norm(hold) <= mu:
        return np.append(hold, 1.0)

    def across(angle):
        way = np.array([np.cos(angle), np.sin(angle)])
        push = g[:2] @ np.append(-mu * way, 1.0)
        return way[0] * push[1] - way[1] * push[0], way @ push

    found = []
    grid = np.linspace(-math.pi, math.pi, 2001) + 1e-4
    for low, high in itertools.pairwise(grid):
        if across(low)[0] * across(high)[0] < 0:
            for _ in range(60):
                middle = (low + high) / 2
                if across(low)[0] * across(middle)[0] <= 0:
                    high = middle
                else:
                    low = middle
            if across(low)[1] > 0:
                found.append(low)
    assert len(found) == 1
    return np.array([-mu * math.cos(found[0]), -mu * math.sin(found[0]), 1.0])


@pytest.mark.parametrize("seed", range(60))
def test_the_sliding_followed_by_an_adaptive_integrator(seed):
    contact = random_contact(seed, decades=2, friction=[0.1, 0.5, 2.0][seed % 3])
    impulse = by_stronge(contact).impulse
    assert np.abs(followed(contact)[0] - impulse).max() <= 1e-8 * np.linalg.norm(impulse)


@given(seed=seeds)
@settings(max_examples=300, derandomize=True, deadline=None)
def test_without_friction_it_is_newtons_law(seed):
    problem = random_problem(seed, friction=0.0)
    ours, theirs = by_stronge(problem), by_newton(problem)
    assert ours.impulse == pytest.approx(theirs.impulse, rel=1e-10)
    assert ours.energy_lost == pytest.approx(theirs.energy_lost, rel=1e-10)


@given(seed=seeds)
@settings(max_examples=300, derandomize=True, deadline=None)
def test_a_central_impact_is_newtons_law(seed):
    """No coupling of sliding and pressing, and the same inertia across the normal all round."""
    rng = np.random.default_rng(seed)
    contact = random_contact(seed)
    n, (across, along) = contact.normal, 10 ** rng.uniform(-3, 3, size=2)
    contact.matrix = across * np.eye(3) + (along - across) * np.outer(n, n)
    ours, theirs = by_stronge(contact), by_newton(contact)
    assert ours.sticking == theirs.sticking
    size = np.linalg.norm(theirs.impulse)
    assert np.abs(ours.impulse - theirs.impulse).max() <= 1e-10 * size
    assert ours.energy_lost == pytest.approx(theirs.energy_lost, rel=1e-10, abs=1e-14 * size)


@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
def test_slip_reverses(e):
    """Sliding stops at p = 1/2; friction 1/2 < 3/4 = |b| / a cannot hold, it turns round.

    du/dp is -mu a + b = -5 first and then mu a + b = -1; dw/dp is 6 + 3/2, then 6 - 3/2.
    """
    a, b, c, mu = 4.0, -3.0, 6.0, 0.5
    u, w = 2.5, 6.0
    impulse, sticking, lost, _ = by_stronge(planar(a, b, c, u, w, mu, e))
    first = u / (a * mu - b)  # 1/2: the normal velocity is then -6 + 15/2 / 2 = -9/4
    at_stop = -w + (c - mu * b) * first
    second = -at_stop / (c + mu * b)
    stored = first * (w - at_stop) / 2 + second * -at_stop / 2
    third = e * math.sqrt(2 * stored / (c + mu * b))
    assert at_stop < 0
    assert not sticking
    assert impulse == pytest.approx(
        [-mu * first + mu * (second + third), 0, first + second + third]
    )
    friction_took = mu * first * u / 2 + mu * (-b - mu * a) * (second + third) ** 2 / 2
    assert lost == pytest.approx((1 - e * e) * stored + friction_took)


def test_jamming_presses_harder_before_it_lets_go():
    """mu b > c: while the foot slides, pressing grows with the impulse; it stops at p = 1."""
    a, b, c, u, w, mu, e = 4.0, 3.0, 3.0, 3.0, 1.0, 1.5, 0.5
    impulse, sticking, _, _ = by_stronge(planar(a, b, c, u, w, mu, e))
    rate = c - mu * b
    stop = u / (a * mu - b)
    assert rate < 0
    closing = w - rate * stop  # 5/2, faster than at first
    held = c - b * b / a  # friction 3/4 < mu holds
    second = closing / held
    stored = stop * (w + closing) / 2 + second * closing / 2
    third = e * math.sqrt(2 * stored / held)
    assert sticking
    hold = -b / a * (second + third)
    assert impulse == pytest.approx([-mu * stop + hold, 0, stop + second + third], rel=1e-13)


@pytest.mark.parametrize("seed", [405, 474, 477, 736, 1250])
def test_the_points_may_press_anew(seed):
    """A slip that turns can make them approach again before the work is back; all of it counts."""
    contact = random_contact(seed, decades=3, friction=3.0, restitution=0.9)
    expected, compressions = followed(contact)
    impulse = by_stronge(contact).impulse
    assert compressions == 2
    assert np.abs(expected - impulse).max() <= 1e-8 * np.linalg.norm(impulse)


@pytest.mark.parametrize(("seed", "e"), [(6841, 0.6), (10889, 0.6), (11416, 0.3)])
def test_the_normal_velocity_may_turn_round_within_a_step(seed, e):
    contact = random_contact(seed, decades=3, friction=3.0, restitution=e)
    expected, _ = followed(contact, max_step=0.1)
    impulse = by_stronge(contact).impulse
    assert np.abs(expected - impulse).max() <= 1e-7 * np.linalg.norm(impulse)


def test_sliding_that_friction_cannot_stop():
    """At rest across the normal, coupling drives the points apart: they slide from the start."""
    a, b, c, w, mu, e = 4.0, 3.0, 6.0, 1.0, 0.5, 0.5
    impulse, sticking, _, _ = by_stronge(planar(a, b, c, 0.0, w, mu, e))
    rate = c - mu * b
    assert not sticking
    assert impulse == pytest.approx(np.array([-mu, 0, 1]) * (1 + e) * w / rate, rel=1e-14)


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1e30, 1e120])
def test_it_is_linear_in_the_velocities(scale):
    for seed in range(20):
        contact = random_contact(seed, friction=0.7)
        impulse = by_stronge(contact).impulse
        contact.velocity = contact.velocity * scale
        assert by_stronge(contact).impulse / scale == pytest.approx(impulse, rel=1e-9)


@pytest.mark.parametrize("spin", [1e4, 1e8, 1e12, 1e20])
def test_a_fast_spin_costs_no_digits(spin):
    """The sliding cannot turn nor end: along one straight line all laws of restitution agree."""
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity((1.0, 0.0, 0.3))
    kick = posture, v, kd.Ball(), kd.Contact((1, 0, 0.3), 0.7, 0.4)
    ours, theirs = (
        kd.strike(*kick, law, ball_spin=(0, spin, 0)).impulse for law in ("stronge", "newton")
    )
    assert ours == pytest.approx(theirs, rel=1e-12)


def test_a_leg_that_friction_locks_to_an_obstacle_is_refused():
    """The toe of a leg with one joint drags behind the hip; no impulse stops it."""
    posture = kd.Leg.human().locked({"knee": 0.1, "ankle": 0.0}).posture([0.3])
    contact = kd.Contact(normal=(0, 0, 1), restitution=0.5, friction=2.0)
    for law in ("stronge", "newton"):
        with pytest.raises(kd.KickdynError, match=f"law '{law}' finds no impulse"):
            kd.strike(posture, [5.0], kd.Ball(mass=math.inf), contact, law)
