"""The table of measured kicks, in CSV and LaTeX."""

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
POSTURE, BALL = LEG.posture([0.2, 0.4, -0.1]), kd.Ball()


def inferred(speed, leg=LEG, **deviations):
    q = leg.configuration(dict(zip(LEG.joint_names, POSTURE.q.tolist(), strict=True)))
    posture = leg.posture(q)
    v = posture.joint_velocity([speed, 0.0, 1.0])
    hit = kd.strike(posture, v, BALL, kd.Contact((1, 0, 0.2), 0.7, 0.3))
    return kd.infer_impact(posture, v, BALL, hit.ball_before, hit.ball_after, **deviations)


def test_each_kick_has_values_and_deviations():
    slow, fast = inferred(10.0, joint_deviation=0.1), inferred(15.0)
    table = kd.kick_table({"slow": slow, "fast": fast})
    speed = {kick: np.linalg.norm(kick.ball_after.velocity) for kick in (slow, fast)}
    for row, column, value in (
        ("restitution", "slow", 0.7), ("foot speed [m/s]", "fast", np.hypot(15.0, 1.0)),
        ("ball speed [m/s]", "slow", speed[slow]), ("ball speed [m/s]", "fast", speed[fast]),
        ("impulse on the ball [N s]", "fast", BALL.mass * speed[fast]),
        ("effective mass [kg]", "slow", slow.effective_mass),
        ("effective mass [kg]", "slow +-", slow.deviations["effective_mass"]),
        ("foot speed [m/s]", "slow +-", slow.deviations["foot_speed"]),
        ("impulse in knee [N s]", "slow", slow.joint_sizes["knee"]),
        ("impulse in knee [N s]", "slow +-", slow.joint_deviations["knee"]),
    ):  # fmt: skip
        assert table.loc[row, column] == pytest.approx(value), (row, column)
    assert table["fast +-"].isna().all()
