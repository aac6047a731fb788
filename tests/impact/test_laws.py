"""The laws of friction, held against their own defining conditions."""

import math

import numpy as np
import pytest
from contacts import LegAndBall, by_newton, by_paper, planar_attack, random_problem, solve_single
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.impact.contact_problem import ImpactLaw, frictionless
from kickdyn.impact.laws import LAWS, solve_contacts

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@given(seed=seeds)
@settings(max_examples=300, derandomize=True, deadline=None)
def test_energy_lost_is_what_the_impulse_takes(law, seed):
    problem = random_problem(seed)
    impulse, _, lost, _ = solve_single(law.solve, problem)
    before = problem.velocity
    work = -0.5 * impulse @ (2 * before + problem.delassus() @ impulse)
    scale = np.linalg.norm(impulse) * np.abs([before, problem.delassus() @ impulse]).max()
    assert lost == pytest.approx(work, abs=1e-11 * scale)


@given(seed=seeds)
@settings(max_examples=300, derandomize=True, deadline=None)
def test_without_friction_energy_is_lost_but_for_e_1(seed):
    problem = random_problem(seed, friction=0.0)
    impulse, _, lost, _ = by_newton(problem)
    assert lost == 0 if problem.restitution == 1 else lost > 0
    assert np.linalg.norm(np.cross(impulse, problem.normal)) <= 1e-15 * np.linalg.norm(impulse)


def test_a_central_hit_by_a_particle_gives_both_laws_eq_10():
    problem = planar_attack(friction=0.4, offset=0.0)
    expected = [kd.normal_impulse(14.0, 0.8, 5.0, problem.ball.mass), 0, 0]
    assert by_newton(problem).impulse == pytest.approx(expected, rel=1e-14)
    assert by_paper(problem).impulse == pytest.approx(expected, rel=1e-14)


def test_rolling_is_what_sticking_leaves():
    """A thin shell that lands on an immovable floor with sliding: 2/5 of it goes into spin."""
    problem = LegAndBall(
        normal=np.array([0.0, 0.0, 1.0]),
        delassus_factor=np.zeros((3, 0)),
        ball=kd.Ball(),
        centre_velocity=np.array([1.0, 0.0, -3.0]),
        spin=np.zeros(3),
        restitution=0.5,
        friction=0.4,
    )
    impulse, sticking, _, _ = by_newton(problem)
    assert sticking
    assert impulse / problem.ball.mass == pytest.approx([-0.4, 0, 4.5], rel=1e-14, abs=1e-15)


def test_sideways_hits_mirror():
    for law in (by_newton, by_paper):
        left, right = (
            law(
                LegAndBall(
                    normal=np.array([0.9, side * 0.3, 0.3]) / math.sqrt(0.99),
                    delassus_factor=np.diag(np.sqrt([0.4, 0.7, 0.9])),
                    ball=kd.Ball(),
                    centre_velocity=np.array([-8.0, 0.0, -2.0]),
                    spin=np.array([0.0, 5.0, 0.0]),
                    restitution=0.7,
                    friction=0.15,
                )
            ).impulse
            for side in (1, -1)
        )
        assert left * [1, -1, 1] == pytest.approx(right, rel=1e-13)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((-1, 0.5, 1), "approach speed is -1"),
        ((1, 1.2, 1), r"restitution is 1\.2"),
        ((1, 0.5, 0), "leg mass is 0"),
        ((1, 0.5, math.nan), "leg mass is nan"),
        ((1, 0.5, 1, -2), "ball mass is -2"),
        ((1, 0.5, math.inf), "both inf"),
    ],
)
def test_bad_normal_impulse(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.normal_impulse(*arguments)


def test_whoever_cannot_serve_a_new_law_refuses_it(monkeypatch):
    """Nothing computes `newton` in its place."""
    doubled = ImpactLaw("doubled", double_impulse)
    monkeypatch.setitem(LAWS, doubled.name, doubled)
    posture = kd.Leg.human().posture([0.1, 0.2, -0.1])
    kick = posture, posture.joint_velocity((3, 0, 1)), kd.Ball(), kd.Contact((1, 0, 0.3), 0.8)
    hit, plain = kd.strike(*kick, "doubled"), kd.strike(*kick)
    assert hit.impulse == pytest.approx(2 * plain.impulse)
    for use in (
        hit.sensitivity,
        lambda: hit.uncertainty(v=0.1),
        lambda: solve_contacts(two_contacts(hit), doubled),
    ):
        with pytest.raises(kd.InvalidInput, match=r"law.* 'doubled'"):
            use()


def double_impulse(problem):
    solution = frictionless(problem)
    return solution._replace(impulses=2 * solution.impulses)


def two_contacts(hit):
    problem = hit.approach.contact_problem()
    return problem._replace(contacts=2 * problem.contacts)
