import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.limb import limb_of

G1 = kd.Leg.from_robot("g1")
BALL = kd.Ball()


def test_an_impact_on_the_limb_is_that_on_the_whole_robot():
    limb = limb_of(G1)
    assert limb.leg.nv == 6
    assert G1.nv > 20
    draw = np.random.default_rng(0)
    q, v = draw.normal(0, 0.3, limb.leg.nq), draw.normal(0, 1, limb.leg.nv)
    impact_target = kd.Contact((1, 0.2, 0.3), 0.8, 0.4)
    v *= np.sign(impact_target.normal @ limb.leg.posture(q).jacobian @ v)
    whole_q, whole_v = limb.whole(G1, q, v)
    whole = kd.strike(G1.posture(whole_q), whole_v, BALL, impact_target)
    alone = kd.strike(limb.leg.posture(q), v, BALL, impact_target)
    assert whole.impulse == pytest.approx(alone.impulse, rel=1e-12)
    assert whole.ball_after.position == pytest.approx(alone.ball_after.position, abs=1e-15)
    _, v_after = limb.whole(G1, q, alone.v_after)
    assert whole.v_after == pytest.approx(v_after, abs=1e-12)
    assert np.count_nonzero(v_after) == 6


def test_a_leg_that_is_nothing_else_stays_itself():
    leg = kd.Leg.human()
    limb = limb_of(leg)
    assert limb.leg is leg
    assert limb.qs.tolist() == limb.vs.tolist() == [0, 1, 2]


def test_a_plan_for_the_whole_robot_is_that_for_its_leg():
    goal = kd.Goal((4, 1, 0), time=0.8)
    whole, alone = (
        kd.plan_kick(leg, goal, BALL) for leg in (G1, kd.Leg.from_robot("g1", legs_only=True))
    )
    assert whole.leg is G1
    names = [name for name in G1.joint_names if G1.angles_deg(whole.q)[name]]
    angles = alone.leg.angles_deg(alone.q)
    assert [G1.angles_deg(whole.q)[name] for name in names] == pytest.approx(
        [angles[name] for name in names], abs=1e-6
    )
    assert whole.value == pytest.approx(alone.value, rel=1e-9)
