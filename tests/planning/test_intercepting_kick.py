"""A kick of a moving ball at a time that is chosen."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.intercepting_kick import STRONGEST, KickSettings
from kickdyn.planning.kick_problem import best_from
from kickdyn.planning.kick_steps import checked_contact
from kickdyn.planning.moving_kick import Interceptor
from kickdyn.planning.objectives import OBJECTIVES, KickObjective

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0))


@pytest.mark.parametrize("distance", [18, 45], ids=["whole launch", "weaker"])
def test_a_polished_kick_does_not_depend_on_rounding(distance):
    """Neither on the unknowns where the solver stops, of kicks within limits and beyond them."""
    objective = KickObjective.JOINT_SPEED
    goal, contact = kd.Goal(distance, time=1.2), checked_contact(None)
    settings = KickSettings(goal, BALL, AIR, contact, objective, True, None, "slsqp")
    incoming = kd.IncomingBall(ROLLING).on_ground_of(HUMAN, BALL)
    task = Interceptor(HUMAN, settings, incoming).at(0.66)
    problem = task.problem()
    weaker = distance == 45
    best = best_from(problem, STRONGEST if weaker else OBJECTIVES[objective](), problem.starts())
    other = np.append(best.x[:-1] * (1.0 - 1e-7), best.x[-1])
    kicks = [task.kick(problem, problem.variables.point(x)) for x in (best.x, other)]
    polished = [kick.polished() for kick in kicks]
    assert (polished[0].meeting.share < 1.0) == weaker
    assert polished[0].meeting.share == pytest.approx(polished[1].meeting.share, abs=1e-12)
    q, v = ([(kick.chosen[0].q, kick.chosen[1])[i] for kick in polished] for i in range(2))
    assert q[0] == pytest.approx(q[1], abs=1e-10)
    assert v[0] == pytest.approx(v[1], abs=1e-9)
    assert kicks[0].chosen[1] != pytest.approx(kicks[1].chosen[1], abs=1e-7)
