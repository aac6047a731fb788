"""Energetic restitution: its energy, closed forms, and an adaptive integration of the sliding."""

import itertools
import math

import numpy as np
import pytest
from contacts import BareContact, by_newton, by_stronge, random_contact, split
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from tolerances import agrees, closed_form, integrated

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
