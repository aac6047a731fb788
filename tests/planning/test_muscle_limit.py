"""Plans whose torques fall with the speed of the joints, as those of muscles."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning.kick_terms import KickVariables, TorqueLimit
from kickdyn.planning.muscle_limit import MuscleTorqueLimit
from kickdyn.robot.muscle_torque import muscle_share

LEG, BALL = kd.Leg.human(height=1.8, mass=75), kd.Ball()


def excess(v, torque):
    """Return the largest torque over its limit at rest, less what muscles have at this speed."""
    use = torque / LEG.effort_limit
    speed = np.maximum(np.sign(torque) * v / LEG.velocity_limit, 0.0)
    return float((np.abs(use) - muscle_share(speed)).max())


def test_residual_and_derivatives():
    contact = kd.Contact(restitution=0.8, friction=0.4)
    variables = KickVariables(LEG, impact_target_for((12.0, 0.0, 6.0), (0, 0, 0), BALL, contact))
    term, plain = MuscleTorqueLimit(variables), TorqueLimit(variables)
    x = np.array([0.4, 0.7, -0.2, 0.3, -0.4, 0.2, 0.9])
    point = variables.point(x)
    posture, v = point.posture, point.v
    use = plain.torque(posture, v) / LEG.effort_limit
    up, down = term.residual(posture, v).reshape(2, 3)
    speed = v / LEG.velocity_limit
    assert up == pytest.approx(muscle_share(np.maximum(speed, 0)) - use)
    assert down == pytest.approx(muscle_share(np.maximum(-speed, 0)) + use)
    slope = term.slope(point)
    for i, step in enumerate(1e-6 * np.eye(len(x))):
        higher, lower = (term.value(variables.point(x + sign * step)) for sign in (1, -1))
        assert slope[:, i] == pytest.approx((higher - lower) / 2e-6, abs=1e-6)


def test_a_kick_near_its_speed_limits_is_slower():
    goal = kd.Goal(30, time=1.4)
    strong, muscles = (kd.plan_kick(LEG, goal, BALL, limits=limits) for limits in (True, "muscles"))
    assert strong.status == muscles.status == "met"
    assert muscles.speed_use < strong.speed_use
    assert muscles.torque_use == pytest.approx(0.99, abs=0.01)


def test_a_motion_keeps_the_falling_torques():
    plan = kd.plan_kick(LEG, kd.Goal(20, time=1.2), BALL, limits="muscles", motion=True)
    assert plan.status == "beyond-limits"
    assert plan.share < 0.9
    assert any(name.startswith("torque of") for name in plan.binding)
    motion = plan.motion
    times = np.linspace(motion.begin, -1e-9, 100)
    assert max(excess(motion.v(t), motion.torque(t)) for t in times) < 0.0


def test_refused():
    with pytest.raises(kd.InvalidInput, match="limits is 'hill': it must be True, False or 'musc"):
        kd.plan_kick(LEG, kd.Goal(20, time=1.2), BALL, limits="hill")
