"""The impact laws: what they have in common, the paper's law, and who refuses a law."""

import dataclasses
import math

import numpy as np
import pytest
from contacts import (
    by_newton,
    by_paper,
    by_stronge,
    planar_attack,
    random_problem,
    solve_single,
    split,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.laws import LAWS

seeds = st.integers(0, 2**32 - 1)


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
