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


def test_a_latex_table_has_the_values_to_two_digits_of_their_deviations():
    known = inferred(10.0, joint_deviation=0.1, velocity_deviation=0.02)
    kicks = {"50%_a": known, "b": inferred(15.0)}
    table = kd.kick_table(kicks)
    text = kd.kick_table(kicks, latex=True).replace(r"\\", "").splitlines()
    assert text[0] == r"\begin{tabular}{lrr}"
    assert text[2].split("&")[1:] == [r" 50\%\_a ", " b "]
    for line, (title, row) in zip(text[4:-2], table.iterrows(), strict=True):
        name, first, second = line.split("&")
        assert name.strip() == title
        value, deviation = first.strip(" $").split(r" \pm ")
        exact = row["50%_a +-"]
        unit = 10.0 ** (np.floor(np.log10(exact)) - 1)  # of the second digit
        assert float(deviation) == pytest.approx(exact, abs=unit / 2)
        assert float(value) == pytest.approx(row["50%_a"], abs=unit / 2)
        assert len(value.partition(".")[2]) == len(deviation.partition(".")[2]) == -np.log10(unit)
        assert float(second.strip(" $")) == pytest.approx(row["b"], rel=5e-4)
    other = kd.Leg.human(height=1.7, mass=60, model="3d")
    with pytest.raises(kd.InvalidInput, match="'b' has other joints than 'a'"):
        kd.kick_table({"a": known, "b": inferred(9.0, other)})
