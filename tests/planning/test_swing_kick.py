from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import kickdyn as kd

pytest.importorskip("casadi")
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning import swing_kick
from kickdyn.planning.kick_problem import kick_problem
from kickdyn.planning.kick_terms import KickTerm
from kickdyn.planning.objectives import JointSpeed
from kickdyn.planning.problem import Kind

JOINTS = 6


def tried(monkeypatch, answers):
    """Solve with a solver that gives `answers`, and return the slacks it was called with."""
    slacks = []

    class Problem:
        iterations = 0

        def __init__(self, *_):
            pass

        def solve(self, _, slack):
            slacks.append(slack)
            iterations, share, use = answers[len(slacks) - 1]
            self.iterations += iterations
            if share is None:
                return None
            return SimpleNamespace(share=share), (SimpleNamespace(torque_use=use),)

    monkeypatch.setattr(swing_kick, "_SwingKickProblem", Problem)
    leg = SimpleNamespace(name="leg")
    variables = SimpleNamespace(qs=slice(None), n=JOINTS, leg=leg)
    problem = SimpleNamespace(variables=variables)
    start = SimpleNamespace(posture=SimpleNamespace(q=np.zeros(JOINTS)), share=1.0)
    monkeypatch.setattr(swing_kick, "solve_kick", lambda *_: (problem, start, ()))
    try:
        best = swing_kick.solve_with_swing(problem, None)[0].point.share
    except kd.InvalidInput:
        best = None
    return slacks, best


@pytest.mark.parametrize(
    ("answers", "slacks", "best"),
    [
        ([(60, 1.0, 0.99)], [0.04], 1.0),
        ([(60, 0.5, 0.99), (60, 0.6, 1.0), (60, 0.7, 1.01), (60, 0.6, 1.0)],
         [0.04, 0.1, 0.2, 0.3], 0.6),
        ([(60, 0.47, 1.38), (60, 0.43, 0.96)], [0.04, 0.3], 0.43),
        ([(60, None, 0.0), (60, 0.7, 1.15), (60, 0.6, 0.9)], [0.04, 0.1, 0.3], 0.6),
        ([(60, 1.0, 1.05), (60, None, 0.0), (60, 1.0, 1.0)], [0.04, 0.1, 0.2], 1.0),
        ([(130, None, 0.0), (130, None, 0.0)], [0.04, 0.1], None),
    ],
)  # fmt: skip
def test_too_small_slacks_are_left_out_and_iterations_are_bounded(
    answers, slacks, best, monkeypatch
):
    assert tried(monkeypatch, answers) == (slacks, best)


@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0, 8.0, 15.0, 30.0])
def test_the_problem_has_the_restitution_of_the_contact(speed):
    contact = kd.Contact((1, 0, 1), [[3, 0.9], [8, 0.6], [20, 0.7]])
    foot = swing_kick.ca.DM(speed * contact.normal)
    found = float(swing_kick._restitution(SimpleNamespace(contact=contact), foot))
    assert found == pytest.approx(contact.restitution_at(speed), abs=1e-14)


def test_a_kick_that_swings_knows_the_restitution_over_speed():
    leg, table = kd.Leg.human(), [[3.0, 0.85], [20.0, 0.5]]
    goal, ball = kd.Goal(15, time=1), kd.Ball()
    plan = kd.plan_kick(leg, goal, ball, swing=True, contact=kd.Contact(None, table, 0.4))
    assert plan.status == "met"
    assert plan.impact.ball_after.velocity == pytest.approx(plan.launch.velocity, abs=1e-10)
    after = plan.phases[1].sample(0.0).v[0]
    assert after == pytest.approx(plan.impact.v_after, abs=1e-8)


def test_a_term_that_a_swing_cannot_keep_is_refused():
    class KneeBelow(KickTerm):
        kind = Kind.INEQUALITY

        def residual(self, posture, v):
            return 0.5 - posture.q[1:2]

        def derivatives(self, posture, v):
            return -np.eye(3)[1:2], None

    velocity = np.array([6.0, 0.0, 3.0])
    target = impact_target_for(velocity, np.zeros(3), kd.Ball(), kd.Contact(friction=0.4))
    problem = kick_problem(kd.Leg.human(), target)
    limited = replace(problem, terms=(*problem.terms, KneeBelow()))
    with pytest.raises(kd.InvalidInput, match="a swing cannot keep the terms KneeBelow"):
        swing_kick.solve_with_swing(limited, JointSpeed())
