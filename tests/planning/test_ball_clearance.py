"""The bodies of a robot stay out of the ball."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.ball_clearance import BallClearance
from kickdyn.planning.kick_terms import KickVariables

G1 = kd.Leg.from_robot("g1", legs_only=True)
PLAN = kd.plan_kick(G1, kd.Goal((4, 1, 0), time=0.8), kd.Ball(), kd.Air())


@pytest.fixture(scope="module")
def term():
    return BallClearance(G1, KickVariables(G1, PLAN.impact_target))


def test_slopes_are_those_of_the_distances(term):
    variables, draw = KickVariables(G1, PLAN.impact_target), np.random.default_rng(1)
    for _ in range(3):
        q = draw.uniform(-0.3, 0.5, variables.n)
        slopes = term.derivatives(variables.posture(q), None)[0][:, variables.vs]
        for i, step in enumerate(1e-6 * np.eye(variables.n)):
            ahead, behind = (
                term.residual(variables.posture(q + sign * step), None) for sign in (1, -1)
            )
            assert slopes[:, i] == pytest.approx((ahead - behind) / 2e-6, abs=1e-7)


def test_a_plan_with_the_toe_is_clear_of_the_ball(term):
    assert PLAN.status == "met"
    assert (term.residual(PLAN.impact.posture, PLAN.v) > 0).all()


def test_a_contact_point_inside_the_foot_is_never_met():
    """The origin of the ankle: whichever way the foot turns, the ball is in it."""
    ankle = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    plan = kd.plan_kick(ankle, kd.Goal((4, 1, 0), time=0.8), kd.Ball(), kd.Air())
    assert plan.status == "collides"
    (line,) = [line for line in plan.warnings if "inside the ball" in line]
    assert "right_ankle_roll_link by" in line


def test_a_leg_without_shapes_has_no_bodies():
    leg = kd.Leg.from_model(G1.model, "toe")
    assert BallClearance(leg, KickVariables(leg, PLAN.impact_target)).bodies == []
