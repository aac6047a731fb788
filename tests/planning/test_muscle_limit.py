"""Torque limits that fall with the speed of the joints, as those of muscles."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, differenced

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning.kick_terms import KickVariables, TorqueLimit
from kickdyn.planning.muscle_limit import MuscleTorqueLimit

LEG, BALL = kd.Leg.human(height=1.8, mass=75), kd.Ball()


def hill(speed):
    """Hill 1938: share of the isometric force at a share of the largest shortening speed."""
    speed = np.maximum(speed, 0.0)
    return (1 - speed) / (1 + 4 * speed)


def test_distances_from_the_falling_limit_and_their_slopes():
    contact = kd.Contact(restitution=0.8, friction=0.4)
    variables = KickVariables(LEG, impact_target_for((12.0, 0.0, 6.0), (0, 0, 0), BALL, contact))
    term, plain = MuscleTorqueLimit(variables), TorqueLimit(variables)
    for x in ([0.4, 0.7, -0.2, 0.3, -0.4, 0.2, 0.9], [0.1, 1.2, 0.3, -0.6, 0.5, -0.1, 1.0]):
        point = variables.point(np.array(x))
        share = plain.torque(point.posture, point.v) / LEG.effort_limit
        speed = point.v / LEG.velocity_limit
        up, down = term.residual(point.posture, point.v).reshape(2, 3)
        agrees(up, hill(speed) - share, 1e-12)
        agrees(down, hill(-speed) + share, 1e-12)
        most = np.where(share > 0, hill(speed), hill(-speed))
        agrees(term.use(point), np.abs(share) / most, 1e-12)
        differences = [
            (term.value(variables.point(x + step)) - term.value(variables.point(x - step))) / 2e-5
            for step in 1e-5 * np.eye(len(x))
        ]
        agrees(term.slope(point), np.transpose(differences), 10 * differenced())


def test_a_kick_of_muscles_is_slower_at_its_torque_limit():
    goal = kd.Goal(30, time=1.4)
    strong, muscles = (kd.plan_kick(LEG, goal, BALL, limits=limits) for limits in (True, "muscles"))
    assert strong.status == muscles.status == "met"
    assert muscles.speed_use < strong.speed_use
    still = np.zeros(3)
    for plan in (strong, muscles):
        torque = pin.rnea(LEG.model, LEG.model.createData(), plan.q, plan.v, still)
        speed = np.sign(torque) * plan.v / LEG.velocity_limit
        excess = (np.abs(torque) / LEG.effort_limit - hill(speed)).max()
        assert (excess <= 1e-4) == (plan is muscles)


@pytest.mark.slow
def test_a_motion_keeps_the_falling_torques():
    plan = kd.plan_kick(LEG, kd.Goal(20, time=1.2), BALL, limits="muscles", motion=True)
    assert plan.status == "beyond-limits"
    motion = plan.motion
    for t in np.linspace(motion.begin, motion.end, 200):
        torque, v = motion.torque(t), motion.v(t)
        share = np.abs(torque) / LEG.effort_limit
        assert (share <= hill(np.sign(torque) * v / LEG.velocity_limit)).all(), t


def test_another_name_of_limits_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"limits is 'hill'.*muscles"):
        kd.plan_kick(LEG, kd.Goal(20, time=1.2), BALL, limits="hill")
