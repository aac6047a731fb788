"""The equations' derivatives, against differences."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.equations import Equations
from kickdyn.planning.impact_target import impact_target_for
from kickdyn.planning.objectives import OBJECTIVES

BALL = kd.Ball()
LEGS = {"human": kd.Leg.human(), "g1": kd.Leg.from_robot("g1", legs_only=True)}


@pytest.mark.parametrize("objective", [*OBJECTIVES, None])
@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("name", LEGS)
def test_slopes_are_those_of_the_values(name, friction, objective):
    spin = np.array([0.0, -10.0 if friction else 0.0, 0.0])
    impact_target = impact_target_for(
        np.array([6.0, 0.0, 3.0]), spin, BALL, 0.8, friction, (0.02, 0, 0.01)
    )
    search = Equations(LEGS[name], impact_target, -0.6, limits=True)
    cost = OBJECTIVES[objective](search, impact_target) if objective else None
    draw, n = np.random.default_rng(0), search.n
    x = np.append(draw.uniform(0.1, 0.5, 2 * n), 0.8)

    def values(x):
        return search.values(search.at(x), x, cost, 3.0)

    slopes = search.slopes(search.at(x), x, values(x), cost, 3.0)
    step = 1e-6 * np.eye(len(x))
    expected = np.array([(values(x + one) - values(x - one)) / 2e-6 for one in step]).T
    assert slopes.shape == expected.shape
    size = np.abs(expected).max(axis=1, keepdims=True)
    digits = 1e-5 if "joint impulse" in (objective or "") else 1e-7
    assert np.abs(slopes - expected)[:1].max() < digits * size[0]
    assert (np.abs(slopes - expected)[1:] < 1e-7 * size[1:]).all()


def limited(what, value):
    model = kd.Leg.human().model
    limits = getattr(model, what)
    limits[1] = value
    setattr(model, what, limits)
    return kd.Leg.from_model(model, "toe")


@pytest.mark.parametrize(("what", "named"), [("velocityLimit", "speed"), ("effortLimit", "torque")])
def test_a_limit_of_0_is_refused_or_lifted_and_an_infinite_one_holds(what, named):
    goal, air = kd.Goal(10, time=1), kd.Air()
    said = f"^{named} limit of knee is 0: it must be above 0.*no-limits"
    with pytest.raises(kd.InvalidInput, match=said):
        kd.plan_kick(limited(what, 0.0), goal, BALL, air)
    lifted = kd.plan_kick(limited(what, 0.0), goal, BALL, air, limits=False)
    free = kd.plan_kick(limited(what, np.inf), goal, BALL, air)
    for plan in (lifted, free):
        assert plan.status == "met"
        others = np.delete(np.abs(plan.v) / LEGS["human"].velocity_limit, 1)
        if what == "velocityLimit":
            assert plan.speed_use == pytest.approx(others.max())
        assert np.isfinite(plan.effort_use)
