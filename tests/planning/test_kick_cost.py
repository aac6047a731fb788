import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.kick_cost import KickObjective, scatter_cost
from kickdyn.planning.kick_program import KickProgram
from kickdyn.planning.scatter import scatter

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
PLAN = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR)


def value(name):
    program = KickProgram(LEG, PLAN.impact_target)
    return program.cost(name)(PLAN.impact.posture, PLAN.v)


def test_each_is_what_its_name_says():
    assert value("joint-speed") == pytest.approx(np.mean((PLAN.v / LEG.velocity_limit) ** 2))
    assert value("kinetic-energy") == pytest.approx(
        0.5 * PLAN.v @ PLAN.impact.posture.inertia @ PLAN.v
    )
    worst = PLAN.impact.worst_joint[1]
    assert worst <= value("joint-impulse") <= 3 ** (1 / 12) * worst


def test_scatter_is_that_of_the_strike():
    spread = {"speed": 0.02, "angle": 0.01}
    radius = scatter_cost(PLAN.impact_target, PLAN.launch, AIR, spread)
    expected = scatter(PLAN.impact, AIR, **spread).radius
    assert radius(PLAN.impact.posture, PLAN.v) == pytest.approx(expected, rel=1e-6)
    assert radius(PLAN.impact.posture, -PLAN.v) > 1e3  # the foot moves away


@pytest.mark.parametrize(
    ("leg", "goal", "spread"),
    [
        (
            kd.Leg.from_robot("g1", legs_only=True),
            kd.Goal((5, 1, 0), time=0.9),
            {"speed": 0.02, "angle": 0.01, "contact": 0.002},
        ),
        (kd.Leg.testbed(), kd.Goal(2, time=0.6), {"angle": 0.02}),
    ],
)
def test_robust_scatters_no_more_than_any_other_objective(leg, goal, spread):
    robust = kd.plan_kick(leg, goal, BALL, AIR, objective="scatter", spread=spread)
    own = scatter(robust.impact, AIR, **spread).radius
    for name in set(KickObjective) - {"scatter"}:
        other = kd.plan_kick(leg, goal, BALL, AIR, objective=name)
        assert other.status == "met"
        assert own <= scatter(other.impact, AIR, **spread).radius * (1 + 1e-6), name
