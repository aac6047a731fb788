"""The way back from a launch to the impact: `strike` with its foot velocity gives the launch."""

import numpy as np
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for

LEG, BALL = kd.Leg.from_robot("g1", legs_only=True), kd.Ball()
POSTURE = LEG.posture(LEG.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.6}))
TABLE = [[3.0, 0.9], [6.0, 0.6], [9.0, 0.7]]
AT_REST = kd.BallState()
SPINNING = kd.BallState(velocity=(-3.0, 0.5, 1.0), spin=(4.0, -9.0, 2.0))


@pytest.mark.parametrize("before", [AT_REST, SPINNING], ids=["at rest", "moves"])
@pytest.mark.parametrize("share", [0.4, 1.0])
@pytest.mark.parametrize(("speed", "restitution", "friction", "spin"), [
    (6.0, 0.7, 0.4, (0, -30, 0)), (6.0, 0.7, 0.5, (3, 5, -6)), (6.0, 0.7, 0.0, (0, 0, 0)),
    (2.0, TABLE, 0.4, (0, -5, 0)), (8.0, TABLE, 0.4, (0, -5, 0)), (16.0, TABLE, 0.0, (0, 0, 0))
])  # fmt: skip
def test_the_strike_gives_what_was_wished_for(speed, restitution, friction, spin, share, before):
    velocity = speed * np.array([0.9, 0.2, 0.4])
    change = velocity - before.velocity
    along = change / np.linalg.norm(change)
    spin = np.array(spin, float) - (spin @ along) * along
    contact = kd.Contact(None, restitution, friction)
    target = impact_target_for(velocity, before.spin + spin, BALL, contact, before)
    v = POSTURE.joint_velocity(target.foot_velocity(POSTURE, share))
    motion = {"ball_velocity": before.velocity, "ball_spin": before.spin}
    hit = kd.strike(POSTURE, v, BALL, target.contact, **motion)
    agrees(hit.ball_after.velocity, before.velocity + share * change, closed_form(100))
    assert hit.ball_after.spin == pytest.approx(before.spin + share * spin, abs=closed_form(1e4))
    up, left = target.contact_offset
    level = np.array([*change[:2], 0]) / np.hypot(*change[:2])
    arm = -BALL.radius * hit.contact.normal
    agrees([up, left], [arm[2], np.cross([0, 0, 1], level) @ arm], closed_form(10))
