"""Random balls from all sides are kicked to their targets, or refused with a reason."""

import numpy as np
import pytest
import replan
from tolerances import optimized

import kickdyn as kd

pytestmark = pytest.mark.slow


def test_random_balls_land_or_are_refused(monkeypatch):
    """A random search finds a kick that is planned, and none where a ball is refused."""
    monkeypatch.setattr(replan, "TIMES", 6)
    landed, refused = [], []
    for case in replan.cases(5, seed=3):
        try:
            plan = kd.plan_kick(case.leg, case.goal, replan.BALL, replan.AIR,
                                incoming=case.incoming, contact=case.contact)  # fmt: skip
        except kd.InvalidInput as error:
            refused.append((case, str(error)))
            continue
        if plan.share == 1.0:
            landed.append(case)
            assert replan.landing_error(case, plan) < optimized()
    assert len(landed) >= 3
    draw = np.random.default_rng(0)
    assert all(reason.isprintable() for _, reason in refused)
    assert not any(replan.finds_kick(case, draw) for case, _ in refused[:1])
    assert any(replan.finds_kick(case, draw) for case in landed[:3])
